"""A step of the slice, linearised: what all parameters put out of balance, at once.

R(x; s, p) is linear in stress, pressure and traction.  Their derivatives come from both sides of a
parameter (`castfem.studies.sensitivity.perturbed_slices`) or, contact's, by the chain rule; their
forces are those of sparse operators, for all parameters together.  The last axis of arrays counts
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
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.studies.sensitivity.law_changes import LawChanges
from castfem.studies.sensitivity.perturbed_slices import SliceSides
from castfem.studies.sensitivity.step_input_derivatives import GivenStep, summed
from castfem.studies.sensitivity.step_inputs import Beginning, Slopes

Some = list[int] | slice
"""Numbers of some of the parameters, or all."""


@dataclass(frozen=True, slots=True)
class OutOfBalance:
    """What parameters put out of balance."""

    rights: Array  #: per unit of each, with the sign of a load (k, local), N/m
    rounding: Array  #: what of that may be rounding (k,), N/m
    #: of each, of what the next step takes up but the displacement; while the unknowns are held, of
    #: those alone that put nothing out of balance on this rank
    slopes: list[Slopes]


@dataclass(frozen=True, slots=True)
class Moved:
    """Derivatives of the motion at the end of a step."""

    nodal: Array  #: displacement of this rank's nodes, ghosts included (dofs, k), m
    scalars: Array  #: scaled scalars (free, k), m
    strains: Array  #: generalized strains (4, k)


@dataclass(frozen=True, slots=True)
class Answers:
    """Derivatives of what the laws answer to a motion, by each parameter."""

    inside: ResponseChange  #: at the points with stress
    surface: list[ResponseChange]  #: at those of the surface, for Nitsche's method; none without


class LinearisedStep:
    """A step that has been kept, with the sides of some parameters.

    Args:
        run: The equilibrium of the run, at the solution.
        forces: Its operators.
        sides: Of each parameter.
        begun: What they begin with.

    Attributes:
        given: What the step is given by the parameters.
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
        self._noise, self._spans = 2e-12 * largest, spans  # of the forces in the slice
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
        """What some of the parameters put out of balance (collective).

        Args:
            moves: How the unknowns move with them (k, local); None while they are held.
            numbers: Of these parameters.
        """
        # All of them, as a rule: arrays are then looked at, not copied.
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
        """The motion that goes with moves of the unknowns; that of the planes alone without."""
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
        """What the laws of all sides answer to the motion."""
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
        """Forces (owned, k), work (4, k) of stresses (k, m, 4) at the points that have any, N/m."""
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
        """What is out of balance, with the sign of a load (k, local), N/m (collective)."""
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
        """Derivatives that the next step begins with, without displacement and rates."""
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
