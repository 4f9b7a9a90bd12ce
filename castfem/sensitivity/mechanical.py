"""Derivatives of the strained slice, carried through each mechanical step.

A step solves R(x; s, p) = 0 for the unknowns x, displacement and free generalized strains, s being
the state it begins with (stress, what the law remembers, displacement), p a parameter.  So

    J dx/dp = - dR/dp at held x,     dR/dp = dR/ds ds/dp + dR/dp,

J the consistent tangent at the end of the step, factored once.  What stands on the right is one
central difference of the residual, between slices on both sides of p that begin with the states on
both sides: the law is integrated there at the same unknowns.  Integrated once more where x has
moved with p it gives stress and memory on both sides, and so ds/dp at the end.  Points that flow go
on flowing, elastic ones stay elastic, liquid stays liquid: where a point is nearer to its yield
limit than the difference is wide, a narrower one is tried.  All parameters are solved for at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from castfem.case.build_machine import build_machine
from castfem.contact.state import CONTACT
from castfem.errors import RunFailure
from castfem.fem import dof_values, reductions
from castfem.mechanics.definition import Slice
from castfem.mechanics.state import MechanicalState
from castfem.mechanics.stepper import MechanicalStepper
from castfem.mechanics.surface_gap import SurfaceGap
from castfem.mechanics.varied_problem import VariedProblem
from castfem.sensitivity.kinks import Kinks
from castfem.sensitivity.moved_state import Slopes, apart, motion, moved, none_of
from castfem.sensitivity.two_sides import Following, Side, Step
from castfem.sensitivity.varied import Variation, Varied
from castfem.simulation.mechanics import make_slice
from castfem.simulation.simulation import Simulation, case_steel
from castfem.values.types import Array

NARROW = (5e-2, 5e-4)  # of the step of a parameter: differences of the residual to try
UNEVEN = 1e-3  # of a difference: how far its two halves may be apart
EXACT = 1e-4  # of the largest derivative of stress or of pressure: what may be out of balance
AT_ONCE = 1e-5  # the same, before anything is corrected
OF_ALL = 1e-7  # of the right-hand side: likewise, where nothing touches
STALE = 0.1  # of what it was before a correction: what remains is rounding
SOLVES = 5  # with the tangent, at most


def lengthened(variation: Variation, begin: float, end: float) -> float:
    """Derivative of the time between two times of the run (s), s per unit."""
    return variation.lateness(end) - variation.lateness(begin)


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
        self._still = VariedProblem(self._problem, self._problem.slice)
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
                time = state.time + side.by * variation.lateness(state.time)
                contact = side.problem.contact
                assert contact is not None
                ends.append(gap.to_wall(contact).of(time, *motion(state, its, side.by)))
            slope = np.zeros(self._simulation.section.owned)
            change = apart(ends[0], ends[1]) / (pair[0].by - pair[1].by)
            slope[gap.dofs] = np.where(open_, change, 0.0)
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

    def moved(self, number: int, state: MechanicalState, by: float) -> MechanicalState:
        """A state as it would be with a parameter moved, in its unit."""
        return moved(state, self.slopes[number], by)

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
        problem, count = self._problem, len(self._sides)
        assert problem.residual_state is not None
        local = problem.residual_state.local.copy()
        problem.linearise()
        self._still.begin(old, state.time, state.temperature)
        left = self._still.residual_at(local, np.zeros_like(local))
        begun = []
        for number, pairs in enumerate(self._sides):
            start = self.marked[number] or none_of(old)
            temperatures = before[number], after[number]
            step = Step(self.variations[number], old, state, start, temperatures, local)
            begun.append(self._begun(pairs, step, left))
        moves: Array = np.zeros((count, len(local)))
        following = [number for number, one in enumerate(begun) if one.whole > 0.0]
        for _ in range(SOLVES):
            if not following:
                break
            more = problem.solve_linearised(np.array([begun[n].right for n in following]))
            if more is None:
                raise RunFailure("the derivative of a mechanical step cannot be solved for")
            moves[following] += more
            following = [n for n in following if self._out_of_balance(begun[n], moves[n])]
        for one, move in zip(begun, moves, strict=True):
            if not one.slopes:  # nothing is out of balance
                one.moved(np.asarray(move))
        found = [one.slopes for one in begun]
        changes = self._displacements(begun, moves)
        for variation, start, slopes, change in zip(
            self.variations, self.marked, found, changes, strict=True
        ):
            slopes["displacement"] = change
            slopes |= self._rates(variation, old, state, start or none_of(old), slopes)
        self.slopes = found

    def _rates(
        self, variation: Variation, old: MechanicalState, state: MechanicalState, start: Slopes,
        slopes: Slopes,
    ) -> Slopes:  # fmt: skip
        """Derivatives of the rates over a step, whose length may depend on the parameter.

        Args:
            variation: The parameter.
            old: The state the step began with.
            state: At its end.
            start: Derivatives of the old state.
            slopes: Of the state, its displacement and scalars among them.
        """
        dt, longer = state.time - old.time, lengthened(variation, old.time, state.time)
        owned = slice(0, self._problem.owned)
        moved = slopes["displacement"][owned] - start["displacement"][owned]
        turned = slopes["scalars"] - start["scalars"]
        return {
            "rate": np.asarray((moved - longer * state.rate) / dt),
            "scalar_rate": np.asarray((turned - longer * state.scalar_rate) / dt),
        }

    def going_on(self, old: MechanicalState, end: float) -> list[Slopes]:
        """Derivatives of the place of a committed state that goes on moving (collective).

        Args:
            old: The committed state, to which `marked` belong.
            end: To when, s; see `MechanicalStepper.going_on`.
        """
        problem, dt, found = self._problem, end - old.time, []
        directions = problem.slice.planes.at(end)[1]
        for variation, marked in zip(self.variations, self.marked, strict=True):
            its, longer = marked or none_of(old), lengthened(variation, old.time, end)
            moved = dof_values.with_ghosts(problem.space, dt * its["rate"] + longer * old.rate)
            scalars = its["scalars"] + dt * its["scalar_rate"] + longer * old.scalar_rate
            found.append(
                {
                    "displacement": np.asarray(its["displacement"] + moved),
                    "generalized_strains": np.asarray(directions @ scalars),
                }
            )
        return found

    def _begun(self, pairs: Sequence[tuple[Side, Side]], step: Step, left: Array) -> Following:
        """What a parameter puts out of balance at held unknowns, by the best pair (collective).

        Args:
            pairs: Of sides, from wide to narrow.
            step: The step as it is there.
            left: What is out of balance where the parameter is.
        """
        comm, still = self._simulation.section.comm, np.zeros_like(step.local)
        found = []
        for pair in pairs:
            one, other = (step.begun(side).residual_at(step.local, still) for side in pair)
            halves = np.abs(one + other - 2.0 * left), np.abs(one - other)
            uneven, whole = (reductions.largest(comm, h) for h in halves)
            right = np.asarray((other - one) / (pair[0].by - pair[1].by))
            share = uneven / whole if whole > 0.0 else np.inf  # too narrow to show anything
            found.append((share, Following(pair, step, right, whole)))
            if uneven <= UNEVEN * whole:
                break
        return min(found, key=lambda one: one[0])[1]

    def _out_of_balance(self, following: Following, move: Array) -> bool:
        """Take what the next step takes up; whether the unknowns are to be corrected (collective).

        Newton's tangent may leave something out, as the turn of friction round an arc does: what
        is out of balance where they have moved corrects them. Where the wall is met it is so stiff
        that an error of displacement that nothing else shows is one of its pressure.
        """
        comm, one, other = self._simulation.section.comm, *following.moved(move)
        following.right = np.asarray((other - one) / following.span)
        if not self._touches:
            left = reductions.largest(comm, np.abs(one - other))
            return left > OF_ALL * following.whole
        before, first = following.left, np.isinf(following.left)
        following.left = now = self._unbalanced(following.right, following.slopes)
        return now > AT_ONCE if first else EXACT < now <= STALE * before

    def _displacements(self, begun: Sequence[Following], moves: Array) -> list[Array]:
        """Derivatives of the displacements of this rank's nodes, ghosts included (collective)."""
        problem = self._problem
        found, held = np.array(moves[:, : problem.owned]), problem.constraints.fixed
        if problem.constraints.moving:
            for number, one in enumerate(begun):
                above, below = one.supports()
                found[number, held] = ((above - below) / one.span)[held]
        if problem.liquid is not None:
            found = problem.liquid.followed(found)
        return [dof_values.with_ghosts(problem.space, change) for change in found]

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
