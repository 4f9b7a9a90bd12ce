"""`castfem mould` and `castfem section`: taper, hot mould, outline at the meniscus.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.atomic_files import replacing
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.base.table import Table, pairs, say
from castfem.cli import parallel
from castfem.cli.drawing import check_picture, drawing
from castfem.model import Case

if TYPE_CHECKING:
    from castfem.physics.mould import Mould, Zone
    from castfem.physics.mould.hot.model import HotWall
    from castfem.studies.mould_fit.coupled import Drawing, Turn
    from castfem.studies.mould_fit.meniscus_outline import Attempt, Outline

_WHERE = {"width": "mid-face, width", "height": "mid-face, height", "diagonal": "corner, diagonal"}
_ROWS = 12
"""Number of steps of the table along the mould."""
_RESULTS = (
    ("heat_removed", "heat removed", "MJ/m", 1e-6),
    ("shell_mid_face", "shell, mid-face", "mm", 1e3),
    ("shell_corner", "shell, corner", "mm", 1e3),
    ("mould_gap_max", "largest gap", "mm", 1e3),
    ("mould_mean_pressure_max", "largest mean pressure", "MPa", 1e-6),
    ("mould_contact_least", "least share in contact", "%", 1e2),
    ("von_mises_max", "von Mises at the exit", "MPa", 1e-6),
)
"""Result of a strand, its label, its unit, and the factor from SI."""


def draw_mould(case: Case, picture: Path, origin: str) -> None:
    """Print size and taper of a case's mould and draw it."""
    from castfem.model.mould_from_case import build_mould
    from castfem.post.plots.mould import draw

    table = case.mould
    if table is None:
        raise InputError(
            f"{origin}: mould: the table is missing, the mould is idealised and follows the "
            'strand; add [mould] with length = "600 mm" and taper = "1 %/m"'
        )
    check_picture(picture)
    mould = build_mould(table, case.section)
    out = parallel.console()
    say(out, pairs(mould_rows(mould)), "", taper_table(mould.zones()))
    if mould.expansion is not None:
        say(out, "", taper_table(mould.zones(as_made=True), "as made, cold"))
    if table.tube is not None:
        say(out, "", f"as heat distorts its copper tube: castfem mould {origin} --hot")
    with drawing(picture):
        draw(mould, picture, case.title)


def mould_rows(mould: Mould) -> list[tuple[str, str]]:
    """Return labels and values that describe a mould."""
    rows = [("length", f"{1e3 * mould.length:g} mm from the meniscus")]
    for label, position in (("at the meniscus", 0.0), ("at the exit", mould.length)):
        sizes = mould.dimensions(position)
        rows.append((label, ", ".join(f"{name} {1e3 * w:.3f} mm" for name, w in sizes.items())))
    if mould.wall_temperature is not None:
        values = [value - ZERO_CELSIUS for value in mould.wall_temperature.values]
        low, high = min(values), max(values)
        span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        rows.append(("wall", f"{span} degC"))
    text = "sizes and taper are those of the working mould"
    if mould.expansion is not None:
        top, exit_ = (1e3 * (mould.expansion.factor(z) - 1.0) for z in (0.0, mould.length))
        text = f"given cold at {mould.expansion.cold - ZERO_CELSIUS:g} degC; expanded by "
        text += f"{top:.2f} per mille at the meniscus, {exit_:.2f} at the exit"
    rows.append(("condition", text))
    return rows


def taper_table(zones: Iterable[Zone], title: str = "") -> Table:
    """Return the table of the tapers: dimension, zone, sizes at both ends, taper in %/m."""
    head = ("dimension", "from [mm]", "to [mm]", "inlet [mm]", "outlet [mm]", "taper [%/m]")
    rows = [
        (
            _WHERE.get(zone.dimension, zone.dimension),
            *(f"{1e3 * one:g}" for one in (zone.start, zone.end)),
            *(f"{1e3 * one:.3f}" for one in (zone.inlet, zone.outlet)),
            f"{100.0 * zone.taper + 0.0:+.3f}",
        )
        for zone in zones
    ]
    return Table(head, rows, title)


