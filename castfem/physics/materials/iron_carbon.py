"""Iron-carbon equilibrium by the lever rule (thesis II.1.4, II.1.5), with shifts by alloying.

There are two diagrams. `assessed` has curves fitted to tie lines of the assessed database
[PovodenKaradeniz2016]: each line of the diagram is a cubic between two points. Pure iron melts at
1537.8 degC and transforms from delta to gamma at 1394.4, the peritectic is L(0.528) + delta(0.093)
-> gamma(0.172) at 1494.6. docs/materials.md gives its accuracy.

`pascon` is that of the thesis, with straight lines between these points (degC, wt% C):

    pure iron melts at 1538; delta turns to gamma at 1394
    peritectic  L(0.51) + delta(0.10) -> gamma(0.18) at 1495
    eutectic    L(4.30) -> gamma(2.11) + cementite at 1148

The thesis prints 1493 twice in its tables where 1495 is meant, and 0.723 for the liquid of the
0.42 %C steel below the peritectic, where its own balance (0.42 - 0.18)/(0.51 - 0.18) gives 0.727.

Below the range where austenite is stable (A3, Acm) the steel is still reported as austenite:
ferrite, pearlite and cementite are not modelled, since the diagram is for solidification.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array

Side = Literal["above", "below"]
DiagramName = Literal["assessed", "pascon", "segregated"]
# Source and status of each diagram.
SOURCES: Mapping[DiagramName, tuple[str, str]] = {
    "assessed": ("Fe-C diagram fitted to Povoden-Karadeniz (2016), shifted by the alloying", "C"),
    "segregated": (
        "microsegregation of Won and Thomas (2001), that of P from memory; solid in equilibrium",
        "M",
    ),
    "pascon": ("Fe-C diagram of Pascon (2003), II.1.5, shifted by the alloying", "F"),
}

MAX_CARBON = 2.11  # wt%, the solubility limit of austenite
# wt% C below which the steel is pure iron, since its freezing range would be lost in rounding
TRACE = 1e-6


@dataclass(frozen=True, slots=True)
class Line:
    """Carbon of one phase in equilibrium with another as a cubic in the temperature.

    With s from 0 at the first to 1 at the last point it is c0 + (c1 - c0) s + s (1 - s) (b0 + b1
    s), also beyond the points.
    """

    first: tuple[float, float]  #: temperature, K, and carbon, wt%, at one point
    last: tuple[float, float]  #: the same at the other
    bend: tuple[float, float] = (0.0, 0.0)  #: b0 and b1, wt%

    def carbon(self, temperature: npt.ArrayLike) -> Array:
        """Carbon at temperatures in K (any shape), wt%."""
        (t0, c0), (t1, c1) = self.first, self.last
        s = (t0 - np.asarray(temperature, float)) / (t0 - t1)
        return np.asarray(c0 + (c1 - c0) * s + s * (1.0 - s) * (self.bend[0] + self.bend[1] * s))

    def temperature(self, carbon: float) -> float:
        """Temperature of a line at a carbon content, wt%, in K.

        Alloying moves the peritectic along the lines: it may be beyond their points.
        """
        (t0, c0), (t1, c1) = self.first, self.last
        if carbon == c0 or not any(self.bend):
            return t0 + (carbon - c0) / (c1 - c0) * (t1 - t0)
        beyond = 0.2 * (t1 - t0)
        return root(lambda t: float(self.carbon(t)) > carbon, t0 - beyond, t1 + beyond)

    def lowered(self, drop: float) -> Line:
        """The line of a steel whose alloying lowers it by `drop`, K."""
        first, last = ((t - drop, carbon) for t, carbon in (self.first, self.last))
        return replace(self, first=first, last=last)


def root(beyond: Callable[[float], bool], start: float, end: float) -> float:
    """Point at which a condition begins to hold that does not hold at the start, by bisection."""
    while start != (middle := 0.5 * (start + end)) != end:
        start, end = (start, middle) if beyond(middle) else (middle, end)
    return middle


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of the iron-carbon diagram at freezing, and the transformation of pure iron."""

    liquid_delta: Line  #: liquid in equilibrium with delta ferrite, from the melting point
    delta: Line  #: delta ferrite in equilibrium with liquid, from the melting point
    liquid_gamma: Line  #: liquid in equilibrium with austenite, from the peritectic
    gamma: Line  #: austenite in equilibrium with liquid, from the peritectic
    transformation: float  #: delta -> gamma of pure iron, K
    #: bends of the lines from there to the peritectic, for delta ferrite and austenite, wt%
    bends: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))


