"""The gap function: distance and normal of a wall seen from the strand's surface.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from castfem.base.types import Array


@dataclass(frozen=True, slots=True, eq=False)
class GapFunction:
    """Intersections of the outward normals at n points of the strand's surface with the wall.

    A displacement u of a point changes its gap by -(normal . u) / (normal . strand normal).
    """

    #: distance (n,), m, from the point along the strand's outward normal to the wall (268)-(273):
    #: positive where open, negative where the point has penetrated, infinite without a wall in that
    #: direction
    gap: Array
    #: unit normal (n, 2) of the wall there, pointing out of the cavity, so that normal . strand
    #: normal > 0; without a wall the strand's own normal
    normal: Array
    #: curvature of the wall there (n,), 1/m, or of the whole wall: rotation of its normal along
    #: (-normal_y, normal_x); positive for a concave cavity wall
    curvature: Array | float = 0.0


class Wall(Protocol):
    """A rigid wall along which the strand moves."""

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        """Return where points meet the wall.

        Args:
            points: Current points of the surface (n, 2), m; origin in the centre of the section,
                x along its width, y along its height.
            normals: Outward unit normals (n, 2) of the strand at them.
            position: Position below the meniscus, m.
        """


@dataclass(frozen=True, slots=True)
class PlaneWall:
    """An unbounded plane wall that may move with the position below the meniscus."""

    point: tuple[float, float]  #: a point of the wall at position 0, m
    normal: tuple[float, float]  #: direction out of the cavity, into the wall; any length
    closing: float = 0.0  #: displacement of the wall against its normal per metre of position, m/m

    def __post_init__(self) -> None:
        """Refuse a normal of zero length."""
        if not 0.0 < math.hypot(*self.normal) < math.inf:
            raise ValueError(f"the normal of a plane wall must have a direction, not {self.normal}")

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        """Return where points meet the wall; see `Wall`."""
        p, m = np.asarray(points, dtype=float), np.asarray(normals, dtype=float)
        n = np.array(self.normal) / math.hypot(*self.normal)
        cosine = m @ n
        # The wall is unbounded: even a ray nearly parallel to it meets it somewhere.
        facing = cosine > 1e-9
        height = (np.array(self.point) - p) @ n - self.closing * position
        gap = np.where(facing, height / np.where(facing, cosine, 1.0), np.inf)
        gap[np.isnan(gap)] = np.inf
        return GapFunction(gap, np.where(np.isfinite(gap)[:, None], n, m))
