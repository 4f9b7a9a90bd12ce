"""A step of the slice, linearised for all parameters at once.

R(x; s, p) is linear in stress, pressure and traction. Their derivatives come from both sides of a
parameter (`castfem.studies.sensitivity.perturbed_slices`) or, for contact, from the chain rule;
their forces come from sparse operators, for all parameters together. The last axis of arrays counts
parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.constitutive.base import ResponseChange
from castfem.physics.contact.linearised import ContactChanges, GivenChanges, LinearisedContact
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.force_operators import ForceOperators
from castfem.physics.mechanics.generalized_plane_strain import ScaledPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.studies.sensitivity.law_changes import LawChanges
from castfem.studies.sensitivity.perturbed_slices import SIGNS, SliceSides, slope_by_temperature
from castfem.studies.sensitivity.step_inputs import Beginning, Slopes


def summed(run: MechanicalProblem, local: Array) -> Array:
    """Sum contributions of all ranks to forces (dofs, k), at the owned unknowns (collective)."""
    if run.section.comm.size == 1:
        return local
    return np.array([dof_values.summed(run.space, column) for column in local.T]).T


class GivenStep:
    """Derivatives of the input of a step, from the arguments of `linearised_step.LinearisedStep`.

    Attributes:
        displacement: Displacement at the start (dofs, k), m.
        strains: Generalized strains at the start (4, k).
        scalars: Scaled scalars at the start (free, k), m.
        offset: Imposed generalized strains at the end (4, k).
        load: Load on the planes (free, k), N/m.
        drag: Restraint of the planes before there is a shell (k,), N/m per m.
        fixed: Prescribed displacements, of supports and deep liquid (owned, k), m.
        young: Modulus of the springs (k,), Pa; None without springs.
    """

    def __init__(
        self,
        run: MechanicalProblem,
        forces: ForceOperators,
        sides: Sequence[SliceSides],
        begun: Sequence[Beginning],
    ) -> None:
        self._run, self._forces, self._pairs = run, forces, list(zip(sides, begun, strict=True))
        self.count = len(self._pairs)
        self.displacement = np.array([its.start["displacement"] for its in begun]).T
        self.strains = np.array([its.start["generalized_strains"] for its in begun]).T
        starts = np.array([its.start["scalars"] for its in begun]).T
        self.scalars = starts / run.planes.scaled.scaling[:, None]
        self.offset, self.load = self._planes()
        self.drag = self._drags()
        self.fixed = self._supports()
        self.young = None if run.constraints.springs is None else self._stiffest()

    def _planes(self) -> tuple[Array, Array]:
        run = self._run
        offset = np.zeros((4, self.count))
        load = np.zeros((len(run.planes.scaled.load), self.count))
        for number, (sides, its) in enumerate(self._pairs):
            if sides.same_planes and (not its.late[1] or run.slice.planes.steady):
                continue

            def given(one: Slice, by: float, its: Beginning = its) -> Array:
                planes = ScaledPlanes.of(
                    one.planes, its.old.bending, its.times(by)[1], run.scales.length
                )
                return np.concatenate([planes.offset, planes.load])

            change = sides.quotient(given)
            offset[:, number], load[:, number] = change[:4], change[4:]
        return offset, load

    def _drags(self) -> Array:
        run = self._run
        if run.liquid is None or run.liquid.bears:
            return np.zeros(self.count)

        def drag(one: Slice, by: float) -> float:
            return run.planes.drag_by(one.young_at_solidus())

        return np.array([sides.quotient(drag) for sides, _ in self._pairs])

    def _supports(self) -> Array:
        run, constraints = self._run, self._run.constraints
        found = np.zeros((run.owned, self.count))
        if constraints.moving:
            at, targets = constraints.fixed, np.zeros((2, len(self.displacement)))
            for number, (sides, its) in enumerate(self._pairs):
                for target, sign in zip(targets, SIGNS, strict=True):
                    constraints.set(its.times(sign * sides.by)[1], target)
                found[at, number] = (targets[0] - targets[1])[at] / sides.span
            constraints.set(self._pairs[0][1].state.time, targets[0])
        if run.liquid is not None:
            found[run.liquid.deep] = self.displacement[run.liquid.deep]
        return found

    def _stiffest(self) -> Array:
        """Derivative of the largest Young's modulus, at its place."""
        run, here = self._run, self._pairs[0][1].points[1]
        young = run.slice.law.elasticity.moduli(here)[2]
        at = np.array([np.argmax(young)] if len(here) else [], np.int64)
        found = np.zeros(self.count)
        for number, (sides, its) in enumerate(self._pairs):
            above, below = (
                one.law.elasticity.moduli(here[at] + sign * sides.by * its.warming[1][at])[2]
                for one, sign in zip(sides.slices, SIGNS, strict=True)
            )
            most = [part.max(initial=-np.inf) for part in (above, below)]
            ends = reductions.largest_of(run.section.comm, most)
            found[number] = (ends[0] - ends[1]) / sides.span
        return found

    def contact(self, contact: LinearisedContact) -> GivenChanges:
        """Derivatives of the contact's input other than the motion at the end of the step."""
        wall = self._run.contact
        assert wall is not None
        found = GivenChanges.none(wall.facets.count, self.count)
        found.before = wall.strand.changes(self.displacement, self.strains)
        for number, (sides, its) in enumerate(self._pairs):
            found.friction[:, :, number] = its.start[f"{CONTACT}friction"]
            found.resistance[:, number] = its.start[f"{CONTACT}withdrawal_resistance"]
            sides.give(contact, found, number)
        return found

    def pressed(self) -> tuple[Array, Array] | None:
        """Derivatives of the forces by the liquid's pressure (collective); None without it.

        Returns:
            Forces of the owned unknowns (owned, k), N/m; work on each generalized strain (4, k).
        """
        run, first = self._run, self._run.points.deviator_points
        if run.slice.ferrostatic is None or run.fields.pressure is None:
            return None
        here = self._pairs[0][1].points[1][first:]
        found = self._pressures(here, [its.warming[1][first:] for _, its in self._pairs])
        nodal, work = np.zeros((run.owned, self.count)), np.zeros((4, self.count))
        sizes = reductions.largest_of(run.section.comm, np.abs(found).max(axis=0, initial=0.0))
        some = np.flatnonzero(sizes)
        if len(some):
            local, work[:, some] = self._forces.of_pressure(found[:, some])
            nodal[:, some] = summed(run, local)
        if run.loads.liquid is not None:
            state = self._pairs[0][1].state
            outside = self._pressures(
                state.temperature, [its.vertices[1] for _, its in self._pairs]
            )
            nodal += self._forces.of_held_liquid(outside)
        return nodal, work

    def _pressures(self, here: Array, warming: Sequence[Array]) -> Array:
        """Derivatives of the ferrostatic pressure (n, k), Pa, at temperatures (n,), K."""
        liquid, time = self._run.slice.ferrostatic, self._pairs[0][1].state.time
        assert liquid is not None
        now = liquid.pressure(here, time)
        rise = slope_by_temperature(lambda t: liquid.pressure(t, time), here, now)
        return np.array(
            [
                sides.pressure(its, here, rise, change)
                for (sides, its), change in zip(self._pairs, warming, strict=True)
            ]
        ).T


