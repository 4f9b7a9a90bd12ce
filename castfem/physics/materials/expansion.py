"""Thermal contraction of the solid shell: linear strain since the solidus (thesis II.2).

Every law gives e(T) = L(T)/L(T_sol) - 1 of the solid; `Steel` makes it 0 in the mushy zone and the
liquid (thesis V.1.4.3, V.1.6).  The mean coefficient of thermal linear expansion follows from it as
e(T)/(T - T_sol).

The thesis' (19) has the ratio of densities inverted, and lacks the division by T - T_sol. From L^3
~ 1/rho: e(T) = (rho(T_sol)/rho(T))^(1/3) - 1 and alpha_m = e(T)/(T - T_sol).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.physics.materials import knots
from castfem.physics.materials.iron_carbon import Diagram, Phases, Side
from castfem.physics.materials.properties import ByFormula, Property

IRON_MASS, CARBON_MASS = 55.845, 12.011  # g/mol
AVOGADRO = 6.02214076e23
DELTA_CELL_ATOMS, GAMMA_CELL_ATOMS = 2, 4  # iron atoms in a bcc and an fcc cell
ANGSTROM3_PER_CM3 = 1e24


class Expansion(Protocol):
    """Strain of the solid since a reference temperature."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures where the strain has a kink or a jump, K."""

    @property
    def curved(self) -> bool:
        """Whether the strain is not linear in T between its kinks."""

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """L(T)/L(reference) - 1; at a jump at the reference its colder side counts."""


@dataclass(frozen=True, slots=True)
class ConstantExpansion:
    """Constant mean coefficient, 1/K: e = alpha (T - T_ref)."""

    coefficient: float
    kinks: tuple[float, ...] = ()
    curved: bool = False

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """Linear strain since `reference` (K)."""
        return self.coefficient * (np.asarray(temperature, float) - reference)


@dataclass(frozen=True, slots=True)
class DifferentialExpansion:
    """Table of the differential coefficient alpha = dL/(L dT) (14).

    ln L(T)/L(T_ref) is its integral from the reference, so that e = exp(integral) - 1. The integral
    itself is the logarithmic strain, which differs by 1.4 % at 20 degC for a steel.
    """

    coefficient: Table
    curved: bool = True

    @property
    def kinks(self) -> tuple[float, ...]:
        """The rows of the table."""
        return self.coefficient.kinks

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """Linear strain since `reference` (K)."""
        return np.expm1(self._integral(temperature) - self._integral(reference))

    def _integral(self, temperature: npt.ArrayLike) -> Array:
        """Integral of the coefficient from the first row, exact for the linear pieces."""
        t = np.asarray(temperature, float)
        rows, alpha = np.array(self.coefficient.arguments), np.array(self.coefficient.values)
        areas = 0.5 * (alpha[1:] + alpha[:-1]) * np.diff(rows)
        sums = np.concatenate([[0.0], np.cumsum(areas)])
        i = np.clip(np.searchsorted(rows, t, side="right") - 1, 0, len(rows) - 1)
        start, first = np.where(t < rows[0], rows[0], rows[i]), alpha[i]
        return np.asarray(sums[i] + 0.5 * (first + self.coefficient(t)) * (t - start))


@dataclass(frozen=True, slots=True)
class MeanExpansion:
    """Table of the mean coefficient from its own reference temperature (often 20 degC)."""

    coefficient: Table  #: mean coefficient, 1/K
    origin: float  #: that reference temperature, K
    curved: bool = True

    @property
    def kinks(self) -> tuple[float, ...]:
        """The rows of the table."""
        return self.coefficient.kinks

    def _length(self, temperature: npt.ArrayLike) -> Array:
        t = np.asarray(temperature, float)
        return 1.0 + self.coefficient(t) * (t - self.origin)

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """Linear strain since `reference` (K)."""
        return self._length(temperature) / self._length(reference) - 1.0


@dataclass(frozen=True, slots=True)
class DensityExpansion:
    """Strain from the density of the steel, by the corrected (19)."""

    density: Property
    curved: bool = True

    @property
    def kinks(self) -> tuple[float, ...]:
        """Kinks of the density."""
        return self.density.kinks

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """Linear strain since `reference` (K)."""
        ratio = self.density(reference, "below") / self.density(temperature)
        return np.cbrt(ratio) - 1.0


