"""Solid fraction as a function of temperature: linear (12), a table, or the lever rule.

Each law is a `Property` (see `castfem.physics.materials.properties`) with a solidus and a liquidus.
Below the solidus it is 1, above the liquidus 0.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.physics.materials.iron_carbon import Diagram, Side
from castfem.physics.materials.properties import Property

# K: smallest freezing range, and distance of two rows of a table; `knots` merges less
NARROWEST = 1e-6


class SolidFraction(Property, Protocol):
    """A property that falls from 1 at the solidus to 0 at the liquidus."""

    @property
    def solidus(self) -> float:
        """Solidus, K."""

    @property
    def liquidus(self) -> float:
        """Liquidus, K."""


@dataclass(frozen=True, slots=True)
class LinearFraction:
    """Solid fraction linear from solidus to liquidus (12); a step where they coincide.

    They coincide if they differ by less than `NARROWEST`: it then freezes at the liquidus.
    """

    solidus: float  #: solidus, K
    liquidus: float  #: liquidus, K, not below the solidus
    curved: bool = False
    span: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        if self.solidus > self.liquidus:
            raise ValueError("solidus above liquidus")
        if self.liquidus - self.solidus < NARROWEST:
            object.__setattr__(self, "solidus", self.liquidus)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Solidus and liquidus."""
        return (self.solidus,) if self.jumps else (self.solidus, self.liquidus)

    @property
    def jumps(self) -> tuple[float, ...]:
        """The melting point, if solidus and liquidus coincide."""
        return (self.solidus,) if self.solidus == self.liquidus else ()

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Solid fraction, between 0 and 1."""
        t = np.asarray(temperature, float)
        if self.jumps:
            solid = t < self.solidus if side == "above" else t <= self.solidus
            return np.asarray(solid, float)
        return np.clip((self.liquidus - t) / (self.liquidus - self.solidus), 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class TableFraction:
    """Solid fraction from a table that falls from 1 at the solidus to 0 at the liquidus.

    Raises:
        ValueError: The values do not fall from 1 to 0.
    """

    #: table over temperature from the solidus to the liquidus: 1 first and 0 last, never rising
    table: Table
    jumps: tuple[float, ...] = ()
    curved: bool = False
    span: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        values = self.table.values
        if len(values) < 2:
            raise ValueError("a table of solid fractions needs two rows at least")
        ends = values[0] == 1.0 and values[-1] == 0.0
        within = all(0.0 < v < 1.0 for v in values[1:-1])
        if not ends or any(np.diff(values) > 0.0) or not within:
            raise ValueError(
                "the solid fraction must fall from 1 in the first row to 0 in the last"
            )

    @property
    def kinks(self) -> tuple[float, ...]:
        """The rows of the table."""
        return self.table.arguments

    @property
    def solidus(self) -> float:
        """First temperature of the table, K."""
        return self.table.arguments[0]

    @property
    def liquidus(self) -> float:
        """Last temperature of the table, K."""
        return self.table.arguments[-1]

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Solid fraction, between 0 and 1."""
        return self.table(temperature)


@dataclass(frozen=True, slots=True)
class LeverFraction:
    """Solid fraction from the iron-carbon equilibrium, including the peritectic jump."""

    diagram: Diagram  #: iron-carbon diagram of the steel
    curved: bool = True
    span: tuple[float, float] = (0.0, np.inf)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Solidus, liquidus and, between them, the peritectic."""
        return tuple(t for t in self.diagram.kinks if self.solidus <= t <= self.liquidus)

    @property
    def jumps(self) -> tuple[float, ...]:
        """The peritectic, or the melting point of pure iron."""
        return tuple(t for t in self.diagram.reactions if self.solidus <= t <= self.liquidus)

    @property
    def solidus(self) -> float:
        """Solidus, K."""
        return self.diagram.solidus

    @property
    def liquidus(self) -> float:
        """Liquidus, K."""
        return self.diagram.liquidus

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Solid fraction, between 0 and 1."""
        return np.asarray(1.0 - self.diagram.phases(temperature, side).liquid)