PASCON = Lines(
    Line((1811.15, 0.0), (1768.15, 0.51)),
    Line((1811.15, 0.0), (1768.15, 0.10)),
    Line((1768.15, 0.51), (1421.15, 4.30)),
    Line((1768.15, 0.18), (1421.15, 2.11)),
    transformation=1667.15,
)
ASSESSED = Lines(
    Line((1810.95, 0.0), (1767.75, 0.5277), (0.0433, -0.0064)),
    Line((1810.95, 0.0), (1767.75, 0.0929), (0.0074, 0.0006)),
    Line((1767.75, 0.5277), (1408.9, 4.495), (1.3555, -0.5261)),
    Line((1767.75, 0.1717), (1408.9, 2.11), (0.0306, 0.2564)),
    transformation=1667.55,
    bends=((-0.0393, -0.0144), (-0.0407, -0.0133)),
)


@dataclass(frozen=True, slots=True)
class Phases:
    """Mass fractions of the phases and the carbon in each; all arrays have the same shape."""

    liquid: Array  #: fraction of liquid
    delta: Array  #: fraction of delta ferrite
    gamma: Array  #: fraction of austenite
    carbon_liquid: Array  #: carbon in the liquid, wt%; NaN where absent
    carbon_delta: Array  #: carbon in the delta ferrite, wt%; NaN where absent
    carbon_gamma: Array  #: carbon in the austenite, wt%; NaN where absent


class Diagram(Protocol):
    """Interface for properties by phase: the diagram, or a table of phases, of a steel."""

    @property
    def carbon(self) -> float:
        """Carbon content, wt%."""

    @property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""

    @property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""

    @property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without delta."""

    @property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there never was any."""

    @property
    def reactions(self) -> tuple[float, ...]:
        """Temperatures at which the fractions jump, K."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which a fraction has a kink or a jump, K, increasing."""

    def phases(self, temperature: npt.ArrayLike, side: Side = "above") -> Phases:
        """Fractions of the phases and their carbon."""


