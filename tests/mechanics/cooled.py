"""A section that cools and strains in equal steps: heat balance, then mechanics, in memory."""

from __future__ import annotations

from typing import Any, Self

from thermal.setups import ThermalSetup

from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.state import MechanicalResult
from castfem.physics.mechanics.stepper import MechanicalStepper


class CooledSlice:
    def __init__(self, thermal: ThermalSetup, slice_: Slice, **settings: Any) -> None:
        self.thermal = thermal
        self.problem = MechanicalProblem(thermal.section, slice_, **settings)
        self.stepper = MechanicalStepper(self.problem)
        self.state = self.stepper.initial(0.0, thermal.state.point.temperature)
        self.results: list[MechanicalResult] = []

    def advance(self, end: float, step: float) -> Self:
        """Take equal steps to `end` (s)."""
        begin = self.state.time
        count = round((end - begin) / step)
        for i in range(count):
            time = begin + (end - begin) * (i + 1) / count
            self.thermal.advance(time, time)
            result = self.stepper.step(self.state, time, self.thermal.state.point.temperature)
            assert result.converged, result.reason
            self.state = result.state
            self.results.append(result)
        return self
