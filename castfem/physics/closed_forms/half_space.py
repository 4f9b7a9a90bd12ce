"""Weiner and Boley's solidifying half-space: temperature and stress."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, fsolve
from scipy.special import erf

from castfem.base.types import Array

# Data of the verification problem of Li and Thomas (2004) and Koric and Thomas (2006), quoted from
# memory (status M); the steel "weiner_boley" and the law of that name have the same data.
SURFACE, MELTING = 1000.0, 1494.4  # degC
YOUNG, POISSON, ALPHA, YIELD = 40e9, 0.3, 2e-5, 20e6  # Pa, -, 1/K, Pa at SURFACE
CONDUCTIVITY, HEAT, DENSITY, LATENT = 33.0, 661.0, 7500.0, 272e3  # SI
DIFFUSIVITY = CONDUCTIVITY / (DENSITY * HEAT)


class HalfSpace:
    """Weiner and Boley's solidifying half-space: elastic, perfectly plastic, free to contract.

    The surface drops to `SURFACE` at once and stays there; the liquid is at the melting point. The
    yield stress falls linearly to zero at the melting point. The solutions at all times are one
    function of zeta = x / (2 sqrt(kappa t)), with three zones: compressive flow at the surface,
    elastic, tensile flow up to the front. Re-derived from the conditions of Weiner and Boley (J.
    Mech. Phys. Solids 11 (1963) 145): smooth transition to tensile flow, compressive flow at the
    inner end of the elastic zone, no resultant.

    Args:
        alpha: Thermal contraction, 1/K.
        yield_stress: Yield stress at `SURFACE`, Pa.
        conductivity: Conductivity, W/(m K).

    Attributes:
        diffusivity: Thermal diffusivity of the steel, m2/s.
        front: zeta of the front. compressed: zeta at the end of compressive flow.
        stretched: zeta at the start of tensile flow. rate: Strain rate times 2 t.
    """

    def __init__(
        self, alpha: float = ALPHA, yield_stress: float = YIELD, conductivity: float = CONDUCTIVITY
    ) -> None:
        self._alpha, self._yield, self._conductivity = alpha, yield_stress, conductivity
        self.diffusivity = conductivity / (DENSITY * HEAT)
        stefan = HEAT * (MELTING - SURFACE) / LATENT
        self.front = brentq(
            lambda z: z * np.exp(z * z) * erf(z) - stefan / np.sqrt(np.pi), 0.1, 2.0, xtol=1e-15
        )
        self.compressed, self.stretched = fsolve(self._conditions, [0.147, 0.264], xtol=1e-13)
        self.rate = self._smooth_exit(self.stretched)

    def temperature(self, zeta: npt.ArrayLike) -> Array:
        """Temperature, degC."""
        z = np.minimum(zeta, self.front)
        return np.asarray(SURFACE + (MELTING - SURFACE) * erf(z) / erf(self.front))

    def _slope(self, zeta: float) -> float:
        rise = (MELTING - SURFACE) * 2 / np.sqrt(np.pi) / erf(self.front)
        return float(rise * np.exp(-(zeta**2)))

    def _limit(self, zeta: npt.ArrayLike) -> Array:
        share = (MELTING - self.temperature(zeta)) / (MELTING - SURFACE)
        return np.asarray(self._yield * share, dtype=np.float64)

    def _smooth_exit(self, zeta: float) -> float:
        stiff = YOUNG / (1 - POISSON)
        return (
            -zeta * self._slope(zeta) * (self._alpha - self._yield / (stiff * (MELTING - SURFACE)))
        )

    def _elastic(self, zeta: npt.ArrayLike, end: float) -> Array:
        """Stress in the elastic zone if tensile flow begins at `end`."""
        z = np.asarray(zeta, float)
        drop = self.temperature(z) - self.temperature(end)
        strain = self._smooth_exit(end) * np.log(z / end) + self._alpha * drop
        return np.asarray(self._limit(end) - YOUNG / (1 - POISSON) * strain)

    def _conditions(self, zones: Array) -> list[float]:
        """Residuals: yield at the inner end of the elastic zone, and no resultant."""
        first, second = zones
        points, weights = np.polynomial.legendre.leggauss(60)

        def integral(low: float, high: float, stress: Any) -> float:
            z = low + 0.5 * (high - low) * (1 + points)
            return float(0.5 * (high - low) * weights @ stress(z))

        total = -integral(0.0, first, self._limit)
        total += integral(first, second, lambda z: self._elastic(z, second))
        total += integral(second, self.front, self._limit)
        return [
            float(self._elastic(first, second) + self._limit(first)) / self._yield,
            total / self._yield,
        ]

    def stress(self, x: Array, time: float) -> Array:
        """Sigma_yy = sigma_zz, Pa, at depths x (n,), m; 0 in the liquid."""
        z = np.maximum(x, 1e-12) / (2 * np.sqrt(self.diffusivity * time))
        zones = [z < self.compressed, z < self.stretched, z < self.front]
        values = [-self._limit(z), self._elastic(z, self.stretched), self._limit(z)]
        return np.asarray(np.select(zones, values, 0.0))

    def flux(self, time: float) -> float:
        """Heat flux through the surface, W/m2."""
        return self._conductivity * self._slope(0.0) / float(2 * np.sqrt(self.diffusivity * time))

    def shell(self, time: float) -> float:
        """Thickness of the shell, m."""
        return float(2 * self.front * np.sqrt(self.diffusivity * time))
