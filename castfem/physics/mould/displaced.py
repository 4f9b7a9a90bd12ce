"""A mould whose wall is displaced from the cavity of its sizes and taper, all round and along.

Displaced by heat, if the cavity is the cold one; or by design, for walls that no taper describes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.mould.cavity import Cavity, Tapers, mirrored
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.mould import Mould
from castfem.physics.mould.perimeter import CORNER, Places, lengths, sides_of
from castfem.physics.mould.segments import Parabolic, Point, Segment, Straight

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


@dataclass(frozen=True, eq=False)
class WallDisplacement:
    """Displacement of the wall of a quarter from its cavity."""

    positions: Array  #: positions below the meniscus (p,), m, increasing; constant beyond them
    #: length of wall from the middle of the right-hand face (w,), m, along the cavity at the
    #: meniscus, increasing, from 0 to the middle of the upper face. Each three consecutive places,
    #: the first shared with the previous three, define a parabola
    ways: Array
    moved: Array  #: displacement (p, w, 2), m

    def __post_init__(self) -> None:
        """Check that the tables are consistent.

        Raises:
            ValueError: They are not.
        """
        p, w = len(self.positions), len(self.ways)
        if p < 2 or w < 3 or w % 2 == 0 or self.moved.shape != (p, w, 2):
            raise ValueError(
                "a displaced wall needs two positions at least and an odd number of places, "
                f"three at least, with x and y for each (it has {p} and {w})"
            )
        if not (np.diff(self.positions) > 0.0).all() or not (np.diff(self.ways) > 0.0).all():
            raise ValueError("positions and places of a displaced wall must increase")
        if not np.isfinite(self.moved).all():
            raise ValueError("the displacement of a wall must be finite everywhere")

    def __eq__(self, other: object) -> bool:
        """Whether it is identical, bit by bit."""
        return isinstance(other, WallDisplacement) and all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("positions", "ways", "moved")
        )

    def __hash__(self) -> int:
        """Return a hash of its numbers."""
        return hash((self.positions.tobytes(), self.ways.tobytes(), self.moved.tobytes()))

    @cached_property
    def _spline(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.positions, self.moved, axis=0, bc_type="natural")

    def at(self, position: float) -> Array:
        """Return the displacement (w, 2) at a position, m: a cubic spline along the mould."""
        within = min(max(position, self.positions[0]), self.positions[-1])
        return np.asarray(self._spline(within))

    def less(self, position: float) -> WallDisplacement:
        """Return the displacement relative to that at a position."""
        return WallDisplacement(self.positions, self.ways, self.moved - self.at(position))


class DisplacedMould(Mould):
    """A rigid mould with a displaced wall; see `Mould`.

    Args:
        cavity: Section without the displacement, with the sizes at the meniscus, m.
        length: Length from the meniscus to its end, m.
        tapers: Tapers of its dimensions, without the displacement.
        displacement: Displacement of the wall.
        wall_temperature: Temperature of the face towards the strand, K; None if not given.

    Raises:
        ValueError: The places are not those of the cavity, or the wall folds.
    """

    def __init__(
        self,
        cavity: Cavity,
        length: float,
        tapers: Tapers,
        displacement: WallDisplacement,
        wall_temperature: Constant | Table | None = None,
    ) -> None:
        start = sides_of(cavity, tapers, 0.0)
        self.displacement = displacement
        self._places = Places.at_ways(start, displacement.ways)
        ends = np.cumsum(lengths(start))
        whole = float(ends[-1])
        if abs(displacement.ways[0]) > 1e-6 * whole or abs(displacement.ways[-1] - whole) > (
            1e-3 * whole
        ):
            raise ValueError(
                f"the displaced wall is given from {1e3 * displacement.ways[0]:.4g} to "
                f"{1e3 * displacement.ways[-1]:.4g} mm of its quarter; the cavity's wall goes from "
                f"0 to {1e3 * whole:.4g} mm"
            )
        for end in ends[:-1]:
            i = int(np.abs(displacement.ways - end).argmin())
            if i % 2 or abs(displacement.ways[i] - end) > 1e-3 * whole:
                raise ValueError(
                    f"a displaced wall needs a place at {1e3 * end:.5g} mm of its quarter, where "
                    "the corner meets a face, and an odd number of places before it"
                )
        super().__init__(cavity, length, tapers, wall_temperature)

    def wall(self, position: float) -> Array:
        """Return the points (w, 2) of the displaced quarter at a position, m."""
        z = self._within(position)
        points, _ = self._places.on(sides_of(self.cavity, self.tapers, z))
        points = points + self.displacement.at(z)
        points[0, 1] = points[-1, 0] = 0.0  # the planes of symmetry are fixed
        return points

    def contour(self, position: float) -> Contour:
        """Return the wall at a position below the meniscus (m); the last one is cached."""
        if self._built is None or self._built[0] != position:
            self._built = (position, _contour(self.wall(position)))
        return self._built[1]

    def dimensions(self, position: float, *, as_made: bool = False) -> dict[str, float]:
        """Return the linear dimensions of the cavity by name, m; see `Mould`.

        Args:
            position: Position below the meniscus, m.
            as_made: Return those without the displacement.
        """
        z = self._within(position)
        plain = self.cavity.dimensions(self.tapers, z, 1.0)
        if as_made:
            return plain
        points = self.wall(z)
        sizes = {
            "width": 2.0 * float(points[0, 0]),
            "height": 2.0 * float(points[-1, 1]),
            "diameter": float(points[0, 0] + points[-1, 1]),
        }
        if "diagonal" in plain:
            sizes["diagonal"] = plain["diagonal"] + 2.0 * self._outward_at_corner(z)
        return {name: sizes[name] for name in plain}

    def marks(self, position: float) -> dict[str, float]:
        """Return the distances of some points of the wall from the centre, by name, m."""
        z = self._within(position)
        size = self.dimensions(z)
        known = {
            "mid-face": "width",
            "narrow face": "width",
            "wide face": "height",
            "corner": "diagonal",
            "wall": "diameter",
        }
        names = self.cavity.marks(self.tapers, z, 1.0)
        return {name: 0.5 * size[known[name]] for name in names}

    def _outward_at_corner(self, position: float) -> float:
        """Return the largest outward displacement of the corner, m."""
        sides = sides_of(self.cavity, self.tapers, position)
        x, y = (end - sides.radius for end in sides.ends)
        moved, here = self.displacement.at(position), self._places.piece == CORNER
        along = moved @ np.array([x, y]) / np.hypot(x, y)
        # The end of the arc belongs to the following face.
        last = np.flatnonzero(here)[-1] + 1
        share = np.append(self._places.share[here], 1.0)
        farthest = np.arctan2(y, x) / (0.5 * np.pi)
        return float(np.interp(farthest, share, np.append(along[here], along[last])))


def _contour(points: Array) -> Contour:
    """Return the closed contour through the points (w, 2) of a quarter, by parabolas.

    Behind its corner every face continues straight.
    """
    quarter: list[Segment] = [
        Parabolic(_point(points[i]), _point(points[i + 1]), _point(points[i + 2]))
        for i in range(0, len(points) - 2, 2)
    ]
    # the faces continue straight behind the corners by this length
    size = float(np.abs(points).max())
    behind: list[Segment] = []
    for first, then in ((points[0], points[1]), (points[-1], points[-2])):
        way = then - first
        far = then + size * way / np.hypot(*way)
        ends = [_point(then), _point(far)]
        behind.append(Straight(*(ends[::-1] if behind else ends)))
    return Contour(mirrored(quarter, 1.0), mirrored(behind, 1.0))


def _point(row: Array) -> Point:
    return float(row[0]), float(row[1])
