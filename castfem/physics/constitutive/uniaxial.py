"""A law in a uniaxial test: prescribed axial strain or stress, free sides.

The axis is z, the casting direction. Many specimens are computed together, one per row; each may
have its own temperature history.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from castfem.base.errors import RunFailure
from castfem.base.types import Array, Flags
from castfem.physics.constitutive.base import Law, MaterialStep, Response
from castfem.physics.constitutive.flow_laws import FlowCurve

AXIAL, SIDES = 2, (0, 1)


@dataclass(frozen=True, slots=True)
class PullLimits:
    """Limits of Newton's method for the free directions of a specimen."""

    iterations: int = 60
    halvings: int = 30  # halvings of a Newton step until the residual falls


LIMITS = PullLimits()


@dataclass(frozen=True, slots=True)
class Tension:
    """History of n specimens at m + 1 times."""

    time: Array  #: s, (m+1,)
    strain: Array  #: total strain, Mandel, (m+1, n, 4)
    thermal_strain: Array  #: (m+1, n)
    stress: Array  #: Pa, Mandel, (m+1, n, 4)
    state: Array  #: (m+1, n, states)
    flows: Flags  #: whether the specimen flowed in the step up to that time, (m+1, n)
    work: Array  #: viscoplastic work since the start, J/m3, (m+1, n)

    @property
    def axial_stress(self) -> Array:
        """Axial stress, Pa, (m+1, n)."""
        return self.stress[:, :, AXIAL]

    @property
    def axial_strain(self) -> Array:
        """Mechanical axial strain, without thermal strain (213), (m+1, n)."""
        return np.asarray(self.strain[:, :, AXIAL] - self.thermal_strain)


@dataclass(frozen=True, slots=True)
class _Machine:
    """The test: `goal` is the prescribed axial strain or stress at each time, (m+1, n)."""

    law: Law  #: law of the specimens
    by_stress: bool  #: whether `goal` is a stress
    goal: Array  #: axial strain or stress
    temperature: Array  #: K, (m+1, n)
    tolerance: float  #: tolerance of the residual stresses, see `pull`
    out: Response  #: arrays for the responses

    def advance(self, record: Tension, k: int, guess: Array) -> Array:
        """Find the strain increments of step k from a guess, and record the result."""
        dt = float(record.time[k] - record.time[k - 1])
        heat = self.temperature[k - 1], self.temperature[k]
        coefficients = self.law.coefficients(*heat)
        thermal = record.thermal_strain[k] - record.thermal_strain[k - 1]

        def respond(increment: Array) -> Response:
            step = MaterialStep(increment, thermal, *heat, dt)
            return self.law.integrate(
                step, record.stress[k - 1], record.state[k - 1],
                coefficients=coefficients, out=self.out,
            )  # fmt: skip

        target = np.zeros_like(guess)
        if self.by_stress:
            target[:, AXIAL] = self.goal[k]
        else:
            guess[:, AXIAL] = self.goal[k] - self.goal[k - 1]
        free = [*SIDES, AXIAL] if self.by_stress else [*SIDES]
        increment = _balanced(respond, guess, target, free, self.tolerance, float(record.time[k]))
        out = self.out
        record.strain[k] = record.strain[k - 1] + increment
        record.stress[k], record.state[k], record.flows[k] = out.stress, out.state, out.flows
        record.work[k] = record.work[k - 1] + out.dissipation
        return increment


def pull(
    law: Law,
    time: npt.ArrayLike,
    axial: npt.ArrayLike,
    temperature: npt.ArrayLike,
    *,
    control: Literal["strain", "stress"] = "strain",
    thermal_strain: npt.ArrayLike = 0.0,
    tolerance: float = 1e-12,
    done: Callable[[Tension, int], None] | None = None,
) -> Tension:
    """Run a tensile test.

    Args:
        law: The constitutive law.
        time: Increasing times, s, (m+1,); the specimens are unstrained at the first.
        axial: Total axial strain or axial stress [Pa] at these times, (m+1,) or (m+1, n).
        temperature: Temperature, K; a number, (m+1,) or (m+1, n).
        control: Whether `axial` is strain or stress.
        thermal_strain: Isotropic thermal strain; a number, (m+1,) or (m+1, n).
        tolerance: Tolerance of prescribed or vanishing stresses, relative to the stiffness of the
            specimen times a strain of 1e-3, or to its stress.
        done: Called after each step with the history and the index of the new entry.

    Raises:
        RunFailure: The state with free sides cannot be found; the message has the time.
    """
    times: Array = np.asarray(time, float)
    histories = [_spread(a, len(times)) for a in (axial, temperature, thermal_strain)]
    n = max(history.shape[1] for history in histories)
    goal, heat, thermal = (
        np.ascontiguousarray(np.broadcast_to(h, (len(times), n))) for h in histories
    )
    record = _blank(times, thermal, law.initial_state(n))
    record.strain[0, :, :3] = thermal[0][:, None]
    if control == "strain":
        record.strain[0, :, AXIAL] = goal[0]
    out = Response.empty(n, len(law.state_names))
    machine = _Machine(law, control == "stress", goal, heat, tolerance, out)
    rate = np.zeros((n, 4))
    for k in range(1, len(times)):
        dt = times[k] - times[k - 1]
        rate = machine.advance(record, k, rate * dt) / dt
        if done is not None:
            done(record, k)
    return record


