"""Heat flux through the strand's surface: plain arrays in, flux and its slope out (thesis II.4).

Every law gives q (W/m2, positive when heat leaves the strand) and dq/dT at given surface
temperatures, a lower bound of dq/dT, and the range of temperatures to which it can drive the
surface.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import STEFAN_BOLTZMANN
from castfem.base.types import Array
from castfem.physics.thermal.mould_flux import Curve, with_slope
from castfem.physics.thermal.spray_correlations import Correlation, flows_up_to
from castfem.physics.thermal.surface_loop import CURVE, FIXED, RADIATION

if TYPE_CHECKING:
    from castfem.physics.thermal.spray_flux import CoefficientTable


OfTemperature = float | Callable[[Array], Array]
"""A number, or a function of temperatures (n,), K."""


@dataclass(frozen=True, slots=True)
class Term:
    """A term of a heat flux, for `SurfaceHeat`; an array has one number per vertex (n,)."""

    kind: int  #: one of those of `castfem.physics.thermal.surface_loop`
    ambient: float  #: ambient temperature, K
    #: FIXED: coefficient, W/(m2 K). SPRAY: water, kg/(m2 s). RADIATION: resistance of gap and wall,
    #: 0.75 a d + 1/eps_wall - 1 of (33).
    number: float | Array = 0.0
    factor: float | Array = 1.0  #: factor of the term
    scale: float = 0.0  #: RADIATION: m^2 sigma of (33), W/(m2 K4)
    curve: OfTemperature | None = None  #: CURVE: coefficient, W/(m2 K). RADIATION: emissivity.
    table: CoefficientTable | None = None  #: SPRAY: coefficients over temperature and water

    def times(self, factor: float) -> Term:
        """The term, times a factor."""
        return replace(self, factor=factor * self.factor)


class SurfaceLaw(ABC):
    """Interface of a law for the thermal problem; all abstract methods are required."""

    __slots__ = ()

    def setting(self, time: float) -> tuple[float, ...]:
        """All that changes with time in the terms, such as flows of water, at a time, s."""
        return ()

    def terms(self, time: float) -> tuple[Term, ...] | None:
        """Terms that add up to the flux at a time, s; None if it is no such sum.

        `SurfaceHeat` takes them instead of `flux`: a subclass with another flux has other terms.
        """
        return None

    @abstractmethod
    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """Flux q and dq/dT (n,) at surface temperatures (n,), K, `time` (s) after the meniscus."""

    @abstractmethod
    def least_rise(self, temperatures: Array, time: float) -> float | Array:
        """Smallest dq/dT, or a lower bound of it.

        A law whose flux decreases with temperature anywhere must return a negative number: steps
        are then limited to one root of the heat balance (`castfem.physics.thermal.unique_root`).

        Args:
            temperatures: Dense temperatures at which it is evaluated (g,), K.
            time: Start of the zone, s; the bound must hold for the whole zone.

        Returns:
            One number, or one per vertex (n,) for a law that differs between them, W/m2K.
        """

    @abstractmethod
    def ambient_range(self, time: float) -> tuple[float, float]:
        """Lowest and highest temperature to which the law drives the surface, K.

        They and the old temperatures bound the new ones of a step. A flux without an ambient
        temperature has 0 and infinity.
        """


@dataclass(frozen=True)
class Convection(SurfaceLaw):
    """h(T) (T - Ta): convection (35), (30); `coefficient` is a number or a function of T (K)."""

    coefficient: OfTemperature
    ambient: float

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        excess = temperature - self.ambient
        if not callable(self.coefficient):
            return self.coefficient * excess, np.full_like(temperature, self.coefficient)
        h, slope = with_slope(self.coefficient, temperature)
        return h * excess, h + slope * excess

    def terms(self, time: float) -> tuple[Term, ...]:
        """See `SurfaceLaw.terms`."""
        if callable(self.coefficient):
            return (Term(CURVE, self.ambient, curve=self.coefficient),)
        return (Term(FIXED, self.ambient, self.coefficient),)

    def least_rise(self, temperatures: Array, time: float) -> float:
        """See `SurfaceLaw.least_rise`."""
        if not callable(self.coefficient):
            return self.coefficient
        return float(self.flux(temperatures, time)[1].min())

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.ambient, self.ambient

    def across(self, gap: float | Array) -> Convection:
        """The law across a gap: the same."""
        return self


@dataclass(frozen=True)
class Contact(SurfaceLaw):
    """Contact with the mould through a gap d (301): h = h_c k_g / (k_g + h_c d).

    Radiation and convection beside it act across the gap in parallel with its conduction, and with
    it in series with the contact resistance 1/h_c (our choice): at touching points there is only
    contact (35), elsewhere they add up across the gap (36), and the flux does not jump in between.

    Attributes:
        coefficient: Coefficient h_c at d = 0, W/m2K, or a curve of it.
        wall: Temperature of the mould's wall, K; a number or a function of time.
        gap_conductivity: Conductivity k_g, W/mK.
        gap: Gap d, m; a number or one per surface node, or two (2, nodes) for nodes that face two
            walls.
        first: With two gaps, the fraction of the surface of each node with the first one (nodes,).
        follows: Whether the gap is that of the mechanics, which changes in each coupling window.
        beside: Other laws across the gap.
    """

    coefficient: float | Curve
    wall: float | Callable[[float], float]
    gap_conductivity: float
    gap: float | Array = 0.0
    first: float | Array = 1.0
    follows: bool = False
    beside: tuple[Convection | Radiation, ...] = ()

    def across(self, gap: Array, first: float | Array = 1.0) -> Contact:
        """The law for the gap, m, of the mechanics, if it follows that."""
        return replace(self, gap=gap, first=first) if self.follows else self

    def heat_transfer(self, coefficient: float | Array) -> Array:
        """Overall coefficient h(d) of (301), W/m2K, for a contact coefficient."""
        hc, kg, gap = np.asarray(coefficient), self.gap_conductivity, np.maximum(self.gap, 0.0)
        return np.asarray(hc * kg / (kg + hc * gap))

    def _wall(self, time: float) -> float:
        return self.wall(time) if callable(self.wall) else self.wall

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        if np.ndim(self.gap) == 2:
            sides = [replace(self, gap=one).flux(temperature, time) for one in np.asarray(self.gap)]
            (one, slope), (other, its_slope) = sides
            rest = 1.0 - np.asarray(self.first)
            return self.first * one + rest * other, self.first * slope + rest * its_slope
        if not isinstance(self.coefficient, float | int):
            return self._of_curve(self.coefficient, temperature, time)
        h = np.array(np.broadcast_to(self.heat_transfer(self.coefficient), temperature.shape))
        flux = h * (temperature - self._wall(time))
        if not self.beside or not self.coefficient > 0.0:
            return flux, h
        # The gap's fraction of the total resistance: 0 where the strand touches.
        share = 1.0 - h / self.coefficient
        crossing, slope, conductance, its_slope = self._crossing(temperature, time)
        both = flux + share * crossing
        less = 1.0 + share * conductance / self.coefficient
        by_less = both / less * share * its_slope / self.coefficient
        return both / less, (h + share * slope - by_less) / less

    def _crossing(self, temperature: Array, time: float) -> tuple[Array, Array, Array, Array]:
        """Flux parallel to the gap's conduction, and conductance (34), each with its derivative."""
        crossing, slope, conductance, its_slope = np.zeros((4, *temperature.shape))
        for law in self.beside:
            law = law.across(self.gap)
            q, dq = law.flux(temperature, time)
            c, dc = _conductance(q, dq, temperature - law.ambient)
            crossing, slope = crossing + q, slope + dq
            conductance, its_slope = conductance + c, its_slope + dc
        return crossing, slope, conductance, its_slope

    def _of_curve(self, curve: Curve, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `flux`, with a temperature-dependent contact coefficient h_c.

        With r = d/k_g and c, q_c acting in parallel, the flux is h_c (T - Tw + r q_c) / (1 + r (h_c
        + c)): the expression in `flux`, multiplied out.
        """
        wall = self._wall(time)
        hc, rise = curve.of(temperature, time, wall)
        r = np.maximum(self.gap, 0.0) / self.gap_conductivity
        crossing, slope, c, dc = self._crossing(temperature, time)
        excess = temperature - wall
        above = hc * (excess + r * crossing)
        its_rise = rise * (excess + r * crossing) + hc * (1.0 + r * slope)
        below, of_below = 1.0 + r * (c + hc), r * (dc + rise)
        flux: Array = above / below
        fall: Array = flux * of_below
        return flux, (its_rise - fall) / below

    def least_rise(self, temperatures: Array, time: float) -> float:
        """See `SurfaceLaw.least_rise`; without a gap, where a decreasing flux decreases most."""
        curve = self.coefficient
        if isinstance(curve, float | int) or curve.over_temperature is None:
            return 0.0
        slope = replace(self, gap=0.0, beside=()).flux(temperatures, time)[1]
        least = float(slope.min())
        # Smaller values are rounding of a flux that does not decrease.
        return least if least < -1e-9 * float(np.abs(slope).max(initial=0.0)) else 0.0

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        met = [self._wall(time), *(law.ambient for law in self.beside)]
        return min(met), max(met)


def _conductance(flux: Array, slope: Array, excess: Array) -> tuple[Array, Array]:
    """Flux over the temperature difference `excess` (34), W/m2K, and its derivative."""
    near = np.abs(excess) < 1e-3  # K
    by = np.where(near, 1.0, excess)
    conductance = np.where(near, slope, flux / by)
    return conductance, np.where(near, 0.0, (slope - conductance) / by)


@dataclass(frozen=True)
class Radiation(SurfaceLaw):
    """gamma (T^4 - Ta^4), (32), with the gap factor (33).

    gamma = m^2 sigma / (0.75 a d + 1/eps_strand + 1/eps_wall - 1); eps_wall = 1 and d = 0 (the
    defaults) leave eps_strand sigma, a small body in wide surroundings.

    Attributes:
        emissivity: eps_strand; a number or a function of the temperature, K.
        ambient: Ambient temperature Ta, K.
        wall_emissivity: eps_wall; a number or a function of the temperature, K.
        refractive_index: Refractive index m.
        absorption: Absorption coefficient a, 1/m.
        gap: Gap d, m; a number or one per surface node; None: none, or that of the contact beside
            it.
    """

    emissivity: OfTemperature
    ambient: float
    wall_emissivity: OfTemperature = 1.0
    refractive_index: float = 1.0
    absorption: float = 0.0
    gap: float | Array | None = None

    def across(self, gap: float | Array) -> Radiation:
        """The law across a gap, m: the given one, if the law has none of its own."""
        return self if self.gap is not None else replace(self, gap=gap)

    def factor(self, temperature: Array) -> Array:
        """The factor gamma of (33), W/m2K4, at surface temperatures (n,)."""
        return self._factor(temperature)[0]

    def _factor(self, temperature: Array) -> tuple[Array, Array]:
        """The factor gamma of (33) at surface temperatures (n,), and its derivative, W/m2K5.

        With c = 0.75 a d + 1/eps_wall - 1 it is m^2 sigma eps / (1 + c eps), with eps of the
        strand.
        """
        given: Array | OfTemperature = self.emissivity
        strand, rise = with_slope(given, temperature) if callable(given) else (given, 0.0)
        between = self._between()
        if between is None:
            return np.zeros_like(temperature), np.zeros_like(temperature)
        less = 1.0 + between * strand
        per_emissivity = self._scale / less
        gamma = np.asarray(per_emissivity * strand)
        if gamma.shape != temperature.shape:
            gamma = np.broadcast_to(gamma, temperature.shape)
        return gamma, np.asarray(per_emissivity * rise / less)

    @property
    def _scale(self) -> float:
        """m^2 sigma, W/(m2 K4)."""
        return self.refractive_index**2 * STEFAN_BOLTZMANN

    def _between(self) -> float | Array | None:
        """0.75 a d + 1/eps_wall - 1; None if it is infinite, so that nothing is radiated."""
        wall = self.wall_emissivity
        if callable(wall):  # the wall has the ambient temperature
            wall = float(wall(np.array([self.ambient]))[0])
        if wall == 0.0:
            return None
        between: float | Array = 1.0 / wall - 1.0
        if self.absorption and self.gap is not None:
            between = between + 0.75 * self.absorption * np.maximum(self.gap, 0.0)
        return between

    def terms(self, time: float) -> tuple[Term, ...]:
        """See `SurfaceLaw.terms`."""
        between = self._between()
        if between is None:
            return ()
        return (Term(RADIATION, self.ambient, between, scale=self._scale, curve=self.emissivity),)

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        # Odd function below absolute zero, which an iterate may reach: the flux stays monotone.
        cube = np.abs(temperature) ** 3
        excess = temperature * cube - self.ambient**4
        gamma, rise = self._factor(temperature)
        return gamma * excess, gamma * 4.0 * cube + rise * excess

    def least_rise(self, temperatures: Array, time: float) -> float:
        """See `SurfaceLaw.least_rise`; without a gap, where a decreasing flux decreases most."""
        if not callable(self.emissivity):
            return 0.0
        return float(replace(self, gap=None).flux(temperatures, time)[1].min())

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.ambient, self.ambient


@dataclass(frozen=True)
class Sprayed(SurfaceLaw):
    """Convection to a spray with variable water flow.

    Attributes:
        correlation: Gives the coefficient.
        water: Water flow, kg/(m2 s), over the time since the meniscus, s.
        most: Largest flow, kg/(m2 s).
        ambient: Temperature of the water, K.
        machine_factor: Divides the coefficient.
    """

    correlation: Correlation
    water: Callable[[float], float]
    most: float
    ambient: float
    machine_factor: float = 1.0

    def _at(self, water: float) -> Convection:
        """Convection for a water flow."""
        return Convection(
            lambda t: self.correlation.coefficient(water, self.ambient, self.machine_factor, t),
            self.ambient,
        )

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        return self._at(self.water(time)).flux(temperature, time)

    def least_rise(self, temperatures: Array, time: float) -> float:
        """See `SurfaceLaw.least_rise`; of all flows up to the largest: h may fall with water."""
        flows = (float(one) for one in flows_up_to(self.most, self.correlation.water[0]))
        return min(float(self._at(one).flux(temperatures, time)[1].min()) for one in flows)

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.ambient, self.ambient


@dataclass(frozen=True)
class PrescribedFlux(SurfaceLaw):
    """A given flux q(t), W/m2; a number or a function of the time since the meniscus."""

    value: float | Callable[[float], float]

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        q = self.value(time) if callable(self.value) else self.value
        return np.full_like(temperature, q), np.zeros_like(temperature)

    def least_rise(self, temperatures: Array, time: float) -> float:
        """See `SurfaceLaw.least_rise`."""
        return 0.0

    def ambient_range(self, time: float) -> tuple[float, float]:
        """Only bounded by absolute zero: a flux sets no temperature."""
        return 0.0, np.inf


@dataclass(frozen=True)
class PrescribedTemperature:
    """A prescribed surface temperature, K (essential condition); it has no flux of its own."""

    value: float
