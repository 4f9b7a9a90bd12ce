"""The scalar problem of a point: how far its equivalent stress falls from that of the trial.

The trial deviator keeps its direction, its equivalent stress falls from `trial` to
q = trial - 3G dp, and the law asks q = flow stress. It is solved for z = ln dp:

    ln( S(z) - S0 + 3G exp(z) ) = ln( trial - S0 ),        S0 = flow stress at rate zero,

whose left side is increasing and, for sums of power laws, convex with slopes between the smallest
exponent of the law and 1: Newton from the right end ln(trial / 3G) falls onto the root without
leaving the bracket, whatever the exponents. Where a law is not convex the bracket guards.
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
    NOTHING,
    PLASTIC,
    ROUNDING,
    SHEAR,
    STEEL,
    STEPS,
    YIELD,
    YIELD_STRESS,
)
from castfem.physics.constitutive.kernel.flow_stress import flow_stress
from castfem.physics.constitutive.kernel.remembered_rate import return_to_curve

LN_2 = math.log(2.0)
TINY_LN = -690.0  # a viscoplastic strain below exp of this is none


@compiled
def _return_to_flow(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, trial, threshold, ln_dt, near
):
    """Solve the scalar problem of a law whose flow stress depends on dp.

    From a `near` increment one Newton step is taken.

    Returns:
        dp, equivalent stress q, dq / d trial, and dq / d old.
    """
    shear3 = 3.0 * c[SHEAR]
    goal = math.log(trial - threshold)
    low, high = NOTHING, math.log(trial / shear3)
    z, fall = high, 1.0
    if signed and old + left * math.exp(high) <= 0.0:
        # While flow goes back e = q/E, and with p4 > 0 no stress at all is a root beside the one
        # that is meant, to the left of which alone the flow stress is below that of the point.
        z = high - LN_2
    if near > 0.0:
        z = math.log(near)
    for _ in range(STEPS):
        increment = math.exp(z)
        flow, slope, _by, _old = flow_stress(
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
        if abs(step) <= LAST_STEP or near > 0.0:
            z -= step
            break
        new = z - step
        if not (low < new <= high):  # also when the step is not a number
            if low > NOTHING:
                new = 0.5 * (low + high)
            else:
                new, fall = z - fall, 2.0 * fall
        z = new
        if z < TINY_LN:
            if not (signed or left < 1.0):
                return 0.0, trial, 1.0, 0.0
            # With strain that recovers, or flow back, the left side may be flat near the right end
            # and a Newton step from there pass the root: that there is no flow has to be checked.
            z = TINY_LN
        if high - low <= ROUNDING * (1.0 + abs(z)):
            break
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
def solve_point(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, before, rate_old, trial, carried, dt, near, near_rate
):
    """Solve one point: equivalent stress, dp, dq / d trial, dq / d old, remembered rate.

    What is `near` to a point that flows flows, what is near to an elastic one is elastic; see
    `constants.SEEK`.
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
        if trial > c[YIELD_STRESS] or near > 0.0:
            stress, kept = c[YIELD_STRESS], 0.0
            increment = (trial - stress) / (3.0 * c[SHEAR])
    elif kind == CURVE_GIVEN:
        if trial > c[YIELD]:
            increment, stress, kept, by_old = _return_to_flow(
                kind, c, *strain, trial, 0.0, math.log(dt), near
            )
            if stress < c[YIELD]:
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
