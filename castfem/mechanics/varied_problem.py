"""Equilibrium of a slice of other numbers on the mesh of a run, as its derivatives need it."""

from __future__ import annotations

import copy

import numpy as np

from castfem.contact.state import ContactState
from castfem.contact.wall_contact import WallContact
from castfem.fem import reductions
from castfem.mechanics.active_part import Rest
from castfem.mechanics.definition import Slice
from castfem.mechanics.liquid import FedLiquid
from castfem.mechanics.material_points import Material
from castfem.mechanics.problem import MechanicalProblem
from castfem.mechanics.scaling import StressScale
from castfem.mechanics.state import MechanicalState
from castfem.values.types import Array, Flags

NO_SCALE = StressScale(0.0, 0.0, 0.0)


class VariedProblem(MechanicalProblem):
    """The equilibrium of another slice, to be asked for its residual alone.

    It shares fields, forms and matrices with the run: use the two in turn, and destroy the run's
    alone.  What is liquid there is so here, and what touches, sticks and slides as well.

    Args:
        run: The equilibrium whose mesh, fields and forms it takes.
        slice_: Of the same planes, supports and kinds of interactions, with other numbers.
    """

    def __init__(self, run: MechanicalProblem, slice_: Slice) -> None:
        vars(self).update(vars(run))  # nothing is built or compiled a second time
        self._run = run
        self.slice, self._material = slice_, Material(slice_.law, self.active)
        self.interactions = run.interactions.of_slice(slice_.interactions, slice_)
        self.planes = run.planes.of_slice(slice_.planes, self.interactions)
        self.residual_state, self._integrated = None, None
        self._begun: tuple[MechanicalState, float, list[Array]] | None = None
        self._held = copy.copy(self.constraints.springs)
        self._base: tuple[Array, Array] | None = None

    def begin(self, old: MechanicalState, time: float, temperature: Array) -> None:
        """See `MechanicalProblem`."""
        super().begin(old, time, temperature)
        self._base = None
        self._begun = old, time, [one.copy() for one in self._shared()]
        self._held = copy.copy(self.constraints.springs)

    def _shared(self) -> list[Array]:
        """Arrays of a step that other slices on this mesh write to as they begin theirs."""
        functions = self.fields.pressure, self._loads.liquid
        found = [one.x.array for one in functions if one is not None]
        return found if self.contact is None else [*found, self.contact.travelled]

    def again(self) -> None:
        """Go on with the step that was begun last, after another slice has begun its own."""
        assert self._begun is not None
        old, time, kept = self._begun
        fields = self.fields
        fields.u_old.x.array[:] = old.displacement
        fields.generalized_strains_old.value[:] = old.generalized_strains
        for one, values in zip(self._shared(), kept, strict=True):
            one[...] = values
        if self._held is not None:
            vars(self.constraints.springs).update(vars(self._held))
        self._loads.set(time)
        self.constraints.set(time, self._target)
        if self.liquid is not None:
            self._target[self.liquid.deep] = old.displacement[self.liquid.deep]
        self.residual_state, self._integrated, self._first = None, None, 0.0

    def _frozen(self, liquid: FedLiquid, temperature: Array) -> Flags:
        """See `MechanicalProblem`: as in the run's last step."""
        self._material = Material(self.slice.law, self.active)
        return self._run._solid

    def _pressed_rest(self) -> Rest:
        """See `MechanicalProblem`: that of the run where liquid presses there as it does."""
        run, pressure = self._run, self.pressure
        at = self.active.rest() if pressure.size else np.zeros(0, np.int64)
        same = np.array_equal(pressure[at], run.pressure[at])
        if reductions.any_of(self.section.comm, not same):
            return super()._pressed_rest()
        return run.rest

    def _scale(self, parts: tuple[Array, Array, Array], local: Array, noise: float) -> StressScale:
        """See `MechanicalProblem`: nothing here is judged by it."""
        return NO_SCALE

    def residual_at(self, local: Array, move: Array) -> Array:
        """Forces that are not in equilibrium at local unknowns moved a little, N/m (collective).

        Args:
            local: The unknowns; the same array in all of a step.
            move: By how much they are moved.
        """
        if (wall := self.contact) is not None:
            scaled = self.planes.scaled
            if self._base is None or self._base[0] is not local:
                strains = scaled.generalized_strains(self.bordered.share(local))
                self._base = local, self._points_moved(wall, local, strains)
            strains = scaled.directions @ self.bordered.share(move)
            wall.shifted(self._base[1], self._points_moved(wall, move, strains))
        return self._residual(local + move).copy()

    def _points_moved(self, wall: WallContact, local: Array, generalized_strains: Array) -> Array:
        """How far local unknowns move the points of the surface (n, 2), m (collective)."""
        motion = self._work.x
        motion.array[: self.owned] = local[: self.owned]
        motion.scatter_forward()
        return wall.strand.moved(motion.array, generalized_strains)

    def at_supports(self) -> Array:
        """Displacements of this rank's unknowns (owned,) where supports prescribe them, else 0, m.

        In the step that was begun last.
        """
        found = np.zeros_like(self.fields.u.x.array)
        for condition in self.constraints.conditions:
            condition.set(found)
        return found[: self.owned]

    def carried(self, old: MechanicalState) -> dict[str, Array]:
        """What the next step takes up of the unknowns evaluated last, by its name in a state.

        All but the displacement.
        """
        found, points = self.residual_state, self.points.count
        assert found is not None
        beside = self.slice.law.initial_state(points)
        contact = next((s for s in self.interactions.states() if isinstance(s, ContactState)), None)
        of_contact = {} if contact is None else contact.numbers()
        dissipation, n = np.zeros(self.points.deviator_points), self.active.deviator_points
        dissipation[self.active.deviator] = self.response.dissipation[:n]
        return of_contact | {
            "dissipation": dissipation,
            "generalized_strains": found.generalized_strains.copy(),
            "scalars": self.free_scalars(found.local),
            "stress": self.active.spread(self.response.stress, np.zeros_like(old.stress)),
            "internal": self.active.spread(self.response.state, beside),
        }
