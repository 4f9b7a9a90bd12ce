"""A step of the slice, linearised: what all parameters put out of balance, at once.

R(x; s, p) is linear in stress, pressure and traction.  Their derivatives come from both sides of a
parameter (`castfem.sensitivity.slice_sides`) or, contact's, by the chain rule; their forces are
those of sparse operators, for all parameters together.  The last axis of arrays counts parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from castfem.contact.linearised import ContactChanges, GivenChanges, LinearisedContact
from castfem.contact.state import CONTACT
from castfem.fem import dof_values, reductions
from castfem.mechanics.force_operators import ForceOperators
from castfem.mechanics.problem import MechanicalProblem
from castfem.sensitivity.beginning import Beginning
from castfem.sensitivity.given_step import GivenStep, summed
from castfem.sensitivity.moved_state import Slopes
from castfem.sensitivity.slice_sides import LawChange, SliceSides
from castfem.values.types import Array, Flags

ENOUGH = 1e-3  # of a difference: halves that are no farther apart are not looked at closely
ROUNDING = 2e-12  # of the forces in the slice: what halves of a difference may be apart for it
OF_DEVIATOR = 4.0 / 3.0  # the largest that a component of a deviator can be over that of a stress


@dataclass(frozen=True, slots=True)
class OutOfBalance:
    """What parameters put out of balance.

    Attributes:
        rights: Per unit of each, with the sign of a load (k, local), N/m.
        rounding: What of that may be rounding (k,), N/m.
        bends: While the unknowns are held, what the halves of the differences are apart, over
            these, or a bound of it (k,).
        bent: Whether that is more than rounding (k,).
        slopes: Of each, of what the next step takes up but the displacement; while the unknowns are
            held, of those alone that put nothing out of balance on this rank.
    """

    rights: Array
    rounding: Array
    bends: Array
    bent: Flags
    slopes: list[Slopes]


@dataclass(frozen=True, slots=True)
class Moved:
    """Derivatives of the motion at the end of a step.

    Attributes:
        nodal: Displacement of this rank's nodes, ghosts included (dofs, k), m.
        scalars: Scaled scalars (free, k), m.
        strains: Generalized strains (4, k).
    """

    nodal: Array
    scalars: Array
    strains: Array


@dataclass(frozen=True, slots=True)
class Answers:
    """Derivatives of what the laws answer to a motion, by each parameter.

    Attributes:
        inside: At the points with stress.
        surface: At those of the surface, for Nitsche's method; none without.
    """

    inside: list[LawChange]
    surface: list[LawChange]


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
        self._noise, self._spans = ROUNDING * largest, spans
        for one, its in zip(sides, begun, strict=True):
            one.begin(its)
        self.given = GivenStep(run, forces, sides, begun)
        now = dof_values.with_ghosts(run.space, self._local[: run.owned]), state.generalized_strains
        change = now[0] - self._old.displacement, now[1] - self._old.generalized_strains
        strain = forces.strains(change[0][:, None], change[1][:, None])
        self._strain = strain[self._stressed.kept, :, 0]
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
        moved = self._moved(moves, numbers)
        answers = self._answers(moved, numbers)
        nodal, work = self._borne([one.stress for one in answers.inside])
        if self._pressed is not None:
            nodal += self._pressed.nodal[:, numbers]
            work += self._pressed.work[:, numbers]
        touched = None
        if self._contact is not None:
            touched = self._touched(self._contact, moved, answers, numbers)
            on_nodes, on_planes = self._contact.forces(touched)
            nodal += summed(self._run, on_nodes)
            work += on_planes
        rights = self._rights(moves is None, moved, nodal, work, numbers)
        rounding = np.asarray(self._noise / self._spans[numbers])
        every = range(len(numbers))
        if moves is not None:
            slopes = [self._slopes(i, moved, answers, touched) for i in every]
            return OutOfBalance(rights, rounding, np.zeros(0), np.zeros(0, bool), slopes)
        bends, bent = self._uneven(rights, [one.bend for one in answers.inside], numbers)
        still = [not rights[i].any() for i in every]
        slopes = [self._slopes(i, moved, answers, touched) if still[i] else {} for i in every]
        return OutOfBalance(rights, rounding, bends, bent, slopes)

    def _moved(self, moves: Array | None, numbers: list[int]) -> Moved:
        """The motion that goes with moves of the unknowns; that of the planes alone without."""
        run, free, count = self._run, len(self.given.scalars), len(numbers)
        nodal: Array = np.zeros((len(self.given.displacement), count))
        scalars: Array = np.zeros((free, count))
        if moves is not None:
            owned = moves[:, : run.owned]
            nodal = np.array([dof_values.with_ghosts(run.space, one) for one in owned]).T
            shares = [run.bordered.share(one) for one in moves]
            scalars = np.reshape(np.array(shares).T, (free, count))
        strains = self.given.offset[:, numbers] + run.planes.scaled.directions @ scalars
        return Moved(nodal, scalars, strains)

    def _answers(self, moved: Moved, numbers: list[int]) -> Answers:
        """What the laws of all sides answer to the motion."""
        given, wall = self.given, self._run.contact
        change = moved.nodal - given.displacement[:, numbers]
        strains = moved.strains - given.strains[:, numbers]
        every = self._forces.strains(change, strains)[self._stressed.kept]
        every = np.moveaxis(every, 2, 0).copy()
        sides = [self._sides[number] for number in numbers]
        inside = [one.law(self._strain, every[i]) for i, one in enumerate(sides)]
        if wall is None or wall.stress is None:
            return Answers(inside, [])
        surface = []
        for i, one in enumerate(sides):
            increments = wall.stress.increments(change[:, i], strains[:, i])
            surface.append(one.law_at_surface(wall.stress.strain, increments))
        return Answers(inside, surface)

    def _borne(self, stresses: list[Array]) -> tuple[Array, Array]:
        """Forces (owned, k) and work (4, k) of stresses (m, 4) at the points that have any, N/m."""
        stress = np.zeros((self._run.active.count, 4, len(stresses)))
        stress[self._stressed.kept] = np.moveaxis(np.array(stresses), 0, 2)
        forces, work = self._forces.of_stress(stress)
        return summed(self._run, forces), work

    def _touched(
        self, contact: LinearisedContact, moved: Moved, answers: Answers, numbers: list[int]
    ) -> ContactChanges:
        """Derivatives of contact."""
        wall, given = self._run.contact, self._touching
        assert wall is not None and given is not None
        places = wall.strand.changes(moved.nodal, moved.strains)
        stress = liquid = None
        if answers.surface:
            stress = np.moveaxis(np.array([one.stress for one in answers.surface]), 0, 2)
            liquid = np.array([self._sides[n].liquid_at_surface() for n in numbers]).T
        return contact.changes(given.of(numbers), places, stress, liquid)

    def _rights(
        self, held: bool, moved: Moved, nodal: Array, work: Array, numbers: list[int]
    ) -> Array:
        """What is out of balance, with the sign of a load (k, local), N/m (collective)."""
        run, given, planes = self._run, self.given, self._run.planes
        balance = planes.scaled.test_directions.T @ work - given.load[:, numbers]
        balance += np.outer(run.bordered.share(self._local) - planes.begun, given.drag[numbers])
        balance += planes.drag * (moved.scalars - given.scalars[:, numbers])
        constraints, fixed = run.constraints, given.fixed[:, numbers]
        right = -nodal
        if held and constraints.moving:
            right -= np.array([run.lifted(one[constraints.fixed]) for one in fixed.T]).T
        at = constraints.prescribed
        right[at] = fixed[at] - moved.nodal[at]
        if (springs := constraints.springs) is not None and given.young is not None:
            drawn = (moved.nodal - given.displacement[:, numbers])[springs.dofs]
            right[springs.dofs] -= springs.force_change(self._local, given.young[numbers], drawn)
        every = range(len(numbers))
        return np.array([run.bordered.join(right[:, i], -balance[:, i]) for i in every])

    def _uneven(self, rights: Array, bends: list[Array], numbers: list[int]) -> tuple[Array, Flags]:
        """How far the halves of the differences are apart; see `OutOfBalance` (collective)."""
        run, comm = self._run, self._run.section.comm
        sizes = np.abs(rights).max(axis=1, initial=0.0) * self._spans[numbers]
        # No node can feel more of the stress than this, which mostly is little enough.
        most = [np.abs(one).max(initial=0.0) for one in bends]
        apart = OF_DEVIATOR * self._forces.most() * np.array(most)
        if self._pressed is not None:
            apart = apart + np.abs(self._pressed.bent_nodal[:, numbers]).max(axis=0, initial=0.0)
        apart, sizes = np.split(reductions.largest_of(comm, np.concatenate([apart, sizes])), 2)
        if (apart > np.maximum(ENOUGH * sizes, self._noise)).any():
            nodal, work = self._borne(bends)
            if self._pressed is not None:
                nodal += self._pressed.bent_nodal[:, numbers]
                work += self._pressed.bent_work[:, numbers]
            nodal[run.constraints.prescribed] = 0.0
            along = run.planes.scaled.test_directions.T @ work
            both = np.concatenate([nodal, along])
            apart = reductions.largest_of(comm, np.abs(both).max(axis=0, initial=0.0))
        share = np.divide(apart, sizes, out=np.full(len(sizes), np.inf), where=sizes > 0.0)
        return share, apart > self._noise

    def _slopes(
        self, i: int, moved: Moved, answers: Answers, touched: ContactChanges | None
    ) -> Slopes:
        """What the next step takes up, but the displacement and its rates."""
        run, old, here, law = self._run, self._old, self._stressed, answers.inside[i]
        dissipation = np.zeros(run.points.deviator_points)
        dissipation[here.rows[: here.deviators]] = law.dissipation[: here.deviators]
        stress, internal = np.zeros_like(old.stress), np.zeros_like(old.internal)
        stress[here.rows], internal[here.rows] = law.stress, law.internal
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
                contact[name] = getattr(answers.surface[i], name)
        return found | {f"{CONTACT}{name}": values for name, values in contact.items()}
