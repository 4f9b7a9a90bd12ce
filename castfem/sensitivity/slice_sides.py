"""The slice on both sides of a parameter: what is no linear function of what it is given.

That is the law at the points, the pressure of the liquid, the wall and its friction.  Everything
else that is in equilibrium follows from these linearly, for all parameters at once
(`castfem.sensitivity.linearised_step`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from castfem.constitutive.base import Response
from castfem.contact.linearised import GivenChanges, LinearisedContact, WallMet
from castfem.contact.state import CONTACT
from castfem.mechanics.definition import Slice
from castfem.mechanics.material_points import FedPoints, Material
from castfem.mechanics.problem import MechanicalProblem
from castfem.sensitivity.beginning import Beginning
from castfem.values.types import Array

SIGNS = (1.0, -1.0)  # above a parameter, and below
SAME_PLACE = 1e-14  # of a position: how far two may be apart for rounding


@dataclass(frozen=True, slots=True)
class LawChange:
    """Derivatives of what a law answers at some points.

    Attributes:
        stress: (n, 4), Pa.
        internal: State of the law (n, states).
        dissipation: (n,), J/m3.
        bend: What the two halves of the difference are apart in the stress (n, 4), Pa.
    """

    stress: Array
    internal: Array
    dissipation: Array
    bend: Array

    @classmethod
    def between(cls, above: Response, below: Response, now: Array, span: float) -> LawChange:
        """From what it answers above and below a parameter, `span` apart; the stress is `now`."""
        return cls(
            stress=np.asarray((above.stress - below.stress) / span),
            internal=np.asarray((above.state - below.state) / span),
            dissipation=np.asarray((above.dissipation - below.dissipation) / span),
            bend=np.asarray(above.stress + below.stress - 2.0 * now),
        )


class SliceSides:
    """The slice with a parameter moved up and down.

    Args:
        run: The equilibrium of the run.
        slices: The slice above and below.
        by: How far the parameter is moved, in its unit.
        same_wall: Whether its mould is that of the run.

    Attributes:
        span: Between the sides, in the unit of the parameter.
        same_planes: Whether what constrains and loads the planes is that of the run.
        walls: Contact above and below; none without a mould.
    """

    def __init__(
        self, run: MechanicalProblem, slices: tuple[Slice, Slice], by: float, same_wall: bool
    ) -> None:
        self.slices, self.by, self.span = slices, by, 2.0 * by
        self._run, self._same_wall = run, same_wall
        self.same_planes = all(one.planes == run.slice.planes for one in slices)
        given = (run.interactions.of_slice(one.interactions, one).wall for one in slices)
        self.walls = tuple(wall for wall in given if wall is not None)
        self._size = (-1, -1)
        self._materials: list[Material] = []
        self._at_surface: list[tuple[Array, Array]] = []
        self._begun: Beginning | None = None

    def begin(self, its: Beginning) -> None:
        """Prepare the law and the wall of both sides for a step, once (collective)."""
        if self._begun is its:
            return
        self._begun, here = its, its.stressed
        size = len(here.rows), here.deviators
        if size != self._size:
            self._size, self._materials = size, [Material(s.law, *size) for s in self.slices]
        stress, internal = (its.start[name][here.rows] for name in ("stress", "internal"))
        warming = [change[here.rows] for change in its.warming]
        for material, slice_, sign in zip(self._materials, self.slices, SIGNS, strict=True):
            by = sign * self.by
            before, after = here.before + by * warming[0], here.after + by * warming[1]
            strain = slice_.thermal_strain
            thermal = np.asarray(strain(after)) - np.asarray(strain(before))
            begun = here.stress + by * stress, here.internal + by * internal
            start, end = its.times(by)
            fed = _fed(here.fed, slice_, end)
            if not self._run.points.whole:
                before, after = self._stiff(its, by)
            material.begin(before, after, thermal, end - start, begun, fed)
        if self.walls:
            self._begin_walls(its)

    def _stiff(self, its: Beginning, by: float) -> tuple[Array, Array]:
        """Temperatures that moduli are to be taken at, see `Points.stiffness_temperature`, K."""
        points, rows = self._run.points, its.stressed.rows
        before, after = (
            points.stiffness_temperature(here + by * change)[rows]
            for here, change in zip(its.points, its.warming, strict=True)
        )
        return before, after

    def _begin_walls(self, its: Beginning) -> None:
        """Prepare the contact of both sides (collective)."""
        old, self._at_surface = its.old.contact, []
        assert old is not None
        for wall, sign in zip(self.walls, SIGNS, strict=True):
            by = sign * self.by
            before, after = (
                here + by * change
                for here, change in zip(
                    (its.old.temperature, its.state.temperature), its.vertices, strict=True
                )
            )
            wall.begin(old, *its.times(by), before, after)
            if wall.stress is not None:
                stress = old.stress + by * its.start[f"{CONTACT}stress"]
                internal = old.internal + by * its.start[f"{CONTACT}internal"]
                self._at_surface.append((stress, internal))

    def law(self, strain: Array, change: Array) -> LawChange:
        """Integrate the law at the points with stress.

        Args:
            strain: Increments there (m, 4).
            change: Their derivatives (m, 4).
        """
        assert self._begun is not None
        for material, sign in zip(self._materials, SIGNS, strict=True):
            material.integrate(strain + sign * self.by * change)
        above, below = (material.response for material in self._materials)
        return LawChange.between(above, below, self._begun.stressed.now, self.span)

    def law_at_surface(self, strain: Array, change: Array) -> LawChange:
        """The same at the points of the surface, where Nitsche's method asks for the stress."""
        run = self._run.contact
        assert run is not None and run.stress is not None
        answers = []
        for wall, begun, sign in zip(self.walls, self._at_surface, SIGNS, strict=True):
            assert wall.stress is not None
            answers.append(wall.stress.integrate(strain + sign * self.by * change, *begun))
        above, below = answers
        return LawChange.between(above, below, run.stress.response.stress, self.span)

    def liquid_at_surface(self) -> Array:
        """Derivative of the liquid's pressure in Nitsche's stress (n,), Pa."""
        above, below = (wall.stress for wall in self.walls)
        assert above is not None and below is not None
        return np.asarray((above.liquid - below.liquid) / self.span)

    def pressure(self, its: Beginning) -> tuple[Array, Array]:
        """Derivative of the ferrostatic pressure at the points of the mean stress (n,), Pa.

        Returns:
            Beside it what its halves are apart.
        """
        first, run = self._run.points.deviator_points, self._run
        here, change = its.points[1][first:], its.warming[1][first:]
        above, below = self._pressures(its, here, change)
        bend = above + below - 2.0 * run.pressure
        return np.asarray((above - below) / self.span), bend

    def pressure_outside(self, its: Beginning) -> Array:
        """Derivative of that of liquid held from outside, at the owned vertices (owned,), Pa."""
        above, below = self._pressures(its, its.state.temperature, its.vertices[1])
        return np.asarray((above - below) / self.span)

    def _pressures(self, its: Beginning, here: Array, change: Array) -> tuple[Array, Array]:
        """Ferrostatic pressure above and below, at temperatures (n,), K, that change, Pa."""
        found = []
        for slice_, sign in zip(self.slices, SIGNS, strict=True):
            by, liquid = sign * self.by, slice_.ferrostatic
            assert liquid is not None
            found.append(liquid.pressure(here + by * change, its.times(by)[1]))
        return found[0], found[1]

    def give(self, contact: LinearisedContact, into: GivenChanges, number: int) -> None:
        """Put what changes beside the motion in column `number` of what contact is given."""
        above, below = self.walls
        into.stiffness[:, number] = (above.stiffness - below.stiffness) / self.span
        into.pool[:, number] = (above.liquid.pool - below.liquid.pool) / self.span
        into.slip[number] = (above.slip - below.slip) / self.span
        into.travel[number] = (above.travel - below.travel) / self.span
        positions = above.position, below.position
        into.normal[:, :, number], into.gap[:, number] = self.wall_moved(contact.place, positions)
        law, run = above.contact.friction, self._run.contact
        assert run is not None
        if law is not None:
            viscous = law.excess(np.zeros(0)) is not None
            if viscous or any(w.contact.friction != run.contact.friction for w in self.walls):
                into.law[:, :, number] = contact.by_law(above, below) / self.span

    def wall_moved(self, place: WallMet, positions: Sequence[float]) -> tuple[Array, Array]:
        """Derivatives of normal (n, 2) and gap (n,) to a wall that moves with the parameter.

        Args:
            place: Where the surface is and meets the wall of the run.
            positions: Of the slice above and below, below the meniscus, m.
        """
        if self._same_wall and abs(positions[0] - positions[1]) <= SAME_PLACE * abs(positions[0]):
            return np.zeros_like(place.normal), np.zeros_like(place.gap)
        (one, gap), (other, least) = (
            place.to(wall.contact.wall, position)
            for wall, position in zip(self.walls, positions, strict=True)
        )
        with np.errstate(invalid="ignore"):
            nearer = np.where(np.isfinite(gap) & np.isfinite(least), gap - least, 0.0)
        return np.asarray((one - other) / self.span), np.asarray(nearer / self.span)


def _fed(fed: FedPoints | None, slice_: Slice, time: float) -> FedPoints | None:
    """The same points of liquid in another slice."""
    if fed is None:
        return None
    return FedPoints.of(fed.carries, fed.liquid, slice_.young_at_solidus(), slice_.head(time))
