"""How the answer of a point changes with what it is given, for laws whose hardening is a number.

At the solution q = trial - 3G dp is the flow stress S(dp; trial, old, what else is given), so

    (dS/d dp + 3G) d dp = (1 - dS/d trial) d trial - dS/d old d old - d S - 3 dG dp

by the implicit function theorem, with dS at held dp (`partials`).  The trial deviator gives the
direction: it turns, and its length is that of `trial`.
"""

from __future__ import annotations

import math

import numpy as np

from castfem.base.compiled import compiled, outermost
from castfem.physics.constitutive.kernel.constants import (
    BULK,
    CARRY_DEVIATOR,
    CARRY_MEAN,
    COLUMNS,
    CURVE_AUTOMATIC,
    ELASTIC,
    FRESH,
    OWN,
    RECOVERY,
    SEEK,
    SHARE,
    SHEAR,
    YOUNG,
)
from castfem.physics.constitutive.kernel.partials import (
    BEFORE,
    CARRIED_ALONG,
    GIVEN,
    LEFT,
    LN_STEP,
    RATE,
    RATE_BEFORE,
    STRESS,
    flow_partials,
    rate_partials,
)
from castfem.physics.constitutive.kernel.point import respond
from castfem.physics.constitutive.kernel.tensors import CARRIED, FLOW

TO_EQUIVALENT = math.sqrt(1.5)  # from the length of a deviator
CLEAR = 1e-4  # of the strain there is: an increment that is a difference of strains to ten digits


@compiled
def _change_trial(  # type: ignore[no-untyped-def]
    c, i, j, strain, thermal, stress_old, d_c, d_strain, d_thermal, d_stress_old, vectors, turned
):
    """How the trial stress of a point changes in one way; writes the change of its deviator.

    Returns:
        Changes of the mean stress and of the length of the deviator; change of the carried
        deviator times that deviator.
    """
    share, shear2 = c[SHARE], 2.0 * c[SHEAR]
    mean_old = (stress_old[i, 0] + stress_old[i, 1] + stress_old[i, 2]) / 3.0
    d_mean_old = (d_stress_old[j, i, 0] + d_stress_old[j, i, 1] + d_stress_old[j, i, 2]) / 3.0
    mean = (strain[i, 0] + strain[i, 1] + strain[i, 2]) / 3.0
    d_mean = (d_strain[j, i, 0] + d_strain[j, i, 1] + d_strain[j, i, 2]) / 3.0
    by_strain = 2.0 * d_c[SHEAR] * share + shear2 * d_c[SHARE]
    length, carried = 0.0, 0.0
    for k in range(4):
        unit = 1.0 if k < 3 else 0.0
        d_carried = d_c[CARRY_DEVIATOR] * (stress_old[i, k] - unit * mean_old)
        d_carried += c[CARRY_DEVIATOR] * (d_stress_old[j, i, k] - unit * d_mean_old)
        turned[k] = d_carried + by_strain * (strain[i, k] - unit * mean)
        turned[k] += shear2 * share * (d_strain[j, i, k] - unit * d_mean)
        length += turned[k] * vectors[FLOW, k]
        carried += d_carried * vectors[CARRIED, k]
    stretch = share * mean - thermal[i]
    d_stretch = d_c[SHARE] * mean + share * d_mean - d_thermal[j, i]
    d_pressure = d_c[CARRY_MEAN] * mean_old + c[CARRY_MEAN] * d_mean_old
    d_pressure += 3.0 * (d_c[BULK] * stretch + c[BULK] * d_stretch)
    return d_pressure, length, carried


