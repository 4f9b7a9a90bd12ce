"""Iron-carbon equilibrium by the lever rule (thesis II.1.4, II.1.5) and what alloying does to it.

All lines of the diagram are straight between these points (degC, wt% C):

    pure iron melts at 1538; delta turns to gamma at 1394
    peritectic  L(0.51) + delta(0.10) -> gamma(0.18) at 1495
    eutectic    L(4.30) -> gamma(2.11) + cementite at 1148

The thesis prints 1493 twice in its tables where 1495 is meant, and 0.723 for the liquid of the
0.42 %C steel below the peritectic, where its own balance (0.42 - 0.18)/(0.51 - 0.18) gives 0.727.

Below the region where austenite is stable (A3, Acm) the steel is still reported as austenite:
ferrite, pearlite and cementite are not modelled, since the diagram serves solidification.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array

Side = Literal["above", "below"]

# Carbon contents at the peritectic and the eutectic, wt%.
PERITECTIC_DELTA, PERITECTIC_GAMMA, PERITECTIC_LIQUID = 0.10, 0.18, 0.51
EUTECTIC_GAMMA, EUTECTIC_LIQUID = 2.11, 4.30
MAX_CARBON = EUTECTIC_GAMMA
TRACE = 1e-6  # wt% C: less is pure iron, its freezing range would be lost in rounding
MAX_ALLOYING = 5.0  # wt% of one element: beyond it linear corrections mean nothing

# Drop of the liquidus and the solidus, K per wt%; used by the public PyCasting model [F].
LIQUIDUS_DROP = {
    "C": 78.0, "Si": 7.5, "Mn": 4.9, "P": 34.4, "S": 38.0,
    "Cr": 1.3, "Ni": 3.1, "Cu": 4.7, "Al": 3.6,
}  # fmt: skip
SOLIDUS_DROP = {
    "C": 200.0, "Si": 16.0, "Mn": 6.0, "P": 93.0, "S": 1100.0, "Cr": 1.7, "Ni": 3.9,
}  # fmt: skip
REGRESSION_START = 1809.15  # K (1536 degC), pure iron in both regressions
# Rise of the delta -> gamma temperature, K per wt%; meant to be Won and Thomas (2001) [M].
TRANSFORMATION_RISE = {"Si": -60.0, "Mn": 12.0, "P": -140.0, "S": -160.0}
ELEMENTS = tuple(LIQUIDUS_DROP)


@dataclass(frozen=True, slots=True)
class Phases:
    """Mass fractions of the phases and the carbon in each; all arrays of one shape."""

    liquid: Array  #: fraction of liquid
    delta: Array  #: fraction of delta ferrite
    gamma: Array  #: fraction of austenite
    carbon_liquid: Array  #: carbon in the liquid, wt%; NaN where there is none of it
    carbon_delta: Array  #: carbon in the delta ferrite, wt%; NaN where there is none of it
    carbon_gamma: Array  #: carbon in the austenite, wt%; NaN where there is none of it


@dataclass(frozen=True, slots=True)
class IronCarbon:
    """Equilibrium of a steel on cooling from the melt, by the lever rule (5)-(11).

    Args:
        carbon: Carbon content, wt%, from 0 to 2.11; a trace below 1e-6 counts as none.
        melting: Melting point without carbon, K.
        peritectic: Temperature of the peritectic reaction, K.
        transformation: Temperature of delta -> gamma without carbon, K.
        eutectic: Temperature of the eutectic, K.

    Raises:
        ValueError: If the carbon content is out of range or the temperatures are out of order.
    """

    carbon: float
    melting: float = 1811.15
    peritectic: float = 1768.15
    transformation: float = 1667.15
    eutectic: float = 1421.15

    def __post_init__(self) -> None:
        if not 0.0 <= self.carbon <= MAX_CARBON:
            raise ValueError(f"carbon must lie in 0 ... {MAX_CARBON} wt%, not {self.carbon}")
        if self.carbon < TRACE:
            object.__setattr__(self, "carbon", 0.0)
        levels = (self.eutectic, self.transformation, self.peritectic, self.melting)
        if not all(a < b for a, b in itertools.pairwise(levels)):
            raise ValueError(
                "the alloying elements put the iron-carbon diagram out of order: eutectic, "
                f"delta-gamma, peritectic and melting at {', '.join(f'{t:.1f} K' for t in levels)}"
            )

    @property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""
        if self.carbon < PERITECTIC_LIQUID:
            share = self.carbon / PERITECTIC_LIQUID
            return self.melting + share * (self.peritectic - self.melting)
        return self._below_peritectic(PERITECTIC_LIQUID, EUTECTIC_LIQUID)

    @property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""
        if self.carbon < PERITECTIC_DELTA:
            share = self.carbon / PERITECTIC_DELTA
            return self.melting + share * (self.peritectic - self.melting)
        if self.carbon <= PERITECTIC_GAMMA:
            return self.peritectic
        return self._below_peritectic(PERITECTIC_GAMMA, EUTECTIC_GAMMA)

    def _below_peritectic(self, start: float, end: float) -> float:
        """Height of the line from `start` at the peritectic to `end` at the eutectic, K."""
        share = (self.carbon - start) / (end - start)
        return self.peritectic + share * (self.eutectic - self.peritectic)

    @property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without delta."""
        if self.carbon >= PERITECTIC_LIQUID:
            return None
        return self._above_transformation(PERITECTIC_DELTA)

    @property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there never was any."""
        if self.carbon >= PERITECTIC_LIQUID:
            return None
        return self._above_transformation(PERITECTIC_GAMMA)

    def _above_transformation(self, end: float) -> float:
        """Height of the line from pure iron to `end` at the peritectic, K."""
        if self.carbon >= end:
            return self.peritectic
        share = self.carbon / end
        return self.transformation + share * (self.peritectic - self.transformation)

    @property
    def reactions(self) -> tuple[float, ...]:
        """Temperatures at which the fractions jump, K: peritectic, or the points of pure iron."""
        if self.carbon == 0.0:
            return (self.transformation, self.melting)
        if PERITECTIC_DELTA < self.carbon < PERITECTIC_LIQUID:
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
            side: The state at exactly the temperature of an isothermal reaction (see `reactions`):
                "above" before it as the steel cools (L + delta at the peritectic), "below" after
                it.  Everywhere else both are the same.

        Returns:
            Arrays of the shape of `temperature`; the fractions lie in [0, 1] and sum to 1.
        """
        t = np.asarray(temperature, float)
        beyond = np.greater_equal if side == "above" else np.greater
        hot = beyond(t, self.peritectic)
        liquid_hot, carbon_liquid_hot, carbon_delta_hot = self._melting_delta(t, beyond)
        liquid_cold, carbon_liquid_cold, carbon_gamma_cold = self._melting_gamma(t)
        delta_cold, carbon_delta_cold, carbon_gamma_solid = self._transforming(t, beyond)
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
        """Carbon of one phase: that of the steel where it is alone, NaN where it is absent."""
        return np.where(fraction >= 1.0, self.carbon, np.where(fraction > 0.0, equilibrium, np.nan))

    def _melting_delta(self, t: Array, beyond: np.ufunc) -> tuple[Array, Array, Array]:
        """Liquid fraction in L + delta with the carbon in both, at or above the peritectic."""
        share = np.clip((self.melting - t) / (self.melting - self.peritectic), 0.0, 1.0)
        in_liquid, in_delta = share * PERITECTIC_LIQUID, share * PERITECTIC_DELTA
        molten = np.asarray(beyond(t, self.melting) | (self.carbon > 0.0), float)
        return _lever(self.carbon, in_delta, in_liquid, molten), in_liquid, in_delta

    def _melting_gamma(self, t: Array) -> tuple[Array, Array, Array]:
        """Liquid fraction in L + gamma with the carbon in both, below the peritectic."""
        share = np.clip((self.peritectic - t) / (self.peritectic - self.eutectic), 0.0, 1.0)
        in_liquid = PERITECTIC_LIQUID + share * (EUTECTIC_LIQUID - PERITECTIC_LIQUID)
        in_gamma = PERITECTIC_GAMMA + share * (EUTECTIC_GAMMA - PERITECTIC_GAMMA)
        return _lever(self.carbon, in_gamma, in_liquid, np.zeros_like(t)), in_liquid, in_gamma

    def _transforming(self, t: Array, beyond: np.ufunc) -> tuple[Array, Array, Array]:
        """Delta fraction in delta + gamma with the carbon in both, below the peritectic."""
        height = self.peritectic - self.transformation
        share = np.clip((t - self.transformation) / height, 0.0, 1.0)
        in_delta, in_gamma = share * PERITECTIC_DELTA, share * PERITECTIC_GAMMA
        ferritic = np.asarray(beyond(t, self.transformation) & (self.carbon == 0.0), float)
        return 1.0 - _lever(self.carbon, in_delta, in_gamma, 1.0 - ferritic), in_delta, in_gamma


