"""Water of many nozzles on a face, its heat transfer, and the heat taken by a roll beside it.

Where sprays overlap their *water* adds up, not their coefficients ([Pascon2003] VI.2.1): h follows
from the sum, and grows more slowly.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from castfem.base.types import Array, Indices
from castfem.physics.thermal.flux_laws import SurfaceLaw, Term
from castfem.physics.thermal.mould_flux import with_slope
from castfem.physics.thermal.spray_correlations import Correlation, flows_up_to
from castfem.physics.thermal.surface_loop import SPRAY, packed


class Coefficient(Hashable, Protocol):
    """Heat transfer coefficient h of a nozzle model for the water on a surface."""

    def __call__(self, water: Array, surface: Array) -> Array:
        """Return h, W/m2K (n,), for flows, kg/(m2 s) (n,), and surface temperatures, K (n,)."""

    def with_slope(self, water: Array, surface: Array) -> tuple[Array, Array]:
        """Return h and its derivative by the temperature (n,), W/m2K2."""

    def extremes(self, most: float, temperatures: Array) -> tuple[Array, Array]:
        """Return where the rise of the flux h (T - Tw) can be least, for flows up to `most`.

        Args:
            most: Largest flow, kg/(m2 s).
            temperatures: Dense temperatures for a coefficient that is smooth (g,), K.

        Returns:
            Increasing flows from 0 (w,), the last at least `most`, and temperatures (t,), K.
        """


@dataclass(frozen=True)
class CoefficientTable:
    """h(T, W) in rows and columns: bilinear between them, constant beyond.

    Raises:
        ValueError: The sizes do not fit, or the arguments do not increase.
    """

    temperatures: tuple[float, ...]  #: surface temperatures, increasing (t,), K
    water: tuple[float, ...]  #: flows per area, increasing from 0 (w,), kg/(m2 s)
    values: tuple[tuple[float, ...], ...] = field(repr=False)  #: h (t, w), W/m2K

    def __post_init__(self) -> None:
        for name, axis in (("temperatures", self.temperatures), ("water", self.water)):
            if len(axis) < 2 or any(not b > a for a, b in itertools.pairwise(axis)):
                raise ValueError(f"at least two increasing {name} are needed")
        if self._arrays[2].shape != (len(self.temperatures), len(self.water)):
            raise ValueError("a coefficient is needed for each temperature and flow")

    @cached_property
    def _arrays(self) -> tuple[Array, Array, Array]:
        return np.array(self.temperatures), np.array(self.water), np.array(self.values, float)

    @cached_property
    def packed(self) -> Array:
        """The table as one array, for compiled code."""
        return packed(*self._arrays)

    @property
    def most(self) -> float:
        """Largest flow, kg/(m2 s)."""
        return self.water[-1]

    def extremes(self, most: float, temperatures: Array) -> tuple[Array, Array]:
        """See `Coefficient`: the rise is linear between rows, on both sides of each, and columns.

        Flows between the columns have no smaller rise, but distinguish vertices with less and more
        water.
        """
        rows, flows, _ = self._arrays
        fourths = np.arange(4 * len(flows) - 3) / 4.0
        between = np.interp(fourths, np.arange(len(flows)), flows)
        return between, np.r_[np.nextafter(rows, 0.0), rows]

    def __call__(self, water: Array, surface: Array) -> Array:
        """See `Coefficient`."""
        return self.with_slope(water, surface)[0]

    def with_slope(self, water: Array, surface: Array) -> tuple[Array, Array]:
        """See `Coefficient`; at a row the slope is that above it."""
        temperatures, flows, grid = self._arrays
        i, right = _place(temperatures, surface)
        j, up = _place(flows, water)
        corner, beside = grid[i, j], grid[i + 1, j]
        low = corner + up * (grid[i, j + 1] - corner)
        high = beside + up * (grid[i + 1, j + 1] - beside)
        rise = high - low
        width = temperatures[i + 1] - temperatures[i]
        within = (surface >= temperatures[0]) & (surface < temperatures[-1])
        return low + right * rise, rise / width * within


def _place(knots: Array, at: Array) -> tuple[Indices, Array]:
    """Interval of each value, and relative position in it; constant beyond the ends."""
    i = knots[1:-1].searchsorted(at, side="right")
    share = (at - knots[i]) / (knots[i + 1] - knots[i])
    return i, np.minimum(np.maximum(share, 0.0), 1.0)


@dataclass(frozen=True, slots=True)
class OfCorrelation:
    """The coefficient of a published correlation for any flow from 0.

    It is zero without water, so that there is no jump at the edge of a spray.
    """

    correlation: Correlation  #: the correlation
    water_temperature: float  #: temperature of the water, K
    machine_factor: float = 1.0  #: divides the coefficient

    def __call__(self, water: Array, surface: Array) -> Array:
        """See `Coefficient`."""
        factor = self.machine_factor
        return self.correlation.coefficient(water, self.water_temperature, factor, surface)

    def with_slope(self, water: Array, surface: Array) -> tuple[Array, Array]:
        """See `Coefficient`."""
        return with_slope(lambda temperature: self(water, temperature), surface)

    def extremes(self, most: float, temperatures: Array) -> tuple[Array, Array]:
        """See `Coefficient`: sampled densely."""
        return flows_up_to(most, self.correlation.water[0]), temperatures[::5]


def water_across(places: Array, nozzles: Sequence[float], width: float, edge: float) -> Array:
    """Water per metre of width over that of one nozzle, summed over equal nozzles, 1/m (n,).

    The water of a nozzle is uniform in the middle of its spray and falls linearly to zero at its
    ends; it integrates to 1.

    Args:
        places: Positions across the face, from its middle (n,), m.
        nozzles: Positions of the nozzles across the face, from its middle, m.
        width: Width of a spray, m.
        edge: Fraction of the half width over which the water falls: 0 for uniform, 1 for a
            triangle.
    """
    apart = np.abs(np.asarray(places)[:, None] - np.asarray(nozzles)[None, :]) / (0.5 * width)
    shape = (1.0 - apart) / edge if edge > 0.0 else np.where(apart <= 1.0, 1.0, 0.0)
    return np.asarray(np.clip(shape, 0.0, 1.0).sum(axis=1) / (width * (1.0 - 0.5 * edge)))


@dataclass(frozen=True, slots=True)
class Share:
    """Contribution of a row of nozzles to the water on a face."""

    water: Array  #: water at each vertex for a flow of 1 m3/s through the circuit (n,), kg/(m2 s)
    flow: Callable[[float], float]  #: flow of the circuit over time, m3/s
    most: float  #: largest flow, m3/s
    coefficient: Coefficient  #: coefficient of its nozzle model


@dataclass(frozen=True, slots=True)
class SprayWater(SurfaceLaw):
    """Heat to the water of all rows that spray a face at one position along the strand.

    With several nozzle models h is the mean of theirs, each at the total water, weighted with its
    part of the water.
    """

    rows: tuple[Share, ...]  #: contribution of each row
    water_temperature: float  #: temperature of the water, K

    def flows(self, time: float) -> list[Array]:
        """Water of each row at a time, kg/(m2 s) (n,)."""
        return [row.water * row.flow(time) for row in self.rows]

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        coefficients = [row.coefficient for row in self.rows]
        return _flux(coefficients, self.flows(time), self.water_temperature, temperature)

    def setting(self, time: float) -> tuple[float, ...]:
        """See `SurfaceLaw.setting`: the flows of the circuits."""
        return tuple(row.flow(time) for row in self.rows)

    def terms(self, time: float) -> tuple[Term, ...] | None:
        """See `SurfaceLaw.terms`: one for each nozzle model, at the total water."""
        parts: dict[int, tuple[CoefficientTable, Array]] = {}
        for row, flow in zip(self.rows, self.flows(time), strict=True):
            table = row.coefficient
            if not isinstance(table, CoefficientTable):
                return None
            before = parts.get(id(table), (table, 0.0))[1]
            parts[id(table)] = table, before + flow
        total = np.sum([flow for _, flow in parts.values()], axis=0)
        wet = total > 0.0
        weights = (
            [1.0]
            if len(parts) == 1
            else [
                np.divide(flow, total, out=np.zeros_like(total), where=wet)
                for _, flow in parts.values()
            ]
        )
        return tuple(
            Term(SPRAY, self.water_temperature, total, weight, table=table)
            for (table, _), weight in zip(parts.values(), weights, strict=True)
        )

    def least_rise(self, temperatures: Array, time: float) -> Array:
        """See `SurfaceLaw.least_rise` (n,): of all flows up to the largest, of each nozzle model.

        The rise of the mean of several models, whose weights add up to 1, is not below the least of
        theirs. h may fall with water, so that the largest flow need not be the worst.
        """
        most = np.sum([row.water * row.most for row in self.rows], axis=0)
        top, grid = float(most.max(initial=0.0)), temperatures.tobytes()
        models = dict.fromkeys(row.coefficient for row in self.rows)
        bounds = [_least_rises(one, self.water_temperature, top, grid) for one in models]
        return np.min([least[flows.searchsorted(most)] for flows, least in bounds], axis=0)

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.water_temperature, self.water_temperature


def _heat_transfer(
    coefficients: Sequence[Coefficient], flows: Sequence[Array], surface: Array
) -> tuple[Array, Array]:
    """Return h for the water of each row, kg/(m2 s), and surfaces, K, with its derivative."""
    total = sum(flows[1:], start=flows[0])
    first = coefficients[0]
    if all(one == first for one in coefficients[1:]):
        return first.with_slope(total, surface)
    found, rise = np.zeros((2, *surface.shape))
    for flow, coefficient in zip(flows, coefficients, strict=True):
        weight = np.divide(flow, total, out=np.zeros_like(total), where=total > 0.0)
        h, slope = coefficient.with_slope(total, surface)
        found, rise = found + weight * h, rise + weight * slope
    return found, rise


def _flux(
    coefficients: Sequence[Coefficient],
    flows: Sequence[Array],
    water_temperature: float,
    temperature: Array,
) -> tuple[Array, Array]:
    """Heat flux for the water of each row, and its derivative, see `SurfaceLaw.flux`."""
    h, slope = _heat_transfer(coefficients, flows, temperature)
    excess = temperature - water_temperature
    return h * excess, h + slope * excess


@lru_cache(maxsize=256)  # the slices of a strand pass the same rows, each with its own laws
def _least_rises(
    coefficient: Coefficient, water_temperature: float, most: float, grid: bytes
) -> tuple[Array, Array]:
    """Return flows up to `most` (w,), and the smallest rise of the flux up to each of them (w,).

    The grid of temperatures is passed as bytes, which can be compared.
    """
    flows, surface = coefficient.extremes(most, np.frombuffer(grid))
    water, surface = np.meshgrid(flows, surface, indexing="ij")
    slope = _flux([coefficient], [water], water_temperature, surface)[1]
    least = np.minimum.accumulate(slope.min(axis=1))
    # Beyond its last flow a table is constant.
    return np.r_[flows, np.inf], np.r_[least, least[-1]]


@dataclass(frozen=True, slots=True)
class RollShare(SurfaceLaw):
    """Heat to a roll as a fraction of the total heat loss of its pitch ([Meng2003])."""

    share: float  #: fraction taken by the roll
    length: float  #: length of contact, m
    #: length, m, and law of all other cooling in the pitch
    beside: tuple[tuple[float, SurfaceLaw], ...]

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`; the surface temperature is taken as uniform along the pitch."""
        flux, slope = np.zeros((2, *temperature.shape))
        for length, law in self.beside:
            q, dq = law.flux(temperature, time)
            flux, slope = flux + length * q, slope + length * dq
        return self._factor * flux, self._factor * slope

    @property
    def _factor(self) -> float:
        return self.share / (1.0 - self.share) / self.length

    def setting(self, time: float) -> tuple[float, ...]:
        """See `SurfaceLaw.setting`."""
        return tuple(one for _, law in self.beside for one in law.setting(time))

    def terms(self, time: float) -> tuple[Term, ...] | None:
        """See `SurfaceLaw.terms`."""
        found: list[Term] = []
        for length, law in self.beside:
            terms = law.terms(time)
            if terms is None:
                return None
            found += [term.times(self._factor * length) for term in terms]
        return tuple(found)

    def least_rise(self, temperatures: Array, time: float) -> float | Array:
        """See `SurfaceLaw.least_rise`: at least that of all laws together."""
        total: float | Array = 0.0
        for length, law in self.beside:
            total = total + length * np.minimum(law.least_rise(temperatures, time), 0.0)
        return self._factor * total

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        ranges = [law.ambient_range(time) for _, law in self.beside]
        return min(low for low, _ in ranges), max(high for _, high in ranges)