@dataclass(frozen=True)
class IronCarbon:
    """Equilibrium of a steel on cooling from the melt, by the lever rule (5)-(11).

    Alloying shifts all lines equally; `alloyed_iron` treats manganese and silicon with the assessed
    diagram.

    Raises:
        ValueError: The carbon content is out of range, or the points are out of order.
    """

    carbon: float  #: carbon content, wt%, from 0 to 2.11; below 1e-6 it counts as none
    lines: Lines = PASCON  #: lines of the diagram; by default the straight ones of the thesis
    peritectic: float = PASCON.liquid_delta.last[0]  #: temperature of the peritectic reaction, K

    def __post_init__(self) -> None:
        if not 0.0 <= self.carbon <= MAX_CARBON:
            raise ValueError(f"carbon must lie in 0 ... {MAX_CARBON} wt%, not {self.carbon}")
        if self.carbon < TRACE:
            object.__setattr__(self, "carbon", 0.0)
        levels = (self.eutectic, self.transformation, self.peritectic, self.melting)
        if not all(a < b for a, b in itertools.pairwise((0.0, *self.at_peritectic))) or not all(
            a < b for a, b in itertools.pairwise(levels)
        ):
            raise ValueError(
                "the alloying elements put the iron-carbon diagram out of order: eutectic, "
                f"delta-gamma, peritectic and melting at {', '.join(f'{t:.1f} K' for t in levels)}"
            )

    @property
    def melting(self) -> float:
        """Temperature at which steel without carbon begins to freeze, K."""
        return self.lines.liquid_delta.first[0]

    @property
    def transformation(self) -> float:
        """Temperature of delta -> gamma without carbon, K."""
        return self.lines.transformation

    @property
    def eutectic(self) -> float:
        """Temperature of the largest carbon content of austenite, K."""
        return self.lines.gamma.last[0]

    @cached_property  # used in each step
    def at_peritectic(self) -> tuple[float, float, float]:
        """Carbon of delta ferrite, austenite and liquid at the peritectic, wt%."""
        lines = (self.lines.delta, self.lines.gamma, self.lines.liquid_delta)
        delta, gamma, liquid = (float(line.carbon(self.peritectic)) for line in lines)
        return delta, gamma, liquid

    @cached_property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""
        lines = self.lines
        before = self.carbon < self.at_peritectic[2]
        return (lines.liquid_delta if before else lines.liquid_gamma).temperature(self.carbon)

    @cached_property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""
        delta, gamma, _ = self.at_peritectic
        if delta <= self.carbon <= gamma:
            return self.peritectic
        line = self.lines.delta if self.carbon < delta else self.lines.gamma
        return line.temperature(self.carbon)

    @cached_property
    def _solid_lines(self) -> tuple[Line, Line]:
        """Delta ferrite and austenite in equilibrium, from pure iron to the peritectic."""
        delta, gamma, _ = self.at_peritectic
        bends = self.lines.bends
        start, end = (self.transformation, 0.0), self.peritectic
        return Line(start, (end, delta), bends[0]), Line(start, (end, gamma), bends[1])

    @property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without delta."""
        return self._above_transformation(0)

    @property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there never was any."""
        return self._above_transformation(1)

    def _above_transformation(self, solid: int) -> float | None:
        """Temperature at which a solid (0: delta, 1: gamma) has the carbon of the steel, K."""
        if self.carbon >= self.at_peritectic[2]:
            return None
        if self.carbon >= self.at_peritectic[solid]:
            return self.peritectic
        return self._solid_lines[solid].temperature(self.carbon)

    @property
    def reactions(self) -> tuple[float, ...]:
        """Temperatures at which the fractions jump, K: peritectic, or the points of pure iron."""
        if self.carbon == 0.0:
            melts_at_once = self.solidus == self.liquidus
            return (self.transformation, *((self.melting,) if melts_at_once else ()))
        if self.at_peritectic[0] < self.carbon < self.at_peritectic[2]:
            return (self.peritectic,)
        return ()

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which a fraction has a kink or a jump, K, increasing."""
        limits = (self.solidus, self.liquidus, self.gamma_start, self.gamma_end, *self.reactions)
        return tuple(sorted({t for t in limits if t is not None}))

    def phases(self, temperature: npt.ArrayLike, side: Side = "above") -> Phases:
        """Fractions of the phases and their carbon at equilibrium.

        Args:
            temperature: K, any shape.
            side: State at exactly the temperature of an isothermal reaction (see `reactions`):
                "above" before it on cooling (L + delta at the peritectic), "below" after it.
                Everywhere else both are equal.

        Returns:
            Arrays of the shape of `temperature`; the fractions are in [0, 1] and sum to 1.
        """
        t = np.asarray(temperature, float)
        beyond = np.greater_equal if side == "above" else np.greater
        hot = beyond(t, self.peritectic)
        liquid_hot, carbon_liquid_hot, carbon_delta_hot = self._melting_delta(t, beyond)
        liquid_cold, carbon_liquid_cold, carbon_gamma_cold = self._melting_gamma(t)
        delta_cold, carbon_delta_cold, carbon_gamma_solid = self.solid(t, self.carbon, side)
        liquid = np.where(hot, liquid_hot, liquid_cold)
        delta = np.where(hot, 1.0 - liquid_hot, delta_cold)
        gamma = 1.0 - liquid - delta
        mushy = liquid_cold > 0.0
        return Phases(
            liquid,
            delta,
            gamma,
            self._carbon(liquid, np.where(hot, carbon_liquid_hot, carbon_liquid_cold)),
            self._carbon(delta, np.where(hot, carbon_delta_hot, carbon_delta_cold)),
            self._carbon(gamma, np.where(mushy, carbon_gamma_cold, carbon_gamma_solid)),
        )

    def _carbon(self, fraction: Array, equilibrium: Array) -> Array:
        """Carbon of one phase: that of the steel if it is the only one, NaN if it is absent."""
        return np.where(fraction >= 1.0, self.carbon, np.where(fraction > 0.0, equilibrium, np.nan))

    def _melting_delta(self, t: Array, beyond: np.ufunc) -> tuple[Array, Array, Array]:
        """Liquid fraction in L + delta with the carbon in both, at or above the peritectic."""
        in_liquid = np.maximum(self.lines.liquid_delta.carbon(t), 0.0)
        in_delta = self.lines.delta.carbon(t)
        molten = np.asarray(beyond(t, self.melting) | (self.carbon > 0.0), float)
        liquid = _lever(self.carbon, in_delta, in_liquid, molten)
        return liquid, in_liquid, np.maximum(in_delta, 0.0)

    def _melting_gamma(self, t: Array) -> tuple[Array, Array, Array]:
        """Liquid fraction in L + gamma with the carbon in both, below the peritectic."""
        in_liquid, in_gamma = (
            line.carbon(np.maximum(t, line.last[0]))
            for line in (self.lines.liquid_gamma, self.lines.gamma)
        )
        return _lever(self.carbon, in_gamma, in_liquid, np.zeros_like(t)), in_liquid, in_gamma

    def solid(
        self, t: Array, carbon: Array | float, side: Side = "above"
    ) -> tuple[Array, Array, Array]:
        """Fraction of delta ferrite in solid below the peritectic, and the carbon of both phases.

        Args:
            t: Temperatures, K (any shape).
            carbon: Carbon of the solid, wt% (same shape).
            side: See `phases`.
        """
        return solid_phases(self._solid_lines, t, carbon, side)


def solid_phases(
    lines: tuple[Line, Line], t: Array, carbon: Array | float, side: Side
) -> tuple[Array, Array, Array]:
    """Fraction of delta ferrite in solid between both lines, and the carbon of both phases.

    Args:
        lines: Delta ferrite and austenite in equilibrium, both from pure iron.
        t: Temperatures, K (any shape).
        carbon: Carbon of the solid, wt% (same shape).
        side: See `IronCarbon.phases`.
    """
    beyond = np.greater_equal if side == "above" else np.greater
    coldest, hottest = lines[0].first[0], max(line.last[0] for line in lines)
    within = np.clip(t, coldest, hottest)
    in_delta, in_gamma = (line.carbon(within) for line in lines)
    ferritic = np.asarray(beyond(t, coldest) & np.equal(carbon, 0.0), float)
    return 1.0 - _lever(carbon, in_delta, in_gamma, 1.0 - ferritic), in_delta, in_gamma


def _lever(carbon: Array | float, poor: Array, rich: Array, limit: Array) -> Array:
    """Fraction of the carbon-rich phase (10), in [0, 1]; `limit` where both are pure iron."""
    span = rich - poor
    two_phases = span > 0.0
    fraction = (carbon - poor) / np.where(two_phases, span, 1.0)
    fraction = np.where(two_phases, fraction, limit)
    return np.asarray(np.clip(fraction, 0.0, 1.0))
