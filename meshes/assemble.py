"""From the vertices and cells of a quarter to a checked `SectionMesh`.

Every section has two planes of symmetry, so builders mesh a quarter (x >= 0, y >= 0). Here the
quarter gets its boundary groups and its second-order nodes, is mirrored to a half or to the whole,
and is checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from castfem.meshes import quality
from castfem.meshes.outline import Outline, Point
from castfem.meshes.section_mesh import SectionMesh

MULTIPLICITY = {"quarter": 4, "half": 2, "whole": 1}
"""Number of modelled parts in the whole section, by name of the symmetry."""

SMALLEST_SCALED_JACOBIAN = 0.05
"""A cell below this (angles within 3 degrees of 0 or 180) is degenerate."""

_ON_CHORD = 1e-9
"""Tolerance for points on a line, relative to its length or to the size of the section."""

# Vertices joined by the sides in the order of DOLFINx' second-order nodes.
_MIDDLE_ENDS = {
    "quadrilateral": ((0, 1), (0, 2), (1, 3), (2, 3)),
    "triangle": ((1, 2), (0, 2), (0, 1)),
}
_REFLECTED = {
    "quadrilateral": (1, 0, 3, 2, 4, 6, 5, 7, 8),
    "triangle": (0, 2, 1, 3, 5, 4),
}


@dataclass(frozen=True, slots=True)
class Probe:
    """Inward line from the surface of the quarter; `mirrors` as in `Piece`."""

    start: Point
    end: Point
    mirrors: str = ""


@dataclass(slots=True)
class _Part:
    """A part of the section on its way to a SectionMesh; groups by name, one name a facet."""

    points: np.ndarray
    cells: np.ndarray
    facets: np.ndarray
    names: np.ndarray
    mirrors: np.ndarray
    probes: dict[str, Probe]


def assemble(
    points: np.ndarray,
    cells: np.ndarray,
    cell: str,
    order: int,
    outline: Outline,
    probes: dict[str, Probe],
    symmetry: str | None,
) -> SectionMesh:
    """Finish a quarter and return the checked mesh.

    Args:
        points: Vertices (n, 2) of the quarter, m.
        cells: Vertices of its cells (m, 3) or (m, 4), DOLFINx order.
        cell: "triangle" or "quadrilateral".
        order: 1 or 2.
        outline: Exact outline of the quarter.
        probes: Probes of the quarter by name.
        symmetry: "quarter", "half", "whole"; None for a section that is modelled as it is.

    Raises:
        ValueError: A cell is inverted or degenerate, or the mesh does not fill the outline.
    """
    points = np.where(np.abs(points) < 1e-10 * outline.extent, 0.0, points)
    _check_connected(points, cells, cell)
    _, boundary, sides = quality.pair_up(cells, cell)
    facets = sides[boundary]
    piece = outline.classify(points, facets)
    if order == 2:
        points, cells = _second_order(points, cells, cell, outline, facets, piece)
    _check_cells(points, cells, cell)
    _check_area(points, cells, cell, outline, facets, piece, order)
    part = _Part(
        points,
        cells,
        facets,
        np.array([p.group for p in outline.pieces], dtype=object)[piece],
        np.array([p.mirrors for p in outline.pieces], dtype=object)[piece],
        probes if order == 2 else _on_chords(probes, points, facets, outline, piece),
    )
    if symmetry in ("half", "whole"):
        part = _mirror(part, 1, ("intrados", "extrados"), cell)
    if symmetry == "whole":
        part = _mirror(part, 0, ("right", "left"), cell)
    groups = tuple(dict.fromkeys(part.names.tolist()))
    number = {name: i for i, name in enumerate(groups)}
    multiplicity = 1 if symmetry is None else MULTIPLICITY[symmetry]
    copies = 1 if symmetry is None else 4 // multiplicity
    return SectionMesh(
        points=np.ascontiguousarray(part.points, dtype=np.float64),
        cells=np.ascontiguousarray(part.cells, dtype=np.int64),
        cell=cell,
        order=order,
        facets=np.ascontiguousarray(part.facets, dtype=np.int64),
        facet_group=np.array([number[name] for name in part.names], dtype=np.int32),
        groups=groups,
        probes={k: (np.array(p.start), np.array(p.end)) for k, p in part.probes.items()},
        multiplicity=multiplicity,
        exact_area=outline.area() * copies,
    )


def _second_order(
    points: np.ndarray,
    cells: np.ndarray,
    cell: str,
    outline: Outline,
    facets: np.ndarray,
    piece: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Add a node in the middle of each side (of a curved facet: on its arc) and of each quad."""
    ends = np.sort(cells[:, np.array(_MIDDLE_ENDS[cell])].reshape(-1, 2), axis=1)
    base = len(points)
    sides, number = np.unique(ends[:, 0] * base + ends[:, 1], return_inverse=True)
    middle = 0.5 * (points[sides // base] + points[sides % base])
    keys = np.sort(facets, axis=1)
    found = np.searchsorted(sides, keys[:, 0] * base + keys[:, 1])
    for i, arc in enumerate(outline.pieces):
        on = found[piece == i]
        middle[on] = arc.onto(middle[on])
    added = base + number.reshape(len(cells), -1)
    if cell == "triangle":
        return np.concatenate([points, middle]), np.concatenate([cells, added], axis=1)
    # The Coons patch of the four sides keeps the curvature of one side out of the others.
    inside = 0.5 * middle[added - base].sum(axis=1) - 0.25 * points[cells].sum(axis=1)
    last = base + len(middle) + np.arange(len(cells))
    return (
        np.concatenate([points, middle, inside]),
        np.concatenate([cells, added, last[:, None]], axis=1),
    )


def _on_chords(
    probes: dict[str, Probe],
    points: np.ndarray,
    facets: np.ndarray,
    outline: Outline,
    piece: np.ndarray,
) -> dict[str, Probe]:
    """Move starts of probes from an arc to the straight facets that approximate it."""
    found = dict(probes)
    for name, probe in probes.items():
        start, end = np.array(probe.start), np.array(probe.end)
        arcs = [
            i
            for i, p in enumerate(outline.pieces)
            if p.centre is not None
            and abs(math.dist(probe.start, p.centre) - p.radius) < _ON_CHORD * outline.extent
        ]
        chords = points[facets[np.isin(piece, arcs), :2]]
        along, sides = end - start, chords[:, 1] - chords[:, 0]
        across = along[0] * sides[:, 1] - along[1] * sides[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (chords[:, 0] - start).T
            depth = (x * sides[:, 1] - y * sides[:, 0]) / across
            at = (x * along[1] - y * along[0]) / across
        met = depth[(at >= -_ON_CHORD) & (at <= 1.0 + _ON_CHORD)]
        nearest = min(met, key=abs, default=0.0)
        if nearest > _ON_CHORD:
            x, y = (start + nearest * along).tolist()
            found[name] = replace(probe, start=(x, y))
    return found


def _mirror(part: _Part, axis: int, names: tuple[str, str], cell: str) -> _Part:
    """Join a part and its image in the line where coordinate `axis` is zero."""
    letter = "xy"[axis]
    own, image = names
    on_line = part.points[:, axis] == 0.0
    number = np.arange(len(part.points))
    number[~on_line] = len(part.points) + np.arange(np.count_nonzero(~on_line))
    flip = np.array([-1.0, 1.0]) if axis == 0 else np.array([1.0, -1.0])
    reflected = np.array(_REFLECTED[cell][: part.cells.shape[1]])
    kept = part.names != f"symmetry_{letter}"
    facets, mirrors = part.facets[kept], part.mirrors[kept]
    splits = np.array([letter in m for m in mirrors], dtype=bool)
    ours, theirs = part.names[kept].copy(), part.names[kept].copy()
    ours[splits] += f"_{own}"
    theirs[splits] += f"_{image}"
    probes = dict(part.probes)
    for name, p in part.probes.items():
        if letter in p.mirrors:
            start, end = (tuple((np.array(q) * flip).tolist()) for q in (p.start, p.end))
            probes[f"{name}_{image}"] = Probe(start, end, p.mirrors)
    return _Part(
        np.concatenate([part.points, part.points[~on_line] * flip]),
        np.concatenate([part.cells, number[part.cells][:, reflected]]),
        np.concatenate([facets, number[facets][:, ::-1]]),
        np.concatenate([ours, theirs]),
        np.concatenate([mirrors, mirrors]),
        probes,
    )


def _check_connected(points: np.ndarray, cells: np.ndarray, cell: str) -> None:
    """Refuse vertices that no cell uses, and vertices that lie on one another."""
    if len(np.unique(cells)) != len(points):
        raise ValueError("the mesh has vertices that belong to no cell")
    ends = points[cells[:, np.array(quality.edges_of(cell))]]
    sides = np.hypot(*(ends[:, :, 1] - ends[:, :, 0]).reshape(-1, 2).T)
    lattice = max(1e-3 * float(sides.min()), 1e-12)
    for shift in (0.0, 0.5):
        keys = np.floor(points / lattice + shift).astype(np.int64)
        if len(np.unique(keys, axis=0)) != len(points):
            raise ValueError("the mesh has two vertices in one place")


def _check_cells(points: np.ndarray, cells: np.ndarray, cell: str) -> None:
    """Refuse cells that are inverted or degenerate anywhere."""
    dets = quality.determinants(points, cells, cell)
    scaled, _ = quality.corner_measures(points, cells, cell)
    inverted = dets.min(axis=1) <= 0.0
    bad = inverted | (scaled.min(axis=1) < SMALLEST_SCALED_JACOBIAN)
    if bad.any():
        x, y = points[cells[np.flatnonzero(bad)[0]]].mean(axis=0)
        kind = "inverted" if inverted.any() else "degenerate"
        raise ValueError(
            f"{np.count_nonzero(bad)} of {len(cells)} cells are {kind}, the first at "
            f"({1e3 * x:.4g}, {1e3 * y:.4g}) mm: choose sizes that follow the section's radii and "
            "thicknesses more closely, or cell = 'triangle'"
        )


def _check_area(
    points: np.ndarray,
    cells: np.ndarray,
    cell: str,
    outline: Outline,
    facets: np.ndarray,
    piece: np.ndarray,
    order: int,
) -> None:
    """Refuse a mesh whose area is not that of its outline to rounding.

    On an arc the mesh has chords (order 1) or parabolas through three points of it (order 2), whose
    segments are known in closed form: 0 and 2/3 chord * sagitta.
    """
    expected = outline.area()
    chords = np.hypot(*(points[facets[:, 1]] - points[facets[:, 0]]).T)
    for i, p in enumerate(outline.pieces):
        if p.centre is None:
            continue
        half = np.arcsin(np.minimum(0.5 * chords[piece == i] / p.radius, 1.0))
        exact = p.radius**2 * (half - np.sin(half) * np.cos(half))
        sagitta = p.radius * (1.0 - np.cos(half))
        meshed = 2.0 / 3.0 * chords[piece == i] * sagitta if order == 2 else np.zeros_like(half)
        expected += np.sign(p.turn) * float((meshed - exact).sum())
    found = quality.area(points, cells, cell)
    if not abs(found - expected) < 1e-9 * expected:
        raise ValueError(
            f"the mesh covers {found:.9g} m2 where its outline encloses {expected:.9g} m2: cells "
            "overlap or are missing"
        )