def draw_hot_mould(case: Case, picture: Path, origin: str, *, coupled: bool) -> None:
    """Compute the hot mould, print and draw it; write wall and tube beside the picture."""
    from mpi4py import MPI

    from castfem.model.mould_from_case import nominal_mould
    from castfem.model.wall_shape import write_wall
    from castfem.physics.mould.hot.vtk_file import write_tube
    from castfem.post.plots.mould import draw_hot
    from castfem.studies.mould_fit.coupled import AGREEMENT, hot_mould_of, table_of
    from castfem.studies.mould_fit.coupled import drawing as drawn

    check_picture(picture)
    table, comm = table_of(case, origin), MPI.COMM_WORLD
    first = comm.rank == 0

    def progress(number: int, turn: Turn) -> None:
        if first and turn.strand is not None:
            print(f"iteration {number}: {_changed(turn)}", flush=True)

    turns = hot_mould_of(case, comm, origin, AGREEMENT.most if coupled else 1, progress)
    wall, solid = turns[-1].wall, picture.with_suffix(".vtu")
    write_tube(solid, wall)
    if not first:
        return
    found = drawn(table, nominal_mould(table, case.section), wall)
    if coupled and turns[0].strand is None:
        given = "flux" if table.tube is not None and table.tube.hot_face is None else "hot_face"
        print(f"mould.tube.{given} heats the tube: the strand is not computed, nothing iterated\n")
    out = parallel.console()
    say(out, pairs(hot_rows(wall)), "", size_table(found, wall))
    if len(turns) > 1:
        say(out, "", turn_table(turns))
    if found.displacement is not None:
        target = picture.with_suffix(".csv")
        write_wall(target, found.displacement, f"{case.title}: wall at work, from its drawing")
        print(f'\nwall in {target}: to run in it, mould.displacement = {{ file = "{target}" }}')
    print(f"\ntube in {solid}, for ParaView: temperature, displacement, von_mises")
    with drawing(picture):
        draw_hot(found, wall, picture, case.title)


def hot_rows(wall: HotWall) -> list[tuple[str, str]]:
    """Return labels and values that describe a working tube."""
    from castfem.physics.mould.hot.copper import SOFTENS

    heated, distorted = wall.heated, wall.distorted
    hottest = heated.hottest
    most = f"{SOFTENS - ZERO_CELSIUS:.0f} degC"
    soft = f" - warning: above {most} the copper softens" if hottest > SOFTENS else ""
    x, y, z = (1e3 * part for part in distorted.largest_at)
    rows = [
        ("hot face", f"at most {hottest - ZERO_CELSIUS:.0f} degC{soft}"),
        ("water side", f"at most {float(wall.outer.max()) - ZERO_CELSIUS:.0f} degC"),
    ]
    if heated.supplied == heated.supplied:
        off = abs(heated.supplied - heated.removed) / (abs(heated.supplied) or 1.0)
        rows.append(("heat", f"{4e-3 * heated.supplied:.1f} kW, balance {off:.1e}"))
    rows += [
        ("length", f"{1e3 * wall.longer:+.2f} mm"),
        (
            "von Mises",
            f"{1e-6 * distorted.largest_stress:.0f} MPa (elastic), the largest, "
            f"at x = {x:.0f}, y = {y:.0f}, {z:.0f} mm below the meniscus",
        ),
    ]
    for name, solved in (("conduction", heated.solved), ("elasticity", distorted.solved)):
        how = f", {solved.iterations} iterations" if solved.iterations else ""
        rows.append((name, f"{solved.unknowns} unknowns, {solved.method}{how}"))
    return rows


def size_table(found: Drawing, wall: HotWall) -> Table:
    """Return the table of cold and working dimensions, and of the temperatures of both faces."""
    import numpy as np

    mould = found.cold
    ends = [found.hot.dimensions(z) for z in (0.0, found.hot.length)]
    names = [
        name
        for name in mould.dimensions(0.0)
        if name != "height" or any(abs(size["width"] - size["height"]) > 1e-7 for size in ends)
    ]
    head = ["position [mm]"]
    head += [f"{name} {state} [mm]" for name in names for state in ("cold", "hot")]
    columns = {"hot face": wall.hot[:, 0]}
    if wall.corner is not None:
        columns["corner"] = wall.hot[:, wall.corner]
    columns["water side"] = wall.outer[:, 0]
    head += [f"{name} [degC]" for name in columns]
    rows = []
    for z in np.linspace(0.0, mould.length, _ROWS + 1):
        cold, hot = found.cold.dimensions(float(z)), found.hot.dimensions(float(z))
        sizes = [f"{1e3 * size[name]:.3f}" for name in names for size in (cold, hot)]
        faces = [
            float(np.interp(z, wall.displacement.positions, column)) - ZERO_CELSIUS
            for column in columns.values()
        ]
        rows.append([f"{1e3 * z:.4g}", *sizes, *(f"{value:.0f}" for value in faces)])
    return Table(head, rows)


