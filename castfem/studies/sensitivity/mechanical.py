"""Derivatives of the strained slice, through each mechanical step.

A step solves R(x; s, p) = 0 for the unknowns x, displacement and free generalized strains, where s
is the initial state (stress, state variables of the law, displacement) and p a parameter. So

    J dx/dp = - dR/dp at held x,     dR/dp = dR/ds ds/dp + dR/dp,

with J the consistent tangent at the end of the step, factored once. The right-hand side has the
forces from derivatives of stress, pressure and traction
(`castfem.studies.sensitivity.linearised_step`). Those of the law are first evaluated at constant
unknowns, with the derivatives of the state; evaluated again with x moving with p they give stress
and state variables, and so ds/dp at the end. Points keep their status: flowing, elastic or liquid.
All parameters are solved for at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.model.build.mechanics import make_slice
from castfem.model.build.simulation import Simulation, case_steel
from castfem.model.machine_from_case import build_machine
from castfem.physics.contact.linearised import WallMet
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.force_operators import ForceOperators
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.surface_gap import SurfaceGap
from castfem.studies.sensitivity.linearised_step import LinearisedStep
from castfem.studies.sensitivity.parameters import ELASTIC, EXPANSION, Parameter
from castfem.studies.sensitivity.perturbed_simulation import Variation, Varied
from castfem.studies.sensitivity.perturbed_slices import SIGNS, SliceSides
from castfem.studies.sensitivity.result import Kink
from castfem.studies.sensitivity.step_inputs import Beginning, Slopes, Stressed, moved, none_of


@dataclass(frozen=True, slots=True)
class StepTolerances:
    """Differences and corrections of a differentiated mechanical step."""

    narrow: float = 5e-2  #: distance of the sides of a parameter, relative to its step
    #: allowed residual, relative to the largest derivative of stress or pressure
    stress: float = 1e-4
    first: float = 1e-5  #: the same before any correction
    #: allowed residual without contact, relative to the right-hand side
    free: float = 1e-7
    stale: float = 0.1  #: reduction that a correction must achieve; otherwise the rest is rounding
    solves: int = 5  #: largest number of solutions with one tangent


TOLERANCES = StepTolerances()


def lengthened(variation: Variation, begin: float, end: float) -> float:
    """Derivative of the time between two times of the run (s), s per unit."""
    return variation.lateness(end) - variation.lateness(begin)


@dataclass(slots=True)
class Following:
    """State of a parameter while its derivatives are computed in a step."""

    right: Array  #: residual per unit of it, with the sign of a load (local,), N/m
    whole: float  #: largest residual at constant unknowns
    #: residual after the last solution; inf before one
    left: float = np.inf
    rounding: float = 0.0  #: rounding of `right`, N/m


class MechanicalDerivatives:
    """Derivatives of the mechanical state by each parameter.

    Args:
        simulation: The run, in which temperatures do not depend on the mechanics.
        variations: Its parameters.

    Attributes:
        slopes: Derivatives of `CARRIED`, per unit of each parameter; empty before a step.
        marked: Derivatives of the committed state.
        kinks: Places where contact was about to change, one per window and parameter.
    """

    def __init__(self, simulation: Simulation, variations: Sequence[Variation]) -> None:
        assert simulation.mechanics is not None
        self._simulation, self.variations = simulation, tuple(variations)
        self._problem = simulation.mechanics.problem
        self._forces = ForceOperators(self._problem)
        self._sides = [self._sides_of(variation) for variation in self.variations]
        for variation in self.variations:
            for end, sign in ((variation.above, 1.0), (variation.below, -1.0)):
                self._give_mechanics(variation, end, sign * variation.parameter.step)
        self.slopes: list[Slopes] = [{} for _ in self.variations]
        self.marked = self.slopes
        self.kinks: list[Kink] = []

    def mark(self) -> None:
        """Keep the derivatives of a committed state, from which a failed window starts again."""
        self.marked = self.slopes

    def committed(self, state: MechanicalState) -> list[Slopes]:
        """The derivatives of the committed state; zeros if there are none yet."""
        return [slopes or none_of(state) for slopes in self.marked]

    def _slice(self, variation: Variation, by: float) -> Slice:
        """The slice with a parameter moved, in its unit."""
        simulation, parameter = self._simulation, variation.parameter
        value = parameter.value + by
        case = parameter.case_at(simulation.case, value)
        alike = case.steel == simulation.case.steel
        steel = parameter.steel_at(simulation.steel if alike else case_steel(case), value)
        its = replace(simulation, case=case, machine=build_machine(case), steel=steel)
        return self._made(its, parameter, by)

    def _sides_of(self, variation: Variation) -> SliceSides:
        case, by = self._simulation.case, TOLERANCES.narrow * variation.parameter.step
        above, below = (self._slice(variation, sign * by) for sign in SIGNS)
        its = variation.above.simulation.case
        same = its.mould == case.mould and its.section == case.section
        return SliceSides(self._problem, (above, below), by, same)

    def _give_mechanics(self, variation: Variation, end: Varied, by: float) -> None:
        """Give the simulation on one side its slice, so that results can be sampled."""
        its = end.simulation
        strained = self._problem.of_slice(self._made(its, variation.parameter, by))
        end.simulation = replace(its, strained=strained)

    def _made(self, its: Simulation, parameter: Parameter, by: float) -> Slice:
        """The slice of a simulation in which a parameter is moved.

        Parts that the parameter does not change are the objects of the run, and recognised by that.
        """
        case, run, held = its.case, self._simulation.case, self._problem.slice
        assert case.mechanics is not None
        alike = case.steel == run.steel and case.mechanics == run.mechanics
        law = held.law if alike and parameter.steel not in ELASTIC else None
        made = make_slice(
            case, case.mechanics, its.machine, its.steel, its.section, its.probes, law
        )
        made = replace(made, law=parameter.law_at(made.law, parameter.value + by))
        if alike and parameter.steel != EXPANSION:
            made = replace(made, thermal_strain=held.thermal_strain)
        if alike and made.ferrostatic is not None and held.ferrostatic is not None:
            freezing = held.ferrostatic.solid_fraction
            made = replace(made, ferrostatic=replace(made.ferrostatic, solid_fraction=freezing))
        return made

    def gaps(self, gap: SurfaceGap, slopes: Sequence[Slopes], state: MechanicalState) -> Array:
        """Derivatives of the gaps for heat transfer by each parameter (k, gaps), m (collective).

        Args:
            gap: Computes it.
            slopes: Derivatives of a new state by each parameter.
            state: State of the gap.
        """
        assert state.contact is not None
        name, none = f"{CONTACT}gap", np.zeros_like(state.contact.gap)
        changes = np.array([its.get(name, none) for its in slopes])
        return self._crossed(gap, state.contact.gap, changes)

    def gaps_of_motion(
        self, gap: SurfaceGap, slopes: Sequence[Slopes], state: MechanicalState
    ) -> Array:
        """The same for a state of which only the motion is known, as from `going_on`."""
        wall = self._problem.contact
        assert wall is not None
        position = wall.contact.position(state.time)
        motion = state.displacement, state.generalized_strains
        place = WallMet(wall.strand, wall.contact.wall, position, motion)
        moved = (np.array([its[name] for its in slopes]).T
                 for name in ("displacement", "generalized_strains"))  # fmt: skip
        changes = place.change(wall.strand.changes(*moved))[1].T.copy()
        for number, variation in enumerate(self.variations):
            sides, late = self._sides[number], variation.lateness(state.time)
            positions = [
                side.contact.position(state.time + sign * sides.by * late)
                for side, sign in zip(sides.walls, SIGNS, strict=True)
            ]
            changes[number] += sides.wall_moved(place, positions)[1]
        return self._crossed(gap, place.gap, changes)

    def _crossed(self, gap: SurfaceGap, here: Array, changes: Array) -> Array:
        """Convert changes of the gap at the points (k, n) to those for heat transfer (k, gaps)."""
        now = gap.across(here)
        open_ = (now > 0.0) & np.isfinite(now)
        found = np.zeros((len(changes), gap.count))
        for number in range(len(changes)):
            found[number, gap.places] = np.where(open_, gap.sides(changes[number]), 0.0)
        return found

    def look(self, state: MechanicalState) -> None:
        """Record where contact is about to change in a committed state (collective).

        There, within the step of its difference quotients, a parameter has one-sided derivatives.
        """
        contact, comm = self._problem.contact, self._simulation.section.comm
        if contact is None or contact.now is None or state.contact is None:
            return
        met, closed = state.contact, contact.status[0]
        left = np.where(closed, met.pressure, met.gap)
        for variation, slopes in zip(self.variations, self.slopes, strict=True):
            if not slopes:
                continue
            parameter = variation.parameter
            change = np.abs(np.where(closed, *(slopes[CONTACT + n] for n in ("pressure", "gap"))))
            near = np.isfinite(left) & (change > 0.0) & (np.abs(left) <= parameter.step * change)
            if count := int(reductions.total(comm, float(near.sum()))):
                _, x, y = reductions.peak(comm, near.astype(float), met.place)
                position = self._simulation.machine.position(state.time)
                self.kinks.append(Kink(parameter.name, position, count, (x, y)))

    def moved(self, number: int, state: MechanicalState, by: float) -> MechanicalState:
        """A state as it would be with a parameter moved, in its unit."""
        return moved(state, self.slopes[number], by)

    def step(
        self, old: MechanicalState, state: MechanicalState, before: Sequence[Array],
        after: Sequence[Array],
    ) -> None:  # fmt: skip
        """Differentiate an accepted step (collective).

        Args:
            old: State at its start.
            state: State at its end.
            before: Derivative of the temperatures at its start by each parameter (owned,), K.
            after: Derivative at its end.
        """
        problem = self._problem
        assert problem.residual_state is not None
        problem.linearise()
        begun = self._begun(old, state, before, after)
        step, every = LinearisedStep(problem, self._forces, self._sides, begun), range(len(begun))
        held = step.evaluate(None, list(every))
        following = [
            Following(right, reductions.largest(self._simulation.section.comm, np.abs(right)))
            for right in held.rights
        ]
        moves: Array = np.zeros((len(following), len(problem.residual_state.local)))
        found = held.slopes
        asked = [number for number in every if following[number].whole > 0.0]
        for _ in range(TOLERANCES.solves):
            if not asked:
                break
            more = problem.solve_linearised(np.array([following[n].right for n in asked]))
            if more is None:
                raise RunFailure(
                    "the linear system for the derivative of a mechanical step cannot be solved"
                )
            moves[asked] += more
            left = step.evaluate(moves[asked], asked)
            for i, number in enumerate(asked):
                following[number].right, found[number] = left.rights[i], left.slopes[i]
                following[number].rounding = float(left.rounding[i])
            asked = [n for n in asked if self._out_of_balance(following[n], found[n])]
        changes = self._displacements(step, moves)
        for variation, its, slopes, change in zip(
            self.variations, begun, found, changes, strict=True
        ):
            slopes["displacement"] = change
            slopes |= self._rates(variation, old, state, its.start, slopes)
        self.slopes = found

    def _begun(
        self, old: MechanicalState, state: MechanicalState, before: Sequence[Array],
        after: Sequence[Array],
    ) -> list[Beginning]:  # fmt: skip
        """Data at the start of a step, by each parameter (collective)."""
        problem, committed, found = self._problem, self.committed(old), []
        points = problem.at_points(old.temperature), problem.at_points(state.temperature)
        stressed = Stressed.of(problem, old, state, points)
        warm = [problem.points.vertex @ self._at_vertices(one).T for one in (before, after)]
        for number, variation in enumerate(self.variations):
            late = variation.lateness(old.time), variation.lateness(state.time)
            warming = warm[0][:, number].copy(), warm[1][:, number].copy()
            vertices = before[number], after[number]
            found.append(
                Beginning(old, state, committed[number], stressed, points, warming, vertices, late)
            )
        return found

    def _at_vertices(self, owned: Sequence[Array]) -> Array:
        """Values at this rank's vertices, including ghosts, for several (n, owned) (collective)."""
        space = self._problem.section.vertex_space
        return np.array([dof_values.with_ghosts(space, values) for values in owned])

    def _rates(
        self, variation: Variation, old: MechanicalState, state: MechanicalState, start: Slopes,
        slopes: Slopes,
    ) -> Slopes:  # fmt: skip
        """Derivatives of the rates over a step, whose length may depend on the parameter.

        Args:
            variation: The parameter.
            old: State at the start of the step.
            state: State at its end.
            start: Derivatives of the old state.
            slopes: Derivatives of the state, including displacement and scalars.
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
        """Derivatives of the motion of a committed state extrapolated in time (collective).

        Args:
            old: The committed state, to which `marked` belong.
            end: End of the extrapolation, s; see `MechanicalStepper.going_on`.
        """
        problem, dt, found = self._problem, end - old.time, []
        directions = problem.slice.planes.at(end)[1]
        for variation, its in zip(self.variations, self.committed(old), strict=True):
            longer = lengthened(variation, old.time, end)
            moved = dof_values.with_ghosts(problem.space, dt * its["rate"] + longer * old.rate)
            scalars = its["scalars"] + dt * its["scalar_rate"] + longer * old.scalar_rate
            found.append(
                {
                    "displacement": np.asarray(its["displacement"] + moved),
                    "generalized_strains": np.asarray(directions @ scalars),
                }
            )
        return found

    def _out_of_balance(self, following: Following, slopes: Slopes) -> bool:
        """Whether the unknowns need a correction (collective).

        Newton's tangent may lack terms, such as the rotation of friction around an arc: the
        residual after the motion corrects this. In contact the stiffness is so high that an error
        of displacement, otherwise negligible, is one of the contact pressure.
        """
        left = reductions.largest(self._simulation.section.comm, np.abs(following.right))
        if left <= following.rounding:
            return False
        if not self._touches:
            return left > TOLERANCES.free * following.whole
        before, first = following.left, np.isinf(following.left)
        following.left = now = self._unbalanced(following.right, slopes)
        return (
            now > TOLERANCES.first
            if first
            else TOLERANCES.stress < now <= TOLERANCES.stale * before
        )

    def _displacements(self, step: LinearisedStep, moves: Array) -> list[Array]:
        """Derivatives of the displacements of this rank's nodes, including ghosts (collective)."""
        problem = self._problem
        found, held = np.array(moves[:, : problem.owned]), problem.constraints.fixed
        found[:, held] = step.given.fixed.T[:, held]
        if problem.liquid is not None:
            found = problem.liquid.followed(found)
        return [dof_values.with_ghosts(problem.space, change) for change in found]

    @property
    def _touches(self) -> bool:
        """Whether there is contact with the wall at the end of the step (collective)."""
        contact = self._problem.contact
        if contact is None:
            return False
        return reductions.any_of(self._simulation.section.comm, bool(contact.status[0].any()))

    def _unbalanced(self, left: Array, slopes: Slopes) -> float:
        """Residual relative to the derivatives of stress and pressure (collective).

        It is evaluated by node, as the stress around it that would cause the force.
        """
        problem, comm = self._problem, self._simulation.section.comm
        by_stress = problem.scales.force_per_stress
        nodal = np.abs(left[: len(by_stress)]) / by_stress
        nodal[problem.constraints.prescribed] = 0.0
        sizes = nodal, *(np.abs(slopes[name]) for name in ("stress", f"{CONTACT}pressure"))
        worst, *derivatives = (reductions.largest(comm, size) for size in sizes)
        return worst / min((d for d in derivatives if d > 0.0), default=np.inf)
