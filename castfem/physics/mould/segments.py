"""Segments of a wall's contour; `castfem.physics.mould.crossings` intersects them with rays.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array
from castfem.physics.mould.crossings import CIRCULAR, PARABOLIC, STRAIGHT

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight segment."""

    start: Point  #: first point (x, y), m
    end: Point  #: last point, m

    def __post_init__(self) -> None:
        """Refuse a segment of zero length."""
        if not math.dist(self.start, self.end) > 0.0:
            raise ValueError(f"a straight segment needs two points, not twice {self.start}")

    def numbers(self) -> tuple[float, ...]:
        """Start, unit tangent and length, for `crossings`."""
        (ax, ay), (bx, by) = self.start, self.end
        length = math.hypot(bx - ax, by - ay)
        return STRAIGHT, ax, ay, (bx - ax) / length, (by - ay) / length, length

    def points(self, count: int = 2) -> Array:
        """Return `count` points (count, 2) along the segment, m."""
        s = np.linspace(0.0, 1.0, count)[:, None]
        return (1.0 - s) * np.array(self.start) + s * np.array(self.end)


@dataclass(frozen=True, slots=True)
class Circular:
    """An arc of less than half a circle."""

    start: Point  #: first point (x, y), m
    end: Point  #: last point, m
    #: centre, m, equidistant from both; on the left of the chord if the cavity is convex, on its
    #: right if the wall bulges into it
    centre: Point

    def __post_init__(self) -> None:
        """Refuse an arc whose ends and centre are inconsistent."""
        one, other = math.dist(self.start, self.centre), math.dist(self.end, self.centre)
        if not math.dist(self.start, self.end) > 0.0 or abs(one - other) > 1e-6 * max(one, other):
            raise ValueError(
                f"no arc from {self.start} to {self.end} about {self.centre}: the ends must differ "
                f"and lie at one distance from the centre, not at {one:g} and {other:g} m"
            )
        if self.bend == 0.0:
            raise ValueError(f"the arc from {self.start} to {self.end} is half a circle; divide it")

    @property
    def radius(self) -> float:
        """Radius, m."""
        return math.dist(self.start, self.centre)

    @property
    def bend(self) -> float:
        """1 if the cavity is convex, -1 if the wall bulges into it, 0 for half a circle."""
        (ax, ay), (bx, by), (cx, cy) = self.start, self.end, self.centre
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        return math.copysign(1.0, area) if abs(area) > 1e-12 * self.radius**2 else 0.0

    def numbers(self) -> tuple[float, ...]:
        """Centre, radius, bend, unit vector along the chord, half of its length: `crossings`."""
        (ax, ay), (bx, by) = self.start, self.end
        chord = math.hypot(bx - ax, by - ay)
        along = (bx - ax) / chord, (by - ay) / chord
        return CIRCULAR, *self.centre, self.radius, self.bend, *along, 0.5 * chord

    def points(self, count: int = 17) -> Array:
        """Return `count` points (count, 2) along the arc, m."""
        a, b, c = (np.array(p) for p in (self.start, self.end, self.centre))
        first = math.atan2(*(a - c)[::-1])
        turn = math.atan2((a - c)[0] * (b - c)[1] - (a - c)[1] * (b - c)[0], (a - c) @ (b - c))
        angle = first + np.linspace(0.0, turn, count)
        return c + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@dataclass(frozen=True, slots=True)
class Parabolic:
    """A parabola through three points, at xi = -1, 0 and 1 (269).

    Three equally spaced points on a line give a straight segment.
    """

    start: Point  #: first point (x, y), m
    middle: Point  #: point at xi = 0, m
    end: Point  #: last point, m

    def __post_init__(self) -> None:
        """Refuse points between which the parabola turns back."""
        a, b, _ = self._powers()
        chord = 2.0 * b
        forward = [float(tangent @ chord) for tangent in (b - 2.0 * a, b, b + 2.0 * a)]
        if not min(forward) > 0.0:
            raise ValueError(
                f"the parabola from {self.start} to {self.end} turns back: its middle point must "
                f"lie over the middle half of the chord, not at {self.middle}"
            )

    def _powers(self) -> tuple[Array, Array, Array]:
        """Return the coefficients (2,) of xi^2, xi and 1."""
        first, middle, last = (np.array(p) for p in (self.start, self.middle, self.end))
        return 0.5 * (first - 2.0 * middle + last), 0.5 * (last - first), middle

    def numbers(self) -> tuple[float, ...]:
        """The coefficients of xi^2, xi and 1, each by component, for `crossings`."""
        return PARABOLIC, *(float(x) for power in self._powers() for x in power)

    def points(self, count: int = 33) -> Array:
        """Return `count` points (count, 2) along the parabola, m."""
        xi = np.linspace(-1.0, 1.0, count)[:, None]
        a, b, c = self._powers()
        return (a * xi + b) * xi + c


Segment = Straight | Circular | Parabolic
