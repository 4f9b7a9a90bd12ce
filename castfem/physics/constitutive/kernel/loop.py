"""The loops over the quadrature points, which Python calls."""

from __future__ import annotations

import numpy as np

from castfem.base.compiled import outermost
from castfem.physics.constitutive.kernel.constants import BULK, SEEK, SHARE, SHEAR
from castfem.physics.constitutive.kernel.point import respond
from castfem.physics.constitutive.kernel.tensors import fill_tangent, turn_tangent


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
        sources: Not to be given, see `castfem.base.compiled`.
    """
    vectors = np.zeros((4, 4))
    for i in range(strain.shape[0]):
        c = coefficients[i]
        increment, scale, kept, by_old, length, _rate, dissipation[i] = respond(
            kind, signed, c, i, strain, thermal[i], stress_old, state_old, dt, SEEK, 0.0,
            vectors, stress, state, i,
        )  # fmt: skip
        flows[i] = increment > 0.0
        share, shear2 = c[SHARE], 2.0 * c[SHEAR]
        fill_tangent(tangent, i, vectors, shear2 * share, c[BULK] * share, scale, kept)
        if signed and increment > 0.0:
            factor = 2.0 / 3.0 * by_old * shear2 * share / length
            turn_tangent(tangent, i, vectors, factor)


@outermost
def difference_points(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, strain, thermal, stress_old, state_old, dt, by,
    d_coefficients, d_strain, d_thermal, d_stress_old, d_state_old, d_dt,
    d_stress, d_state, d_dissipation, sources=None,
):  # fmt: skip
    """Derivatives of what `integrate_points` writes, as what it is given changes in some ways.

    Central differences, for laws whose state is a tensor; `changes` has those of all others. A
    point is solved for once; on both sides of it, since they are near, by one Newton step, whose
    error is even in the distance. What flows goes on flowing.

    Args:
        kind: One of the laws of `constants`.
        signed: As in `integrate_points`; so are the following up to `dt`.
        coefficients: (n, columns).
        strain: (n, 4).
        thermal: (n,).
        stress_old: (n, 4), Pa.
        state_old: (n, states).
        dt: s.
        by: How far to go in each way (k,).
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
    vectors = np.zeros((4, 4))
    columns, states = coefficients.shape[1], state_old.shape[1]
    c, its_strain, its_stress, its_state = (
        np.zeros(columns), np.zeros((1, 4)), np.zeros((1, 4)), np.zeros((1, states)),
    )  # fmt: skip
    stress, state, work = np.zeros((2, 4)), np.zeros((2, states)), np.zeros(2)
    near, near_rate = np.zeros(strain.shape[0]), np.zeros(strain.shape[0])
    for i in range(strain.shape[0]):
        near[i], _scale, _kept, _by_old, _length, near_rate[i], _work = respond(
            kind, signed, coefficients[i], i, strain, thermal[i], stress_old, state_old, dt, SEEK,
            0.0, vectors, stress, state, 0,
        )  # fmt: skip
    for j in range(len(by)):
        for i in range(strain.shape[0]):
            for side in range(2):
                step = by[j] if side == 0 else -by[j]
                for m in range(columns):
                    c[m] = coefficients[i, m] + step * d_coefficients[j, i, m]
                for m in range(4):
                    its_strain[0, m] = strain[i, m] + step * d_strain[j, i, m]
                    its_stress[0, m] = stress_old[i, m] + step * d_stress_old[j, i, m]
                for m in range(states):
                    its_state[0, m] = state_old[i, m] + step * d_state_old[j, i, m]
                work[side] = respond(
                    kind, signed, c, 0, its_strain, thermal[i] + step * d_thermal[j, i], its_stress,
                    its_state, dt + step * d_dt[j], near[i], near_rate[i],
                    vectors, stress, state, side,
                )[6]  # fmt: skip
            span = 2.0 * by[j]
            for m in range(4):
                d_stress[j, i, m] = (stress[0, m] - stress[1, m]) / span
            for m in range(states):
                d_state[j, i, m] = (state[0, m] - state[1, m]) / span
            d_dissipation[j, i] = (work[0] - work[1]) / span
