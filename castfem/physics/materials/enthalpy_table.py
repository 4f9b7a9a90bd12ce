"""Enthalpy given in rows, as exported by tools for thermodynamic equilibria.

The rows include the heat of freezing. The heat capacity follows from them and is constant between
two rows.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.tables import Table
from castfem.base.types import Array, Indices
from castfem.physics.materials.iron_carbon import Side


@dataclass(frozen=True, slots=True)
class EnthalpyTable:
    """Linear between the rows, and extrapolated with the slope of the first and the last piece.

    Raises:
        ValueError: The enthalpy does not increase from row to row.
    """

    table: Table  #: enthalpy over temperature, J/kg
    jumps: tuple[float, ...] = ()
    curved: bool = False

    def __post_init__(self) -> None:
        rows = zip(self.table.arguments, self.table.values, strict=True)
        for number, ((_, low), (hot, high)) in enumerate(itertools.pairwise(rows), start=2):
            if not high > low:
                raise ValueError(
                    f"must increase with temperature; row {number} ({hot - ZERO_CELSIUS:g} degC) "
                    f"does not exceed row {number - 1}"
                )

    @property
    def kinks(self) -> tuple[float, ...]:
        """The rows."""
        return self.table.kinks

    @property
    def span(self) -> tuple[float, float]:
        """Temperature range of the table, K."""
        return self.table.span

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Enthalpy, J/kg."""
        t = np.asarray(temperature, float)
        beyond = t - np.clip(t, self.table.arguments[0], self.table.arguments[-1])
        slopes = self.slopes
        return np.asarray(self.table(t) + np.where(beyond < 0.0, slopes[0], slopes[-1]) * beyond)

    @property
    def slopes(self) -> Array:
        """Heat capacity between the rows, including the heat of freezing, J/(kg K)."""
        return np.diff(self.table.values) / np.diff(self.table.arguments)

    def sensible(self, solidus: float, liquidus: float) -> SensibleHeat:
        """Return the specific heat without the heat of freezing.

        Outside the freezing range it is the slope of the table; within it, the mean of those on
        both sides. The rest of the slope there is the heat of freezing.
        """
        rows = self.table.arguments
        ends = np.unique([t for t in (*rows, solidus, liquidus) if rows[0] < t < rows[-1]])
        edges = np.concatenate([[rows[0]], ends, [rows[-1]]])
        middles = 0.5 * (edges[1:] + edges[:-1])
        values = self._slope_at(middles, "above")
        mean = 0.5 * (self._slope_at(solidus, "below") + self._slope_at(liquidus, "above"))
        values = np.where((solidus < middles) & (middles < liquidus), mean, values)
        return SensibleHeat(tuple(map(float, ends)), tuple(map(float, values)), self.span)

    def _slope_at(self, temperature: npt.ArrayLike, side: Side) -> Array:
        """Slope of the piece at each temperature; at a row, of the piece on the given side."""
        places = _places(self.table.arguments, temperature, side)
        return np.asarray(self.slopes[np.clip(places - 1, 0, len(self.slopes) - 1)])


@dataclass(frozen=True, slots=True)
class SensibleHeat:
    """Piecewise constant specific heat."""

    jumps: tuple[float, ...]  #: temperatures at which it changes, K
    values: tuple[float, ...]  #: values on the pieces, one more than jumps, J/(kg K)
    span: tuple[float, float]  #: temperature range of its definition, K
    curved: bool = False  #: always linear

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which it changes, K."""
        return self.jumps

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Specific heat, J/(kg K)."""
        return np.asarray(np.asarray(self.values)[_places(self.jumps, temperature, side)])


def _places(rows: Sequence[float], temperature: npt.ArrayLike, side: Side) -> Indices:
    """Number of rows below each temperature; one at it counts according to the side."""
    t = np.asarray(temperature, float)
    return np.asarray(np.searchsorted(np.asarray(rows), t, "right" if side == "above" else "left"))
