"""Round sections."""

from __future__ import annotations

from castfem.meshes.assemble import MULTIPLICITY, Probe, assemble
from castfem.meshes.outline import Piece, quarter
from castfem.meshes.rectangle import isotropic, quad_grading
from castfem.meshes.rounded import rounded_quarter
from castfem.meshes.section_mesh import SectionMesh
from castfem.meshes.sizes import check_choices, check_length, check_sizes


def disc(
    *,
    diameter: float,
    surface_size: float,
    core_size: float,
    face_size: float | None = None,
    surface_depth: float = 0.0,
    core_depth: float | None = None,
    symmetry: str = "quarter",
    cell: str = "quadrilateral",
    order: int = 1,
) -> SectionMesh:
    """Mesh a round bloom or billet.

    Quadrilaterals: layers round a core of one block per quarter. Triangles: unstructured. The
    surface is the group "surface" (half and whole: surface_intrados and surface_extrados).

    Args:
        diameter: Diameter, m.
        surface_size: Size normal to the surface, at it, m.
        core_size: Size in the core, m.
        face_size: Size along the surface; by default `core_size`, m.
        surface_depth: See `Sizes`.
        core_depth: See `Sizes`; by default the radius.
        symmetry: "quarter", "half" or "whole".
        cell: "quadrilateral" or "triangle".
        order: 1 or 2.

    Raises:
        ValueError: A parameter is impossible; the message names it.
    """
    check_choices(cell, order, symmetry)
    r = 0.5 * check_length("diameter", diameter)
    face = core_size if face_size is None else face_size
    sizes = check_sizes(
        r,
        r,
        surface_size=surface_size,
        core_size=core_size,
        corner_size=face,
        face_size=face,
        surface_depth=surface_depth,
        core_depth=core_depth,
    )
    arc = Piece("surface", (r, 0.0), (0.0, r), (0.0, 0.0), mirrors="y")
    outline = quarter([arc])
    quarters = 4 // MULTIPLICITY[symmetry]
    if cell == "triangle":
        points, cells = isotropic(outline, sizes, (), quarters)
    else:
        side = Piece("surface", (r, 0.0), (r, 0.0), mirrors="y")
        top = Piece("surface", (0.0, r), (0.0, r), mirrors="y")
        points, cells = rounded_quarter((side, arc, top), quad_grading(sizes), quarters)
    diagonal = r * 0.5**0.5
    probes = {
        "mid_face": Probe((0.0, r), (0.0, 0.0), "y"),
        "narrow_face": Probe((r, 0.0), (0.0, 0.0), "x"),
        "diagonal": Probe((diagonal, diagonal), (0.0, 0.0), "xy"),
    }
    return assemble(points, cells, cell, order, outline, probes, symmetry)
