"""The scalar problem of radial return: from the trial equivalent stress to the new one.

The trial deviator keeps its direction, its equivalent stress falls from `trial` to q = trial - 3G
dp, and the law requires q = flow stress. It is solved for z = ln dp:

    ln( S(z) - S0 + 3G exp(z) ) = ln( trial - S0 ),        S0 = flow stress at rate zero,

whose left-hand side is increasing and, for sums of power laws, convex with slopes between the
smallest exponent of the law and 1: Newton's method converges to the root from the right without
leaving the bracket, for any exponents. It starts at ln(trial / 3G), where flow would take all of
the trial stress, or where the viscous stress alone equals it, if that is less. Where a law is not
convex the bracket protects it.

A flow curve with an automatic yield limit, `hardening_laws.NortonHoff` without one, leads to
another problem: its flow stress depends on a rate variable, [Pascon2003] (163), and so on the
carried stress, too.
"""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    CREEP,
    CURVE_AUTOMATIC,
    CURVE_GIVEN,
    DELTA_WEIGHT,
    HARDENING,
    HARDENING_EXPONENT,
    LAST_STEP,
    LN_LEVEL,
    LN_SQRT3,
    NOTHING,
    ON_CURVE,
    PLASTIC,
    RATE_EXPONENT,
    ROUNDING,
    SHEAR,
    STEEL,
    STEPS,
    YIELD,
    YIELD_STRESS,
    YOUNG,
)
from castfem.physics.constitutive.kernel.flow_stress import (
    exp,
    fastest,
    flow_stress,
    hardening_strain,
    strain_factor,
)

LN_2 = math.log(2.0)
TINY_LN = -690.0  # viscoplastic strains below exp of this count as zero


@compiled
def _begin(kind, c, old, left, signed, goal, high, ln_dt):  # type: ignore[no-untyped-def]
    """Return ln dp at which the search for a root below `high` begins."""
    if signed and old + left * math.exp(high) <= 0.0:
        # While flow is reversed e = q/E, and with p4 > 0 zero stress is a root, too; only to the
        # left of the wanted root is the flow stress below the stress of the point.
        return high - LN_2
    if signed and old < 0.0:  # the back stress may assist the flow
        return high
    return min(high, fastest(kind, c, goal, ln_dt))


@compiled
def _return_to_flow(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, trial, threshold, ln_dt, near
):
    """Solve the scalar problem of a law whose flow stress depends on dp.

    From a `near` increment one Newton step is taken, along the tangent there.

    Returns:
        dp, equivalent stress q, dq / d trial, and dq / d old.
    """
    shear3 = 3.0 * c[SHEAR]
    goal = math.log(trial - threshold)
    low, high = NOTHING, math.log(trial / shear3)
    z = math.log(near) if near > 0.0 else _begin(kind, c, old, left, signed, goal, high, ln_dt)
    fall, solved = 1.0, False
    for _ in range(STEPS):
        increment = math.exp(z)
        flow, slope, by_trial, by_old = flow_stress(
            kind, c, old, aside, left, signed, trial, z, increment, ln_dt
        )
        total = flow + shear3 * increment
        excess = math.log(total) - goal if total > 0.0 else NOTHING
        if excess > 0.0:
            if z == TINY_LN:
                return 0.0, trial, 1.0, 0.0
            high = z
        else:
            low = z
        rise = (slope + shear3 * increment) / total if total > 0.0 else 0.0
        step = excess / rise if rise > 0.0 else math.inf
        if near > 0.0 or abs(step) <= LAST_STEP:
            increment, flow = increment - step * increment, flow - step * slope
            solved = True
            break
        new = z - step
        if not (low < new <= high):  # also if the step is NaN
            if low > NOTHING:
                new = 0.5 * (low + high)
            else:
                new, fall = z - fall, 2.0 * fall
        z = new
        if z < TINY_LN:
            if not (signed or left < 1.0):
                return 0.0, trial, 1.0, 0.0
            # With recovery, or reversed flow, the left-hand side may be flat near the right end,
            # and a Newton step from there may pass the root: absence of flow has to be checked.
            z = TINY_LN
        if high - low <= ROUNDING * (1.0 + abs(z)):
            break
    if not solved:
        increment = math.exp(z)
        flow, slope, by_trial, by_old = flow_stress(
            kind, c, old, aside, left, signed, trial, z, increment, ln_dt
        )
    stress = trial - shear3 * increment
    if stress < 0.5 * trial:  # a difference of nearly equal numbers
        stress = min(threshold + flow, 0.5 * trial)
    change = slope + shear3 * increment
    kept = (slope + shear3 * increment * by_trial) / change if change > 0.0 else 0.0
    by_old *= shear3 * increment / change if change > 0.0 else 0.0
    return increment, stress, kept, by_old


