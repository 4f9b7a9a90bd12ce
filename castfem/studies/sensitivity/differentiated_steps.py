"""The steps of a run, each followed by the derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from castfem.base.types import Array
from castfem.physics.coupling.step_control import StepControl
from castfem.physics.coupling.subcycling import MechanicalSteps, Moment, ThermalSteps
from castfem.physics.thermal.stepper import StepResult, ThermalState, ThermalStepper
from castfem.studies.sensitivity.thermal import ThermalDerivatives

if TYPE_CHECKING:
    from castfem.physics.coupling.staggered import StaggeredCoupling, StrandState
    from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
    from castfem.studies.sensitivity.coupled import FollowedCoupling
    from castfem.studies.sensitivity.mechanical import MechanicalDerivatives


class FollowedSteps(ThermalSteps):
    """Thermal steps, each followed by the derivatives.

    Args:
        stepper: Takes one step. control: Chooses its length and learns.
        derivatives: Carried through each step that is kept.
    """

    def __init__(
        self, stepper: ThermalStepper, control: StepControl, derivatives: ThermalDerivatives
    ) -> None:
        super().__init__(stepper, control)
        self._derivatives = derivatives

    def kept(self, old: ThermalState, result: StepResult) -> None:
        """Carry the derivatives through a step."""
        self._derivatives.step(old, result)


class FollowedMechanics(MechanicalSteps):
    """Mechanical steps, each followed by the derivatives.

    Args:
        steps: That are followed.
        thermal: Derivatives of the temperatures. mechanical: Of the slice.
    """

    def __init__(
        self, steps: MechanicalSteps, thermal: ThermalDerivatives, mechanical: MechanicalDerivatives
    ) -> None:
        super().__init__(steps.stepper, steps.longest)
        self._thermal, self.mechanical = thermal, mechanical
        self._before: list[Array] = []

    def mark(self, state: ThermalState) -> None:
        """Keep the derivatives of a committed state."""
        self.mechanical.mark()
        self._before = self._warming(state)

    def _warming(self, state: ThermalState) -> list[Array]:
        return [self._thermal.warming(i, state) for i in range(len(self._thermal.variations))]

    def through(self, old: MechanicalState, moments: Sequence[Moment]) -> MechanicalResult:
        """Carry the derivatives through the step of a window."""
        result = super().through(old, moments)
        if result.converged:
            assert self._thermal.reached is not None, "temperatures go first"
            after = self._warming(self._thermal.reached)
            self.mechanical.step(old, result.state, self._before, after)
        return result


def followed(coupling: StaggeredCoupling) -> FollowedCoupling:
    """The coupling as `follow` has made it."""
    from castfem.studies.sensitivity.coupled import FollowedCoupling

    assert isinstance(coupling, FollowedCoupling)
    return coupling


def mark_coupled(coupling: FollowedCoupling, state: StrandState) -> None:
    """Keep the derivatives of a committed state, after those of its temperatures (collective)."""
    assert isinstance(coupling.mechanics, FollowedMechanics)
    coupling.mechanics.mark(state.thermal)
    coupling.mark(state)
