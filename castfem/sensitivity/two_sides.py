"""A step of the slice on both sides of a parameter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from castfem.mechanics.state import MechanicalState
from castfem.mechanics.varied_problem import VariedProblem
from castfem.sensitivity.moved_state import Slopes, between, moved
from castfem.sensitivity.varied import Variation
from castfem.values.types import Array


@dataclass(slots=True)
class Side:
    """The slice on one side of a parameter.

    Attributes:
        by: By how much the parameter is moved, in its unit.
        problem: Its equilibrium.
    """

    by: float
    problem: VariedProblem


@dataclass(frozen=True, slots=True)
class Step:
    """A step of the slice, as it is on the sides of one parameter.

    Attributes:
        variation: The parameter.
        old: The state it began with.
        state: At its end.
        start: Derivatives of the old state.
        temperatures: Derivatives of the temperatures at its start and end (owned,), K.
        local: Unknowns at its end.
    """

    variation: Variation
    old: MechanicalState
    state: MechanicalState
    start: Slopes
    temperatures: tuple[Array, Array]
    local: Array

    def begun(self, side: Side) -> VariedProblem:
        """The slice on one side, at the start of its step (collective)."""
        by, states = side.by, (self.old, self.state)
        times = [s.time + by * self.variation.lateness(s.time) for s in states]
        warm = [s.temperature + by * t for s, t in zip(states, self.temperatures, strict=True)]
        begun = replace(moved(self.old, self.start, by), time=times[0], temperature=warm[0])
        side.problem.begin(begun, times[1], warm[1])
        return side.problem


@dataclass(slots=True)
class Following:
    """A parameter's part in a step, while its derivatives are sought.

    Attributes:
        pair: Its sides, above and below. step: The step as it is there.
        right: What is out of balance per unit of the parameter, with the sign of a load, N/m.
        whole: Largest difference between the sides at held unknowns, N/m.
        left: What was out of balance after the last solution; without bounds before one.
        slopes: Of `CARRIED` but the displacement.
    """

    pair: tuple[Side, Side]
    step: Step
    right: Array
    whole: float
    left: float = np.inf
    slopes: Slopes = field(default_factory=dict)

    @property
    def span(self) -> float:
        """Between the sides, in the unit of the parameter."""
        return self.pair[0].by - self.pair[1].by

    def moved(self, move: Array) -> list[Array]:
        """Residuals on both sides where the unknowns have moved with the parameter (collective)."""
        parts, ends = [], []
        for side in self.pair:
            side.problem.again()
            parts.append(side.problem.residual_at(self.step.local, side.by * move))
            ends.append(side.problem.carried(self.step.old))
        self.slopes = between(ends, self.span)
        return parts

    def supports(self) -> list[Array]:
        """Displacements of the supports on both sides (owned,), m (collective)."""
        found = []
        for side in self.pair:
            side.problem.again()
            found.append(side.problem.at_supports())
        return found
