"""Thermal and mechanical steps within one coupling window."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpi4py import MPI

from castfem.base import log
from castfem.base.constants import ROUNDING, same_instant
from castfem.base.types import Array
from castfem.physics.coupling.step_control import Proposal, StepControl, StepLength
from castfem.physics.thermal.jump import Jump
from castfem.physics.thermal.stepper import StepResult, ThermalState, ThermalStepper

if TYPE_CHECKING:
    from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
    from castfem.physics.mechanics.stepper import MechanicalStepper

FALLS = "the heat flux falls so steeply as the surface warms that the step has several solutions"
Moment = tuple[float, Array]  # a time, s, and temperatures of the owned vertices at that time, K


@dataclass(frozen=True, slots=True)
class SubSteps:
    """Result of successive thermal steps."""

    state: ThermalState  #: state at their end
    step: float  #: length of the last step, s
    length: StepLength  #: length of the next step
    newton: int  #: total Newton iterations
    balance: float  #: largest relative heat balance error
    steps: int  #: number of steps
    rejected: int  #: number of rejected steps
    #: steps by backward Euler, where the second-order scheme left the physical bounds, or would
    #: again
    limited: int

    def __add__(self, after: SubSteps) -> SubSteps:
        """The sum of two results, `after` being the later."""
        worse = max(self.balance, after.balance, key=abs)
        return SubSteps(
            after.state, after.step, after.length, self.newton + after.newton, worse,
            self.steps + after.steps, self.rejected + after.rejected, self.limited + after.limited,
        )  # fmt: skip


class ThermalSteps:
    """Thermal steps with error control and step reduction.

    Args:
        stepper: Takes one step. control: Chooses its length.

    Attributes:
        on_kept: Called with each accepted step and its initial state; None for none.
    """

    def __init__(self, stepper: ThermalStepper, control: StepControl) -> None:
        self.stepper, self.control = stepper, control
        self.on_kept: Callable[[ThermalState, StepResult], None] | None = None

    def one(self, state: ThermalState, length: StepLength, stop: float | None = None) -> SubSteps:
        """One step of a given length, shortened if necessary, not beyond `stop` (s).

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        rejected, kept = -1, False
        jump = Jump.of(self.stepper, state) if state.cooling_changed else None
        if jump is not None:
            length = self.control.restart(length, jump.errors)
        while not kept:
            tried = self.control.propose(length, state.time, stop)
            if jump is not None:
                state = jump.state(tried.taken)
            result = self.stepper.step(state, tried.end)
            length, kept = self._judged(state, tried, result)
            rejected += 1
        if self.on_kept is not None:
            self.on_kept(state, result)
        return SubSteps(
            result.state, tried.taken, length, result.newton, result.balance, 1, rejected,
            int(result.limited),
        )  # fmt: skip

    def _judged(
        self, state: ThermalState, tried: Proposal, result: StepResult
    ) -> tuple[StepLength, bool]:
        """Length of the step after a tried one, and whether this one is accepted."""
        reason = self.stepper.stray(result.state) if result.converged else result.reason
        if reason:
            log.logger.debug("t = %.6g s: step %.3g s: %s", state.time, tried.taken, reason)
            return self.control.failed(tried, reason), False
        longest = self.stepper.longest(state, result.state)
        if tried.taken > longest * (1.0 + ROUNDING):
            log.logger.debug("t = %.6g s: step %.3g s: the flux falls", state.time, tried.taken)
            # Somewhat less than the longest step with a unique solution.
            return self.control.failed(tried, FALLS, 0.7 * longest), False
        return self.control.learn(tried, result.error), self.control.accepts(result.error)

    def to(self, state: ThermalState, length: StepLength, end: float) -> SubSteps:
        """Take the steps needed to reach `end` (s), the first of a given length.

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        substeps = self.one(state, length, end)
        while not same_instant(substeps.state.time, end, self.control.end):
            substeps += self.one(substeps.state, substeps.length, end)
        return substeps

    def through(
        self, state: ThermalState, length: StepLength, instants: Sequence[float]
    ) -> tuple[SubSteps, list[Moment]]:
        """Take the steps needed to reach the last of some times (s); steps end at all of them.

        Returns:
            The steps, and the temperatures at each of the times.

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        substeps = self.to(state, length, instants[0])
        moments = [(instants[0], substeps.state.point.temperature)]
        for end in instants[1:]:
            substeps += self.to(substeps.state, substeps.length, end)
            moments.append((end, substeps.state.point.temperature))
        return substeps, moments


class MechanicalSteps:
    """Mechanical steps of equal length.

    Args:
        stepper: Takes one step.
        longest: Longest step, s; None for one step per window.
    """

    def __init__(self, stepper: MechanicalStepper, longest: float | None = None) -> None:
        self.stepper, self.longest = stepper, longest

    @property
    def comm(self) -> MPI.Comm:
        """Communicator of the problem."""
        return self.stepper.comm

    def instants(self, start: float, end: float) -> list[float]:
        """Ends of the steps of a window, s."""
        duration, count = end - start, 1
        if self.longest is not None:
            count = max(1, math.ceil(duration / self.longest * (1.0 - ROUNDING)))
        return [start + duration * k / count for k in range(1, count)] + [end]

    def through(self, old: MechanicalState, moments: Sequence[Moment]) -> MechanicalResult:
        """One step to each moment; `old` is unchanged, also if a step fails."""
        time, temperature = moments[0]
        result = self.stepper.step(old, time, temperature)
        for time, temperature in moments[1:]:
            if not result.converged:
                break
            result = result.before(self.stepper.step(result.state, time, temperature))
        return result if result.converged or result.state is old else replace(result, state=old)
