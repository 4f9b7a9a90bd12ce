"""Derivatives of the strained slice, carried through each mechanical step.

A step solves R(x; s, p) = 0 for the unknowns x, displacement and free generalized strains, s being
the state it begins with (stress, what the law remembers, displacement), p a parameter.  So

    J dx/dp = - dR/dp at held x,     dR/dp = dR/ds ds/dp + dR/dp,

J the consistent tangent at the end of the step, factored once.  What stands on the right is one
central difference of the residual, between slices on both sides of p that begin with the states on
both sides: the law is integrated there at the same unknowns.  Integrated once more where x has
moved with p it gives stress and memory on both sides, and so ds/dp at the end.  Points that flow go
on flowing, elastic ones stay elastic, liquid stays liquid: where a point is nearer to its yield
limit than the difference is wide, a narrower one is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.errors import RunFailure
from castfem.fem import reductions
from castfem.mechanics.definition import Slice
from castfem.mechanics.problem import MechanicalProblem
from castfem.mechanics.state import MechanicalState
from castfem.mechanics.stepper import MechanicalStepper
from castfem.sensitivity.varied import Variation, Varied
from castfem.simulation.mechanics import make_slice
from castfem.simulation.simulation import Simulation, case_steel
from castfem.values.types import Array

CARRIED = ("displacement", "generalized_strains", "scalars", "stress", "internal")
"""Parts of a mechanical state that depend on what was before."""
NARROW = (5e-2, 5e-4)  # of the step of a parameter: differences of the residual to try
UNEVEN = 1e-3  # of a difference: how far its two halves may be apart

Slopes = dict[str, Array]


@dataclass(slots=True)
class Side:
    """The slice on one side of a parameter.

    Attributes:
        by: By how much the parameter is moved, in its unit. problem: Its equilibrium.
    """

    by: float
    problem: MechanicalProblem


class MechanicalDerivatives:
    """Derivatives of the mechanical state by each parameter.

    Args:
        simulation: The run, whose slice is strained by temperatures that do not feel it.
        variations: Its parameters.

    Attributes:
        slopes: Of `CARRIED`, per unit of each parameter.
    """

    def __init__(self, simulation: Simulation, variations: Sequence[Variation]) -> None:
        assert simulation.mechanics is not None
        self._simulation, self.variations = simulation, tuple(variations)
        self._problem = simulation.mechanics.problem
        self._sides = [self._sides_of(v) for v in self.variations]
        for variation in self.variations:
            for end, sign in ((variation.above, 1.0), (variation.below, -1.0)):
                self._give_mechanics(variation, end, sign * variation.parameter.step)
        self.slopes: list[Slopes] = [{} for _ in self.variations]
        self._marked = self.slopes

    def mark(self) -> None:
        """Keep the derivatives of a committed state: a window that fails begins there again."""
        self._marked = self.slopes

    def _slice(self, variation: Variation, by: float) -> Slice:
        """The slice with a parameter moved, in its unit."""
        simulation, parameter = self._simulation, variation.parameter
        value = parameter.value + by
        case = parameter.case_at(simulation.case, value)
        assert case.mechanics is not None
        alike = case.steel == simulation.case.steel
        steel = parameter.steel_at(simulation.steel if alike else case_steel(case), value)
        end = variation.above if by > 0.0 else variation.below
        made = make_slice(
            case, case.mechanics, end.simulation.machine, steel, simulation.section,
            simulation.probes,
        )  # fmt: skip
        return replace(made, law=parameter.law_at(made.law, value))

    def _sides_of(self, variation: Variation) -> list[tuple[Side, Side]]:
        """Pairs of sides, above and below, from wide to narrow."""
        found = []
        for share in NARROW:
            by = share * variation.parameter.step
            pair = (Side(s * by, self._problem.of_slice(self._slice(variation, s * by)))
                    for s in (1.0, -1.0))  # fmt: skip
            found.append(tuple(pair))
        return found  # type: ignore[return-value]

    def _give_mechanics(self, variation: Variation, end: Varied, by: float) -> None:
        """Let results be read off the slice on one side."""
        problem = self._problem.of_slice(self._slice(variation, by))
        stepper = MechanicalStepper(problem, judge=False)
        end.simulation = replace(end.simulation, mechanics=stepper)

    def moved(self, number: int, state: MechanicalState, by: float) -> MechanicalState:
        """A state as it would be with a parameter moved, in its unit."""
        return _moved(state, self.slopes[number], by)

    def step(
        self, old: MechanicalState, state: MechanicalState, before: Sequence[Array],
        after: Sequence[Array],
    ) -> None:  # fmt: skip
        """Carry the derivatives through a step that has been kept (collective).

        Args:
            old: The state it began with.
            state: At its end.
            before: Derivative of the temperatures at its start by each parameter (owned,), K.
            after: At its end.

        Raises:
            RunFailure: The tangent cannot be factored.
        """
        problem = self._problem
        assert problem.residual_state is not None
        local = problem.residual_state.local.copy()
        problem.linearise()
        starts = [slopes or _none(old) for slopes in self._marked]
        moves: list[tuple[tuple[Side, Side], Array]] = []
        for number, pairs in enumerate(self._sides):
            temperatures = before[number], after[number]
            for pair in pairs:
                parts = [
                    self._residual(side, number, (old, state), starts[number], temperatures, local)
                    for side in pair
                ]
                halves = np.abs(parts[0] + parts[1]), np.abs(parts[0] - parts[1])
                apart, whole = (
                    reductions.largest(self._simulation.section.comm, h) for h in halves
                )
                if apart <= UNEVEN * whole:
                    break
            span = pair[0].by - pair[1].by
            move = problem.solve_linearised(np.asarray((parts[1] - parts[0]) / span))
            if move is None:
                raise RunFailure("the derivative of a mechanical step cannot be solved for")
            moves.append((pair, move))
        found: list[Slopes] = []
        for number, (pair, move) in enumerate(moves):
            temperatures = before[number], after[number]
            ends: list[Slopes] = []
            for side in pair:
                at = local + side.by * move
                self._residual(side, number, (old, state), starts[number], temperatures, at)
                ends.append(side.problem.carried(old))
            span = pair[0].by - pair[1].by
            above, below = ends
            found.append({n: np.asarray((above[n] - below[n]) / span) for n in CARRIED})
        self.slopes = found

    def _residual(
        self,
        side: Side,
        number: int,
        states: tuple[MechanicalState, MechanicalState],
        slopes: Slopes,
        temperatures: tuple[Array, Array],
        local: Array,
    ) -> Array:
        """Residual on one side at some unknowns."""
        old, new = states
        v, by = self.variations[number], side.by
        times = [t + by * v.lateness(t) for t in (old.time, new.time)]
        warm = [s.temperature + by * t for s, t in zip(states, temperatures, strict=True)]
        begun = replace(_moved(old, slopes, by), time=times[0], temperature=warm[0])
        side.problem.begin(begun, times[1], warm[1])
        return side.problem.residual_at(local)


def _none(state: MechanicalState) -> Slopes:
    return {name: np.zeros_like(getattr(state, name)) for name in CARRIED}


def _moved(state: MechanicalState, slopes: Slopes, by: float) -> MechanicalState:
    if not slopes:
        return state
    changed = {name: getattr(state, name) + by * slopes[name] for name in CARRIED}
    return replace(state, **changed)
