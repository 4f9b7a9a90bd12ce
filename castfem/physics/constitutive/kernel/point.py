"""One quadrature point over a step: from its trial stress to its new stress and state."""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    CURVE_AUTOMATIC,
    ELASTIC,
    FRESH,
    RECOVERY,
    SHARE,
)
from castfem.physics.constitutive.kernel.radial_return import solve_point
from castfem.physics.constitutive.kernel.tensors import (
    fill_stress,
    hardened_strain,
    keep_strain,
    recovered_strain,
    set_back_stress,
    split_along_flow,
    trial_stress,
)


@compiled
def respond(  # type: ignore[no-untyped-def]
    kind, signed, c, i, strain, thermal, stress_old, state_old, dt, near, near_rate,
    vectors, stress, state, row,
):  # fmt: skip
    """Integrate one point; see `loop.integrate_points`.

    Args:
        kind: One of the laws of `constants`.
        signed: Whether its state is a tensor.
        c: Its coefficients.
        i: Row of the point in `strain`, `stress_old` and `state_old`.
        strain: Total strain increments (n, 4).
        thermal: Of that of the point, the isotropic thermal one.
        stress_old: (n, 4), Pa.
        state_old: (n, states).
        dt: s.
        near: What is known of dp, see `constants.SEEK`.
        near_rate: The rate that is remembered there.
        vectors: Out, (4, 4): direction of the trial deviator, what of a signed law's strain lies
            across the flow, back stress, deviator carried along (Pa); see `tensors`. The row of the
            back stress is 0 where a law has none.
        stress: Out, (m, 4), Pa.
        state: Out, (m, states).
        row: Row of the point in these.

    Returns:
        dp, equivalent stress over that of the trial, dq / d trial, dq / d old, length of the trial
        deviator (Pa), remembered rate (1/s), and viscoplastic work (J/m3).
    """
    memory = 3 if signed else 1  # column of the remembered rate
    time = c[SHARE] * dt
    left = 1.0 / (1.0 + time * c[RECOVERY])
    hardens = kind != ELASTIC and c[FRESH] == 0.0
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
    fill_stress(stress, row, scale * length, vectors, mean)
    if signed:
        stored = keep_strain(kind, c, vectors, old, aside, gain, state, row)
    elif kind != ELASTIC:
        state[row, 0] = old + gain
    if kind == CURVE_AUTOMATIC:
        state[row, memory] = rate
    work = max(equivalent - stored, 0.0) * increment
    return increment, scale, kept, by_old, length, rate, work
