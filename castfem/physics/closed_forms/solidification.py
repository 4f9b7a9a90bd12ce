"""Closed forms of one-dimensional solidification, solved to rounding error.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, fsolve
from scipy.special import erf, erfc

from castfem.base.types import Array


@dataclass(frozen=True)
class ThreeZones:
    """Similarity solution of an alloy whose solid fraction is linear in T (thesis (12)).

    Half-space x > 0, initially at `initial`, with the surface at `surface` from t = 0. Solid and
    liquid have the same k and c, the mushy zone k and c + L / (Tl - Ts). In each zone T is an error
    function of eta = x / (2 sqrt t); temperature and flux are continuous at both fronts.
    """

    conductivity: float
    density: float
    specific_heat: float
    latent_heat: float
    surface: float
    solidus: float
    liquidus: float
    initial: float

    @property
    def diffusivities(self) -> tuple[float, float]:
        """Diffusivities of solid (and liquid) and of the mushy zone, m2/s."""
        rho, c = self.density, self.specific_heat
        mushy_zone = c + self.latent_heat / (self.liquidus - self.solidus)
        return self.conductivity / (rho * c), self.conductivity / (rho * mushy_zone)

    def fronts(self) -> tuple[float, float]:
        """Similarity coordinates eta of solidus and liquidus, m/sqrt(s)."""
        a, am = self.diffusivities
        ra, rm = np.sqrt(a), np.sqrt(am)

        def mismatch(eta: Array) -> list[float]:
            s, l = eta * ra  # noqa: E741
            d_mushy = erf(l / rm) - erf(s / rm)
            solid = (self.solidus - self.surface) * np.exp(-((s / ra) ** 2)) / (ra * erf(s / ra))
            mushy_s = (self.liquidus - self.solidus) * np.exp(-((s / rm) ** 2)) / (rm * d_mushy)
            mushy_l = (self.liquidus - self.solidus) * np.exp(-((l / rm) ** 2)) / (rm * d_mushy)
            liquid = (self.initial - self.liquidus) * np.exp(-((l / ra) ** 2)) / (ra * erfc(l / ra))
            return [solid / mushy_s - 1.0, liquid / mushy_l - 1.0]

        eta = fsolve(mismatch, [0.5, 0.7], xtol=1e-12)
        assert np.abs(mismatch(eta)).max() < 1e-9
        return float(eta[0] * ra), float(eta[1] * ra)

    def temperature(self, x: Array, t: float) -> Array:
        """T at depth x (n,), m, and time t, s."""
        a, am = self.diffusivities
        ra, rm = np.sqrt(a), np.sqrt(am)
        s, l = self.fronts()  # noqa: E741
        eta = np.asarray(x) / (2 * np.sqrt(t))
        solid = self.surface + (self.solidus - self.surface) * erf(eta / ra) / erf(s / ra)
        share = (erf(eta / rm) - erf(s / rm)) / (erf(l / rm) - erf(s / rm))
        mushy_zone = self.solidus + (self.liquidus - self.solidus) * share
        liquid = self.initial - (self.initial - self.liquidus) * erfc(eta / ra) / erfc(l / ra)
        return np.where(eta < s, solid, np.where(eta < l, mushy_zone, liquid))

    def heat(self, t: float) -> float:
        """Heat removed through the surface by time t, J/m2."""
        return 2.0 * t * self.flux(t)

    def flux(self, t: float) -> float:
        """Heat flux through the surface at time t, W/m2."""
        a, _ = self.diffusivities
        s, _ = self.fronts()
        slope = (self.solidus - self.surface) / (erf(s / np.sqrt(a)) * np.sqrt(np.pi * a))
        return float(self.conductivity * slope / np.sqrt(t))

    def depths(self, t: float) -> tuple[float, float]:
        """Depth of the solidus and of the liquidus at time t, m."""
        s, l = self.fronts()  # noqa: E741
        return 2.0 * s * float(np.sqrt(t)), 2.0 * l * float(np.sqrt(t))


@dataclass(frozen=True)
class Neumann:
    """Two-phase Stefan problem with isothermal melting; one-phase for `initial` = `melting`.

    Solid and liquid have the same density; the surface is at `surface` from t = 0.
    """

    solid: tuple[float, float]  # k W/mK, c J/kgK
    liquid: tuple[float, float]
    density: float
    latent_heat: float
    surface: float
    melting: float
    initial: float

    def root(self) -> float:
        """lambda: the front is at 2 lambda sqrt(a_s t)."""
        (ks, cs), (kl, cl) = self.solid, self.liquid
        a_s, a_l = ks / (self.density * cs), kl / (self.density * cl)
        nu = np.sqrt(a_s / a_l)
        stefan = cs * (self.melting - self.surface) / self.latent_heat
        ratio = kl / ks * nu * (self.initial - self.melting) / (self.melting - self.surface)

        def f(lam: float) -> float:
            return float(
                np.exp(-(lam**2)) / erf(lam)
                - ratio * np.exp(-((nu * lam) ** 2)) / erfc(nu * lam)
                - lam * np.sqrt(np.pi) / stefan
            )

        return float(brentq(f, 1e-6, 5.0, xtol=1e-15))

    def flux(self, t: float) -> float:
        """Heat flux through the surface at time t, W/m2."""
        k, c = self.solid
        rise = (self.melting - self.surface) / erf(self.root())
        return float(k * rise / np.sqrt(np.pi * k / (self.density * c) * t))

    def front(self, t: float) -> float:
        """Depth of the melting isotherm at time t, m."""
        return float(2 * self.root() * np.sqrt(self.solid[0] / (self.density * self.solid[1]) * t))

    def temperature(self, x: Array, t: float) -> Array:
        """T at depth x (n,), m, and time t, s."""
        a_s = self.solid[0] / (self.density * self.solid[1])
        a_l = self.liquid[0] / (self.density * self.liquid[1])
        lam, nu = self.root(), np.sqrt(a_s / a_l)
        x = np.asarray(x)
        solid = self.surface + (self.melting - self.surface) * erf(
            x / (2 * np.sqrt(a_s * t))
        ) / erf(lam)
        liquid = self.initial - (self.initial - self.melting) * erfc(
            x / (2 * np.sqrt(a_l * t))
        ) / erfc(nu * lam)
        return np.where(x < self.front(t), solid, liquid)
