"""The loop over the quadrature points, which Python calls."""

from __future__ import annotations

import math

import numpy as np

from castfem.constitutive.kernel.constants import (
    BULK,
    CURVE_AUTOMATIC,
    ELASTIC,
    FRESH,
    RECOVERY,
    SHARE,
    SHEAR,
)
from castfem.constitutive.kernel.radial_return import solve_point
from castfem.constitutive.kernel.tensors import (
    fill_stress,
    fill_tangent,
    hardened_strain,
    keep_strain,
    recovered_strain,
    set_back_stress,
    split_along_flow,
    trial_stress,
    turn_tangent,
)
from castfem.support.compiled import outermost


@outermost
def integrate_points(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, strain, thermal, stress_old, state_old, dt,
    stress, tangent, state, dissipation, flows, sources=None,
):  # fmt: skip
    """Integrate all points over a step.

    Args:
        kind: One of the laws of `constants`.
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
        sources: Not to be given, see `castfem.support.compiled`.
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
            set_back_stress(
                kind, c, recovered_strain(state_old[i], left * hardens, tensor), tensor, back
            )
        mean, length, carried = trial_stress(
            c, strain[i], thermal[i], stress_old[i], back, normal, carried_part
        )
        trial, aside = math.sqrt(1.5) * length, 0.0
        if signed:
            before = hardened_strain(tensor, carried_part, carried) / left
            old, aside = split_along_flow(tensor, normal)
        else:
            before = state_old[i, 0] if hardens else 0.0
            old = left * before
        rate_old = state_old[i, memory] if kind == CURVE_AUTOMATIC and hardens else 0.0
        equivalent, increment, kept, by_old, rate = solve_point(
            kind, c, old, aside, left, signed, before, rate_old, trial, carried, time
        )
        scale, gain, stored = equivalent / trial if increment > 0.0 else 1.0, left * increment, 0.0
        flows[i] = increment > 0.0
        fill_stress(stress[i], scale * length, normal, back, mean)
        fill_tangent(tangent[i], normal, shear2 * share, c[BULK] * share, scale, kept)
        if signed:
            stored = keep_strain(kind, c, tensor, normal, old, aside, gain, state[i])
            if increment > 0.0:
                factor = 2.0 / 3.0 * by_old * shear2 * share / length
                turn_tangent(tangent[i], normal, tensor, factor)
        elif kind != ELASTIC:
            state[i, 0] = old + gain
        if kind == CURVE_AUTOMATIC:
            state[i, memory] = rate
        dissipation[i] = max(equivalent - stored, 0.0) * increment
