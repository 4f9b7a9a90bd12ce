"""The cavity of a mould: its section at each position, from sizes and tapers.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from castfem.base.constants import EXACT
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.segments import Circular, Parabolic, Point, Segment, Straight
from castfem.physics.mould.taper import TaperProfile


@dataclass(frozen=True, slots=True)
class Tapers:
    """The profiles of the cavity's dimensions along the mould."""

    width: TaperProfile  #: width at the middle of the narrow faces; for a round, the diameter
    height: TaperProfile  #: height at the middle of the wide faces
    #: section at its corners; None if the faces stay plane
    corner: TaperProfile | None = None

    @property
    def profiles(self) -> tuple[TaperProfile, ...]:
        """All given profiles."""
        return tuple(c for c in (self.width, self.height, self.corner) if c is not None)

    def of(self, dimension: str) -> tuple[TaperProfile, ...]:
        """Return the profiles that a dimension of the cavity depends on."""
        if dimension == "diagonal":
            return (self.width, self.height) if self.corner is None else (self.corner,)
        return (self.height,) if dimension == "height" else (self.width,)


def same(profile: TaperProfile) -> Tapers:
    """Return the same profile for the whole perimeter."""
    return Tapers(profile, profile)


class Cavity(Protocol):
    """A section of the cavity; its sizes are those at the meniscus."""

    def contour(self, tapers: Tapers, position: float, scale: float) -> Contour:
        """Return the wall at a position below the meniscus, all lengths multiplied by `scale`."""

    def dimensions(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the linear dimensions used in (300), by name, m."""

    def marks(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the distances of some points of the wall from the centre, by name, m."""


@dataclass(frozen=True, slots=True)
class Sides:
    """Half sizes of a rectangle, m: at mid-face, at the faces' ends, radius of the corners."""

    middle: tuple[float, float]
    ends: tuple[float, float]
    radius: float


@dataclass(frozen=True, slots=True)
class RectangleCavity:
    """A rectangle whose faces are plane or, if the corner has its own taper, parabolas."""

    width: float  #: width (x) at the meniscus, m
    height: float  #: height (y) at the meniscus, m
    #: corner radius there, 0 for sharp corners, m; it follows the taper of the corner
    radius: float = 0.0

    def sides(self, tapers: Tapers, position: float, scale: float) -> Sides:
        """Return the sizes at a position.

        Raises:
            ValueError: The taper leaves no flat face between the corners.
        """
        start = 0.5 * self.width, 0.5 * self.height
        a, b = (
            scale * profile.half(position, half)
            for profile, half in zip((tapers.width, tapers.height), start, strict=True)
        )
        ends = (a, b)
        if tapers.corner is not None:
            ends = (
                scale * tapers.corner.half(position, start[0]),
                scale * tapers.corner.half(position, start[1]),
            )
        radius = 0.5 * self.radius * (ends[0] / start[0] + ends[1] / start[1])
        if not (min(a, b) > 0.0 and min(ends) > radius):
            raise ValueError(
                f"the mould closes: {1e3 * position:g} mm below the meniscus the taper leaves a "
                f"cavity of {2e3 * a:.5g} x {2e3 * b:.5g} mm with corners of {1e3 * radius:.4g} mm"
            )
        return Sides((a, b), ends, radius)

    def contour(self, tapers: Tapers, position: float, scale: float) -> Contour:
        """Return the wall at a position; see `Cavity`."""
        return rectangle(self.sides(tapers, position, scale))

    def dimensions(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return width and height at mid-face and the diagonal; see `Cavity`."""
        sides = self.sides(tapers, position, scale)
        return {
            "width": 2.0 * sides.middle[0],
            "height": 2.0 * sides.middle[1],
            "diagonal": 2.0 * _diagonal(sides),
        }

    def marks(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the distances of the mid-faces and the corner; see `Cavity`."""
        sides = self.sides(tapers, position, scale)
        faces = {"narrow face": sides.middle[0], "wide face": sides.middle[1]}
        if self.width == self.height and tapers.width == tapers.height:
            faces = {"mid-face": sides.middle[0]}
        return {**faces, "corner": _diagonal(sides)}


def _diagonal(sides: Sides) -> float:
    """Return half the diagonal, measured to the rounded corner, m."""
    return math.hypot(*(end - sides.radius for end in sides.ends)) + sides.radius


@dataclass(frozen=True, slots=True)
class RoundCavity:
    """A circle."""

    diameter: float  #: diameter at the meniscus, m

    def _radius(self, tapers: Tapers, position: float, scale: float) -> float:
        radius = scale * tapers.width.half(position, 0.5 * self.diameter)
        if not radius > 0.0:
            raise ValueError(f"the mould closes {1e3 * position:g} mm below the meniscus")
        return radius

    def contour(self, tapers: Tapers, position: float, scale: float) -> Contour:
        """Return the wall at a position; see `Cavity`."""
        return circle(self._radius(tapers, position, scale))

    def dimensions(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the diameter; see `Cavity`."""
        return {"diameter": 2.0 * self._radius(tapers, position, scale)}

    def marks(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the radius; see `Cavity`."""
        return {"wall": self._radius(tapers, position, scale)}


@dataclass(frozen=True, slots=True)
class FreeCavity:
    """A section of any doubly symmetric shape; the taper of its width scales it as a whole."""

    #: segments from (a, 0) to (0, c), counter-clockwise, at the meniscus
    quarter: tuple[Segment, ...]
    width: float  #: overall width, m
    height: float  #: overall height, m

    def _scale(self, tapers: Tapers, position: float, scale: float) -> float:
        found = scale * tapers.width.half(position, 0.5 * self.width) / (0.5 * self.width)
        if not found > 0.0:
            raise ValueError(f"the mould closes {1e3 * position:g} mm below the meniscus")
        return found

    def contour(self, tapers: Tapers, position: float, scale: float) -> Contour:
        """Return the wall at a position; see `Cavity`."""
        return Contour(mirrored(self.quarter, self._scale(tapers, position, scale)))

    def dimensions(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return overall width and height; see `Cavity`."""
        factor = self._scale(tapers, position, scale)
        return {"width": factor * self.width, "height": factor * self.height}

    def marks(self, tapers: Tapers, position: float, scale: float) -> dict[str, float]:
        """Return the distance of the narrow face; see `Cavity`."""
        return {"narrow face": 0.5 * self._scale(tapers, position, scale) * self.width}


def rectangle(sides: Sides) -> Contour:
    """Return the closed contour of a rectangle with straight or parabolic faces.

    Behind the corners the faces continue straight, so that a point beyond the neighbouring face
    still finds its own face.
    """
    (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
    segments: list[Segment] = []
    behind: list[Segment] = []
    # Each face with the following corner, rotated by quarter turns from the right-hand one.
    for turn, (middle, end, reach) in enumerate(((a, p, q), (b, q, p)) * 2):
        low, high = (end, r - reach), (end, reach - r)
        bulged = abs(middle - end) > EXACT * end
        face = [low, (middle, 0.0), high] if bulged else [low, high]
        corners = [_turned(point, turn) for point in face]
        segments.append(Parabolic(*corners) if bulged else Straight(*corners))
        if r > 0.0:
            arc = [(end, reach - r), (end - r, reach), (end - r, reach - r)]
            segments.append(Circular(*(_turned(point, turn) for point in arc)))
        for far in ([(end, -2.0 * reach), low], [high, (end, 2.0 * reach)]):
            behind.append(Straight(*(_turned(point, turn) for point in far)))
    return Contour(segments, behind)


def circle(radius: float) -> Contour:
    """Return a circle about the origin."""
    east = (radius, 0.0)
    ends = [_turned(east, turn) for turn in range(5)]
    return Contour([Circular(one, other, (0.0, 0.0)) for one, other in itertools.pairwise(ends)])


def _turned(point: Point, quarters: int) -> Point:
    """Return a point rotated about the origin by quarter turns, exactly."""
    x, y = point
    for _ in range(quarters % 4):
        x, y = -y, x
    return x, y


def mirrored(quarter: Sequence[Segment], scale: float) -> list[Segment]:
    """Return the whole of a doubly symmetric contour from its quarter, scaled about the origin."""
    whole: list[Segment] = []
    for sx, sy in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)):
        flipped = sx * sy < 0.0
        for segment in reversed(quarter) if flipped else quarter:
            names = ["start", "end"]
            if flipped:
                names.reverse()
            if isinstance(segment, Circular):
                names.append("centre")
            elif isinstance(segment, Parabolic):
                names.insert(1, "middle")
            points = [getattr(segment, name) for name in names]
            whole.append(type(segment)(*((scale * sx * x, scale * sy * y) for x, y in points)))
    return whole
