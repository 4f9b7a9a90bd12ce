"""`castfem mesh` and `castfem material`: pictures and a short description."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.base.libraries import own_style
from castfem.base.quantities import PERCENT
from castfem.base.table import pairs, say
from castfem.cli import parallel
from castfem.model import Case
from castfem.model.section import meshing

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh


def build_mesh(case: Case) -> SectionMesh:
    """Return the mesh of a case."""
    from castfem.meshes import build

    with meshing():
        return build(**case.mesh_parameters())


def draw_mesh(case: Case, picture: Path) -> None:
    """Build the mesh of a case, print its counts and quality, and draw it."""
    from castfem.meshes.draw import draw

    check_picture(picture)
    mesh = build_mesh(case)
    say(parallel.console(), pairs(mesh_rows(mesh)))
    with drawing(picture), own_style():
        draw(mesh, picture)


def mesh_rows(mesh: SectionMesh) -> list[tuple[str, str]]:
    """Return labels and values that describe a mesh."""
    q = mesh.quality()
    return [
        ("cells", f"{q.cells} of shape {mesh.cell}, order {mesh.order}"),
        ("points", f"{q.points}, of which {q.vertices} vertices"),
        ("boundary", f"{q.facets} facets: {', '.join(mesh.groups)}"),
        ("sizes", f"{1e3 * q.smallest_size:.4g} to {1e3 * q.largest_size:.4g} mm"),
        ("growth", f"at most {q.max_growth:.3g} from cell to cell"),
        ("aspect ratio", f"at most {q.max_aspect_ratio:.3g}"),
        ("angles", f"{q.min_angle:.4g} to {q.max_angle:.4g} degrees"),
        ("scaled Jacobian", f"at least {q.min_scaled_jacobian:.3g}"),
        ("area", f"{1e4 * q.area:.6g} cm^2, relative error {q.area_error:.2g}"),
        ("modelled part", f"1/{mesh.multiplicity} of the section"),
    ]


_LACKS = "is needed by"  # of an element missing from a composition


def draw_material(
    name: str,
    composition: Iterable[str],
    picture: Path,
    database: Path | None = None,
    scheil: bool = False,
    segregated: bool = False,
) -> None:
    """Describe a steel and plot its properties; with a database, beside those of the set itself.

    Microsegregation is plotted beside equilibrium.
    """
    if segregated and database is not None:
        raise InputError("--segregated: goes without a database; give --scheil with it")
    if scheil and database is None:
        raise InputError("--scheil: freezes by a thermodynamic database; give --database FILE")
    amounts = _composition(composition)
    check_picture(picture)
    from castfem.physics.materials import describe_steel, load_steel
    from castfem.physics.materials.phase_table import Request, Scheil
    from castfem.post.plots.steel import plot_steel

    load = partial(load_steel, name, Path.cwd(), composition=amounts, origin="steel")
    beside = None
    try:
        changes: dict[str, object] = {"diagram": "segregated"} if segregated else {}
        if database is not None:
            changes["database"] = Request(str(database), scheil=Scheil() if scheil else None)
        steel = load(overrides=changes)
        if changes:
            # outside the range of the set itself, as for stainless steel
            with suppress(InputError):
                beside = load()
    except InputError as error:
        lines = [f"{one}, here by -c C=0.2" if _LACKS in one else one for one in error.problems]
        raise InputError(lines) from None
    say(parallel.console(), pairs(describe_steel(steel)))
    with drawing(picture):
        plot_steel(steel, picture, beside)


def check_picture(picture: Path) -> None:
    """Refuse a picture with an unknown file ending before anything is computed."""
    formats = (".png", ".pdf", ".svg")
    if picture.suffix.lower() not in formats:
        raise InputError(
            f"{picture}: the name of a picture ends in {', '.join(formats)}; to write into a "
            "folder, make it first"
        )


@contextmanager
def drawing(picture: Path) -> Iterator[None]:
    """Print where the picture is, or raise why it cannot be written."""
    check_picture(picture)
    try:
        yield
    except OSError as error:
        raise InputError(f"{picture}: cannot be written ({error.strerror})") from None
    print(f"drawn in {picture}")


def _composition(assignments: Iterable[str]) -> dict[str, float]:
    """Return weight percent by element from assignments such as "C=0.42"."""
    found = {}
    for assignment in assignments:
        element, _, text = assignment.partition("=")
        try:
            found[element.strip()] = PERCENT.read(text)
        except ValueError:
            raise InputError(
                f'--composition "{assignment}": write it as element=weight percent, such as '
                'C=0.42 or C="0.42 %"'
            ) from None
    return found
