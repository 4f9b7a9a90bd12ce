"""One quadrature point over a step: from its trial stress to new stress, state and tangent.

Mandel vectors are [xx, yy, zz, sqrt(2) xy]; the state of a signed law is its viscoplastic strain
tensor E with xx, yy and sqrt(2) xy. Arrays over points are passed with a row number, since
extracting the row costs numba as much as the work done on it.
"""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    BULK,
    CARRY_DEVIATOR,
    CARRY_MEAN,
    CURVE_AUTOMATIC,
    DELTA_WEIGHT,
    ELASTIC,
    FRESH,
    HARDENING,
    HARDENING_EXPONENT,
    RECOVERY,
    SHARE,
    SHEAR,
    STEEL,
)
from castfem.physics.constitutive.kernel.flow_stress import back_stress_gain
from castfem.physics.constitutive.kernel.radial_return import solve_point

FLOW, ACROSS, BACK, CARRIED = range(4)
"""Rows of the vectors of a point: direction of the flow; strain tensor, then its part across the
flow; back stress; deviator carried along."""


@compiled
def recovered_strain(state_old, i, left, vectors):  # type: ignore[no-untyped-def]
    """Viscoplastic strain of the state after recovery; returns its equivalent strain."""
    vectors[ACROSS, 0], vectors[ACROSS, 1] = left * state_old[i, 0], left * state_old[i, 1]
    vectors[ACROSS, 3] = left * state_old[i, 2]
    vectors[ACROSS, 2] = -(vectors[ACROSS, 0] + vectors[ACROSS, 1])
    square = 0.0
    for k in range(4):
        square += vectors[ACROSS, k] ** 2
    return math.sqrt(2.0 / 3.0 * square)


@compiled
def split_along_flow(vectors):  # type: ignore[no-untyped-def]
    """Part of the strain tensor along the flow, as equivalent strain; keeps the part across it.

    Returns:
        The part along the flow, and the equivalent strain of the part across it.
    """
    along, square = 0.0, 0.0
    for k in range(4):
        along += vectors[ACROSS, k] * vectors[FLOW, k]
    for k in range(4):
        vectors[ACROSS, k] -= along * vectors[FLOW, k]
        square += vectors[ACROSS, k] ** 2
    return math.sqrt(2.0 / 3.0) * along, math.sqrt(2.0 / 3.0 * square)


@compiled
def set_back_stress(kind, c, strain, vectors):  # type: ignore[no-untyped-def]
    """Set the back stress of a point along its strain tensor, with equivalent `strain`."""
    level = 0.0
    if kind == STEEL and strain > 0.0:
        # The length is sqrt(2/3) of the equivalent stress, and sqrt(3/2) of the strain that of the
        # tensor.
        level = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * strain ** c[HARDENING_EXPONENT]
        level *= 2.0 / 3.0 / strain
    for k in range(4):
        vectors[BACK, k] = level * vectors[ACROSS, k]


@compiled
def hardened_strain(vectors, carried):  # type: ignore[no-untyped-def]
    """Hardening strain along the carried stress."""
    along = 0.0
    for k in range(4):
        along += vectors[ACROSS, k] * vectors[CARRIED, k]
    return max(along / carried, 0.0) if carried > 0.0 else 0.0


@compiled
def trial_stress(c, i, strain, thermal, stress_old, vectors):  # type: ignore[no-untyped-def]
    """Compute the trial stress of a point; writes its direction and the deviator carried along.

    Returns:
        Mean stress, length of the deviator minus `back`, and the carried equivalent stress.
    """
    share, shear2 = c[SHARE], 2.0 * c[SHEAR]
    mean_old = (stress_old[i, 0] + stress_old[i, 1] + stress_old[i, 2]) / 3.0
    mean_strain = share * (strain[i, 0] + strain[i, 1] + strain[i, 2]) / 3.0
    mean = c[CARRY_MEAN] * mean_old + 3.0 * c[BULK] * (mean_strain - thermal)
    square, square_old = 0.0, 0.0
    for k in range(4):
        deviator_old = stress_old[i, k] - (mean_old if k < 3 else 0.0)
        deviator = share * strain[i, k] - (mean_strain if k < 3 else 0.0)
        vectors[CARRIED, k] = c[CARRY_DEVIATOR] * deviator_old
        vectors[FLOW, k] = vectors[CARRIED, k] + shear2 * deviator - vectors[BACK, k]
        square += vectors[FLOW, k] ** 2
        square_old += vectors[CARRIED, k] ** 2
    length = math.sqrt(square)
    if length > 0.0:
        for k in range(4):
            vectors[FLOW, k] /= length
    return mean, length, math.sqrt(1.5 * square_old)


