"""Partial derivatives of the flow stress of a point, while its viscoplastic increment dp is held.

They are of what the point is given: its coefficients, and behind their columns what hangs on the
state it begins with (`LEFT` and the following).  With these a change of what is given is, by the
implicit function theorem, one of dp; see `changes`.

For laws whose hardening has no direction.
"""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    COLUMNS,
    CREEP,
    CURVE_AUTOMATIC,
    CURVE_GIVEN,
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
    PLASTIC,
    RATE_EXPONENT,
    ROUNDING,
    SHEAR,
    SOFTENING,
    STEEL,
    STRAIN_EXPONENT,
    YIELD,
    YIELD_STRESS,
    YOUNG,
)
from castfem.physics.constitutive.kernel.flow_stress import strain_factor

# What a point is given beside its coefficients: what recovery leaves of strain, ln of the step,
# stress that is carried along, strain and rate it remembers.
LEFT, LN_STEP, CARRIED_ALONG, BEFORE, RATE_BEFORE = range(COLUMNS, COLUMNS + 5)
GIVEN = COLUMNS + 5
STRESS, RATE = range(2)  # rows of the partial derivatives: of the flow stress, of ln of the rate


@compiled
def _add_strain_factor(c, strain, times, by, row):  # type: ignore[no-untyped-def]
    """Add `times` the derivatives of `strain_factor` by its coefficients to a row; by strain."""
    e = min(max(strain, 1e-300), c[LARGEST_STRAIN])
    _value, by_strain = strain_factor(c, strain)
    by[row, SOFTENING] -= times * e
    by[row, STRAIN_EXPONENT] += times * math.log(e)
    if strain >= c[LARGEST_STRAIN]:
        by[row, LARGEST_STRAIN] += times * (c[STRAIN_EXPONENT] / e - c[SOFTENING])
    return by_strain


@compiled
def _add_remembered(c, carried, before, rate_before, weight, by):  # type: ignore[no-untyped-def]
    """Add `weight` times the derivatives of ln of the old rate, of which the curve knows."""
    exponent, young = c[RATE_EXPONENT], c[YOUNG]
    strain = before + carried / young
    ln_factor, by_strain = strain_factor(c, strain)
    ln_old = (math.log(carried) - c[LN_LEVEL] - ln_factor) / exponent - LN_SQRT3
    if rate_before > 0.0 and math.log(rate_before) > ln_old:
        by[RATE, RATE_BEFORE] += weight / rate_before
        return math.log(rate_before)
    part = weight / exponent
    _add_strain_factor(c, strain, -part, by, RATE)
    by[RATE, LN_LEVEL] -= part
    by[RATE, RATE_EXPONENT] -= part * (ln_old + LN_SQRT3)
    by[RATE, BEFORE] -= part * by_strain
    by[RATE, CARRIED_ALONG] += part * (1.0 / carried - by_strain / young)
    by[RATE, YOUNG] += part * by_strain * carried / young**2
    return ln_old


@compiled
def rate_partials(  # type: ignore[no-untyped-def]
    c, trial, carried, before, rate_before, increment, rate, dt, by
):
    """Fill the row of ln of the rate r that `remembered_rate` finds.

    It solves carried (r / old)^m + E dt r = carried + E de, with E de what loads beyond the carried
    stress; the terms on the left are `along` and `stiff` here.

    Returns:
        Its derivative by dp, and by the trial stress.
    """
    if not rate > 0.0:
        return 0.0, 0.0
    exponent, y = c[RATE_EXPONENT], math.log(rate)
    stiff = c[YOUNG] * dt * rate
    # Elastic unloading is as fast as loading back.
    sign = -1.0 if increment == 0.0 and trial < carried else 1.0
    less = 3.0 * c[SHEAR] - c[YOUNG]
    loads = 1.0 if sign * (trial - carried) - less * increment > 0.0 else 0.0
    along = 0.0
    if carried > 0.0:
        along = carried + max(sign * (trial - carried) - less * increment, 0.0) - stiff
        ln_old = _add_remembered(c, carried, before, rate_before, exponent * along, by)
        by[RATE, RATE_EXPONENT] -= along * (y - ln_old)
        by[RATE, CARRIED_ALONG] += 1.0 - along / carried
    by[RATE, CARRIED_ALONG] -= loads * sign
    by[RATE, SHEAR] -= 3.0 * loads * increment
    by[RATE, YOUNG] += loads * increment - stiff / c[YOUNG]
    by[RATE, LN_STEP] -= stiff
    whole = exponent * along + stiff
    for column in range(GIVEN):
        by[RATE, column] /= whole
    return -loads * less / whole, loads * sign / whole


