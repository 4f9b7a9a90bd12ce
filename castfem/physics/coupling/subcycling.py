"""Subcycling: the thermal and the mechanical steps within one coupling window."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base import log
from castfem.base.tolerances import same_instant
from castfem.base.types import Array
from castfem.physics.coupling.step_control import StepControl
from castfem.physics.thermal.stepper import StepResult, ThermalState, ThermalStepper

if TYPE_CHECKING:
    from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
    from castfem.physics.mechanics.stepper import MechanicalStepper

ROUNDING = 1e-9  # of a step: how much longer it may be
FALLS = "the heat flux falls so steeply as the surface warms that the step has several solutions"
BELOW = 0.7  # of the longest step that has one: what is tried
Moment = tuple[float, Array]  # a time, s, and temperatures of the owned vertices then, K


@dataclass(frozen=True, slots=True)
class SubSteps:
    """Thermal steps that were taken one after another.

    Attributes:
        state: At their end. step: Length of the last, s. newton: Newton iterations of all.
        balance: Largest relative error of their heat balances. steps: Their number.
        rejected: Steps that were tried and not kept. limited: Steps taken by backward Euler
            because the second-order scheme left the physical bounds, or would have come back.
    """

    state: ThermalState
    step: float
    newton: int
    balance: float
    steps: int
    rejected: int
    limited: int

    def __add__(self, after: SubSteps) -> SubSteps:
        """Both, `after` being the later."""
        worse = max(self.balance, after.balance, key=abs)
        return SubSteps(
            after.state, after.step, self.newton + after.newton, worse, self.steps + after.steps,
            self.rejected + after.rejected, self.limited + after.limited,
        )  # fmt: skip


class ThermalSteps:
    """Thermal steps with error control and cut-back.

    Args:
        stepper: Takes one step. control: Chooses its length and learns.

    Attributes:
        on_kept: Called with each step that is kept, and the state it began with; None for nobody.
    """

    def __init__(self, stepper: ThermalStepper, control: StepControl) -> None:
        self.stepper, self.control = stepper, control
        self.on_kept: Callable[[ThermalState, StepResult], None] | None = None

    def one(self, state: ThermalState, stop: float | None = None) -> SubSteps:
        """One step, not past `stop` (s).

        Raises:
            RunFailure: At the smallest step.
        """
        rejected = 0
        while True:
            end = self.control.propose(state.time, stop)
            dt = end - state.time
            result = self.stepper.step(state, end)
            stray = self.stepper.stray(state, result.state) if result.converged else ""
            longest = self.stepper.longest(state, result.state) if not stray else np.inf
            if not result.converged or stray:
                reason = stray or result.reason
                log.logger.debug("t = %.6g s: step %.3g s: %s", state.time, dt, reason)
                self.control.failed(dt, reason)
            elif dt > longest * (1.0 + ROUNDING):
                log.logger.debug("t = %.6g s: step %.3g s: the flux falls", state.time, dt)
                self.control.failed(dt, FALLS, BELOW * longest)
            else:
                self.control.learn(dt, result.error)
                if self.control.accepts(result.error):
                    break
            rejected += 1
        if self.on_kept is not None:
            self.on_kept(state, result)
        return SubSteps(
            result.state, dt, result.newton, result.balance, 1, rejected, int(result.limited)
        )

    def to(self, state: ThermalState, end: float) -> SubSteps:
        """As many steps as it takes to `end` (s).

        Raises:
            RunFailure: At the smallest step.
        """
        substeps = self.one(state, end)
        while not same_instant(substeps.state.time, end, self.control.end):
            substeps += self.one(substeps.state, end)
        return substeps

    def through(
        self, state: ThermalState, instants: Sequence[float]
    ) -> tuple[SubSteps, list[Moment]]:
        """As many steps as it takes to the last of some instants (s), all of which are hit.

        Returns:
            The steps, and the temperature at each instant.

        Raises:
            RunFailure: At the smallest step.
        """
        substeps = self.to(state, instants[0])
        moments = [(instants[0], substeps.state.point.temperature)]
        for end in instants[1:]:
            substeps += self.to(substeps.state, end)
            moments.append((end, substeps.state.point.temperature))
        return substeps, moments


class MechanicalSteps:
    """Mechanical steps of equal length.

    Args:
        stepper: Takes one step.
        longest: Length of a step, s, at most; None for one step a window.
    """

    def __init__(self, stepper: MechanicalStepper, longest: float | None = None) -> None:
        self.stepper, self.longest = stepper, longest

    @property
    def comm(self) -> MPI.Comm:
        """Ranks that step together."""
        return self.stepper.comm

    def instants(self, start: float, end: float) -> list[float]:
        """Where the steps of a window end, s."""
        duration, count = end - start, 1
        if self.longest is not None:
            count = max(1, math.ceil(duration / self.longest * (1.0 - ROUNDING)))
        return [start + duration * k / count for k in range(1, count)] + [end]

    def through(self, old: MechanicalState, moments: Sequence[Moment]) -> MechanicalResult:
        """One step to each moment; `old` is left untouched, and the result if one of them fails."""
        time, temperature = moments[0]
        result = self.stepper.step(old, time, temperature)
        for time, temperature in moments[1:]:
            if not result.converged:
                break
            result = result.before(self.stepper.step(result.state, time, temperature))
        return result if result.converged or result.state is old else replace(result, state=old)