@compiled
def keep_strain(  # type: ignore[no-untyped-def]
    kind, c, vectors, old, aside, gain, state, row
):
    """Write the new strain tensor of a point.

    Returns:
        Gain of the back stress as a part of the flow stress.
    """
    along = math.sqrt(1.5) * (old + gain)
    state[row, 0] = vectors[ACROSS, 0] + along * vectors[FLOW, 0]
    state[row, 1] = vectors[ACROSS, 1] + along * vectors[FLOW, 1]
    state[row, 2] = vectors[ACROSS, 3] + along * vectors[FLOW, 3]
    if kind == STEEL and c[DELTA_WEIGHT] < 1.0 and gain > 0.0:
        return (1.0 - c[DELTA_WEIGHT]) * back_stress_gain(c, old, aside, gain)[0]
    return 0.0


@compiled
def fill_stress(stress, row, length, vectors, mean):  # type: ignore[no-untyped-def]
    """Write the stress of a point: remaining deviator, back stress and mean stress."""
    for k in range(4):
        stress[row, k] = length * vectors[FLOW, k] + vectors[BACK, k] + (mean if k < 3 else 0.0)


@compiled
def fill_tangent(tangent, i, vectors, shear2, bulk, scale, kept):  # type: ignore[no-untyped-def]
    """2G (scale P + (kept - scale) n n) + K 1 1, with P the deviatoric projector."""
    for k in range(4):
        for m in range(4):
            part = (kept - scale) * vectors[FLOW, k] * vectors[FLOW, m]
            if k == m:
                part += scale
            if k < 3 and m < 3:
                part -= scale / 3.0
            part *= shear2
            if k < 3 and m < 3:
                part += bulk
            tangent[i, k, m] = part


@compiled
def turn_tangent(tangent, i, vectors, factor):  # type: ignore[no-untyped-def]
    """Add the term of the tangent from the rotation of the flow relative to the strain tensor."""
    for k in range(4):
        for m in range(4):
            tangent[i, k, m] += factor * vectors[FLOW, k] * vectors[ACROSS, m]


@compiled
def respond(  # type: ignore[no-untyped-def]
    kind, signed, c, i, strain, thermal, stress_old, state_old, dt, near, near_rate,
    vectors, stress, state, row,
):  # fmt: skip
    """Integrate one point; see `calling.integrate_points`.

    Args:
        kind: Number of a law in `constants`.
        signed: Whether its state is a tensor.
        c: Coefficients of the point.
        i: Row of the point in `strain`, `stress_old` and `state_old`.
        strain: Total strain increments (n, 4).
        thermal: Isotropic thermal part of that of the point.
        stress_old: Stresses at the start (n, 4), Pa.
        state_old: States at the start (n, states).
        dt: Time step, s.
        near: Known value near dp, see `constants.SEEK`.
        near_rate: Rate variable at that value.
        vectors: Output (4, 4): direction of the trial deviator, part of a signed law's strain
            across the flow, back stress, deviator carried along (Pa). The row of the back stress is
            0 for laws without one.
        stress: Output (m, 4), Pa.
        state: Output (m, states).
        row: Row of the point in the output.

    Returns:
        dp, equivalent stress over that of the trial, dq / d trial, dq / d old, length of the trial
        deviator (Pa), rate variable (1/s), and viscoplastic work (J/m3).
    """
    memory = 3 if signed else 1  # column of the rate variable
    time = c[SHARE] * dt
    left = 1.0 / (1.0 + time * c[RECOVERY])
    hardens = kind != ELASTIC and c[FRESH] <= 0.0
    if signed:
        recovered = recovered_strain(state_old, i, left * hardens, vectors)
        set_back_stress(kind, c, recovered, vectors)
    mean, length, carried = trial_stress(c, i, strain, thermal, stress_old, vectors)
    trial, aside = math.sqrt(1.5) * length, 0.0
    if signed:
        before = hardened_strain(vectors, carried) / left
        old, aside = split_along_flow(vectors)
    else:
        before = state_old[i, 0] if hardens else 0.0
        old = left * before
    rate_old = state_old[i, memory] if kind == CURVE_AUTOMATIC and hardens else 0.0
    equivalent, increment, kept, by_old, rate = solve_point(
        kind, c, old, aside, left, signed, before, rate_old, trial, carried, time, near, near_rate
    )
    scale, gain, stored = equivalent / trial if increment > 0.0 else 1.0, left * increment, 0.0
    # For a direction of zero length, so that its derivative is that of the deviator.
    fill_stress(stress, row, scale * (length if length > 0.0 else 1.0), vectors, mean)
    if signed:
        stored = keep_strain(kind, c, vectors, old, aside, gain, state, row)
    elif kind != ELASTIC:
        state[row, 0] = old + gain
    if kind == CURVE_AUTOMATIC:
        state[row, memory] = rate
    work = max(equivalent - stored, 0.0) * increment
    return increment, scale, kept, by_old, length, rate, work
