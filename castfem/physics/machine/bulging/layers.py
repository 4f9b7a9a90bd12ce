"""The law of the shell integrated through its thickness for a given history of the moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.compiled import compiled, outermost
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.kernel.loop import integrate_all
from castfem.physics.machine.bulging.shell import Points, stiffness

BALANCED = 1e-6
"""Tolerance of the residual, relative to the largest moment."""
ITERATIONS = 120


@compiled
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve for the columns of `right`, in place: elimination with partial pivoting.

    numba would compile np.linalg.solve and its error messages for 5 s. A singular matrix gives
    values that are not finite.
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
def _correction(  # type: ignore[no-untyped-def]
    stress, tangent, weight, arm, moment, size, change
):
    """Newton's correction of the strain increments of all points.

    The unknowns are the strain across the width, the axial strain and the curvature of the whole
    section, and at each point the strain through the thickness, which is eliminated first. The
    stress through the thickness and the forces across and along the strip are zero; the moment is
    given.

    Args:
        stress: Stresses (n, 4).
        tangent: Tangents (n, 4, 4).
        weight: Weights (n,), m.
        arm: Depth of the neutral axis minus depth (n,), m.
        moment: Given moment, N.
        size: Thickness, m.
        change: Output: correction of the strain increments (n, 4).

    Returns:
        The residual as a moment, N, and d curvature / d moment.
    """
    matrix, solved = np.zeros((3, 3)), np.zeros((3, 2))  # columns: for the residual, for the moment
    row, net, through = np.zeros(3), np.zeros(3), 0.0
    for i in range(len(weight)):
        c, w, a = tangent[i], weight[i], arm[i]
        free = stress[i, 1] / c[1, 1]
        across, along = stress[i, 0] - c[0, 1] * free, stress[i, 2] - c[2, 1] * free
        xx, xz = c[0, 0] - c[0, 1] * c[1, 0] / c[1, 1], c[0, 2] - c[0, 1] * c[1, 2] / c[1, 1]
        zx, zz = c[2, 0] - c[2, 1] * c[1, 0] / c[1, 1], c[2, 2] - c[2, 1] * c[1, 2] / c[1, 1]
        row[0], row[1], row[2] = xx, xz, xz * a
        matrix[0] += w * row
        row[0], row[1], row[2] = zx, zz, zz * a
        matrix[1] += w * row
        matrix[2] += w * a * row
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


@outermost
def _lead(  # type: ignore[no-untyped-def]
    kind, signed, coefficients, thermal_rate, weight, arm, size, moment, dt, stress, state,
    curvature, axial, compliance,
):  # fmt: skip
    """Integrate the layers over a history of the moment, step by step.

    Args:
        kind: Number of the law, with its `coefficients` (n, columns) and whether it is `signed`:
            see `integrate_points`.
        signed: See `integrate_points`.
        coefficients: See `integrate_points`.
        thermal_rate: Thermal strain rates (n,), 1/s.
        weight: Weights (n,), m.
        arm: Depth of the neutral axis minus depth (n,), m.
        size: Thickness, m.
        moment: Moments at the ends of the steps (m,), N per metre of width.
        dt: Durations of the steps (m,), s.
        stress: Input: at the start; output: at the end (n, 4), Pa.
        state: Likewise (n, states).
        curvature: Output, curvature since the start (m+1,), 1/m.
        axial: Output, strain of the neutral axis since the start (m+1,).
        compliance: Output, d curvature / d moment (m,), 1/(N m).

    Returns:
        Number of steps taken, all of them unless the layers cannot carry a moment, and relative
            residual
        of the last.
    """
    n, scale = len(weight), max(np.abs(moment).max(), 1e-300)
    new, state_new, tangent = np.empty_like(stress), np.empty_like(state), np.empty((n, 4, 4))
    dissipation, flows = np.empty(n), np.empty(n, np.bool_)
    increment, change, taken = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4))
    rate, rest = np.zeros((n, 4)), 0.0
    for k in range(len(dt)):
        increment[:] = rate * dt[k]
        share, least, balanced = 1.0, np.inf, False
        for _ in range(ITERATIONS):
            integrate_all(
                kind, signed, coefficients, increment, thermal_rate * dt[k], stress, state, dt[k],
                new, tangent, state_new, dissipation, flows,
            )  # fmt: skip
            rest, compliance[k] = _correction(new, tangent, weight, arm, moment[k], size, change)
            if rest <= BALANCED * scale:
                balanced = True
                break
            if rest < least or share < 1e-4:
                taken[:] = change
                share, least = 1.0, rest
                increment += taken
            else:  # too far: halve the step
                share *= 0.5
                increment -= share * taken
        if not balanced:
            return k, rest / scale
        stress[:] = new
        state[:] = state_new
        bent = (increment[0, 2] - increment[-1, 2]) / (arm[0] - arm[-1])
        curvature[k + 1] = curvature[k] + bent
        axial[k + 1] = axial[k] + increment[0, 2] - bent * arm[0]
        rate[:] = increment / dt[k]
    return len(dt), rest / scale


@dataclass(frozen=True, slots=True)
class Condition:
    """Stress and state of all layers at one position."""

    stress: Array  #: Mandel vectors, Pa, (n, 4)
    state: Array  #: state of the law, (n, states)


@dataclass(frozen=True, slots=True)
class LayerHistory:
    """Layers over a history of the moment."""

    curvature: Array  #: since the start, 1/m, (m+1,)
    axial_strain: Array  #: strain of the neutral axis since the start, (m+1,)
    compliance: Array  #: d curvature / d moment of each step, 1/(N m), (m,)
    end: Condition  #: stress and state at the end


class Layers:
    """The layers of a shell, integrated over histories of the moment.

    Args:
        law: Law of the steel.
        points: Points through the thickness.

    Attributes:
        law: Law of the steel.
        points: Points through the thickness.
        stiffness: Elastic stiffness.
        arm: Depth of the neutral axis minus depth (n,), m.
    """

    def __init__(self, law: Law, points: Points) -> None:
        self.law, self.points = law, points
        self.stiffness = stiffness(law.elasticity, points)
        self.arm = self.stiffness.neutral - points.depth
        self._coefficients = law.coefficients(points.temperature, points.temperature)

    def virgin(self) -> Condition:
        """Return stress-free, unstrained layers."""
        n = len(self.points.depth)
        return Condition(np.zeros((n, 4)), self.law.initial_state(n))

    def advance(self, start: Condition, moment: Array, dt: Array) -> LayerHistory:
        """Integrate the layers over a history of the moment.

        Args:
            start: Initial condition; it is not modified.
            moment: Moments at the ends of the steps (m,), N per metre of width.
            dt: Durations of the steps (m,), s.

        Raises:
            RunFailure: No state of the layers carries a moment.
        """
        steps, points = len(dt), self.points
        curvature, axial, compliance = np.zeros(steps + 1), np.zeros(steps + 1), np.zeros(steps)
        stress, state = start.stress.copy(), start.state.copy()
        taken, rest = _lead(
            self.law.kind, self.law.signed, self._coefficients, points.thermal_rate, points.weight,
            self.arm, points.thickness, moment, dt, stress, state, curvature, axial, compliance,
        )  # fmt: skip
        if taken < steps:
            raise RunFailure(
                f"the shell of {1e3 * points.thickness:.3g} mm cannot carry the moment of "
                f"{moment[taken]:.3g} N per metre of width that the pressure of the liquid brings "
                f"about between the rolls (out of balance by {rest:.1e} of the largest)"
            )
        return LayerHistory(curvature, axial, compliance, Condition(stress, state))
