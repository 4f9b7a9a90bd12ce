"""A rectangle whose outline is offset outwards or inwards by a table along a quarter of it.

The length along a quarter (`way`) is measured from the middle of the right-hand face over the
corner to the middle of the upper face; offsets are along the outward normal, the same in all four
quarters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from castfem.meshes.section_mesh import SectionMesh

Table = tuple[Sequence[float], Sequence[float]]
"""Lengths along the quarter and offsets, m."""
_MOST = 0.2
"""Largest offset relative to half the smaller side."""


def ways_round(points: np.ndarray, a: float, b: float, radius: float) -> np.ndarray:
    """Length along the quarter (n,) to points (n, 2) on the outline, or in line with it, m.

    Args:
        points: Points in any quarter, m.
        a: Half the width, m.
        b: Half the height, m.
        radius: Radius of the corners, m.
    """
    x, y = np.abs(np.asarray(points, float)).T
    right, arc = b - radius, 0.5 * np.pi * radius
    from_corner = np.arctan2(np.maximum(y - right, 0.0), np.maximum(x - (a - radius), 0.0))
    on_arc = right + radius * from_corner
    below, beyond = y <= right, x <= a - radius
    upper = right + arc + (a - radius - x)
    # Far inside, where both conditions hold, the nearer face is taken.
    face = below & (~beyond | (a - x <= b - y))
    return np.asarray(np.where(face, y, np.where(beyond, upper, on_arc)))


def normals_round(ways: np.ndarray, b: float, radius: float) -> np.ndarray:
    """Outward unit normals (n, 2) of the first quarter's outline."""
    if radius == 0.0:
        angle = np.where(ways < b, 0.0, np.where(ways > b, 0.5 * np.pi, 0.25 * np.pi))
    else:
        angle = np.clip((ways - (b - radius)) / radius, 0.0, 0.5 * np.pi)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def bulged(mesh: SectionMesh, a: float, b: float, radius: float, table: Table) -> SectionMesh:
    """Move a mesh of a rectangle so that its outline has the offsets of a table.

    Points inside move in proportion to their distance from the centre along a ray to the outline;
    lines of symmetry are unchanged.

    Args:
        mesh: Mesh of the rectangle, or of a part of it.
        a: Half its width, m.
        b: Half its height, m.
        radius: Radius of its corners, m.
        table: Increasing lengths and offsets, m; linear in between, constant beyond.

    Raises:
        ValueError: The offsets are too large.
    """
    largest = float(np.abs(np.asarray(table[1], float)).max())
    if largest > _MOST * min(a, b):
        raise ValueError(
            f"bulge is {1e3 * largest:.4g} mm somewhere; allowed: at most "
            f"{1e3 * _MOST * min(a, b):.4g} mm, a fifth of half the smaller side"
        )

    def moved(points: np.ndarray) -> np.ndarray:
        return np.asarray(points + _shift(np.asarray(points, float), a, b, radius, table))

    before = mesh.quality().area
    probes = {
        name: (moved(start[None])[0], moved(end[None])[0])
        for name, (start, end) in mesh.probes.items()
    }
    found = replace(mesh, points=moved(mesh.points), probes=probes)
    return replace(found, exact_area=mesh.exact_area * found.quality().area / before)


def _shift(points: np.ndarray, a: float, b: float, radius: float, table: Table) -> np.ndarray:
    """Displacement (n, 2) of points (n, 2)."""
    q = np.abs(points)
    reach, out = _outline(q, a, b, radius)
    ways = ways_round(out, a, b, radius)
    offset = np.interp(ways, *table)
    shift = (offset / reach)[:, None] * normals_round(ways, b, radius)
    shift[q[:, 0] <= 1e-12 * a, 0] = 0.0
    shift[q[:, 1] <= 1e-12 * b, 1] = 0.0
    return np.asarray(np.where(points < 0.0, -1.0, 1.0) * shift)


def _outline(q: np.ndarray, a: float, b: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Intersections of rays from the centre through q (n, 2) with the outline: factor, point."""
    tiny = 1e-12 * max(a, b)
    x, y = np.maximum(q, tiny).T
    to_right, to_top = a / x, b / y
    corner = np.array([a - radius, b - radius])
    along, square = q @ corner, np.maximum((q**2).sum(axis=1), tiny**2)
    rest = np.maximum(along**2 - square * (corner @ corner - radius**2), 0.0)
    to_arc = (along + np.sqrt(rest)) / square
    reach = np.where(
        y * to_right <= b - radius,
        to_right,
        np.where(x * to_top <= a - radius, to_top, np.maximum(to_arc, 1.0e-12)),
    )
    return reach, q * reach[:, None]
