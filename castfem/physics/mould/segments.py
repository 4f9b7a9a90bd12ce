"""Segments of a wall's contour, and their intersections with rays, (268)-(273) of the thesis.

A contour runs counter-clockwise: the cavity is on the left of a segment, its outward normal (into
the mould) on the right. A ray p + d m through a point p of the strand, along its outward normal m,
may meet a segment twice; only where it leaves the cavity (outward normal . m > 0) does it meet the
wall from inside. A straight line, a circle or a parabola has at most one such intersection, whose
root is given in a form without cancellation, so that no iteration is needed. The distance d is
negative where the point has penetrated the wall, and infinite where the ray misses the segment.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array

Point = tuple[float, float]
Crossing = tuple[Array, Array, Array, Array]
"""Distance along the ray, two components of the wall's unit normal, and curvature, each (k, n)."""

GRAZING = 0.02
"""Cosine between ray and wall normal below which a ray is parallel to the wall (89 degrees)."""


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight segment."""

    start: Point  #: first point (x, y), m
    end: Point  #: last point, m

    def __post_init__(self) -> None:
        """Refuse a segment of zero length."""
        if not math.dist(self.start, self.end) > 0.0:
            raise ValueError(f"a straight segment needs two points, not twice {self.start}")

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

    def points(self, count: int = 33) -> Array:
        """Return `count` points (count, 2) along the parabola, m."""
        xi = np.linspace(-1.0, 1.0, count)[:, None]
        a, b, c = self._powers()
        return (a * xi + b) * xi + c


Segment = Straight | Circular | Parabolic


@dataclass(frozen=True, slots=True, eq=False)
class Straights:
    """Straight segments as arrays: start and unit tangent (k, 1) by component, length (k, 1)."""

    start: tuple[Array, Array]
    tangent: tuple[Array, Array]
    length: Array

    @classmethod
    def of(cls, segments: list[Straight]) -> Straights:
        """Collect the coefficients of segments in arrays."""
        start = np.array([s.start for s in segments])
        along = np.array([s.end for s in segments]) - start
        length = np.hypot(along[:, :1], along[:, 1:])
        return cls(_columns(start), _columns(along / length), length)

    def cross(self, p: Array, m: Array, slack: float) -> Crossing:
        """Return where rays from p (2, n) along unit vectors m (2, n) leave the cavity."""
        (sx, sy), (tx, ty) = self.start, self.tangent
        nx, ny = ty, -tx
        cosine = nx * m[0] + ny * m[1]
        wx, wy = sx - p[0], sy - p[1]
        facing = cosine > GRAZING
        d = (nx * wx + ny * wy) / np.where(facing, cosine, 1.0)
        s = (d * m[0] - wx) * tx + (d * m[1] - wy) * ty
        met = facing & (s >= -slack) & (s <= self.length + slack)
        shape = d.shape
        nx, ny = np.broadcast_to(nx, shape), np.broadcast_to(ny, shape)
        return np.where(met, d, np.inf), nx, ny, np.broadcast_to(0.0, shape)


@dataclass(frozen=True, slots=True, eq=False)
class Circulars:
    """Arcs as arrays (k, 1): centre, radius, bend, unit vector along the chord, half its length."""

    centre: tuple[Array, Array]
    radius: Array
    bend: Array
    chord: tuple[Array, Array]
    half: Array

    @classmethod
    def of(cls, segments: list[Circular]) -> Circulars:
        """Collect the coefficients of segments in arrays."""
        chord = np.array([s.end for s in segments]) - np.array([s.start for s in segments])
        length = np.hypot(chord[:, :1], chord[:, 1:])
        return cls(
            _columns(np.array([s.centre for s in segments])),
            np.array([[s.radius] for s in segments]),
            np.array([[s.bend] for s in segments]),
            _columns(chord / length),
            0.5 * length,
        )

    def cross(self, p: Array, m: Array, slack: float) -> Crossing:
        """Return where rays from p (2, n) along unit vectors m (2, n) leave the cavity."""
        (ux, uy), radius, bend = self.chord, self.radius, self.bend
        qx, qy = p[0] - self.centre[0], p[1] - self.centre[1]
        along = qx * m[0] + qy * m[1]
        aside = qx * m[1] - qy * m[0]
        # The root of d^2 + 2 along d + |q|^2 - radius^2 = 0 with bend (along + d) > 0.
        root = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
        facing = root > GRAZING * radius
        excess = np.hypot(qx, qy)
        excess = (excess - radius) * (excess + radius)
        same = along * bend > 0.0
        d = np.where(same, -excess / np.where(same, along + bend * root, 1.0), bend * root - along)
        nx, ny = bend * (qx + d * m[0]) / radius, bend * (qy + d * m[1]) / radius
        # On the arc: beyond the chord seen from the centre, and between its ends.
        beyond = ux * ny - uy * nx < 0.0
        met = facing & beyond & (np.abs(ux * nx + uy * ny) * radius <= self.half + slack)
        return np.where(met, d, np.inf), nx, ny, np.broadcast_to(bend / radius, d.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Parabolics:
    """Parabolas as arrays (k, 1): the coefficients of xi^2, xi and 1, each by component."""

    square: tuple[Array, Array]
    linear: tuple[Array, Array]
    middle: tuple[Array, Array]

    @classmethod
    def of(cls, segments: list[Parabolic]) -> Parabolics:
        """Collect the coefficients of segments in arrays."""
        powers = [s._powers() for s in segments]
        square, linear, middle = (_columns(np.array([p[i] for p in powers])) for i in range(3))
        return cls(square, linear, middle)

    def cross(self, p: Array, m: Array, slack: float) -> Crossing:
        """Return where rays from p (2, n) along unit vectors m (2, n) leave the cavity (271)."""
        (ax, ay), (bx, by) = self.square, self.linear
        wx, wy = self.middle[0] - p[0], self.middle[1] - p[1]
        a, b, c = ax * m[1] - ay * m[0], bx * m[1] - by * m[0], wx * m[1] - wy * m[0]
        # The root of a xi^2 + b xi + c = 0 with slope 2 a xi + b < 0, where the ray leaves (272).
        slope = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
        falling = b < 0.0
        straight = a == 0.0
        below = np.where(falling, slope - b, 1.0)
        twice = np.where(falling | straight, 1.0, 2.0 * a)
        xi = np.where(falling, 2.0 * c / below, -(b + slope) / twice)
        inside = (falling | ~straight) & (np.abs(xi) <= 1.0 + slack / np.hypot(bx, by))
        xi = np.where(inside, xi, 0.0)
        tx, ty = 2.0 * ax * xi + bx, 2.0 * ay * xi + by
        scale = 1.0 / np.hypot(tx, ty)
        nx, ny = ty * scale, -tx * scale
        met = inside & (slope * scale > GRAZING)  # normal . ray = slope over |(tx, ty)|
        d = ((ax * xi + bx) * xi + wx) * m[0] + ((ay * xi + by) * xi + wy) * m[1]
        turn = 2.0 * (tx * ay - ty * ax) * scale**3
        return np.where(met, d, np.inf), nx, ny, turn


def _columns(vectors: Array) -> tuple[Array, Array]:
    """Split (k, 2) into its components (k, 1)."""
    return np.ascontiguousarray(vectors[:, :1]), np.ascontiguousarray(vectors[:, 1:])
