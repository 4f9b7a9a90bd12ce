"""Flow stress of each law for a plastic strain increment, with derivatives.

Each function takes the row `c` of coefficients of a point, see `constants`. The hardening strain is
`old` initially and grows by the fraction `left` (after recovery) of the increment; `aside` is the
part of a signed strain across the flow.
"""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    CREEP,
    DELTA_EXPONENT,
    DELTA_HARDENING,
    DELTA_STRAIN_SCALE,
    DELTA_WEIGHT,
    EXPONENT,
    GAMMA_EXPONENT,
    HARDENING,
    HARDENING_EXPONENT,
    LARGEST_STRAIN,
    LN_DELTA_LEVEL,
    LN_FACTOR,
    LN_GAMMA_RATE,
    LN_LEVEL,
    LN_SQRT3,
    RATE_EXPONENT,
    SHEAR,
    SOFTENING,
    STEEL,
    STRAIN_EXPONENT,
    YOUNG,
)

HUGE_LN = 600.0  # largest logarithm, so that no exponential overflows


@compiled
def exp(x):  # type: ignore[no-untyped-def]
    """Exponential function without overflow."""
    return math.exp(min(x, HUGE_LN))


@compiled
def back_stress_gain(c, old, aside, gain):  # type: ignore[no-untyped-def]
    """Change of austenite's back stress along the flow for a gain in strain along it.

    X = f1 r^f2 along E, r its equivalent strain with the parts `old` along the flow and `aside`
    across it: along the flow f1 r^(f2-1) (old + gain).

    Returns:
        The change, and its derivatives with respect to the gain and to `old`.
    """
    m, u = c[HARDENING_EXPONENT] - 1.0, old + gain
    before = math.sqrt(old * old + aside * aside)
    r = max(math.sqrt(u * u + aside * aside), u, -u, 1e-300)  # the squares may underflow
    level_old = c[HARDENING] * before**m if before > 0.0 else 0.0
    if before > 0.0 and r > 0.5 * before:  # a difference of nearly equal numbers
        part = (2.0 * (old / before) + gain / before) * (gain / before)
        grown = level_old * math.expm1(0.5 * m * math.log1p(part))
        level = level_old + grown
    else:
        level = c[HARDENING] * r**m
        grown = level - level_old
    share = u / r
    by_gain = level * (1.0 + m * share * share)
    if before == 0.0:
        return level * u, by_gain, 0.0
    # The flow turns relative to a constant strain tensor: dr / d old is gain / r.
    return level * gain + grown * old, by_gain, grown + level * m * share * gain / r


@compiled
def _steel_flow(c, old, aside, left, signed, z, increment, ln_dt):  # type: ignore[no-untyped-def]
    """Kozlowski III and the delta-ferrite law, weighted: S - S0, derivatives by z and by `old`."""
    stress, slope, by_old = 0.0, 0.0, 0.0
    weight, gain = c[DELTA_WEIGHT], left * increment
    if weight < 1.0:
        m = c[HARDENING_EXPONENT]
        if signed:
            back, by_gain, by_old = back_stress_gain(c, old, aside, gain)
            back_slope = by_gain * gain
            by_old *= 1.0 - weight
        elif old > 0.0:
            x = gain / old
            back = c[HARDENING] * old**m * math.expm1(m * math.log1p(x))
            back_slope = c[HARDENING] * (old + gain) ** m * m * x / (1.0 + x)
        else:
            back = c[HARDENING] * exp(m * (z + math.log(left)))
            back_slope = m * back
        viscous = exp((z - ln_dt - c[LN_GAMMA_RATE]) / c[GAMMA_EXPONENT])
        stress += (1.0 - weight) * (back + viscous)
        slope += (1.0 - weight) * (back_slope + viscous / c[GAMMA_EXPONENT])
    if weight > 0.0:
        n, m = c[DELTA_EXPONENT], c[DELTA_HARDENING]
        strain, hardens = old + gain, 1.0
        if strain < 0.0:
            strain, hardens = 0.0, 0.0
        hard = 1.0 + DELTA_STRAIN_SCALE * strain
        delta = exp(c[LN_DELTA_LEVEL] + m * math.log(hard) + (z - ln_dt) / n)
        stress += weight * delta
        slope += weight * delta * (1.0 / n + hardens * m * DELTA_STRAIN_SCALE * gain / hard)
        by_old += weight * delta * hardens * m * DELTA_STRAIN_SCALE / hard
    return stress, slope, by_old


@compiled
def fastest(kind, c, ln_stress, ln_dt):  # type: ignore[no-untyped-def]
    """Value of ln dp at which the viscous stress alone equals a stress above S0.

    With strain hardening dp is no larger. Infinite if a law has no such bound.
    """
    if kind == CREEP:
        return ln_dt + c[LN_FACTOR] + c[EXPONENT] * ln_stress
    if kind == STEEL and c[DELTA_WEIGHT] < 1.0:
        ln_viscous = ln_stress - math.log(1.0 - c[DELTA_WEIGHT])
        return ln_dt + c[LN_GAMMA_RATE] + c[GAMMA_EXPONENT] * ln_viscous
    return math.inf


@compiled
def strain_factor(c, strain):  # type: ignore[no-untyped-def]
    """Logarithm of exp(-p1 e) e^p4 and its derivative by e; constant beyond the largest strain."""
    e = min(max(strain, 1e-300), c[LARGEST_STRAIN])
    slope = c[STRAIN_EXPONENT] / e - c[SOFTENING]
    if strain >= c[LARGEST_STRAIN]:
        slope = 0.0
    return c[STRAIN_EXPONENT] * math.log(e) - c[SOFTENING] * e, slope


@compiled
def hardening_strain(old, gain):  # type: ignore[no-untyped-def]
    """Hardening strain, and its derivative with respect to a gain: zero while flow is reversed."""
    strain = old + gain
    if strain < 0.0:
        return 0.0, 0.0
    return strain, 1.0


@compiled
def flow_stress(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, trial, z, increment, ln_dt
):
    """Flow stress above S0 at dp = exp(z), and its derivatives by z, by trial and by `old`."""
    if kind == CREEP:
        stress = exp((z - ln_dt - c[LN_FACTOR]) / c[EXPONENT])
        return stress, stress / c[EXPONENT], 0.0, 0.0
    if kind == STEEL:
        stress, slope, by_old = _steel_flow(c, old, aside, left, signed, z, increment, ln_dt)
        return stress, slope, 0.0, by_old
    young, shear3 = c[YOUNG], 3.0 * c[SHEAR]
    hardening, hardens = hardening_strain(old, left * increment)
    strain = hardening + (trial - shear3 * increment) / young
    ln_factor, by_strain = strain_factor(c, strain)
    rate = c[RATE_EXPONENT]
    stress = exp(c[LN_LEVEL] + ln_factor + rate * (z - ln_dt + LN_SQRT3))
    slope = stress * (rate + by_strain * (hardens * left - shear3 / young) * increment)
    return stress, slope, stress * by_strain / young, stress * by_strain * hardens
