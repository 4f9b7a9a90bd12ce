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
from typing import Any

import numpy as np

from castfem.case.build_machine import build_machine
from castfem.contact.state import CONTACT
from castfem.errors import RunFailure
from castfem.fem import reductions
from castfem.mechanics.definition import Slice
from castfem.mechanics.state import MechanicalState
from castfem.mechanics.stepper import MechanicalStepper
from castfem.mechanics.surface_gap import SurfaceGap
from castfem.mechanics.varied_problem import VariedProblem
from castfem.sensitivity.kinks import Kinks
from castfem.sensitivity.varied import Variation, Varied
from castfem.simulation.mechanics import make_slice
from castfem.simulation.simulation import Simulation, case_steel
from castfem.values.types import Array

CARRIED = ("displacement", "generalized_strains", "scalars", "stress", "internal")
"""Parts of a mechanical state that depend on what was before."""
NARROW = (5e-2, 5e-4)  # of the step of a parameter: differences of the residual to try
UNEVEN = 1e-3  # of a difference: how far its two halves may be apart

EXACT = 1e-4  # of the largest derivative of stress or of pressure: what may be out of balance
OF_ALL = 1e-7  # of the right-hand side: likewise, where nothing touches
STALE = 0.1  # of what it was before a correction: what remains is rounding
SOLVES = 5  # with the tangent, at most

Slopes = dict[str, Array]


@dataclass(slots=True)
class Side:
    """The slice on one side of a parameter.

    Attributes:
        by: By how much the parameter is moved, in its unit.
        problem: Its equilibrium.
    """

    by: float
    problem: VariedProblem


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
        self.marked = self.slopes
        self.kinks = Kinks(simulation.section.comm)

    def mark(self) -> None:
        """Keep the derivatives of a committed state: a window that fails begins there again."""
        self.marked = self.slopes

    def _slice(self, variation: Variation, by: float) -> Slice:
        """The slice with a parameter moved, in its unit."""
        simulation, parameter = self._simulation, variation.parameter
        value = parameter.value + by
        case = parameter.case_at(simulation.case, value)
        assert case.mechanics is not None
        alike = case.steel == simulation.case.steel
        steel = parameter.steel_at(simulation.steel if alike else case_steel(case), value)
        machine = build_machine(case)
        made = make_slice(
            case, case.mechanics, machine, steel, simulation.section, simulation.probes
        )
        return replace(made, law=parameter.law_at(made.law, value))

    def _sides_of(self, variation: Variation) -> list[tuple[Side, Side]]:
        """Pairs of sides, above and below, from wide to narrow."""
        found = []
        for share in NARROW:
            by = share * variation.parameter.step
            pair = (Side(s * by, VariedProblem(self._problem, self._slice(variation, s * by)))
                    for s in (1.0, -1.0))  # fmt: skip
            found.append(tuple(pair))
        return found  # type: ignore[return-value]

    def _give_mechanics(self, variation: Variation, end: Varied, by: float) -> None:
        """Let results be read off the slice on one side."""
        problem = VariedProblem(self._problem, self._slice(variation, by))
        stepper = MechanicalStepper(problem, judge=False)
        end.simulation = replace(end.simulation, mechanics=stepper)

    def gaps(
        self, gap: SurfaceGap, state: MechanicalState, slopes: Sequence[Slopes]
    ) -> list[Array]:
        """Derivatives of the gap that heat crosses by each parameter (owned,), m (collective).

        Args:
            gap: Measures it.
            state: Whose gap it is.
            slopes: Of that state, by each parameter.
        """
        here, found = gap.at(state), []
        open_ = (here > 0.0) & np.isfinite(here)
        for variation, its, pairs in zip(self.variations, slopes, self._sides, strict=True):
            pair, ends = pairs[0], []
            for side in pair:
                moved = _moved(state, its, side.by)
                moved = replace(moved, time=state.time + side.by * variation.lateness(state.time))
                contact = side.problem.contact
                assert contact is not None
                ends.append(gap.to_wall(contact).at(moved))
            slope = np.zeros(self._simulation.section.owned)
            apart = _apart(ends[0], ends[1]) / (pair[0].by - pair[1].by)
            slope[gap.dofs] = np.where(open_, apart, 0.0)
            found.append(slope)
        return found

    def look(self, state: MechanicalState) -> None:
        """Note where contact is about to change in a committed state (collective)."""
        contact = self._problem.contact
        if contact is None or contact.now is None or state.contact is None:
            return
        position = self._simulation.machine.position(state.time)
        for variation, slopes in zip(self.variations, self.slopes, strict=True):
            if slopes:
                self.kinks.look(
                    variation.parameter, position, state.contact, contact.status[0], slopes
                )

    def at(self, state: MechanicalState, slopes: Slopes, by: float) -> MechanicalState:
        """A state as it would be with a parameter moved, by derivatives that are given."""
        return _moved(state, slopes, by)

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
        found: list[Slopes] = []
        for number, pairs in enumerate(self._sides):
            start = self.marked[number] or none_of(old)
            temperatures = before[number], after[number]
            step = _Step(self.variations[number], old, state, start, temperatures, local)
            found.append(self._solved(pairs, step))
        self.slopes = found

    def _solved(self, pairs: Sequence[tuple[Side, Side]], step: _Step) -> Slopes:
        """Derivatives at the end of a step by one parameter (collective).

        Newton's tangent may leave something out, as the turn of friction round an arc does: what
        is out of balance where x has moved corrects it. Where the wall is met that is done once at
        least: it is so stiff that an error of displacement that nothing else shows is one of its
        pressure.
        """
        comm = self._simulation.section.comm
        move = np.zeros_like(step.local)
        for pair in pairs:
            parts = [step.begun(side).residual_at(step.local, move) for side in pair]
            halves = np.abs(parts[0] + parts[1]), np.abs(parts[0] - parts[1])
            apart, whole = (reductions.largest(comm, h) for h in halves)
            if apart <= UNEVEN * whole:
                break
        span = pair[0].by - pair[1].by
        worst = np.inf
        for taken in range(SOLVES):
            more = self._problem.solve_linearised(np.asarray((parts[1] - parts[0]) / span))
            if more is None:
                raise RunFailure("the derivative of a mechanical step cannot be solved for")
            move, ends = move + more, []
            for number, side in enumerate(pair):
                side.problem.again()
                parts[number] = side.problem.residual_at(step.local, side.by * move)
                ends.append(side.problem.carried(step.old))
            left, slopes = parts[0] - parts[1], _slopes(ends, span)
            if not self._touches:
                if reductions.largest(comm, np.abs(left)) <= OF_ALL * whole:
                    break
                continue
            before, worst = worst, self._unbalanced(np.asarray(left / span), slopes)
            if taken and (worst <= EXACT or worst > STALE * before):
                break
        return slopes

    @property
    def _touches(self) -> bool:
        """Whether the wall is met at the end of the step (collective)."""
        contact = self._problem.contact
        if contact is None:
            return False
        return reductions.any_of(self._simulation.section.comm, bool(contact.status[0].any()))

    def _unbalanced(self, left: Array, slopes: Slopes) -> float:
        """What is out of balance, over the derivatives of stress and of pressure (collective).

        It is looked at by node, as the stress round it that would make such a force.
        """
        problem, comm = self._problem, self._simulation.section.comm
        by_stress = problem.scales.force_per_stress
        nodal = np.abs(left[: len(by_stress)]) / by_stress
        nodal[problem.constraints.prescribed] = 0.0
        sizes = nodal, *(np.abs(slopes[name]) for name in ("stress", f"{CONTACT}pressure"))
        worst, *derivatives = (reductions.largest(comm, size) for size in sizes)
        return worst / min((d for d in derivatives if d > 0.0), default=np.inf)