@compiled
def _remembered(ln_carried, ln_old, exponent, ln_stiff, total, guess):  # type: ignore[no-untyped-def]
    """Find ln of the rate r with carried (r / old)^exponent + stiff r = total, and its derivative.

    The logarithm of the left-hand side is convex in ln r: Newton's method is monotone from the
    right end, and after one step from a guess on the left.
    """
    if total <= 0.0:
        return NOTHING, 0.0
    goal = math.log(total)
    y = goal - ln_stiff
    if ln_carried == NOTHING:
        return y, 1.0 / total
    high = min(y, ln_old + (goal - ln_carried) / exponent)
    y = guess if high - 1.0 < guess < high else high
    rise = 1.0
    for _ in range(STEPS):
        a = ln_carried + exponent * (y - ln_old)
        b = ln_stiff + y
        top = max(a, b)
        left, right = math.exp(a - top), math.exp(b - top)
        rise = (exponent * left + right) / (left + right)
        step = (top + math.log(left + right) - goal) / rise
        y = min(y - step, high)
        if abs(step) <= LAST_STEP:
            break
    return y, 1.0 / (total * rise)


@compiled
def _curve_stress(  # type: ignore[no-untyped-def]
    c, old, left, trial, drive, carried, increment, guess, ln_carried, ln_old, ln_stiff
):
    """Flow stress with the rate variable at dp, derivatives by dp, trial and old, and ln rate.

    `drive` is the trial stress minus the carried one. A point that carries stress but has no rate
    yet, such as one that has just solidified, takes the rate at which the curve passes through that
    stress: with the rate of the step, a small load would reduce its flow stress faster than flow
    unloads it, and the response would jump.
    """
    shear3, young, exponent = 3.0 * c[SHEAR], c[YOUNG], c[RATE_EXPONENT]
    gain = drive - (shear3 - young) * increment  # E times the increment of e
    loads = gain > 0.0
    gain = max(gain, 0.0)
    total = carried + gain
    y, by_total = _remembered(ln_carried, ln_old, exponent, ln_stiff, total, guess)
    hardening, hardens = hardening_strain(old, left * increment)
    strain = hardening + (trial - shear3 * increment) / young
    ln_factor, by_strain = strain_factor(c, strain)
    if y == NOTHING:
        return 0.0, 0.0, 0.0, 0.0, y
    stress = exp(c[LN_LEVEL] + ln_factor + exponent * (y + LN_SQRT3))
    by_rate = exponent * by_total if loads else 0.0
    by_increment = by_strain * (hardens * left - shear3 / young) - by_rate * (shear3 - young)
    by_trial, by_old = by_strain / young + by_rate, by_strain * hardens
    return stress, stress * by_increment, stress * by_trial, stress * by_old, y


