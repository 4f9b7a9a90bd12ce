"""Rectangular sections: billet, bloom and slab, with or without rounded corners; and the strip."""

from __future__ import annotations

import math

import numpy as np

from castfem.meshes.assemble import MULTIPLICITY, Probe, assemble
from castfem.meshes.blocks import join
from castfem.meshes.bulge import Table, bulged
from castfem.meshes.grading import SizeLaw, size_law
from castfem.meshes.outline import Outline, Piece, chain, quarter
from castfem.meshes.rounded import Grading, rounded_quarter
from castfem.meshes.section_mesh import SectionMesh
from castfem.meshes.sizes import (
    Sizes,
    check_choices,
    check_count,
    check_length,
    check_radius,
    check_sizes,
)
from castfem.meshes.triangles import split_rectangles, unstructured


def rectangle(
    *,
    width: float,
    height: float,
    corner_radius: float = 0.0,
    symmetry: str = "quarter",
    cell: str = "quadrilateral",
    order: int = 1,
    bulge: Table | None = None,
    **sizes: float,
) -> SectionMesh:
    """Mesh a billet, bloom or slab.

    Quadrilaterals: for sharp corners a product of two graded grids (all cells are rectangles); for
    rounded ones three blocks with layers that follow the surface. Triangles: the rectangles
    cut in two for sharp corners; else unstructured, nearly equilateral and Delaunay.

    Args:
        width: Width (x), m.
        height: Height or thickness (y), m.
        corner_radius: Radius of the corners, 0 for sharp ones, m.
        symmetry: "quarter" (x, y >= 0), "half" (x >= 0) or "whole".
        cell: "quadrilateral" or "triangle".
        order: 1 or 2.
        bulge: Offsets of the outline over the length along a quarter, see `bulged`.
        **sizes: Those of `Sizes`, m; surface_size and core_size must be given.

    Raises:
        ValueError: A parameter is impossible; the message names it.
    """
    check_choices(cell, order, symmetry)
    a, b = 0.5 * check_length("width", width), 0.5 * check_length("height", height)
    thin = min(a, b)
    check_length("corner_radius", corner_radius, thin, "half the smaller side", zero=True)
    if corner_radius > 0.0:
        check_radius("corner_radius", corner_radius)
    checked = check_sizes(thin, max(a, b), **sizes)
    r = thin if thin - corner_radius < 1e-9 * thin else float(corner_radius)
    faces = (
        Piece("narrow_face", (a, 0.0), (a, b - r), mirrors="x"),
        Piece("corner", (a, b - r), (a - r, b), (a - r, b - r), mirrors="xy"),
        Piece("wide_face", (a - r, b), (0.0, b), mirrors="y"),
    )
    outline = quarter(faces)
    quarters = 4 // MULTIPLICITY[symmetry]
    if r == 0.0:
        points, cells = _grid(a, b, checked, quarters)
        cells = split_rectangles(cells) if cell == "triangle" else cells
    elif cell == "triangle":
        points, cells = isotropic(outline, checked, (faces[1],), quarters)
    else:
        points, cells = rounded_quarter(faces, quad_grading(checked), quarters)
    on_arc = r * (1.0 - math.sqrt(0.5))
    probes = {
        "mid_face": Probe((0.0, b), (0.0, 0.0), "y"),
        "narrow_face": Probe((a, 0.0), (0.0, 0.0), "x"),
        "corner": Probe((a - on_arc, b - on_arc), (a - thin, b - thin), "xy"),
    }
    mesh = assemble(points, cells, cell, order, outline, probes, symmetry)
    return mesh if bulge is None else bulged(mesh, a, b, r, bulge)


def quad_grading(sizes: Sizes) -> Grading:
    """Laws of a structured mesh, where a column has one size at the face and in the core."""
    coarse = min(sizes.face_size, sizes.core_size)
    return Grading(sizes.inward(coarse), sizes.along(coarse))


