"""A jump of the rates where the cooling changes: how long the first step after it may be.

With the rates before the jump the estimated error of that step would be mostly the jump itself.
With the rates after it, each vertex is treated as if it alone returned exponentially to its heat
balance with the new cooling: then the rates of a step's stages are known, and with them its
estimated error for any length of the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.thermal.stepper import DEFECT, GAMMA, ThermalState, ThermalStepper


@dataclass(frozen=True, slots=True)
class Jump:
    """The rates of a state whose cooling has just changed."""

    stepper: ThermalStepper
    before: ThermalState  #: state at the change, with the rates before it
    rate: Array  #: dH/dt with the present cooling (owned,), W/m3
    decay: Array  #: rate at which the balance of a vertex closes (owned,), 1/s

    @classmethod
    def of(cls, stepper: ThermalStepper, state: ThermalState) -> Jump:
        """The jump at a state, with the present cooling, gaps and shape."""
        problem, point = stepper.problem, state.point
        if problem.cooling.prescribed:  # its neighbours feel the new temperature at once
            enthalpy = state.enthalpy.copy()
            enthalpy[problem.fixed] = problem.fixed_enthalpy
            point = problem.curve.at(enthalpy)
        return cls(stepper, state, *problem.rate(point, state.time))

    def errors(self, steps: Array) -> Array:
        """Expected errors of a first step (n,), K, for its length (n,), s (collective)."""
        change = np.abs((self.rate - self.before.rate) * self.before.point.temperature_slope)
        x = np.multiply.outer(steps, self.decay)
        if self.stepper.scheme == "sdirk2":
            first = 1.0 / (1.0 + GAMMA * x)  # rates of the stages, as a fraction of the first rate
            last = (1.0 - (1.0 - 2.0 * GAMMA) * x) * first**2
            share = np.abs(DEFECT[0] + DEFECT[1] * first + DEFECT[2] * last)
        else:
            share = 0.5 * x / (1.0 + x)
        largest = (share * change).max(axis=1, initial=0.0)
        return steps * reductions.largest_of(self.stepper.comm, largest)

    def state(self, step: float) -> ThermalState:
        """The state with the rates after the jump, for a first step of a length, s."""
        tau = (GAMMA if self.stepper.scheme == "sdirk2" else 1.0) * step
        expected = self.before.rate + (self.rate - self.before.rate) / (1.0 + tau * self.decay)
        return replace(self.before, rate=self.rate, next_rate=expected, cooling_changed=False)
