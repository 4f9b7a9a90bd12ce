"""The loop that leads the layers of a shell through a history of the moment, for numba.

`layers` calls it. It makes no arrays (all are passed to it), so that its machine code runs without
numba (`castfem.base.shared_code`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, cfunc, types

from castfem.base.compiled import OPTIONS, compiled
from castfem.physics.constitutive.kernel.loop import integrate_all

BALANCED = 1e-6
"""Allowed residual of the balance, over the largest moment."""
ITERATIONS = 120
NEW, INCREMENT, CHANGE, TAKEN, RATE = range(5)
"""Fields of all layers: new stress, strain increment, its correction and the last one taken, rate
of the increment."""
DISSIPATION, FLOWS, THERMAL = range(3)
"""Values of all layers."""


@compiled
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve for the columns of `right`, in place: elimination with partial pivoting.

    numba would take 5 s to compile np.linalg.solve and its error messages. The result for a
    singular matrix is not finite.
    """
    n, columns = right.shape
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        for j in range(columns):
            right[k, j], right[pivot, j] = right[pivot, j], right[k, j]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(columns):
                right[i, j] -= factor * right[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(columns):
            for i in range(k + 1, n):
                right[k, j] -= matrix[k, i] * right[i, j]
            right[k, j] /= matrix[k, k]


@compiled
def _add_row(matrix, row, factor, across, along, along_bent):  # type: ignore[no-untyped-def]
    """Add a multiple of three numbers to a row of a matrix."""
    matrix[row, 0] += factor * across
    matrix[row, 1] += factor * along
    matrix[row, 2] += factor * along_bent


@compiled
def _correction(  # type: ignore[no-untyped-def]
    stress, tangent, weight, arm, moment, size, change, matrix, solved, net
):
    """Newton's correction of the strain increments of all points.

    The unknowns are the strain across the width, the axial strain and the curvature of the whole
    section, and at each point the strain through the thickness, which is eliminated first. There
    is no stress through the thickness and no force across the width or along it; the moment is
    given.

    Args:
        stress: Stress (n, 4), Pa.
        tangent: Tangent of the law (n, 4, 4), Pa.
        weight: Weights of the layers (n,), m.
        arm: Neutral depth minus depth (n,), m.
        moment: Prescribed moment, N.
        size: Thickness, m.
        change: Output, correction of the strain increments (n, 4).
        matrix: Work array (3, 3).
        solved: Work array (3, 2): solution for the residual, and for the moment.
        net: Work array (3,).

    Returns:
        The residual as a moment, N, and d curvature / d moment.
    """
    through = 0.0
    for k in range(3):
        net[k], solved[k, 0], solved[k, 1] = 0.0, 0.0, 0.0
        for m in range(3):
            matrix[k, m] = 0.0
    for i in range(len(weight)):
        c, w, a = tangent[i], weight[i], arm[i]
        free = stress[i, 1] / c[1, 1]
        across, along = stress[i, 0] - c[0, 1] * free, stress[i, 2] - c[2, 1] * free
        xx, xz = c[0, 0] - c[0, 1] * c[1, 0] / c[1, 1], c[0, 2] - c[0, 1] * c[1, 2] / c[1, 1]
        zx, zz = c[2, 0] - c[2, 1] * c[1, 0] / c[1, 1], c[2, 2] - c[2, 1] * c[1, 2] / c[1, 1]
        _add_row(matrix, 0, w, xx, xz, xz * a)
        _add_row(matrix, 1, w, zx, zz, zz * a)
        _add_row(matrix, 2, w * a, zx, zz, zz * a)
        solved[0, 0] -= w * across
        solved[1, 0] -= w * along
        solved[2, 0] -= w * a * along
        net[0] += w * stress[i, 0]
        net[1] += w * stress[i, 2]
        net[2] += w * a * stress[i, 2]
        through += w * stress[i, 1] ** 2
    net[2] -= moment
    solved[2, 0] += moment
    solved[2, 1] = 1.0
    _solve(matrix, solved)
    for i in range(len(weight)):
        c, axial = tangent[i], solved[1, 0] + solved[2, 0] * arm[i]
        change[i, 0], change[i, 2], change[i, 3] = solved[0, 0], axial, 0.0
        change[i, 1] = -(stress[i, 1] + c[1, 0] * solved[0, 0] + c[1, 2] * axial) / c[1, 1]
    out = net[2] ** 2 + size**2 * (net[0] ** 2 + net[1] ** 2) + size**3 * through
    return np.sqrt(out), solved[2, 1]


@compiled
def _add(target, source, factor):  # type: ignore[no-untyped-def]
    """Add a multiple of an array (n, m) to another."""
    for i in range(target.shape[0]):
        for m in range(target.shape[1]):
            target[i, m] += factor * source[i, m]


@compiled
def _set(target, source, factor):  # type: ignore[no-untyped-def]
    """Write a multiple of an array (n, m) into another."""
    for i in range(target.shape[0]):
        for m in range(target.shape[1]):
            target[i, m] = factor * source[i, m]


@compiled
def lead(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, thermal_rate, weight, arm, size, moment, scale, dt, stress, state,
    curvature, axial, compliance, ended, fields, tangent, state_new, values, vectors,
):  # fmt: skip
    """Lead the layers through a history of the moment, step by step.

    Args:
        kind: Law, see `calling.integrate_points`.
        signed: Kind of hardening, see there.
        coefficients: Coefficients of the law (n, columns), see there.
        thermal_rate: Rate of thermal strain (n,), 1/s.
        weight: Weights of the layers (n,), m.
        arm: Neutral depth minus depth (n,), m.
        size: Thickness, m.
        moment: Moments at the ends of the steps (m,), N per metre of width.
        scale: Largest magnitude of the moments.
        dt: Lengths of the steps (m,), s.
        stress: Stress at the start; output: at the end (n, 4), Pa.
        state: State variables at the start; output: at the end (n, states).
        curvature: Output, curvature since the start (m+1,), 1/m.
        axial: Output, strain of the neutral axis since the start (m+1,).
        compliance: Output, d curvature / d moment (m,), 1/(N m).
        ended: Output (2,), number of steps taken, fewer if the layers cannot carry a moment, and
            the relative residual of the balance in the last step.
        fields: Work array, initially 0 (5, n, 4).
        tangent: Work array, initially 0 (n, 4, 4).
        state_new: Work array, initially 0 (n, states).
        values: Work array, initially 0 (3, n).
        vectors: Work array, initially 0 (11, 4).
    """
    new, increment, change = fields[NEW], fields[INCREMENT], fields[CHANGE]
    taken, rate = fields[TAKEN], fields[RATE]
    matrix, solved, net = vectors[4:7, :3], vectors[7:10, :2], vectors[10, :3]
    rest = 0.0
    ended[0] = len(dt)
    for k in range(len(dt)):
        _set(increment, rate, dt[k])
        for i in range(len(weight)):
            values[THERMAL, i] = thermal_rate[i] * dt[k]
        share, least, balanced = 1.0, np.inf, False
        for _ in range(ITERATIONS):
            integrate_all(
                vectors[:4], kind, signed, coefficients, increment, values[THERMAL], stress, state,
                dt[k], new, tangent, state_new, values[DISSIPATION], values[FLOWS],
            )  # fmt: skip
            rest, compliance[k] = _correction(
                new, tangent, weight, arm, moment[k], size, change, matrix, solved, net
            )
            if rest <= BALANCED * scale:
                balanced = True
                break
            if rest < least or share < 1e-4:
                _set(taken, change, 1.0)
                share, least = 1.0, rest
                _add(increment, taken, 1.0)
            else:  # too far: halfway back
                share *= 0.5
                _add(increment, taken, -share)
        if not balanced:
            ended[0] = k
            break
        _set(stress, new, 1.0)
        _set(state, state_new, 1.0)
        bent = (increment[0, 2] - increment[-1, 2]) / (arm[0] - arm[-1])
        curvature[k + 1] = curvature[k] + bent
        axial[k + 1] = axial[k] + increment[0, 2] - bent * arm[0]
        for i in range(len(weight)):
            for m in range(4):
                rate[i, m] = increment[i, m] / dt[k]
    ended[1] = rest / scale


def lead_at() -> Any:
    """Compile `lead` for addresses of its arrays, in the order of `layers`."""
    whole, real = types.int64, types.float64
    numbers = [whole] * 5 + [types.boolean, real, real]
    signature = types.void(*numbers, *[types.CPointer(real)] * 17)

    def at(  # type: ignore[no-untyped-def]
        n, columns, states, steps, kind, signed, size, scale,
        coefficients, thermal_rate, weight, arm, moment, dt,
        stress, state, curvature, axial, compliance, ended,
        fields, tangent, state_new, values, vectors,
    ):  # fmt: skip
        lead(
            kind, signed, carray(coefficients, (n, columns)), carray(thermal_rate, (n,)),
            carray(weight, (n,)), carray(arm, (n,)), size, carray(moment, (steps,)), scale,
            carray(dt, (steps,)), carray(stress, (n, 4)), carray(state, (n, states)),
            carray(curvature, (steps + 1,)), carray(axial, (steps + 1,)),
            carray(compliance, (steps,)), carray(ended, (2,)), carray(fields, (5, n, 4)),
            carray(tangent, (n, 4, 4)), carray(state_new, (n, states)), carray(values, (3, n)),
            carray(vectors, (11, 4)),
        )  # fmt: skip

    return cfunc(signature, **OPTIONS)(at)