def _spread(values: npt.ArrayLike, times: int) -> Array:
    """Return values as (times, n) or (times, 1)."""
    array: Array = np.asarray(values, float)
    if array.ndim == 0:
        return np.full((times, 1), float(array))
    if array.shape[0] != times:
        raise ValueError(f"{times} times, but {array.shape[0]} values")
    return array[:, None] if array.ndim == 1 else array


def _blank(times: Array, thermal: Array, state: Array) -> Tension:
    """Return an empty history."""
    m, n = thermal.shape
    history = np.zeros((m, *state.shape))
    history[0] = state
    return Tension(
        times, np.zeros((m, n, 4)), thermal, np.zeros((m, n, 4)), history,
        np.zeros((m, n), dtype=np.bool_), np.zeros((m, n)),
    )  # fmt: skip


def _balanced(
    respond: Callable[[Array], Response], increment: Array, target: Array, free: list[int],
    tolerance: float, time: float,
) -> Array:  # fmt: skip
    """Newton's method for the strain increments in the directions `free`, damped for each specimen.

    The last evaluated response is that of the returned increments.
    """
    response = respond(increment)
    worst = np.inf
    for _ in range(LIMITS.iterations):
        residual = (response.stress - target)[:, free]
        tangent = response.tangent[:, free][:, :, free]
        size = np.linalg.norm(residual, axis=1)
        stiff = 1e-3 * np.abs(tangent).max(axis=(1, 2))
        scale = np.maximum(stiff, np.abs(response.stress).max(axis=1))
        moves = size > tolerance * scale
        if not moves.any():
            return increment
        worst = float(np.max(size / scale))
        move = np.zeros_like(increment)
        # A plateau has no stiffness along the flow: a small one is added, and halving does the
        # rest.
        softest = np.linalg.eigvalsh(tangent)[:, 0]
        lent = np.where(softest < 1e-6 * stiff, 10.0 * stiff - softest, 0.0)
        tangent = tangent + lent[:, None, None] * np.eye(len(free))
        step = np.linalg.solve(tangent, residual[:, :, None])[:, :, 0]
        move[:, free] = np.where(moves[:, None], -step, 0.0)
        for _halving in range(LIMITS.halvings):
            response = respond(increment + move)
            new = np.linalg.norm((response.stress - target)[:, free], axis=1)
            worse = new > size * (1.0 + 1e-9)
            if not worse.any():
                break
            move[worse] *= 0.5
        else:
            response = respond(increment + move)
        increment = increment + move
    raise RunFailure(f"tensile test: no equilibrium of the free sides at {time:g} s ({worst:.1e})")


def axial_stress(strain: Array, rate: Array, modulus: float, curve: FlowCurve) -> Array:
    """Axial stress (n,) of a bar loaded, unloaded and reversed at constant rates, Pa.

    Loading follows the elastic line until it reaches the curve of its rate, then the curve (thesis
    III.2.6); a change of rate changes the curve at once. On reversal the bar follows the elastic
    line through that point; in the opposite direction it flows on the curve again, hardened by all
    previous flow. A bar held at constant strain relaxes, for which the result is NaN from there on.

    Args:
        strain: Axial mechanical strain (n,), from 0.
        rate: Strain rate of the step that ends at each point (n,), 1/s; the first is not used.
        modulus: Young's modulus, Pa.
        curve: Flow curve of the law, `RadialReturn.flow_curve`.
    """
    found = np.full(len(strain), np.nan)
    found[0] = modulus * strain[0]
    # Strain at zero stress, and accumulated flow, at the last reversal.
    rest, flowed, direction = 0.0, 0.0, 0.0
    changes = np.flatnonzero(np.diff(rate[1:])) + 2
    for first, last in zip([1, *changes], [*changes, len(strain)], strict=True):
        speed = float(rate[first])
        if speed == 0.0:
            break
        if direction * speed < 0.0:
            released = float(strain[first - 1] - found[first - 1] / modulus)
            rest, flowed = released, flowed + abs(released - rest)
        direction = np.sign(speed)
        reach = direction * (strain[first:last] - rest)
        limit = curve(flowed + np.maximum(reach, 0.0), abs(speed))
        found[first:last] = direction * np.minimum(modulus * reach, limit)
    return found
