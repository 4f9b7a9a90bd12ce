"""The mould: a cavity whose section depends on the position below the meniscus.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.mould.cavity import Cavity, Tapers, same
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.taper import Taper, segment_ends, taper_between
from castfem.physics.mould.wall import GapFunction


@dataclass(frozen=True, slots=True)
class Expansion:
    """Thermal expansion of a mould whose cold shape is given.

    Every length of the cavity is 1 + alpha (T(z) - T_cold) times its cold value: plates or tube
    expand freely, according to the mean temperature T(z) across their thickness.
    """

    coefficient: float  #: mean expansion coefficient alpha of the copper from T_cold to T, 1/K
    cold: float  #: temperature T_cold of the given shape, K
    temperature: Constant | Table  #: mean temperature T(z) of the wall along the mould, K

    def factor(self, position: float) -> float:
        """Return hot over cold length at a position."""
        return 1.0 + self.coefficient * (self.temperature(position) - self.cold)


@dataclass(frozen=True, slots=True)
class Zone:
    """Taper (300) of one dimension in one zone of the mould."""

    dimension: str  #: name of the dimension: "width", "height", "diagonal", "diameter"
    start: float  #: start of the zone, from the meniscus, m
    end: float  #: end of the zone, m
    inlet: float  #: the dimension at its start, m
    outlet: float  #: the dimension at its end, m

    @property
    def taper(self) -> float:
        """Taper (300), 1/m."""
        return taper_between(self.inlet, self.outlet, self.end - self.start)


def is_below(position: float, length: float) -> bool:
    """Whether a position is below the end of a mould of some length, m."""
    return position > length * (1.0 + ROUNDING)


class Mould:
    """A rigid mould in working condition: the wall around the strand.

    It implements `Wall`. Above the meniscus it continues unchanged; below its end there is no wall:
    all gaps are infinite.

    Args:
        cavity: Section, with the sizes at the meniscus, m.
        length: Length from the meniscus to its end, m.
        tapers: Tapers of its dimensions; None for none.
        wall_temperature: Temperature of the face towards the strand, K; None if not given.
        expansion: Expansion, if cavity and tapers are those of the cold mould; None in working
            condition.

    Raises:
        ValueError: The length is not positive, or the taper closes the mould.
    """

    def __init__(
        self,
        cavity: Cavity,
        length: float,
        tapers: Tapers | None = None,
        wall_temperature: Constant | Table | None = None,
        expansion: Expansion | None = None,
    ) -> None:
        if not 0.0 < length < np.inf:
            raise ValueError(f"the length of a mould must be positive, not {length:g} m")
        self.tapers = same(Taper.single(0.0, length)) if tapers is None else tapers
        self.cavity, self.length = cavity, length
        self.wall_temperature, self.expansion = wall_temperature, expansion
        self._built: tuple[float, Contour] | None = None
        for position in segment_ends(self.tapers.profiles, length):
            self.contour(position)

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        """Return where points of the strand meet the wall; see `Wall`."""
        if is_below(position, self.length):
            return GapFunction(np.full(len(points), np.inf), np.array(normals, dtype=float))
        return self.contour(position).gap_function(points, normals)

    def temperature(self, position: float) -> float:
        """Return the temperature of the face towards the strand, K.

        Raises:
            ValueError: The mould has no wall temperature.
        """
        if self.wall_temperature is None:
            raise ValueError("this mould has no wall temperature: mould.wall_temperature")
        return self.wall_temperature(position)

    def contour(self, position: float) -> Contour:
        """Return the wall at a position below the meniscus (m); the last one is cached."""
        if self._built is None or self._built[0] != position:
            z = self._within(position)
            self._built = (position, self.cavity.contour(self.tapers, z, self._scale(z)))
        return self._built[1]

    def dimensions(self, position: float, *, as_made: bool = False) -> dict[str, float]:
        """Return the linear dimensions of the cavity by name, m.

        Args:
            position: Position below the meniscus, m.
            as_made: Return those of the cold mould, if its cold shape is given.
        """
        z = self._within(position)
        return self.cavity.dimensions(self.tapers, z, 1.0 if as_made else self._scale(z))

    def marks(self, position: float) -> dict[str, float]:
        """Return the distances of some points of the wall from the centre, by name, m."""
        z = self._within(position)
        return self.cavity.marks(self.tapers, z, self._scale(z))

    def zones(self, *, as_made: bool = False) -> tuple[Zone, ...]:
        """Return the taper of every dimension in every zone, and over the whole mould.

        A zone extends from one change of the dimension's taper to the next. The last entry of a
        dimension is for the whole mould, if there is more than one zone.

        Args:
            as_made: Return those of the cold mould, if its cold shape is given.
        """
        found = []
        for name in self.dimensions(0.0):
            ends = segment_ends(self.tapers.of(name), self.length)
            size = {z: self.dimensions(z, as_made=as_made)[name] for z in ends}
            pairs = list(itertools.pairwise(ends))
            if len(pairs) > 1:
                pairs.append((0.0, self.length))
            found += [Zone(name, one, other, size[one], size[other]) for one, other in pairs]
        return tuple(found)

    def _within(self, position: float) -> float:
        return min(max(position, 0.0), self.length)

    def _scale(self, position: float) -> float:
        return 1.0 if self.expansion is None else self.expansion.factor(position)