@compiled
def _curve_partials(  # type: ignore[no-untyped-def]
    kind, c, stress, old, left, trial, increment, ln_dt, rate, by_rate, by
):
    """Fill the row of the flow stress of a curve of strain and rate, see `flow_partials`."""
    shear3, young, exponent = 3.0 * c[SHEAR], c[YOUNG], c[RATE_EXPONENT]
    beyond = trial - shear3 * increment
    strain = old + left * increment + beyond / young
    by_strain = stress * _add_strain_factor(c, strain, stress, by, STRESS)
    by[STRESS, LN_LEVEL] = stress
    by[STRESS, SHEAR] = -3.0 * by_strain * increment / young
    by[STRESS, YOUNG] = -by_strain * beyond / young**2
    by[STRESS, LEFT] = by_strain * increment
    by_increment, by_trial = by_strain * (left - shear3 / young), by_strain / young
    if kind == CURVE_GIVEN:
        ln_rate = math.log(increment) - ln_dt
        by[STRESS, LN_STEP] = -stress * exponent
        by_increment += stress * exponent / increment
    else:
        ln_rate = math.log(rate) if rate > 0.0 else 0.0
        for column in range(GIVEN):
            by[STRESS, column] += stress * exponent * by[RATE, column]
        by_increment += stress * exponent * by_rate[0]
        by_trial += stress * exponent * by_rate[1]
    by[STRESS, RATE_EXPONENT] += stress * (ln_rate + LN_SQRT3)
    return by_increment, by_trial, by_strain


@compiled
def _steel_partials(c, old, left, increment, ln_dt, by):  # type: ignore[no-untyped-def]
    """Fill the row of the flow stress of Kozlowski III and the delta-ferrite law."""
    weight, strain = c[DELTA_WEIGHT], old + left * increment
    z = math.log(increment) - ln_dt
    by_increment, by_strain = 0.0, 0.0
    if weight < 1.0:
        n, m = c[GAMMA_EXPONENT], c[HARDENING_EXPONENT]
        part = (1.0 - weight) * strain**m
        arg = (z - c[LN_GAMMA_RATE]) / n
        viscous = math.exp(arg)
        flow = (1.0 - weight) * viscous
        by[STRESS, HARDENING] = part
        by[STRESS, HARDENING_EXPONENT] = part * c[HARDENING] * math.log(strain)
        by[STRESS, LN_GAMMA_RATE] = -flow / n
        by[STRESS, GAMMA_EXPONENT] = -flow * arg / n
        by[STRESS, DELTA_WEIGHT] = -(c[HARDENING] * strain**m + viscous)
        by_increment += flow / n
        by_strain += part * c[HARDENING] * m / strain
    if weight > 0.0:
        n, m = c[DELTA_EXPONENT], c[DELTA_HARDENING]
        hard = 1.0 + DELTA_STRAIN_SCALE * strain
        delta = math.exp(c[LN_DELTA_LEVEL] + m * math.log(hard) + z / n)
        flow = weight * delta
        by[STRESS, LN_DELTA_LEVEL] = flow
        by[STRESS, DELTA_HARDENING] = flow * math.log(hard)
        by[STRESS, DELTA_EXPONENT] = -flow * z / n**2
        by[STRESS, DELTA_WEIGHT] += delta
        by_increment += flow / n
        by_strain += flow * m * DELTA_STRAIN_SCALE / hard
    by[STRESS, LN_STEP] = -by_increment
    by[STRESS, LEFT] = by_strain * increment
    return by_increment / increment + left * by_strain, 0.0, by_strain


@compiled
def flow_partials(  # type: ignore[no-untyped-def]
    kind, c, stress, old, left, trial, increment, ln_dt, rate, by_rate, by
):
    """Fill the row of the flow stress of a point that flows.

    Args:
        kind: One of the laws of `constants`.
        c: Coefficients of the point.
        stress: What of its trial is left.
        old: Strain that hardens before the increment.
        left: What recovery leaves of strain.
        trial: Trial stress.
        increment: Of the viscoplastic strain.
        ln_dt: ln of the step, as the law sees it.
        rate: The remembered one.
        by_rate: What `rate_partials` has returned.
        by: Out, (2, GIVEN), with the row of the rate.

    Returns:
        Its derivative by dp, by the trial stress, and by `old`.
    """
    if kind == STEEL:
        return _steel_partials(c, old, left, increment, ln_dt, by)
    if kind == CREEP:
        arg = (math.log(increment) - ln_dt - c[LN_FACTOR]) / c[EXPONENT]
        slope = math.exp(arg) / c[EXPONENT]
        by[STRESS, LN_FACTOR] = by[STRESS, LN_STEP] = -slope
        by[STRESS, EXPONENT] = -slope * arg
        return slope / increment, 0.0, 0.0
    if kind == PLASTIC:
        by[STRESS, YIELD_STRESS] = 1.0
        return 0.0, 0.0, 0.0
    if kind == CURVE_GIVEN and stress <= c[YIELD] * (1.0 + ROUNDING):
        by[STRESS, YIELD] = 1.0
        return 0.0, 0.0, 0.0
    assert kind in (CURVE_GIVEN, CURVE_AUTOMATIC)
    return _curve_partials(kind, c, stress, old, left, trial, increment, ln_dt, rate, by_rate, by)
