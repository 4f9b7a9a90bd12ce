"""The loops over the quadrature points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, cfunc, types

from castfem.base.compiled import OPTIONS, compiled, outermost
from castfem.physics.constitutive.kernel.constants import BULK, SEEK, SHARE, SHEAR
from castfem.physics.constitutive.kernel.dual import TINY, fill
from castfem.physics.constitutive.kernel.point import fill_tangent, respond, turn_tangent


@compiled
def integrate_all(  # type: ignore[no-untyped-def]
    vectors, kind, signed, coefficients, strain, thermal, stress_old, state_old, dt,
    stress, tangent, state, dissipation, flows,
):  # fmt: skip
    """Integrate all points over a step, see `calling.integrate_points`; room for its `vectors`."""
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


def integrate_at() -> Any:
    """Compile `integrate_all` for addresses of its arrays, in the order of `calling`."""
    whole, real = types.int64, types.CPointer(types.float64)
    numbers = [whole] * 4 + [types.boolean, types.float64]
    signature = types.void(*numbers, *[real] * 10, types.CPointer(types.boolean))

    def integrate(  # type: ignore[no-untyped-def]
        n, columns, states, kind, signed, dt, vectors, coefficients, strain, thermal, stress_old,
        state_old, stress, tangent, state, dissipation, flows,
    ):  # fmt: skip
        integrate_all(
            carray(vectors, (4, 4)), kind, signed, carray(coefficients, (n, columns)),
            carray(strain, (n, 4)), carray(thermal, (n,)), carray(stress_old, (n, 4)),
            carray(state_old, (n, states)), dt, carray(stress, (n, 4)), carray(tangent, (n, 4, 4)),
            carray(state, (n, states)), carray(dissipation, (n,)), carray(flows, (n,)),
        )  # fmt: skip

    return cfunc(signature, **OPTIONS)(integrate)


@outermost
def differentiate_points(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, strain, thermal, stress_old, state_old, dt,
    d_coefficients, d_strain, d_thermal, d_stress_old, d_state_old, d_dt,
    d_stress, d_state, d_dissipation,
):  # fmt: skip
    """Derivatives of the output of `calling.integrate_points` for k derivatives of its input.

    A point is solved first; one further Newton step with numbers that carry a derivative (`dual`)
    stays at the solution and gives its derivative. Flowing points keep flowing.

    Args:
        kind: Law, see `calling.integrate_points`, as for the following up to `dt`.
        signed: Kind of hardening.
        coefficients: Coefficients of the law (n, columns).
        strain: Total strain increments (n, 4).
        thermal: Thermal strain increments (n,).
        stress_old: Stress at the start (n, 4), Pa.
        state_old: State variables at the start (n, states).
        dt: Length of the step, s.
        d_coefficients: Derivatives (k, n, columns), one per parameter.
        d_strain: Derivatives (k, n, 4).
        d_thermal: Derivatives (k, n).
        d_stress_old: Derivatives (k, n, 4), Pa.
        d_state_old: Derivatives (k, n, states).
        d_dt: Derivatives (k,), s.
        d_stress: Output, derivatives (k, n, 4), Pa.
        d_state: Output, derivatives (k, n, states).
        d_dissipation: Output, derivatives (k, n), J/m3.
    """
    columns, states = coefficients.shape[1], state_old.shape[1]
    vectors, stress, state = np.zeros((4, 4)), np.zeros((1, 4)), np.zeros((1, states))
    dual = np.complex128
    c, its_vectors = np.zeros((1, columns), dual), np.zeros((4, 4), dual)
    its_strain, its_old, its_state_old = (
        np.zeros((1, 4), dual), np.zeros((1, 4), dual), np.zeros((1, states), dual),
    )  # fmt: skip
    its_stress, its_state = np.zeros((1, 4), dual), np.zeros((1, states), dual)
    for i in range(strain.shape[0]):
        near, near_rate = SEEK, 0.0
        for _ in range(2):  # the second step converges to rounding
            near, _scale, _kept, _by_old, _length, near_rate, _work = respond(
                kind, signed, coefficients[i], i, strain, thermal[i], stress_old, state_old, dt,
                near, near_rate, vectors, stress, state, 0,
            )  # fmt: skip
        for j in range(len(d_dt)):
            fill(c, coefficients, d_coefficients, i, j)
            fill(its_strain, strain, d_strain, i, j)
            fill(its_old, stress_old, d_stress_old, i, j)
            fill(its_state_old, state_old, d_state_old, i, j)
            work = respond(
                kind, signed, c[0], 0, its_strain, complex(thermal[i], TINY * d_thermal[j, i]),
                its_old, its_state_old, complex(dt, TINY * d_dt[j]), near, near_rate,
                its_vectors, its_stress, its_state, 0,
            )[6]  # fmt: skip
            for m in range(4):
                d_stress[j, i, m] = its_stress[0, m].imag / TINY
            for m in range(states):
                d_state[j, i, m] = its_state[0, m].imag / TINY
            d_dissipation[j, i] = work.imag / TINY