def turn_table(turns: Sequence[Turn]) -> Table:
    """Return the table of strand and wall in each iteration, one column each."""
    heads = ["iteration", *(str(number) for number in range(1, len(turns) + 1))]
    rows = []
    for name, label, unit, factor in _RESULTS:
        values = [turn.strand.value(name) for turn in turns if turn.strand is not None]
        if all(value == value for value in values):
            rows.append([f"{label} [{unit}]", *(f"{factor * value:.4g}" for value in values)])
    hottest = [f"{turn.wall.heated.hottest - ZERO_CELSIUS:.1f}" for turn in turns]
    moved = ["-" if turn.moved != turn.moved else f"{1e6 * turn.moved:.2f}" for turn in turns]
    rows += [["hot face [degC]", *hottest], ["wall moved [um]", *moved]]
    return Table(heads, rows)


def _changed(turn: Turn) -> str:
    hottest = turn.wall.heated.hottest - ZERO_CELSIUS
    if turn.moved != turn.moved:
        return f"hot face at most {hottest:.0f} degC"
    return (
        f"hot face at most {hottest:.0f} degC, wall moved by {1e6 * turn.moved:.1f} um, heat by "
        f"{100.0 * turn.heat:+.2f} %"
    )


def find_outline(case: Case, picture: Path, origin: str, at: str | None) -> None:
    """Find the outline, print the runs, draw it, and write outline and wall beside the picture."""
    from mpi4py import MPI

    from castfem.model.wall_shape import write_wall
    from castfem.post.plots.mould import draw_section
    from castfem.studies.mould_fit.meniscus_outline import (
        find_section,
        natural_wall,
        sides_of_section,
    )

    check_picture(picture)
    try:
        position = None if at is None else Kind("m", "mm", above=0.0).read(at)
    except ValueError as error:
        raise InputError(f"--at {at}: {error}") from None
    comm = MPI.COMM_WORLD

    def progress(number: int, attempt: Attempt) -> None:
        if comm.rank == 0:
            print(
                f"run {number}: {1e6 * attempt.worst:.1f} um off the required section", flush=True
            )

    try:
        attempts = find_section(case, comm, origin, position, report=progress)
    except InputError as error:
        if at is None:
            raise
        raise InputError([f"--at {at}: {one}" for one in error.problems]) from None
    if comm.rank > 0:
        return
    last = attempts[-1]
    sides = sides_of_section(case.section)  # type: ignore[arg-type]
    say(parallel.console(), "", outline_table(last))
    outline, wall = (picture.with_name(f"{picture.stem}_{n}.csv") for n in ("outline", "wall"))
    write_outline(outline, last.start, f"{case.title}: outline at the meniscus")
    write_wall(wall, natural_wall(last, sides), f"{case.title}: wall that follows the strand")
    print(f'\noutline in {outline}: section.bulge = {{ file = "{outline}" }}')
    print(f'wall that follows it in {wall}: mould.displacement = {{ file = "{wall}" }}')
    with drawing(picture):
        draw_section(attempts, sides, picture, case.title)


def outline_table(attempt: Attempt) -> Table:
    """Return the table of the outline at the meniscus and at the wanted position."""
    import numpy as np

    start, end = attempt.start, attempt.end
    rows = []
    for way in np.linspace(0.0, start.ways[-1], 13):
        values = (1e3 * np.interp(way, start.ways, one.offset) for one in (start, end))
        rows.append((f"{1e3 * way:.1f}", *(f"{value:+.4f}" for value in values)))
    return Table(("way round [mm]", "at the meniscus [mm]", "at the end [mm]"), rows)


def write_outline(path: Path, outline: Outline, about: str) -> None:
    """Write an outline as a file for `section.bulge`, atomically."""
    rows = zip(outline.ways, outline.offset, strict=True)
    lines = [f"# {about}", "way [mm], value [mm]"]
    lines += [f"{1e3 * way:.9g}, {1e3 * offset:.9g}" for way, offset in rows]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
