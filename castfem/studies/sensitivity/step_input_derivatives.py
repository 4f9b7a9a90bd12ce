"""What a step of the slice is given by each parameter, beside the law at its points.

The last axis of the arrays here counts the parameters (k).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.contact.linearised import GivenChanges, LinearisedContact
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.definition import Slice
from castfem.physics.mechanics.force_operators import ForceOperators
from castfem.physics.mechanics.planes import ScaledPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.studies.sensitivity.perturbed_slices import SIGNS, SliceSides, slope_by_temperature
from castfem.studies.sensitivity.step_inputs import Beginning


def summed(run: MechanicalProblem, local: Array) -> Array:
    """Contributions of all ranks to forces (dofs, k), at the owned unknowns (collective)."""
    if run.section.comm.size == 1:
        return local
    return np.array([dof_values.summed(run.space, column) for column in local.T]).T


class GivenStep:
    """Derivatives of what a step is given, from what `linearised_step.LinearisedStep` is.

    Attributes:
        displacement: At the start (dofs, k), m.
        strains: Generalized strains at the start (4, k).
        scalars: Scaled scalars at the start (free, k), m.
        offset: Generalized strains that are imposed at the end (4, k).
        load: On the planes (free, k), N/m.
        drag: Of what holds them before there is a shell (k,), N/m per m.
        fixed: What is prescribed, by supports and of deep liquid (owned, k), m.
        young: Of the modulus that springs are measured by (k,), Pa; None without springs.
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
        """Derivative of the largest Young's modulus, where it is."""
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
        """What contact is given beside the motion at the end of the step."""
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
        """What the pressure of the liquid changes by (collective); None without any.

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