@compiled
def _linearise(  # type: ignore[no-untyped-def]
    kind, c, i, state_old, dt, vectors, increment, stress, length, rate, by
):
    """Fill the partial derivatives of a point.

    Returns:
        What the point has begun with: whether it hardens, its time, what recovery leaves of strain,
        that strain, and the stress that is carried along. And slopes: dS/d dp, dS/d trial,
        dS/d old, and d ln rate/d dp, d ln rate/d trial.
    """
    by[:] = 0.0
    hardens = 1.0 if kind != ELASTIC and c[FRESH] == 0.0 else 0.0
    time = c[SHARE] * dt
    left = 1.0 / (1.0 + time * c[RECOVERY])
    before = state_old[i, 0] if hardens > 0.0 else 0.0
    carried, trial = 0.0, TO_EQUIVALENT * length
    for k in range(4):
        carried += vectors[CARRIED, k] ** 2
    carried = TO_EQUIVALENT * math.sqrt(carried)
    by_rate, by_stress = (0.0, 0.0), (0.0, 0.0, 0.0)
    if kind == CURVE_AUTOMATIC:
        rate_before = state_old[i, 1] if hardens > 0.0 else 0.0
        by_rate = rate_partials(c, trial, carried, before, rate_before, increment, rate, time, by)
    if increment > 0.0:
        by_stress = flow_partials(
            kind, c, stress, left * before, left, trial, increment, math.log(time), rate, by_rate,
            by,
        )  # fmt: skip
    return (hardens, time, left, before, carried), (*by_stress, *by_rate)


@compiled
def _give(  # type: ignore[no-untyped-def]
    kind, c, d_c, begun, d_state_old, i, j, d_carried, dt, d_dt, given
):
    """Write all that a point is given more in one way, see `partials`.

    Returns:
        The change of the strain that hardens before the increment.
    """
    hardens, time, left, before, carried = begun
    for m in range(OWN, len(d_c)):
        given[m] = d_c[m]
    d_time = d_c[SHARE] * dt + c[SHARE] * d_dt
    d_left = -left * left * (d_time * c[RECOVERY] + time * d_c[RECOVERY])
    given[SHEAR], given[YOUNG] = d_c[SHEAR], d_c[YOUNG]
    given[LEFT], given[LN_STEP] = d_left, d_time / time
    given[CARRIED_ALONG] = 1.5 * d_carried / carried if carried > 0.0 else 0.0
    given[BEFORE] = hardens * d_state_old[j, i, 0] if kind != ELASTIC else 0.0
    given[RATE_BEFORE] = hardens * d_state_old[j, i, 1] if kind == CURVE_AUTOMATIC else 0.0
    return left * given[BEFORE] + before * d_left


@compiled
def _sum(by, row, given, columns):  # type: ignore[no-untyped-def]
    """What changes in one way by all that is given, dp and the trial stress held."""
    found = by[row, SHEAR] * given[SHEAR] + by[row, YOUNG] * given[YOUNG]
    for m in range(OWN, columns):
        found += by[row, m] * given[m]
    for m in range(COLUMNS, GIVEN):
        found += by[row, m] * given[m]
    return found


@compiled
def _change_flow(  # type: ignore[no-untyped-def]
    shear, d_shear, increment, d_trial, d_flow, by_increment, by_trial
):
    """Changes of the stress and of dp of a point that flows, by the implicit function theorem."""
    shear3, softer = 3.0 * shear, 3.0 * d_shear * increment
    whole = by_increment + shear3
    if whole <= 0.0:
        return 0.0, 0.0
    # Of a law that hardly knows the rate dS/d dp may be all but as large as numbers are.
    hard, soft = by_increment / whole, shear3 / whole
    d_stress = (hard + soft * by_trial) * d_trial + soft * d_flow - hard * softer
    return d_stress, ((1.0 - by_trial) * d_trial - d_flow - softer) / whole


@compiled
def _known(kind, c, i, state_old, dt, state_now, flows):  # type: ignore[no-untyped-def]
    """What an answer that is there tells of dp and of the remembered rate, see `constants.SEEK`."""
    if kind == ELASTIC or not flows[i]:
        return 0.0, 0.0
    before = state_old[i, 0] if c[FRESH] == 0.0 else 0.0
    slower = 1.0 + c[SHARE] * dt * c[RECOVERY]
    increment = slower * state_now[i, 0] - before
    if increment < CLEAR * before:  # a difference of nearly equal numbers
        return SEEK, 0.0
    return increment, state_now[i, 1] if kind == CURVE_AUTOMATIC else 0.0