Some = list[int] | slice
"""Indices of some of the parameters, or all."""


@dataclass(frozen=True, slots=True)
class OutOfBalance:
    """Residuals caused by parameters."""

    rights: Array  #: per unit of each, with the sign of a load (k, local), N/m
    rounding: Array  #: rounding of these (k,), N/m
    #: derivatives for the next step by each parameter, without displacement; at constant unknowns
    #: only for parameters without a residual on this rank
    slopes: list[Slopes]


@dataclass(frozen=True, slots=True)
class Moved:
    """Derivatives of the motion at the end of a step."""

    nodal: Array  #: displacement of this rank's nodes, including ghosts (dofs, k), m
    scalars: Array  #: scaled scalars (free, k), m
    strains: Array  #: generalized strains (4, k)


@dataclass(frozen=True, slots=True)
class Answers:
    """Derivatives of the responses of the laws to a motion, by each parameter."""

    inside: ResponseChange  #: response at the points with stress
    surface: list[ResponseChange]  #: response at the surface for Nitsche's method, otherwise empty


class LinearisedStep:
    """An accepted step, with the sides of some parameters.

    Args:
        run: The equilibrium of the run, at the solution.
        forces: Its operators.
        sides: Sides of each parameter.
        begun: Their derivatives at the start.

    Attributes:
        given: Derivatives of the input of the step.
    """

    def __init__(
        self,
        run: MechanicalProblem,
        forces: ForceOperators,
        sides: Sequence[SliceSides],
        begun: Sequence[Beginning],
    ) -> None:
        state = run.residual_state
        assert state is not None
        self._run, self._forces, self._sides = run, forces, tuple(sides)
        self._old, self._stressed, self._local = begun[0].old, begun[0].stressed, state.local
        largest = reductions.largest(run.section.comm, np.abs(state.forces))
        spans = np.array([one.span for one in sides])
        self._noise, self._spans = 2e-12 * largest, spans  # rounding of the forces in the slice
        for one, its in zip(sides, begun, strict=True):
            one.begin(its)
        self.given = GivenStep(run, forces, sides, begun)
        now = dof_values.with_ghosts(run.space, self._local[: run.owned]), state.generalized_strains
        change = now[0] - self._old.displacement, now[1] - self._old.generalized_strains
        strain = forces.strains(change[0][:, None], change[1][:, None])
        self._law = LawChanges(run, sides, begun, strain[0, self._stressed.kept])
        self._contact: LinearisedContact | None = None
        self._touching: GivenChanges | None = None
        if run.contact is not None:
            before = self._old.displacement, self._old.generalized_strains
            assert self._old.contact is not None
            self._contact = LinearisedContact(run.contact, self._old.contact, now, before)
            self._touching = self.given.contact(self._contact)
        self._pressed = self.given.pressed()

    def evaluate(self, moves: Array | None, numbers: list[int]) -> OutOfBalance:
        """Residuals caused by some of the parameters (collective).

        Args:
            moves: Derivatives of the unknowns (k, local); None at constant unknowns.
            numbers: Indices of these parameters.
        """
        # Usually all of them: arrays are then views, not copies.
        some = slice(None) if len(numbers) == len(self._sides) else numbers
        moved = self._moved(moves, some)
        answers = self._answers(moved, numbers, some, held=moves is None)
        nodal, work = self._borne(answers.inside.stress)
        if self._pressed is not None:
            nodal += self._pressed[0][:, some]
            work += self._pressed[1][:, some]
        touched = None
        if self._contact is not None:
            touched = self._touched(self._contact, moved, answers, numbers, some)
            on_nodes, on_planes = self._contact.forces(touched)
            nodal += summed(self._run, on_nodes)
            work += on_planes
        rights = self._rights(moves is None, moved, nodal, work, some)
        rounding = np.asarray(self._noise / self._spans[some])
        every = range(len(numbers))
        ended = [moves is not None or not rights[i].any() for i in every]
        slopes = [self._slopes(i, moved, answers, touched) if ended[i] else {} for i in every]
        return OutOfBalance(rights, rounding, slopes)

    def _moved(self, moves: Array | None, some: Some) -> Moved:
        """The motion for derivatives of the unknowns; without these only that of the planes."""
        run, free = self._run, len(self.given.scalars)
        offset = self.given.offset[:, some]
        count = offset.shape[1]
        nodal: Array = np.zeros((len(self.given.displacement), count))
        scalars: Array = np.zeros((free, count))
        if moves is not None:
            owned = moves[:, : run.owned]
            nodal = np.array([dof_values.with_ghosts(run.space, one) for one in owned]).T
            shares = [run.bordered.share(one) for one in moves]
            scalars = np.reshape(np.array(shares).T, (free, count))
        strains = offset + run.planes.scaled.directions @ scalars
        return Moved(nodal, scalars, strains)

    def _answers(self, moved: Moved, numbers: list[int], some: Some, *, held: bool) -> Answers:
        """Responses of the laws of all sides to the motion."""
        given, wall = self.given, self._run.contact
        change = moved.nodal - given.displacement[:, some]
        strains = moved.strains - given.strains[:, some]
        every = self._forces.strains(change, strains)[:, self._stressed.kept]
        inside = self._law.held(every) if held else self._law.moved(every, some)
        if wall is None or wall.stress is None:
            return Answers(inside, [])
        surface = []
        for i, number in enumerate(numbers):
            increments = wall.stress.strained.increments(change[:, i], strains[:, i])
            surface.append(self._sides[number].law_at_surface(wall.stress.strain, increments))
        return Answers(inside, surface)

    def _borne(self, stresses: Array) -> tuple[Array, Array]:
        """Forces (owned, k), work (4, k) of stresses (k, m, 4) at the points with stress, N/m."""
        stress = np.zeros((len(stresses), self._run.active.count, 4))
        stress[:, self._stressed.kept] = stresses
        forces, work = self._forces.of_stress(stress)
        return summed(self._run, forces), work

    def _touched(
        self,
        contact: LinearisedContact,
        moved: Moved,
        answers: Answers,
        numbers: list[int],
        some: Some,
    ) -> ContactChanges:
        wall, given = self._run.contact, self._touching
        assert wall is not None and given is not None
        places = wall.strand.changes(moved.nodal, moved.strains)
        stress = liquid = None
        if answers.surface:
            stress = np.moveaxis(np.array([one.stress[0] for one in answers.surface]), 0, 2)
            liquid = np.array([self._sides[n].liquid_at_surface() for n in numbers]).T
        return contact.changes(given.of(some), places, stress, liquid)

    def _rights(self, held: bool, moved: Moved, nodal: Array, work: Array, some: Some) -> Array:
        """Residuals with the sign of a load (k, local), N/m (collective)."""
        run, given, planes = self._run, self.given, self._run.planes
        balance = planes.scaled.test_directions.T @ work - given.load[:, some]
        balance += np.outer(run.bordered.share(self._local) - planes.begun, given.drag[some])
        balance += planes.drag * (moved.scalars - given.scalars[:, some])
        constraints, fixed = run.constraints, given.fixed[:, some]
        right = -nodal
        if held and constraints.moving:
            right -= np.array([run.lifted(one[constraints.fixed]) for one in fixed.T]).T
        at = constraints.prescribed
        right[at] = fixed[at] - moved.nodal[at]
        if (springs := constraints.springs) is not None and given.young is not None:
            drawn = (moved.nodal - given.displacement[:, some])[springs.dofs]
            right[springs.dofs] -= springs.force_change(self._local, given.young[some], drawn)
        every = range(right.shape[1])
        return np.array([run.bordered.join(right[:, i], -balance[:, i]) for i in every])

    def _slopes(
        self, i: int, moved: Moved, answers: Answers, touched: ContactChanges | None
    ) -> Slopes:
        """Derivatives at the start of the next step, without displacement and rates."""
        run, old, here, law = self._run, self._old, self._stressed, answers.inside
        dissipation = np.zeros(run.points.deviator_points)
        dissipation[here.rows[: here.deviators]] = law.dissipation[i, : here.deviators]
        stress, internal = np.zeros_like(old.stress), np.zeros_like(old.internal)
        stress[here.rows], internal[here.rows] = law.stress[i], law.state[i]
        found = {
            "dissipation": dissipation,
            "generalized_strains": moved.strains[:, i].copy(),
            "scalars": moved.scalars[:, i] * run.planes.scaled.scaling,
            "stress": stress,
            "internal": internal,
        }
        if touched is None or old.contact is None:
            return found
        contact = {name: values[..., i].copy() for name, values in touched.numbers().items()}
        contact["weight"] = np.zeros_like(old.contact.weight)
        for name in ("stress", "internal"):
            contact[name] = np.zeros_like(getattr(old.contact, name))
        if answers.surface:
            at_surface = answers.surface[i]
            contact["stress"], contact["internal"] = at_surface.stress[0], at_surface.state[0]
        return found | {f"{CONTACT}{name}": values for name, values in contact.items()}
