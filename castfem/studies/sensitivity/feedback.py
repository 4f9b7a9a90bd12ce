"""What the strained slice does to the heat balance of a coupling window, differentiated.

Beside the gap, which the laws of the surface see, that is the heat of viscoplastic work and the
shape of the slice (`castfem.studies.sensitivity.shape_change`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from castfem.base.types import Array
from castfem.physics.thermal.problem import Stage, ThermalProblem
from castfem.studies.sensitivity.shape_change import ShapeChange


@dataclass(slots=True)
class Feedback:
    """Derivatives of what a window hands to its thermal steps, by each parameter.

    Attributes:
        duration: Of the window, s.
        heating: Of the heat of viscoplastic work (parameters, owned), J/m3; empty without.
        shape: Of the shape; None where heat does not follow it.
    """

    duration: float
    heating: Array = field(default_factory=lambda: np.zeros((0, 0)))
    shape: ShapeChange | None = None

    def of_stage(self, stage: Stage, problem: ThermalProblem) -> Array:
        """What stands on the right of a stage (parameters or 1, owned), J/m (collective)."""
        found: Array = np.zeros((1, len(stage.enthalpy)))
        if self.heating.size:
            found = stage.tau / self.duration * problem.area * self.heating
        if self.shape is not None:
            found = found + self.shape.of_stage(stage)
        return found

    def gained(self, share: float, change: Array, problem: ThermalProblem) -> Array:
        """Derivatives of what leaves in a step beside that by its change of enthalpy, J/m.

        Args:
            share: Of the window that the step is.
            change: Of the enthalpy over the step (owned,), J/m3.
            problem: The heat balance.

        Returns:
            (parameters,) or one for all.
        """
        found: Array = np.zeros(1)
        if self.heating.size:
            found = share * (self.heating @ problem.area)
        if self.shape is not None:
            found = found - self.shape.filled @ (problem.area * change)
        return found