@outermost
def differentiate_points(  # type: ignore[no-untyped-def]
    kind, coefficients, strain, thermal, stress_old, state_old, dt, state_now, flows,
    d_coefficients, d_strain, d_thermal, d_stress_old, d_state_old, d_dt,
    d_stress, d_state, d_dissipation, sources=None,
):  # fmt: skip
    """Derivatives of what `loop.integrate_points` writes, as what it is given changes in some ways.

    What flows goes on flowing.

    Args:
        kind: One of the laws of `constants`.
        coefficients: (n, columns).
        strain: Total strain increments (n, 4).
        thermal: Isotropic thermal strain increments (n,).
        stress_old: (n, 4), Pa.
        state_old: (n, states).
        dt: s.
        state_now: What `integrate_points` has written of the state (n, states).
        flows: Likewise (n,).
        d_coefficients: Change in each way (k, n, columns).
        d_strain: (k, n, 4).
        d_thermal: (k, n).
        d_stress_old: (k, n, 4), Pa.
        d_state_old: (k, n, states).
        d_dt: (k,), s.
        d_stress: Out, (k, n, 4), Pa.
        d_state: Out, (k, n, states).
        d_dissipation: Out, (k, n), J/m3.
        sources: Not to be given.
    """
    vectors, turned = np.zeros((4, 4)), np.zeros(4)
    given, by = np.zeros(GIVEN), np.zeros((2, GIVEN))
    stress, state = np.zeros((1, 4)), np.zeros((1, state_old.shape[1]))
    columns = coefficients.shape[1]
    for i in range(strain.shape[0]):
        c = coefficients[i]
        near, near_rate = _known(kind, c, i, state_old, dt, state_now, flows)
        increment, scale, _kept, _by_old, length, rate, _work = respond(
            kind, False, c, i, strain, thermal[i], stress_old, state_old, dt, near, near_rate,
            vectors, stress, state, 0,
        )  # fmt: skip
        left_over = scale * TO_EQUIVALENT * length
        begun, slopes = _linearise(
            kind, c, i, state_old, dt, vectors, increment, left_over, length, rate, by
        )
        for j in range(len(d_dt)):
            d_c = d_coefficients[j, i]
            d_mean, d_length, d_carried = _change_trial(
                c, i, j, strain, thermal, stress_old, d_c, d_strain, d_thermal, d_stress_old,
                vectors, turned,
            )  # fmt: skip
            d_old = _give(kind, c, d_c, begun, d_state_old, i, j, d_carried, dt, d_dt[j], given)
            d_trial = TO_EQUIVALENT * d_length
            d_equivalent, d_increment = d_trial, 0.0
            if increment > 0.0:
                d_flow = slopes[2] * d_old + _sum(by, STRESS, given, columns)
                d_equivalent, d_increment = _change_flow(
                    c[SHEAR], d_c[SHEAR], increment, d_trial, d_flow, slopes[0], slopes[1]
                )
            along = d_equivalent / TO_EQUIVALENT - scale * d_length
            for k in range(4):
                pressure = d_mean if k < 3 else 0.0
                d_stress[j, i, k] = scale * turned[k] + along * vectors[FLOW, k] + pressure
            d_dissipation[j, i] = d_equivalent * increment + left_over * d_increment
            if kind != ELASTIC:
                d_state[j, i, 0] = d_old + given[LEFT] * increment + begun[2] * d_increment
            if kind == CURVE_AUTOMATIC:
                d_ln_rate = _sum(by, RATE, given, columns)
                d_ln_rate += slopes[3] * d_increment + slopes[4] * d_trial
                d_state[j, i, 1] = rate * d_ln_rate