@dataclass(frozen=True, slots=True)
class ChandraExpansion:
    """Chandra's procedure (20)-(21): specific volumes of pure delta and gamma iron, with carbon.

    Wray's specific volume of a pure phase gives the volume of its cell, the carbon in the phase
    widens the cell edge, and the specific volumes of the phases are averaged by mass fraction.
    """

    diagram: Diagram  #: iron-carbon diagram of the steel
    curved: bool = True

    @property
    def kinks(self) -> tuple[float, ...]:
        """Kinks of the phase fractions."""
        return self.diagram.kinks

    def specific_volume(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Specific volume of the solid phases together, m3/kg (without liquid)."""
        t = np.asarray(temperature, float)
        return self.volume_of(t, self.diagram.phases(t, side))

    def volume_of(self, temperature: Array, phases: Phases) -> Array:
        """Specific volume of given solid phases at temperatures in K, m3/kg."""
        solid = np.maximum(1.0 - phases.liquid, 1e-300)
        delta, gamma = _cell_volumes(temperature - ZERO_CELSIUS, phases)
        return np.asarray(1e-3 * (phases.delta * delta + phases.gamma * gamma) / solid)

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        """Linear strain since `reference` (K)."""
        ratio = self.specific_volume(temperature) / self.specific_volume(reference, "below")
        return np.cbrt(ratio) - 1.0


def without_transformation(
    law: Expansion, temperature: npt.ArrayLike, reference: float
) -> Array | None:
    """Strain of a steel whose phases only cool, without transformation.

    With v the specific volume at the temperature T and the phases p (fractions, carbon of each), 3
    d(ln L) = (1/v) (dv/dT at constant p) dT + (1/v) (change of v with p at constant T). This is the
    first term, integrated from the reference; the rest of `Expansion.strain` is the contraction of
    delta ferrite as it transforms to austenite.

    Args:
        law: Law of the contraction.
        temperature: Temperature, K, any shape.
        reference: Temperature at which the strain is 0, K.

    Returns:
        Strain with the shape of `temperature`; None for a law that does not depend on the phases.
    """
    by_phase = _volume_by_phase(law)
    if by_phase is None:
        return None
    diagram, volume = by_phase
    t = np.asarray(temperature, float)
    coldest, hottest = float(t.min(initial=reference)), float(t.max(initial=reference))
    if coldest == hottest:
        return np.zeros_like(t)
    breaks = knots.merged(law.kinks, diagram.reactions, coldest, hottest)
    grid = np.union1d(knots.grid(breaks, coldest, hottest, True), t)
    cold, hot = grid[:-1], grid[1:]
    # On each piece the average of the expansions with the phases at its start and its end.
    gain = np.zeros_like(cold)
    for phases in (diagram.phases(cold, "above"), diagram.phases(hot, "below")):
        gain += np.log(volume(hot, phases) / volume(cold, phases)) / 6.0
    length = np.concatenate([[0.0], np.cumsum(gain)])
    return np.expm1(np.interp(t, grid, length) - np.interp(reference, grid, length))


def _volume_by_phase(
    law: Expansion,
) -> tuple[Diagram, Callable[[Array, Phases], Array]] | None:
    """Diagram of a law, and its specific volume for given phases, m3/kg (or proportional)."""
    if isinstance(law, ChandraExpansion):
        return law.diagram, law.volume_of
    density = law.density if isinstance(law, DensityExpansion) else None
    if not isinstance(density, ByFormula) or density.diagram is None:
        return None
    if not density.formula.by_phase:
        return None

    def volume(temperature: Array, phases: Phases) -> Array:
        evaluate = density.formula.evaluate
        return np.reciprocal(evaluate(temperature, phases, **density.parameters))

    return density.diagram, volume


def _cell_volumes(celsius: Array, phases: Phases) -> tuple[Array, Array]:
    """Specific volumes of delta and gamma with their carbon (20)-(21), cm3/g.

    Carbon is interstitial: a gram of steel has 1 - W/100 grams of iron, whose cells it widens.
    """
    w_delta, w_gamma = (np.nan_to_num(c) for c in (phases.carbon_delta, phases.carbon_gamma))
    delta = 0.1234 + 9.38e-6 * (celsius - 20.0)
    gamma = 0.1225 + 9.45e-6 * (celsius - 20.0)
    edge = 8.4e-3 * atomic_percent(w_delta)
    delta = delta * (1.0 + edge / _edge(delta, DELTA_CELL_ATOMS)) ** 3 * (1.0 - w_delta / 100.0)
    edge = gamma_edge_per_carbon(celsius) * w_gamma
    gamma = gamma * (1.0 + edge / _edge(gamma, GAMMA_CELL_ATOMS)) ** 3 * (1.0 - w_gamma / 100.0)
    return delta, gamma


def _edge(volume: Array, atoms: int) -> Array:
    """Edge of the cubic cell of pure iron, Angstrom, from a specific volume in cm3/g."""
    return np.cbrt(volume * ANGSTROM3_PER_CM3 * atoms * IRON_MASS / AVOGADRO)


def gamma_edge_per_carbon(celsius: npt.ArrayLike) -> Array:
    """Widening of the austenite cell by carbon (21), Angstrom per wt%, from 20 to 1500 degC.

    The coefficients are as printed in the thesis. They look odd but are plausible: at 20 degC they
    give 0.0317 against 0.0330 of the usual a = 3.5780 + 0.0330 W; Harste's density formula has
    0.0286 throughout, which they give at 680 degC; they fall with temperature, like the partial
    volume of carbon according to Ridley and Stuart; and 0.42 %C austenite contracts by the 22e-6
    1/K that the thesis reads off its Figure 28.
    """
    t = np.asarray(celsius, float)
    return 0.0317 - 11.65e-7 * t - 0.05e-7 * t**2


def atomic_percent(weight_percent: npt.ArrayLike) -> Array:
    """Atomic percent of carbon in iron from its weight percent."""
    w = np.asarray(weight_percent, float)
    moles = w / CARBON_MASS
    return 100.0 * moles / (moles + (100.0 - w) / IRON_MASS)