def isotropic(
    outline: Outline, sizes: Sizes, corners: tuple[Piece, ...], quarters: int
) -> tuple[np.ndarray, np.ndarray]:
    """Unstructured triangles: one size in all directions, the smallest requested at each point."""
    fine = min(sizes.surface_size, sizes.face_size)
    depths = sizes.surface_depth, sizes.core_depth
    inward = size_law(fine, sizes.core_size, *depths)
    # Two facets at least on an arc, so that no cell is flat between its two sides on the surface.
    smallest = min([sizes.corner_size, *(0.5 * arc.length for arc in corners)])
    corner = size_law(min(smallest, fine), sizes.core_size, *depths)
    refined = corners if smallest < fine else ()
    estimate = _under(outline.surface, outline.area(), inward)
    if refined:
        estimate += _under(refined, outline.area(), corner)
    check_count(estimate, quarters)
    return unstructured(outline, inward, refined, corner)


def _under(pieces: tuple[Piece, ...], area: float, law: SizeLaw) -> float:
    """Approximate number of triangles of a law under pieces of the surface."""
    length = sum(p.length for p in pieces)
    depth = np.r_[0.0, np.geomspace(1e-3 * law.fine, area / length, 2001)]
    middle = 0.5 * (depth[1:] + depth[:-1])
    return float(2.31 * length * (np.diff(depth) / law.size(middle) ** 2).sum())


def _grid(a: float, b: float, sizes: Sizes, quarters: int) -> tuple[np.ndarray, np.ndarray]:
    """Product of two graded grids on [0, a] x [0, b], fine at x = a and y = b.

    A row has one height from the corner to the middle of the face, so the smaller one of the two
    sizes is used.
    """
    fine = min(sizes.surface_size, sizes.corner_size)
    coarse = min(sizes.face_size, sizes.core_size)
    law = size_law(fine, coarse, sizes.surface_depth, sizes.core_depth)
    check_count(law.count(a) * law.count(b), quarters)
    return product(a - law.nodes(a)[::-1], b - law.nodes(b)[::-1])


def product(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grid of rectangles on ascending coordinates (p,) and (q,): points and cells."""
    return join([np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)])


def strip(
    *,
    length: float,
    width: float,
    surface_size: float,
    core_size: float | None = None,
    face_size: float | None = None,
    surface_depth: float = 0.0,
    core_depth: float | None = None,
    cell: str = "quadrilateral",
    order: int = 1,
) -> SectionMesh:
    """Mesh a strip [0, length] x [0, width] for one-dimensional problems, the surface at x = 0.

    Args:
        length: Length (x), away from the surface, m.
        width: Width (y), m.
        surface_size: Size along x at the surface, m.
        core_size: Size along x at the far end; by default `surface_size` (uniform), m.
        face_size: Size across the strip; by default `width` (one cell), m.
        surface_depth: Distance over which the size at the surface is kept, m.
        core_depth: Distance at which the core size is reached; by default `length`, m.
        cell: "quadrilateral" or "triangle".
        order: 1 or 2.

    Raises:
        ValueError: A parameter is impossible; the message names it.
    """
    check_choices(cell, order, None)
    check_length("length", length)
    check_length("width", width)
    core = surface_size if core_size is None else core_size
    across = width if face_size is None else face_size
    check_length("face_size", across, width, "the width of the strip")
    sizes = check_sizes(
        length,
        length,
        surface_size=surface_size,
        core_size=core,
        corner_size=surface_size,
        face_size=core,
        surface_depth=surface_depth,
        core_depth=core_depth,
    )
    law, rows = sizes.inward(), math.ceil(width / across - 1e-9)
    check_count(law.count(length) * rows)
    points, cells = product(law.nodes(length), np.linspace(0.0, width, rows + 1))
    if cell == "triangle":
        cells = split_rectangles(cells)
    corners = ((0.0, 0.0), (length, 0.0), (length, width), (0.0, width))
    names = ("side_low", "core_end", "side_high", "surface")
    ends = corners[1:] + corners[:1]
    outline = chain([Piece(*piece) for piece in zip(names, corners, ends, strict=True)])
    probes = {"mid_face": Probe((0.0, 0.5 * width), (length, 0.5 * width))}
    return assemble(points, cells, cell, order, outline, probes, None)
