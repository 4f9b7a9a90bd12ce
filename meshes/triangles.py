"""Triangles: right ones split from rectangles, and unstructured ones from gmsh, made Delaunay."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np

from castfem.meshes.grading import SizeLaw
from castfem.meshes.outline import Outline, Piece, Point
from castfem.meshes.quality import pair_up

_OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.Algorithm": 6,  # frontal Delaunay
    "Mesh.ElementOrder": 1,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeMin": 0.0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFactor": 1.0,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomSeed": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.SecondOrderLinear": 0,
    "Mesh.Smoothing": 5,
    "Mesh.SubdivisionAlgorithm": 0,
}

_model_number = itertools.count()


def split_rectangles(cells: np.ndarray) -> np.ndarray:
    """Two triangles for each quadrilateral (m, 4) in tensor order, cut from vertex 0 to vertex 3.

    In the quarter that diagonal points at the section's corner, whose cell therefore is not cut
    off by a triangle with all its vertices on the surface.
    """
    return cells[:, [[0, 1, 3], [0, 3, 2]]].reshape(-1, 3)


def unstructured(
    outline: Outline, inward: SizeLaw, corners: tuple[Piece | Point, ...], corner: SizeLaw
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh an outline with nearly equilateral triangles by gmsh, and make the mesh Delaunay.

    Args:
        outline: Outline of the quarter.
        inward: Size against the depth below the surface.
        corners: Arcs and points from which `corner` is measured.
        corner: Size against the distance from the corners; the smaller size holds.

    Returns:
        Points (n, 2), m, and cells (m, 3), counter-clockwise.
    """
    with _gmsh() as gmsh:
        points, curves = _add_outline(gmsh, outline)
        surface = [curves[i] for i, p in enumerate(outline.pieces) if p in outline.surface]
        fields = [_distance_law(gmsh, surface, [], inward, outline)]
        arcs = [curves[outline.pieces.index(c)] for c in corners if isinstance(c, Piece)]
        ends = [points[c] for c in corners if not isinstance(c, Piece)]
        if arcs or ends:
            fields.append(_distance_law(gmsh, arcs, ends, corner, outline))
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)
        gmsh.model.mesh.generate(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(2)
    order = np.argsort(tags)
    index = order[np.searchsorted(tags, nodes, sorter=order)]
    used, cells = np.unique(index, return_inverse=True)  # centres of arcs are nodes of no cell
    xy = coordinates.reshape(-1, 3)[used, :2]
    cells = cells.reshape(-1, 3)
    a, b, c = (xy[cells[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1]]
    return clear_boundary(xy, make_delaunay(xy, cells))


def make_delaunay(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Flip sides until no two angles opposite to one side add up to more than 180 degrees.

    On a Delaunay mesh the P1 stiffness matrix has no positive off-diagonal entry from an interior
    side, which is what the discrete maximum principle needs. Flips never move a vertex; they end
    because each one lowers the Dirichlet energy of the mesh (Rippa 1990).
    """
    cells = cells.copy()
    for _ in range(200):
        pairs, _, sides = pair_up(cells, "triangle")
        cell, local = np.divmod(pairs, 3)
        apex = np.stack([cells[cell[:, k], (local[:, k] + 2) % 3] for k in (0, 1)], axis=1)
        ends = sides[pairs[:, 0]]  # the first cell lies on the left of its side
        first_end, second_end = points[ends[:, 0]], points[ends[:, 1]]
        cotangents = _cotangent(points[apex[:, 0]], first_end, second_end)
        cotangents = cotangents + _cotangent(points[apex[:, 1]], first_end, second_end)
        bad = np.flatnonzero(cotangents < -1e-10)
        if len(bad) == 0:
            break
        busy: set[int] = set()
        for i in bad[np.argsort(cotangents[bad], kind="stable")]:
            first, second = int(cell[i, 0]), int(cell[i, 1])
            if first in busy or second in busy:
                continue
            busy |= {first, second}
            a, b, c, d = (int(v) for v in (*ends[i], *apex[i]))
            cells[first], cells[second] = (c, a, d), (d, b, c)
    return cells


def clear_boundary(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move inner vertices off the boundary where they see a boundary side under an obtuse angle.

    Such an angle gives the P1 stiffness matrix a positive entry that no flip can remove. The vertex
    is moved inwards until it is just outside the circle over the side, and the mesh made Delaunay
    again.
    """
    points = points.copy()
    for _ in range(20):
        _, boundary, sides = pair_up(cells, "triangle")
        cell, local = np.divmod(boundary, 3)
        apex = cells[cell, (local + 2) % 3]
        first, second = points[sides[boundary, 0]], points[sides[boundary, 1]]
        inner = ~np.isin(apex, sides[boundary])
        bad = inner & (_cotangent(points[apex], first, second) < 0.0)
        if not bad.any():
            break
        side = (second - first)[bad]
        half = 0.5 * np.hypot(*side.T)
        normal = np.stack([-side[:, 1], side[:, 0]], axis=1) / (2.0 * half)[:, None]
        off = points[apex[bad]] - 0.5 * (first + second)[bad]
        height = np.einsum("na,na->n", off, normal)
        along = np.einsum("na,na->n", off, side) / (2.0 * half)
        wanted = np.sqrt((1.02 * half) ** 2 - along**2)
        np.add.at(points, apex[bad], (wanted - height)[:, None] * normal)
        cells = make_delaunay(points, cells)
    return points, cells


def _cotangent(apex: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Cotangent (n,) of the angle at `apex` between two points, all (n, 2)."""
    p, q = first - apex, second - apex
    return np.einsum("na,na->n", p, q) / np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


def _add_outline(gmsh: ModuleType, outline: Outline) -> tuple[dict[Point, int], list[int]]:
    """Add the outline and its surface to the current model; tags of points and of curves."""
    geo, points = gmsh.model.geo, {}
    for p in outline.pieces:
        points[p.start] = geo.addPoint(*p.start, 0.0)
    curves = []
    for p, after in zip(outline.pieces, outline.pieces[1:] + outline.pieces[:1], strict=True):
        start, end = points[p.start], points[after.start]
        if p.centre is None:
            curves.append(geo.addLine(start, end))
        else:
            curves.append(geo.addCircleArc(start, geo.addPoint(*p.centre, 0.0), end))
    geo.addPlaneSurface([geo.addCurveLoop(curves)])
    geo.synchronize()
    return points, curves


def _distance_law(
    gmsh: ModuleType, curves: list[int], points: list[int], law: SizeLaw, outline: Outline
) -> int:
    """Background field that follows a law of the distance from curves and points; its tag."""
    field = gmsh.model.mesh.field
    distance = field.add("Distance")
    field.setNumbers(distance, "CurvesList", curves)
    field.setNumbers(distance, "PointsList", points)
    # gmsh measures to samples of the curves: enough of them that the error is lost in the size.
    longest = max(p.length for p in outline.pieces)
    field.setNumber(distance, "Sampling", min(20000, math.ceil(4.0 * longest / law.fine)))
    threshold = field.add("Threshold")
    field.setNumber(threshold, "InField", distance)
    reach = (law.coarse - law.fine) / law.slope if law.slope > 0.0 else 1e-9
    for name, value in (
        ("SizeMin", law.fine),
        ("SizeMax", law.coarse if law.slope > 0.0 else law.fine),
        ("DistMin", law.keep),
        ("DistMax", law.keep + reach),
    ):
        field.setNumber(threshold, name, value)
    return int(threshold)


@contextmanager
def _gmsh() -> Iterator[ModuleType]:
    """A new model in gmsh; the previous state (initialised or not, options, model) is restored."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # the latter for a library it needs
        raise ImportError(
            f"gmsh makes meshes of triangles and cannot be loaded ({error}): `pip install gmsh`; "
            "what it needs besides comes with `apt install python3-gmsh`",
            name="gmsh",
        ) from error

    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    current = gmsh.model.getCurrent()
    found = {name: gmsh.option.getNumber(name) for name in _OPTIONS}
    name = f"castfem_section_{next(_model_number)}"
    try:
        for option, value in _OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield gmsh
    finally:
        if name in gmsh.model.list():
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
        for option, value in found.items():
            gmsh.option.setNumber(option, value)
        if ours:
            gmsh.finalize()
        elif current in gmsh.model.list():
            gmsh.model.setCurrent(current)
