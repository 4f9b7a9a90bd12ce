"""The compiled loop over quadrature points: fully implicit radial return for all flow laws.

Everything that numba compiles stands in this one file, since its cache on disk notices a change of
the file of the outermost function only.  Strains and stresses are Mandel vectors
[xx, yy, zz, sqrt(2) xy]; a deviator s has the equivalent stress q = sqrt(3/2) |s|.

Scalar problem of a point: the trial deviator keeps its direction, its equivalent stress falls from
`trial` to q = trial - 3G dp, and the law asks q = flow stress.  It is solved for z = ln dp:

    ln( S(z) - S0 + 3G exp(z) ) = ln( trial - S0 ),        S0 = flow stress at rate zero,

whose left side is increasing and, for sums of power laws, convex with slopes between the smallest
exponent of the law and 1: Newton from the right end ln(trial / 3G) falls onto the root without
leaving the bracket, whatever the exponents.  Where a law is not convex the bracket guards.

Hardening goes by a strain h.  Accumulated: h = R (p + dp), with R = 1 / (1 + dt/tau) what recovery
leaves.  Signed: the viscoplastic strain tensor E is the state, e = R sqrt(2/3) E:n its part along
the flow n; h = max(e + R dp, 0) where hardening multiplies, and where it adds (austenite) it is the
back stress X along E, from which the trial deviator is then counted: the same scalar problem with
the trial |s - X|.  n is that of the trial, so that e is known, but it turns with the strain
increment: the tangent gains a term along n (x) E, `by_old` being the derivative of q by e.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

# Columns of the coefficients that all laws share; those of a law follow.
SHEAR, BULK, YOUNG, CARRY_DEVIATOR, CARRY_MEAN, SHARE, FRESH, RECOVERY, OWN = range(9)
# Laws.
ELASTIC, PLASTIC, CREEP, CURVE_GIVEN, CURVE_AUTOMATIC, STEEL = range(6)
# Own columns of each law, counted from OWN.
LN_LEVEL, SOFTENING, RATE_EXPONENT, STRAIN_EXPONENT, YIELD, LARGEST_STRAIN = range(OWN, OWN + 6)
YIELD_STRESS = OWN
LN_FACTOR, EXPONENT = OWN, OWN + 1
(HARDENING, HARDENING_EXPONENT, LN_GAMMA_RATE, GAMMA_EXPONENT,
 LN_DELTA_LEVEL, DELTA_HARDENING, DELTA_EXPONENT, DELTA_WEIGHT) = range(OWN, OWN + 8)  # fmt: skip
DELTA_STRAIN_SCALE = 1000.0  # in (1 + 1000 p)^m of the delta-ferrite law

LN_2 = math.log(2.0)
LN_SQRT3 = 0.5 * math.log(3.0)
HUGE_LN = 600.0  # logarithms are cut here, so that no exponential overflows
TINY_LN = -690.0  # a viscoplastic strain below exp of this is none
NOTHING = -1e300  # stands for the logarithm of zero
ROUNDING = 1e-14
LAST_STEP = 1e-8  # of a Newton that converges quadratically: what follows is rounding
STEPS = 200  # of a safeguarded Newton; convex problems take about 6


def compiled(function: Callable[..., Any]) -> Any:
    """Compile with numba, keeping the result on disk where a folder for it can be written.

    Divisions follow IEEE instead of raising; fastmath stays off, since it would let the compiler
    assume that no NaN and no infinity exists, which the tests must be able to see.
    """
    options = {"nogil": True, "error_model": "numpy"}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no place for its cache
        return numba.njit(**options)(function)


@compiled
def _exp(x):  # type: ignore[no-untyped-def]
    return math.exp(min(x, HUGE_LN))


@compiled
def _back_stress(c, old, aside, gain):  # type: ignore[no-untyped-def]
    """Change of austenite's back stress along the flow, by a gain in strain along it.

    X = f1 r^f2 along E, r its equivalent strain with the parts `old` along the flow and `aside`
    across it: along the flow f1 r^(f2-1) (old + gain).

    Returns:
        The change, its derivative by the gain, and by `old`.
    """
    m, u = c[HARDENING_EXPONENT] - 1.0, old + gain
    before, r = math.hypot(old, aside), max(math.hypot(u, aside), 1e-300)
    level, share = c[HARDENING] * r**m, u / r
    by_gain = level * (1.0 + m * share * share)
    if before == 0.0:
        return level * u, by_gain, 0.0
    level_old = c[HARDENING] * before**m
    grown = level - level_old
    if r > 0.5 * before:  # a difference of nearly equal numbers
        part = (2.0 * (old / before) + gain / before) * (gain / before)
        grown = level_old * math.expm1(0.5 * m * math.log1p(part))
    # The flow turns against a strain tensor that stays: r by `old` is gain / r.
    return level * gain + grown * old, by_gain, grown + level * m * share * gain / r


@compiled
def _steel_flow(c, old, aside, left, signed, z, increment, ln_dt):  # type: ignore[no-untyped-def]
    """Kozlowski III weighted with the delta-ferrite law: S - S0, derivatives by z and by `old`."""
    stress, slope, by_old = 0.0, 0.0, 0.0
    weight, gain = c[DELTA_WEIGHT], left * increment
    if weight < 1.0:
        m = c[HARDENING_EXPONENT]
        if signed:
            back, by_gain, by_old = _back_stress(c, old, aside, gain)
            back_slope = by_gain * gain
            by_old *= 1.0 - weight
        elif old > 0.0:
            x = gain / old
            back = c[HARDENING] * old**m * math.expm1(m * math.log1p(x))
            back_slope = c[HARDENING] * (old + gain) ** m * m * x / (1.0 + x)
        else:
            back = c[HARDENING] * _exp(m * (z + math.log(left)))
            back_slope = m * back
        viscous = _exp((z - ln_dt - c[LN_GAMMA_RATE]) / c[GAMMA_EXPONENT])
        stress += (1.0 - weight) * (back + viscous)
        slope += (1.0 - weight) * (back_slope + viscous / c[GAMMA_EXPONENT])
    if weight > 0.0:
        n, m = c[DELTA_EXPONENT], c[DELTA_HARDENING]
        strain, hardens = old + gain, 1.0
        if strain < 0.0:
            strain, hardens = 0.0, 0.0
        hard = 1.0 + DELTA_STRAIN_SCALE * strain
        delta = _exp(c[LN_DELTA_LEVEL] + m * math.log(hard) + (z - ln_dt) / n)
        stress += weight * delta
        slope += weight * delta * (1.0 / n + hardens * m * DELTA_STRAIN_SCALE * gain / hard)
        by_old += weight * delta * hardens * m * DELTA_STRAIN_SCALE / hard
    return stress, slope, by_old


@compiled
def _strain_factor(c, strain):  # type: ignore[no-untyped-def]
    """Logarithm of exp(-p1 e) e^p4 and its derivative by e; constant beyond the largest strain."""
    e = min(max(strain, 1e-300), c[LARGEST_STRAIN])
    slope = c[STRAIN_EXPONENT] / e - c[SOFTENING]
    if strain >= c[LARGEST_STRAIN]:
        slope = 0.0
    return c[STRAIN_EXPONENT] * math.log(e) - c[SOFTENING] * e, slope


@compiled
def _hardening(old, gain):  # type: ignore[no-untyped-def]
    """Strain that hardens, and its derivative by a gain: none while flow goes back."""
    strain = old + gain
    if strain < 0.0:
        return 0.0, 0.0
    return strain, 1.0


@compiled
def _flow(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, trial, z, increment, ln_dt
):
    """Flow stress above S0 at dp = exp(z), and its derivatives by z, by trial and by `old`."""
    if kind == CREEP:
        stress = _exp((z - ln_dt - c[LN_FACTOR]) / c[EXPONENT])
        return stress, stress / c[EXPONENT], 0.0, 0.0
    if kind == STEEL:
        stress, slope, by_old = _steel_flow(c, old, aside, left, signed, z, increment, ln_dt)
        return stress, slope, 0.0, by_old
    young, shear3 = c[YOUNG], 3.0 * c[SHEAR]
    hardening, hardens = _hardening(old, left * increment)
    strain = hardening + (trial - shear3 * increment) / young
    ln_factor, by_strain = _strain_factor(c, strain)
    rate = c[RATE_EXPONENT]
    stress = _exp(c[LN_LEVEL] + ln_factor + rate * (z - ln_dt + LN_SQRT3))
    slope = stress * (rate + by_strain * (hardens * left - shear3 / young) * increment)
    return stress, slope, stress * by_strain / young, stress * by_strain * hardens


@compiled
def _return(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, trial, threshold, ln_dt
):
    """Solve the scalar problem of a law whose flow stress depends on dp.

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
    for _ in range(STEPS):
        increment = math.exp(z)
        flow, slope, _by, _old = _flow(
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
        if abs(step) <= LAST_STEP:
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
    flow, slope, by_trial, by_old = _flow(
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

    The logarithm of the left side is convex in ln r: Newton from the right end is monotone, from a
    guess on the left it is after one step.
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
    """Flow stress with the remembered rate at dp, derivatives by dp, trial and old, and ln rate.

    `drive` is what the trial stress exceeds the carried one by. A point that carries stress but has
    no rate yet, as one that has just solidified, remembers the rate at which the curve passes
    through that stress: were it to take the rate of the step, a small load would make its flow
    stress fall faster than flow unloads it, and the answer would jump.
    """
    shear3, young, exponent = 3.0 * c[SHEAR], c[YOUNG], c[RATE_EXPONENT]
    gain = drive - (shear3 - young) * increment  # E times the increment of e
    loads = gain > 0.0
    gain = max(gain, 0.0)
    total = carried + gain
    y, by_total = _remembered(ln_carried, ln_old, exponent, ln_stiff, total, guess)
    hardening, hardens = _hardening(old, left * increment)
    strain = hardening + (trial - shear3 * increment) / young
    ln_factor, by_strain = _strain_factor(c, strain)
    if y == NOTHING:
        return 0.0, 0.0, 0.0, 0.0, y
    stress = _exp(c[LN_LEVEL] + ln_factor + exponent * (y + LN_SQRT3))
    by_rate = exponent * by_total if loads else 0.0
    by_increment = by_strain * (hardens * left - shear3 / young) - by_rate * (shear3 - young)
    by_trial, by_old = by_strain / young + by_rate, by_strain * hardens
    return stress, stress * by_increment, stress * by_trial, stress * by_old, y


@compiled
def _return_to_curve(  # type: ignore[no-untyped-def]
    c, old, left, before, rate_old, trial, carried, dt
):
    """Law (163) with the yield limit found automatically, see `NortonHoff`.

    `before` is the strain that had hardened the carried stress at the start of the step.

    Returns:
        dp, equivalent stress q, dq / d trial, dq / d old, and the rate the curve was read at.
    """
    shear3, young, exponent = 3.0 * c[SHEAR], c[YOUNG], c[RATE_EXPONENT]
    drive = trial - carried
    ln_stiff = math.log(young) + math.log(dt)
    ln_carried, ln_old = NOTHING, NOTHING
    if carried > 0.0:
        ln_carried = math.log(carried)
        # The rate at which the curve passes through the stress there is; less cannot be remembered.
        ln_factor, _by = _strain_factor(c, before + carried / young)
        ln_old = (ln_carried - c[LN_LEVEL] - ln_factor) / exponent - LN_SQRT3
        if rate_old > 0.0:
            ln_old = max(ln_old, math.log(rate_old))
    args = (ln_carried, ln_old, ln_stiff)
    stress, by_increment, by_trial, by_old, y = _curve_stress(
        c, old, left, trial, drive, carried, 0.0, NOTHING, *args
    )
    if trial <= stress * (1.0 + ROUNDING) or trial <= 0.0:
        if drive < 0.0:  # elastic unloading is as fast as loading back
            y = _curve_stress(c, old, left, trial, -drive, carried, 0.0, NOTHING, *args)[4]
        return 0.0, trial, 1.0, 0.0, _exp(y)
    low, high = 0.0, trial / shear3
    increment = min((trial - stress) / shear3, high)
    for _ in range(STEPS):
        stress, by_increment, by_trial, by_old, y = _curve_stress(
            c, old, left, trial, drive, carried, increment, y, *args
        )
        excess = trial - shear3 * increment - stress
        if excess > 0.0:
            low = increment
        else:
            high = increment
        slope = shear3 + by_increment
        step = excess / slope if slope > 0.0 else math.inf
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
    return increment, found, kept, by_old, _exp(y)


@compiled
def _radial(  # type: ignore[no-untyped-def]
    kind, c, old, aside, left, signed, before, rate_old, trial, carried, dt
):
    """Solve one point: equivalent stress, dp, dq / d trial, dq / d old, remembered rate."""
    increment, stress, kept, by_old, rate = 0.0, trial, 1.0, 0.0, 0.0
    strain = old, aside, left, signed
    if kind == CURVE_AUTOMATIC:
        increment, stress, kept, by_old, rate = _return_to_curve(
            c, old, left, before, rate_old, trial, carried, dt
        )
    elif kind == PLASTIC:
        if trial > c[YIELD_STRESS]:
            stress, kept = c[YIELD_STRESS], 0.0
            increment = (trial - stress) / (3.0 * c[SHEAR])
    elif kind == CURVE_GIVEN:
        if trial > c[YIELD]:
            increment, stress, kept, by_old = _return(kind, c, *strain, trial, 0.0, math.log(dt))
            if stress < c[YIELD]:
                stress, kept, by_old = c[YIELD], 0.0, 0.0
                increment = (trial - stress) / (3.0 * c[SHEAR])
    elif kind in (STEEL, CREEP):
        threshold = 0.0
        if kind == STEEL and old > 0.0 and not signed:
            threshold = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * old ** c[HARDENING_EXPONENT]
        if trial > threshold * (1.0 + ROUNDING) and trial > 1e-290:
            increment, stress, kept, by_old = _return(
                kind, c, *strain, trial, threshold, math.log(dt)
            )
    return stress, increment, kept, by_old, rate


@compiled
def _tensor(state_old, left, tensor):  # type: ignore[no-untyped-def]
    """Viscoplastic strain of the state times what recovery leaves of it; its equivalent strain."""
    tensor[0], tensor[1], tensor[3] = left * state_old[0], left * state_old[1], left * state_old[2]
    tensor[2] = -(tensor[0] + tensor[1])
    square = 0.0
    for k in range(4):
        square += tensor[k] ** 2
    return math.sqrt(2.0 / 3.0 * square)


@compiled
def _across(tensor, normal):  # type: ignore[no-untyped-def]
    """Part of the strain tensor along the flow, as equivalent strain; leaves what is across it.

    Returns:
        The part along the flow, and the equivalent strain of what is across.
    """
    along, square = 0.0, 0.0
    for k in range(4):
        along += tensor[k] * normal[k]
    for k in range(4):
        tensor[k] -= along * normal[k]
        square += tensor[k] ** 2
    return math.sqrt(2.0 / 3.0) * along, math.sqrt(2.0 / 3.0 * square)


@compiled
def _fill_tangent(tangent, normal, shear2, bulk, scale, kept):  # type: ignore[no-untyped-def]
    """2G (scale P + (kept - scale) n n) + K 1 1, with P the deviatoric projector."""
    for k in range(4):
        for m in range(4):
            part = (kept - scale) * normal[k] * normal[m]
            if k == m:
                part += scale
            if k < 3 and m < 3:
                part -= scale / 3.0
            part *= shear2
            if k < 3 and m < 3:
                part += bulk
            tangent[k, m] = part


@compiled
def _turn_tangent(tangent, normal, across, factor):  # type: ignore[no-untyped-def]
    """What the tangent has of the flow's turning against the strain tensor."""
    for k in range(4):
        for m in range(4):
            tangent[k, m] += factor * normal[k] * across[m]


@compiled
def _set_back(kind, c, strain, tensor, back):  # type: ignore[no-untyped-def]
    """Back stress of a point along its strain tensor, of the equivalent `strain`."""
    level = 0.0
    if kind == STEEL and strain > 0.0:
        # sqrt(2/3) of the equivalent stress is the length, sqrt(3/2) of the strain the tensor's.
        level = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * strain ** c[HARDENING_EXPONENT]
        level *= 2.0 / 3.0 / strain
    for k in range(4):
        back[k] = level * tensor[k]


@compiled
def _hardened(tensor, carried_part, carried):  # type: ignore[no-untyped-def]
    """Strain that has hardened the flow along the carried stress."""
    along = 0.0
    for k in range(4):
        along += tensor[k] * carried_part[k]
    return max(along / carried, 0.0) if carried > 0.0 else 0.0


@compiled
def _trial(c, strain, thermal, stress_old, back, normal, carried_part):  # type: ignore[no-untyped-def]
    """Trial stress of a point; writes its direction and the deviator carried along.

    Returns:
        Mean stress, length of the deviator less `back`, and the carried equivalent stress.
    """
    share, shear2 = c[SHARE], 2.0 * c[SHEAR]
    mean_old = (stress_old[0] + stress_old[1] + stress_old[2]) / 3.0
    mean_strain = share * (strain[0] + strain[1] + strain[2]) / 3.0
    mean = c[CARRY_MEAN] * mean_old + 3.0 * c[BULK] * (mean_strain - thermal)
    square, square_old = 0.0, 0.0
    for k in range(4):
        deviator_old = stress_old[k] - (mean_old if k < 3 else 0.0)
        deviator = share * strain[k] - (mean_strain if k < 3 else 0.0)
        carried_part[k] = c[CARRY_DEVIATOR] * deviator_old
        normal[k] = carried_part[k] + shear2 * deviator - back[k]
        square += normal[k] ** 2
        square_old += carried_part[k] ** 2
    length = math.sqrt(square)
    if length > 0.0:
        for k in range(4):
            normal[k] /= length
    return mean, length, math.sqrt(1.5 * square_old)


@compiled
def _keep_tensor(  # type: ignore[no-untyped-def]
    kind, c, tensor, normal, old, aside, gain, state
):
    """Write the new strain tensor of a point.

    Returns:
        What of the flow stress its back stress has gained.
    """
    along = math.sqrt(1.5) * (old + gain)
    state[0] = tensor[0] + along * normal[0]
    state[1] = tensor[1] + along * normal[1]
    state[2] = tensor[3] + along * normal[3]
    if kind == STEEL and c[DELTA_WEIGHT] < 1.0 and gain > 0.0:
        return (1.0 - c[DELTA_WEIGHT]) * _back_stress(c, old, aside, gain)[0]
    return 0.0


@compiled
def _fill_stress(stress, length, normal, back, mean):  # type: ignore[no-untyped-def]
    """Write the stress of a point: what is left of its deviator, back stress and mean stress."""
    for k in range(4):
        stress[k] = length * normal[k] + back[k] + (mean if k < 3 else 0.0)


@compiled
def integrate_points(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, strain, thermal, stress_old, state_old, dt,
    stress, tangent, state, dissipation, flows,
):  # fmt: skip
    """Integrate all points over a step.

    Args:
        kind: One of the laws above.
        signed: Whether hardening goes by the viscoplastic strain tensor; the first three columns of
            the state are then its xx, yy and sqrt(2) xy.
        coefficients: (n, columns).
        strain: Total strain increments (n, 4).
        thermal: Isotropic thermal strain increments (n,).
        stress_old: (n, 4), Pa.
        state_old: (n, states).
        dt: s.
        stress: Out, (n, 4), Pa.
        tangent: Out, (n, 4, 4), d stress / d strain, Pa.
        state: Out, (n, states).
        dissipation: Out, viscoplastic work (n,), J/m3, but for what a back stress stores.
        flows: Out, whether the point flows (n,).
    """
    normal, tensor, back, carried_part = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    memory = 3 if signed else 1  # column of the remembered rate
    for i in range(strain.shape[0]):
        c = coefficients[i]
        share, shear2 = c[SHARE], 2.0 * c[SHEAR]
        time = share * dt
        left = 1.0 / (1.0 + time * c[RECOVERY])
        hardens = kind != ELASTIC and c[FRESH] == 0.0
        if signed:
            _set_back(kind, c, _tensor(state_old[i], left * hardens, tensor), tensor, back)
        mean, length, carried = _trial(
            c, strain[i], thermal[i], stress_old[i], back, normal, carried_part
        )
        trial, aside = math.sqrt(1.5) * length, 0.0
        if signed:
            before = _hardened(tensor, carried_part, carried) / left
            old, aside = _across(tensor, normal)
        else:
            before = state_old[i, 0] if hardens else 0.0
            old = left * before
        rate_old = state_old[i, memory] if kind == CURVE_AUTOMATIC and hardens else 0.0
        equivalent, increment, kept, by_old, rate = _radial(
            kind, c, old, aside, left, signed, before, rate_old, trial, carried, time
        )
        scale, gain, stored = equivalent / trial if increment > 0.0 else 1.0, left * increment, 0.0
        flows[i] = increment > 0.0
        _fill_stress(stress[i], scale * length, normal, back, mean)
        _fill_tangent(tangent[i], normal, shear2 * share, c[BULK] * share, scale, kept)
        if signed:
            stored = _keep_tensor(kind, c, tensor, normal, old, aside, gain, state[i])
            if increment > 0.0:
                factor = 2.0 / 3.0 * by_old * shear2 * share / length
                _turn_tangent(tangent[i], normal, tensor, factor)
        elif kind != ELASTIC:
            state[i, 0] = old + gain
        if kind == CURVE_AUTOMATIC:
            state[i, memory] = rate
        dissipation[i] = max(equivalent - stored, 0.0) * increment