def _lever(carbon: float, poor: Array, rich: Array, limit: Array) -> Array:
    """Fraction of the carbon-rich phase (10), in [0, 1]; `limit` where both are pure iron."""
    span = rich - poor
    two_phases = span > 0.0
    fraction = (carbon - poor) / np.where(two_phases, span, 1.0)
    fraction = np.where(two_phases, fraction, limit)
    return np.asarray(np.clip(fraction, 0.0, 1.0))


def check_composition(composition: Mapping[str, float]) -> list[str]:
    """Return what is wrong with a composition in wt%, one text per element ("Mn: ...")."""
    problems = []
    for element, content in composition.items():
        most = MAX_CARBON if element == "C" else MAX_ALLOYING
        if not math.isfinite(content) or not 0.0 <= content <= most:
            problems.append(f"{element}: {content:g} wt% is out of range; 0 ... {most:g} wt%")
    return problems


def alloyed(composition: Mapping[str, float]) -> IronCarbon:
    """Iron-carbon diagram shifted by the alloying elements.

    Our choice: melting point, peritectic and eutectic drop together, by the slopes of the liquidus
    regression without its carbon term, so that the lines still meet and the lever rule still
    conserves carbon; the delta-gamma point moves by Won and Thomas' slopes.  The carbon contents of
    the peritectic stay where they are.  Segregation of P and S, which lowers the true solidus
    further, is not in an equilibrium diagram: see `regression_solidus`.

    Args:
        composition: wt% by element symbol; elements left out count as 0.

    Raises:
        ValueError: If an element is out of range or the shifted diagram is out of order.
    """
    problems = check_composition(composition)
    if problems:
        raise ValueError("; ".join(problems))
    others = {e: w for e, w in composition.items() if e != "C"}
    drop = sum(LIQUIDUS_DROP[e] * w for e, w in others.items())
    rise = sum(TRANSFORMATION_RISE.get(e, 0.0) * w for e, w in others.items())
    pure = IronCarbon(0.0)
    return IronCarbon(
        composition.get("C", 0.0),
        melting=pure.melting - drop,
        peritectic=pure.peritectic - drop,
        transformation=pure.transformation + rise,
        eutectic=pure.eutectic - drop,
    )


def regression_liquidus(composition: Mapping[str, float]) -> float:
    """Liquidus in K from a linear regression over the composition in wt%; PyCasting's set [F]."""
    return REGRESSION_START - sum(LIQUIDUS_DROP.get(e, 0.0) * w for e, w in composition.items())


def regression_solidus(composition: Mapping[str, float]) -> float:
    """Solidus in K from a linear regression over the composition in wt%; PyCasting's set [F].

    Meant for C below about 0.17 wt%; unlike the equilibrium diagram it knows what segregated P and
    S do.  Cu and Al have no coefficient.
    """
    return REGRESSION_START - sum(SOLIDUS_DROP.get(e, 0.0) * w for e, w in composition.items())