@compiled
def return_to_curve(  # type: ignore[no-untyped-def]
    c, old, left, before, rate_old, trial, carried, dt, near, near_rate
):
    """Solve the scalar problem of a point.

    `before` is the strain that had hardened the carried stress at the start of the step. From a
    `near` increment, and the rate there, Newton's method runs without safeguards.

    Returns:
        dp, equivalent stress q, dq / d trial, dq / d old, and the rate of the curve.
    """
    shear3, young, exponent = 3.0 * c[SHEAR], c[YOUNG], c[RATE_EXPONENT]
    drive = trial - carried
    ln_stiff = math.log(young) + math.log(dt)
    ln_carried, ln_old = NOTHING, NOTHING
    if carried > 0.0:
        ln_carried = math.log(carried)
        # The rate at which the curve passes through the stress there; the rate variable is not
        # below it.
        ln_factor, _by = strain_factor(c, before + carried / young)
        ln_old = (ln_carried - c[LN_LEVEL] - ln_factor) / exponent - LN_SQRT3
        if rate_old > 0.0:
            ln_old = max(ln_old, math.log(rate_old))
    args = (ln_carried, ln_old, ln_stiff)
    increment, y, stress = max(near, 0.0), NOTHING, 0.0
    if near > 0.0 and near_rate > 0.0:
        y = math.log(near_rate)
    elif near <= 0.0:
        stress, by_increment, by_trial, by_old, y = _curve_stress(
            c, old, left, trial, drive, carried, 0.0, NOTHING, *args
        )
    if near == 0.0 or (near < 0.0 and trial <= stress * (1.0 + ON_CURVE)) or trial <= 0.0:
        if drive < 0.0:  # elastic unloading takes the same rate as reloading
            y = _curve_stress(c, old, left, trial, -drive, carried, 0.0, NOTHING, *args)[4]
        return 0.0, trial, 1.0, 0.0, exp(y)
    low, high = 0.0, trial / shear3
    if near < 0.0:
        increment = min((trial - stress) / shear3, high)
    for number in range(STEPS):
        stress, by_increment, by_trial, by_old, y = _curve_stress(
            c, old, left, trial, drive, carried, increment, y, *args
        )
        excess = trial - shear3 * increment - stress
        if excess > 0.0:
            low = increment
        else:
            high = increment
        slope = shear3 + by_increment
        step = excess / slope if slope > 0.0 or near > 0.0 else math.inf
        if near > 0.0:
            increment, stress = increment + step, stress + by_increment * step
            if number == 1:  # the rate belongs to the previous increment
                break
            continue
        if abs(step) <= LAST_STEP * increment or high - low <= ROUNDING * high:
            if low <= increment + step <= high:
                increment, stress = increment + step, stress + by_increment * step
            break
        new = increment + step
        increment = new if low < new < high else 0.5 * (low + high)
    found = trial - shear3 * increment
    if found < 0.5 * trial:
        found = min(stress, 0.5 * trial)
    change = shear3 + by_increment
    kept = 1.0 - shear3 * (1.0 - by_trial) / change if change > 0.0 else 0.0
    by_old *= shear3 / change if change > 0.0 else 0.0
    return increment, found, kept, by_old, exp(y)


@compiled
def solve_point(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, before, rate_old, trial, carried, dt, near, near_rate
):
    """Solve one point: equivalent stress, dp, dq / d trial, dq / d old, rate variable.

    A point near a flowing one flows, and one near an elastic one is elastic; see `constants.SEEK`.
    """
    increment, stress, kept, by_old, rate = 0.0, trial, 1.0, 0.0, 0.0
    strain = old, aside, left, signed
    if kind == CURVE_AUTOMATIC:
        increment, stress, kept, by_old, rate = return_to_curve(
            c, old, left, before, rate_old, trial, carried, dt, near, near_rate
        )
    elif near == 0.0:
        pass
    elif kind == PLASTIC:
        if trial > c[YIELD_STRESS] * (1.0 + ON_CURVE) or near > 0.0:
            stress, kept = c[YIELD_STRESS], 0.0
            increment = (trial - stress) / (3.0 * c[SHEAR])
    elif kind == CURVE_GIVEN:
        if trial > c[YIELD] * (1.0 + ON_CURVE):
            at_limit = near > 0.0 and trial - 3.0 * c[SHEAR] * near <= c[YIELD] * (1.0 + ROUNDING)
            if not at_limit:
                increment, stress, kept, by_old = _return_to_flow(
                    kind, c, *strain, trial, 0.0, math.log(dt), near
                )
            if at_limit or stress < c[YIELD]:
                stress, kept, by_old = c[YIELD], 0.0, 0.0
                increment = (trial - stress) / (3.0 * c[SHEAR])
    elif kind in (STEEL, CREEP):
        threshold = 0.0
        if kind == STEEL and old > 0.0 and not signed:
            threshold = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * old ** c[HARDENING_EXPONENT]
        if trial > threshold * (1.0 + ROUNDING) and trial > 1e-290:
            increment, stress, kept, by_old = _return_to_flow(
                kind, c, *strain, trial, threshold, math.log(dt), near
            )
    return stress, increment, kept, by_old, rate
