"""The slice on both sides of a parameter: effects of a parameter other than the motion.

These are the law (`castfem.studies.sensitivity.law_changes`), the pressure of the liquid, the wall
and its friction. All other contributions to equilibrium follow from these linearly, for all
parameters at once (`castfem.studies.sensitivity.linearised_step`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from castfem.base.types import Array
from castfem.physics.constitutive.base import ResponseChange
from castfem.physics.contact.linearised import GivenChanges, LinearisedContact, WallMet
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.material_points import FedPoints
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.studies.sensitivity.step_inputs import Beginning

SIGNS = (1.0, -1.0)  # above and below a parameter


@dataclass(frozen=True, slots=True)
class DifferenceLimits:
    """Steps of differences by temperature, and detection of kinks."""

    warmer: float = 1e-4  #: change of temperature to either side, K
    #: relative difference of the two halves above which there is a kink
    uneven: float = 0.1
    same_place: float = 1e-14  #: relative difference of two positions due to rounding


DIFFERENCES = DifferenceLimits()


def slope(above: Array, here: Array, below: Array, by: float) -> Array:
    """Derivative from values at a point and on both sides, `by` apart.

    At a kink or a jump between them the smaller one-sided value is used. A one-sided value has an
    error of half the curvature times the distance, so it is used nowhere else: the weight of a
    phase with a narrow blend changes completely within kelvins.
    """
    up, down = (above - here) / by, (here - below) / by
    sizes = np.abs(up), np.abs(down)
    even = np.abs(up - down) <= DIFFERENCES.uneven * np.maximum(*sizes)
    return np.where(even, 0.5 * (up + down), np.where(sizes[0] < sizes[1], up, down))


def slope_by_temperature(curve: Callable[[Array], Array], temperature: Array, here: Array) -> Array:
    """Derivative of a curve at temperatures (K), where it has the values `here`."""
    return slope(
        curve(temperature + DIFFERENCES.warmer),
        here,
        curve(temperature - DIFFERENCES.warmer),
        DIFFERENCES.warmer,
    )


class SliceSides:
    """The slice with a parameter moved up and down.

    Args:
        run: The equilibrium of the run.
        slices: The slice above and below.
        by: Distance by which the parameter is moved, in its unit.
        same_wall: Whether its mould is that of the run.

    Attributes:
        span: Distance of the sides, in the unit of the parameter.
        same_law: Whether its law is that of the run.
        same_planes: Whether constraints and loads of the planes are those of the run.
        walls: Contact above and below; empty without a mould.
    """

    def __init__(
        self, run: MechanicalProblem, slices: tuple[Slice, Slice], by: float, same_wall: bool
    ) -> None:
        self.slices, self.by, self.span = slices, by, 2.0 * by
        self._run, self._same_wall = run, same_wall
        self.same_law = all(one.law is run.slice.law for one in slices)
        self._solid = [one.young_at_solidus() for one in slices]
        self.same_planes = all(one.planes == run.slice.planes for one in slices)
        given = (run.interactions.of_slice(one.interactions, one).wall for one in slices)
        self.walls = tuple(wall for wall in given if wall is not None)
        self._at_surface: list[tuple[Array, Array]] = []
        self._begun: Beginning | None = None

    def quotient(self, of: Callable[[Slice, float], Any]) -> Any:
        """Derivative of a function of the slice, and the distance the parameter is moved by."""
        above, below = (
            of(one, sign * self.by) for one, sign in zip(self.slices, SIGNS, strict=True)
        )
        return (above - below) / self.span

    def begin(self, its: Beginning) -> None:
        """Prepare the wall of both sides for a step, once (collective)."""
        if self._begun is not its and self.walls:
            self._begin_walls(its)
        self._begun = its

    def fed(self, fed: FedPoints | None, its: Beginning) -> tuple[FedPoints | None, ...]:
        """The liquid points of the run above and below; the same object if nothing differs."""
        if fed is None:
            return None, None
        heads = (
            one.head(its.times(sign * self.by)[1])
            for one, sign in zip(self.slices, SIGNS, strict=True)
        )
        found = [
            FedPoints.of(fed.carries, fed.liquid, young, head)
            for young, head in zip(self._solid, heads, strict=True)
        ]
        if all(one.young == fed.young for one in found):
            return fed, fed
        return tuple(found)

    def _begin_walls(self, its: Beginning) -> None:
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

    def law_at_surface(self, strain: Array, change: Array) -> ResponseChange:
        """Derivatives of the law's response at the surface, for Nitsche's method.

        Args:
            strain: Strain increments there (n, 4).
            change: Their derivatives (n, 4).
        """
        answers = []
        for wall, begun, sign in zip(self.walls, self._at_surface, SIGNS, strict=True):
            assert wall.stress is not None
            answers.append(wall.stress.integrate(strain + sign * self.by * change, *begun))
        above, below = answers
        found = ResponseChange.empty(1, len(strain), above.state.shape[1])
        for name in ("stress", "state", "dissipation"):
            span = getattr(above, name) - getattr(below, name)
            getattr(found, name)[0] = span / self.span
        return found

    def liquid_at_surface(self) -> Array:
        """Derivative of the liquid's pressure in Nitsche's stress (n,), Pa."""
        above, below = (wall.stress for wall in self.walls)
        assert above is not None and below is not None
        return np.asarray((above.liquid - below.liquid) / self.span)

    def pressure(self, its: Beginning, here: Array, rise: Array, warming: Array) -> Array:
        """Derivative of the ferrostatic pressure (n,), Pa.

        Args:
            its: Data at the start of the step.
            here: Temperatures (n,), K.
            rise: Derivative of the pressure by temperature (n,), Pa/K.
            warming: Derivatives of the temperatures (n,), K.
        """
        run = self._run.slice.ferrostatic
        liquids = [one.ferrostatic for one in self.slices if one.ferrostatic is not None]
        assert run is not None
        above, below = (
            one.head(its.times(sign * self.by)[1]) for one, sign in zip(liquids, SIGNS, strict=True)
        )
        share = run.share(here)
        found = rise * warming + (above - below) / self.span * share
        if any(one.solid_fraction != run.solid_fraction for one in liquids):
            more, less = (one.share(here) for one in liquids)
            found += run.head(its.state.time) * slope(more, share, less, self.by)
        return np.asarray(found)

    def give(self, contact: LinearisedContact, into: GivenChanges, number: int) -> None:
        """Write the changes of contact other than by the motion to column `number`."""
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
            place: Geometry of the surface and its contact with the wall of the run.
            positions: Positions of the slice above and below, below the meniscus, m.
        """
        if self._same_wall and abs(positions[0] - positions[1]) <= DIFFERENCES.same_place * abs(
            positions[0]
        ):
            return np.zeros_like(place.normal), np.zeros_like(place.gap)
        (one, gap), (other, least) = (
            place.to(wall.contact.wall, position)
            for wall, position in zip(self.walls, positions, strict=True)
        )
        with np.errstate(invalid="ignore"):
            nearer = np.where(np.isfinite(gap) & np.isfinite(least), gap - least, 0.0)
        return np.asarray((one - other) / self.span), np.asarray(nearer / self.span)
