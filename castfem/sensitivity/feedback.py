"""What the strained slice does to the heat balance of a coupling window, differentiated.

Beside the gap, which the laws of the surface see, that is the heat of viscoplastic work and the
shape of the slice: conduction L through it, shares w of its surface, volume M that its steel fills.
In the derivative of a stage, M (H - H_base) + tau (L theta + w q - M s) = 0, they stand on the
right.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from petsc4py import PETSc

import numpy as np

from castfem.thermal.boundary import Patch
from castfem.thermal.problem import Stage, ThermalProblem
from castfem.values.types import Array


@dataclass(slots=True)
class ShapeSlopes:
    """Derivatives of what the shape gives the heat balance, by one parameter.

    Attributes:
        conduction: Of L.
        weights: Of the shares of the perimeter, with their patch.
        filled: Of the volume that the vertices' steel fills, over the undeformed one (owned,).
    """

    conduction: PETSc.Mat
    weights: list[tuple[Patch, Array]]
    filled: Array

    def of_stage(self, stage: Stage, problem: ThermalProblem) -> Array:
        """What stands on the right of a stage (owned,), J/m."""
        flow = np.zeros_like(stage.enthalpy)
        theta, out = self.conduction.createVecs()
        theta.setArray(stage.point.conduction)
        self.conduction.mult(theta, out)
        flow += out.getArray(readonly=True)
        theta.destroy()
        out.destroy()
        slopes = {id(patch): slope for patch, slope in self.weights}
        for patch, law in problem.cooling.laws:
            flux = law.flux(stage.point.temperature[patch.dofs], stage.time)[0]
            flow[patch.dofs] += slopes[id(patch)] * flux
        return -stage.tau * (problem.area * self.filled * stage.rate + flow)


@dataclass(slots=True)
class Feedback:
    """Derivatives of what a window hands to its thermal steps, by each parameter.

    Attributes:
        duration: Of the window, s.
        heating: Of the heat of viscoplastic work (parameters, owned), J/m3; empty without.
        shape: Of the shape; empty where heat does not follow it.
    """

    duration: float
    heating: Array = field(default_factory=lambda: np.zeros((0, 0)))
    shape: list[ShapeSlopes] = field(default_factory=list)

    def of_stage(self, number: int, stage: Stage, problem: ThermalProblem) -> Array:
        """What stands on the right of a stage by one parameter (owned,), J/m."""
        found = np.zeros_like(stage.enthalpy)
        if self.heating.size:
            found += stage.tau / self.duration * problem.area * self.heating[number]
        if self.shape:
            found += self.shape[number].of_stage(stage, problem)
        return found

    def gained(self, number: int, share: float, change: Array, problem: ThermalProblem) -> float:
        """Derivative of what leaves in a step beside that by its change of enthalpy, J/m.

        Args:
            number: Of the parameter.
            share: Of the window that the step is.
            change: Of the enthalpy over the step (owned,), J/m3.
            problem: The heat balance.
        """
        found = 0.0
        if self.heating.size:
            found += share * float(problem.area @ self.heating[number])
        if self.shape:
            found -= float((problem.area * self.shape[number].filled) @ change)
        return found
