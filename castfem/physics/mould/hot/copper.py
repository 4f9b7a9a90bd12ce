"""Properties of mould copper: conductivity, expansion and stiffness over temperature."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.tables import Constant, Table, celsius
from castfem.base.types import Array

REFERENCE = 20.0 + ZERO_CELSIUS
"""Reference temperature of mean expansion coefficients, K."""
SOFTENS = 400.0 + ZERO_CELSIUS
"""Temperature above which mould copper loses its cold work within a campaign, K."""
MELTS = 1084.62 + ZERO_CELSIUS
"""Freezing point of copper in the International Temperature Scale of 1990, K."""
CONDUCTIVITY = celsius((20.0, 100.0, 200.0, 300.0), (394.0, 385.0, 381.0, 377.0))
"""[Calcutt2001], W/(m K)."""
EXPANSION = celsius((100.0, 200.0, 300.0), (16.8e-6, 17.3e-6, 17.7e-6))
"""Mean coefficient from 20 degC to T, [Calcutt2001], 1/K."""
STIFFNESS = celsius((20.0, 300.0), (117e9, 106e9))
"""At 20 degC [Smithells2004]; the decrease with temperature is quoted from memory, Pa."""
POISSON = 0.34
"""Quoted from memory; [Smithells2004] has 0.34 to 0.35."""


def mean_strain(coefficient: Constant | Table, temperature: Array | float) -> Array:
    """Return the expansion from `REFERENCE` to a temperature (K), by the mean coefficient there."""
    kelvin = np.asarray(temperature, float)
    return np.asarray(coefficient(kelvin) * (kelvin - REFERENCE))


@dataclass(frozen=True, slots=True)
class Copper:
    """The copper of a mould."""

    conductivity: Constant | Table = CONDUCTIVITY  #: k(T), W/(m K)
    #: mean coefficient from `REFERENCE` to T, or a constant, 1/K
    expansion: Constant | Table = EXPANSION
    youngs_modulus: Constant | Table = STIFFNESS  #: E(T), Pa
    poisson: Constant | Table = field(default_factory=lambda: Constant(POISSON))  #: nu(T)
    #: temperature at which its dimensions are those of the cold mould, K
    cold: float = 25.0 + ZERO_CELSIUS

    def thermal_strain(self, temperature: Array | float) -> Array:
        """Return the strain of free copper from the cold mould to a temperature (K)."""
        warm = mean_strain(self.expansion, temperature)
        return np.asarray(warm - mean_strain(self.expansion, self.cold))

    def conduction_integral(self, temperature: Array) -> Array:
        """Return theta(T) = int k dT from the first row of k (or 0 K), W/m."""
        knots, k, theta = self._knots()
        i = self._row(knots, temperature)
        down = temperature - knots[i]
        return np.asarray(theta[i] + down * (k[i] + 0.5 * self._slopes(knots, k)[i] * down))

    def temperature(self, theta: Array) -> Array:
        """Return T(theta), the inverse of `conduction_integral`, K."""
        knots, k, starts = self._knots()
        i = self._row(starts, theta)
        rest, slope = theta - starts[i], self._slopes(knots, k)[i]
        root = np.sqrt(np.maximum(k[i] ** 2 + 2.0 * slope * rest, 0.0))
        return np.asarray(knots[i] + 2.0 * rest / (k[i] + root))

    def _knots(self) -> tuple[Array, Array, Array]:
        """Return temperatures, k and theta at the rows, and far beyond them where k is constant."""
        kinks = list(self.conductivity.kinks) or [ZERO_CELSIUS]
        knots = np.array([kinks[0] - 1e4, *kinks, kinks[-1] + 1e4])
        k = np.asarray(self.conductivity(knots))
        steps = 0.5 * (k[1:] + k[:-1]) * np.diff(knots)
        theta = np.concatenate([[0.0], np.cumsum(steps)])
        return knots, k, theta - theta[1]

    @staticmethod
    def _row(starts: Array, values: Array) -> Array:
        return np.clip(np.searchsorted(starts, values, side="right") - 1, 0, len(starts) - 2)

    @staticmethod
    def _slopes(knots: Array, k: Array) -> Array:
        return np.diff(k) / np.diff(knots)