def _slopes(ends: Sequence[Slopes], span: float) -> Slopes:
    above, below = ends
    return {n: np.asarray(_apart(above[n], below[n]) / span) for n in above}


@dataclass(frozen=True, slots=True)
class _Step:
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
        begun = replace(_moved(self.old, self.start, by), time=times[0], temperature=warm[0])
        side.problem.begin(begun, times[1], warm[1])
        return side.problem


def none_of(state: MechanicalState) -> Slopes:
    """Derivatives of a state that depends on no parameter."""
    found = {name: np.zeros_like(getattr(state, name)) for name in CARRIED}
    if state.contact is not None:
        found |= {name: np.zeros_like(v) for name, v in state.contact.numbers().items()}
    return found


def _apart(above: Array, below: Array) -> Array:
    """One less the other; 0 where both are without bounds, as the gap to no wall."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nan_to_num(above - below, nan=0.0), dtype=np.float64)


def _moved(state: MechanicalState, slopes: Slopes, by: float) -> MechanicalState:
    if not slopes:
        return state
    changed: Slopes = {name: getattr(state, name) + by * slopes[name] for name in CARRIED}
    if state.contact is not None:
        numbers = state.contact.numbers()
        changed |= {name: value + by * slopes[name] for name, value in numbers.items()}
    return with_numbers(state, changed)


def with_numbers(state: MechanicalState, numbers: Slopes) -> MechanicalState:
    """A state with other numbers, by their names in `Slopes`."""
    changed: dict[str, Any] = {name: numbers[name] for name in CARRIED}
    if state.contact is not None:
        touched: dict[str, Any] = {
            name.removeprefix(CONTACT): numbers[name] for name in state.contact.numbers()
        }
        contact = replace(state.contact, **touched)
        changed["interactions"] = tuple(
            contact if one is state.contact else one for one in state.interactions
        )
    return replace(state, **changed)
