"""Flow curves in closed form, which the laws reproduce and which are fitted to measurements.

Stresses in Pa, rates in 1/s, temperatures in K. The status of numbers (F read in the source, M from
memory and not yet checked, C computed here) is given beside them.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array

MEGA = 1e6
SQRT3 = float(np.sqrt(3.0))


def modified_norton_hoff(
    strain: npt.ArrayLike,
    rate: npt.ArrayLike,
    strength: npt.ArrayLike,
    p1: npt.ArrayLike,
    p3: npt.ArrayLike,
    p4: npt.ArrayLike,
) -> Array:
    """Equivalent stress of the modified Norton-Hoff law (163), Pa.

    Args:
        strain: Equivalent strain.
        rate: Equivalent strain rate, 1/s.
        strength: K0 p2, Pa (s^p3).
        p1: Softening.
        p3: Exponent of the strain rate.
        p4: Exponent of the strain.
    """
    e, r = np.asarray(strain, float), np.asarray(rate, float)
    return np.asarray(
        SQRT3 * np.asarray(strength) * np.exp(-np.asarray(p1) * e)
        * (SQRT3 * r) ** np.asarray(p3) * e ** np.asarray(p4)
    )  # fmt: skip


def yield_limit(
    modulus: float, rate: float, strength: float, p1: float, p3: float, p4: float
) -> tuple[float, float]:
    """Strain and stress where the elastic line meets the curve (163), thesis (207)-(212).

    The thesis bisects (209) in the strain. With the logarithm of the strain, e = exp(x), it reads
    (1 - p4) x + p1 exp(x) = ln(level / modulus); the root is bracketed, so that it is always found,
    and has a closed form for p1 = 0.

    Args:
        modulus: Slope of the elastic line, Pa.
        rate: Equivalent strain rate, 1/s.
        strength: K0 p2, Pa (s^p3).
        p1: Softening.
        p3: Exponent of the strain rate.
        p4: Exponent of the strain, below 1.

    Returns:
        Strain, and stress in Pa: the first intersection on loading from zero.

    Raises:
        ValueError: p4 is not below 1, or the curve stays above the line (p1 very negative).
    """
    from scipy.optimize import brentq

    if not p4 < 1.0:
        raise ValueError(f"p4 ({p4}) must be below 1 for an elastic line to meet the curve")
    goal = float(np.log(SQRT3 * strength * (SQRT3 * rate) ** p3 / modulus))

    def excess(x: float) -> float:
        return (1.0 - p4) * x + p1 * float(np.exp(x)) - goal

    start = goal / (1.0 - p4)
    if p1 == 0.0:
        strain = float(np.exp(start))
        return strain, modulus * strain
    # For p1 < 0 the left-hand side has its maximum at e = (1 - p4)/|p1|; the first root is before
    # it.
    low, high = start - 1.0, start + 1.0
    if p1 > 0.0:
        low = min(start, float(np.log((abs(goal) + 1.0) / p1))) - 700.0
        high = start
    else:
        low, high = start, float(np.log((1.0 - p4) / -p1))
        if excess(high) < 0.0:
            raise ValueError("the elastic line never meets the curve: p1 is too negative")
    strain = float(np.exp(brentq(excess, low, high, xtol=1e-14, rtol=1e-15, maxiter=500)))
    return strain, modulus * strain


@dataclass(frozen=True, slots=True)
class Austenite:
    """Coefficients of Kozlowski's model III for austenite at given temperatures.

    In MPa: rate = level (s - hardening e^exponent)^stress_exponent, with e the viscoplastic strain.
    Fitted by Kozlowski et al. (1992) for about 950 ... 1400 degC, 1e-6 ... 1e-3 1/s, 0.005 ... 1.54
    %C; status M. Outside this range it is an extrapolation.
    """

    hardening: Array  #: Pa
    hardening_exponent: Array  #: exponent of the viscoplastic strain
    ln_rate: Array  #: ln of the rate [1/s] for a viscous stress of 1 Pa
    stress_exponent: Array  #: exponent of the viscous stress

    @classmethod
    def at(cls, temperature: npt.ArrayLike, carbon: float) -> Austenite:
        """Coefficients at temperatures in K for a carbon content in wt%."""
        t = np.asarray(temperature, float)
        n = 8.132 - 1.540e-3 * t
        level = 46550.0 + 71400.0 * carbon + 12000.0 * carbon**2
        ln_level = np.log(level) - 44650.0 / t
        return cls(
            MEGA * (130.5 - 5.128e-3 * t),
            -0.6289 + 1.114e-3 * t,
            ln_level - n * np.log(MEGA),
            n,
        )

    def stress(self, strain: npt.ArrayLike, rate: npt.ArrayLike) -> Array:
        """Stress at a viscoplastic strain and rate, Pa."""
        back = self.hardening * np.asarray(strain, float) ** self.hardening_exponent
        viscous = np.exp((np.log(rate) - self.ln_rate) / self.stress_exponent)
        return np.asarray(back + viscous)


@dataclass(frozen=True, slots=True)
class DeltaFerrite:
    """Coefficients of Zhu's power law for delta ferrite at given temperatures.

    In MPa: rate = 0.1 (s / (f (T/300)^-5.52 (1 + 1000 e)^m))^n, f = 13678 C^-0.0556. Zhu (1996),
    fitted to data of Wray (1976); status M.
    """

    ln_level: Array  #: ln of the stress [Pa] at rate 1 1/s without strain
    hardening: Array  #: m
    stress_exponent: Array  #: n

    @classmethod
    def at(cls, temperature: npt.ArrayLike, carbon: float) -> DeltaFerrite:
        """Coefficients at temperatures in K for a carbon content in wt% (0.0001 at least)."""
        t = np.asarray(temperature, float)
        n = 1.0 / (1.617e-4 * t - 0.06166)
        level = MEGA * 13678.0 * max(carbon, 1e-4) ** -5.56e-2
        ln_level = np.log(level) - 5.52 * np.log(t / 300.0) + np.log(10.0) / n
        return cls(np.asarray(ln_level), -9.4156e-5 * t + 0.3495, np.asarray(n))

    def stress(self, strain: npt.ArrayLike, rate: npt.ArrayLike) -> Array:
        """Stress at a viscoplastic strain and rate, Pa."""
        hard = 1.0 + 1000.0 * np.asarray(strain, float)
        return np.asarray(
            np.exp(self.ln_level + np.log(rate) / self.stress_exponent) * hard**self.hardening
        )
