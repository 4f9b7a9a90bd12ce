"""`castfem section`: the section at the meniscus whose strand has the wanted one further down."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.atomic_files import replacing
from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.cli.drawing import check_picture, drawing
from castfem.model import Case

if TYPE_CHECKING:
    from castfem.studies.mould_fit.section import Attempt, Outline


def find(case: Case, picture: Path, origin: str, at: str | None) -> None:
    """Find the section, print the runs, draw it, and write outline and wall beside the picture.

    Args:
        case: The case; its section is the wanted one.
        picture: File of the picture; the files of the outline and the wall begin like it.
        origin: What the user called the case, for messages.
        at: Position of the wanted section with its unit; None: the end of the mould.

    Raises:
        InputError: The case cannot be asked, or a file cannot be written.
        RunFailure: A run fails, or they do not come closer.
    """
    from mpi4py import MPI

    from castfem.model.wall_shape import write_wall
    from castfem.post.plots.section_shape import draw
    from castfem.studies.mould_fit.section import find_section, natural_wall, sides_of_section

    check_picture(picture)
    try:
        position = None if at is None else Kind("m", "mm", above=0.0).read(at)
    except ValueError as error:
        raise InputError(f"--at {at}: {error}") from None
    comm = MPI.COMM_WORLD

    def told(number: int, attempt: Attempt) -> None:
        if comm.rank == 0:
            print(f"run {number}: {1e6 * attempt.worst:.1f} um off the wanted section", flush=True)

    try:
        attempts = find_section(case, comm, origin, position, told=told)
    except InputError as error:
        if at is None:
            raise
        raise InputError([f"--at {at}: {one}" for one in error.problems]) from None
    if comm.rank > 0:
        return
    last = attempts[-1]
    sides = sides_of_section(case.section)  # type: ignore[arg-type]
    print()
    print("\n".join(outline_lines(last)))
    outline, wall = (picture.with_name(f"{picture.stem}_{n}.csv") for n in ("outline", "wall"))
    write_outline(outline, last.start, f"{case.title}: outline at the meniscus")
    write_wall(wall, natural_wall(last, sides), f"{case.title}: wall that follows the strand")
    print(f'\noutline in {outline}: section.bulge = {{ file = "{outline}" }}')
    print(f'wall that follows it in {wall}: mould.displacement = {{ file = "{wall}" }}')
    with drawing(picture):
        draw(attempts, sides, picture, case.title)


def outline_lines(attempt: Attempt) -> list[str]:
    """Return the table of the outline at the meniscus and at the wanted position."""
    import numpy as np

    start, end = attempt.start, attempt.end
    rows = [f"{'way round [mm]':>14}  {'at the meniscus [mm]':>20}  {'at the end [mm]':>15}"]
    for way in np.linspace(0.0, start.ways[-1], 13):
        values = (1e3 * np.interp(way, start.ways, one.offset) for one in (start, end))
        first, then = values
        rows.append(f"{1e3 * way:14.1f}  {first:+20.4f}  {then:+15.4f}")
    return rows


def write_outline(path: Path, outline: Outline, about: str) -> None:
    """Write an outline as `section.bulge` reads it, whole or not at all.

    Raises:
        InputError: It cannot be written.
    """
    rows = zip(outline.ways, outline.offset, strict=True)
    lines = [f"# {about}", "way [mm], value [mm]"]
    lines += [f"{1e3 * way:.9g}, {1e3 * offset:.9g}" for way, offset in rows]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
