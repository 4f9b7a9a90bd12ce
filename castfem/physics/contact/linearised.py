"""Linearised contact with the wall, with constant status: touching, sticking, sliding, liquid.

A point x of the surface meets the wall at q = x + g_s s, where s is the strand's normal there, n
the wall's, t = (-n_y, n_x) and kappa the curvature. As x moves and the wall stays,

    g_s' = -n . x' / (n . s),     q' = x' + g_s' s,     n' = kappa t (t . q'),

and the distance along the wall's normal, g = g_s (n . s), changes by -n . x' + g_s (n' . s). The
rest is the chain rule through the pressure (penalty or Nitsche) and the friction. The geometry is
that of the undeformed slice: small strain.

The last axis of the arrays here counts the parameters (k).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.forms.mechanics import SQRT2
from castfem.physics.contact.friction import Sliding, return_friction
from castfem.physics.contact.state import ContactState
from castfem.physics.contact.strand_surface import StrandSurface
from castfem.physics.contact.wall_contact import WallContact
from castfem.physics.mould.wall import Wall

Motion = tuple[Array, Array]  # displacement of this rank's nodes, including ghosts; strains (4,)


def dot(one: Array, other: Array) -> Array:
    """Scalar products of vectors (n, 2) with changes (n, 2, k): (n, k)."""
    return np.asarray(one[:, 0, None] * other[:, 0] + one[:, 1, None] * other[:, 1])


def turned(vector: Array) -> Array:
    """Vectors (n, 2, ...) turned by a right angle, from a normal to the direction along a wall."""
    return np.stack([-vector[:, 1], vector[:, 0]], axis=1)


class WallMet:
    """Contact geometry of a wall, with its derivatives by the motion of the surface.

    Args:
        surface: Points of the strand.
        wall: The wall. position: Position of the slice below the meniscus, m.
        motion: Motion of the slice.

    Attributes:
        normal: Normal of the wall (n, 2). gap: Distance along it (n,), m; inf without a wall.
        along: Direction along the wall in the section (n, 2).
    """

    def __init__(self, surface: StrandSurface, wall: Wall, position: float, motion: Motion) -> None:
        moved = surface.moved(*motion)
        self.strand = surface.facing(*motion)[0]
        self.met = surface.meet(wall, position, moved, self.strand)
        self._surface = surface
        self.normal, self.gap, self._curvature = surface.gap_to(self.met)
        self.along = turned(self.normal)
        self._open = np.where(np.isfinite(self.gap), self.met.found.gap, 0.0)

    def change(self, moved: Array) -> tuple[Array, Array]:
        """Change of normal (n, 2, k) and gap (n, k) as the points move by `moved` (n, 2, k)."""
        nearer = -dot(self.normal, moved)
        met = moved + self.strand[:, :, None] * (nearer / self.met.facing[:, None])[:, None]
        turn = self._curvature[:, None] * dot(self.along, met)
        normal = self.along[:, :, None] * turn[:, None]
        gap = nearer + self._open[:, None] * dot(self.strand, normal)
        return normal, np.where(np.isfinite(self.gap)[:, None], gap, 0.0)

    def to(self, wall: Wall, position: float) -> tuple[Array, Array]:
        """Normal (n, 2) and gap (n,) to another wall from the same points."""
        other = self._surface.meet(wall, position, self.met.moved, self.strand)
        normal, gap, _ = self._surface.gap_to(other)
        return normal, gap


@dataclass(slots=True)
class GivenChanges:
    """Derivatives of the input of the contact of a step."""

    normal: Array  #: normal of the wall at the present place (n, 2, k)
    gap: Array  #: gap to it (n, k), m
    stiffness: Array  #: stiffness K_p (n, k), Pa/m
    pool: Array  #: pressure of liquid at the surface (n, k), Pa
    slip: Array  #: slip along the strand over the step (k,), m
    travel: Array  #: travel of the step (k,), m
    #: friction with changed law or duration, for the present trial friction (n, 2, k), Pa
    law: Array
    friction: Array  #: friction at the start of the step (n, 2, k), Pa
    resistance: Array  #: withdrawal resistance at the start (3, k)
    before: Array  #: motion of the points at the start of the step (n, 2, k), m

    @classmethod
    def none(cls, points: int, count: int) -> GivenChanges:
        """Return zero derivatives by `count` parameters at some points."""
        scalar, vector = np.zeros((points, count)), np.zeros((points, 2, count))
        return cls(
            vector.copy(), scalar.copy(), scalar.copy(), scalar.copy(), np.zeros(count),
            np.zeros(count), vector.copy(), vector.copy(), np.zeros((3, count)), vector.copy(),
        )  # fmt: skip

    def of(self, numbers: list[int] | slice) -> GivenChanges:
        """Return the derivatives by some of the parameters."""
        return GivenChanges(*(getattr(self, one.name)[..., numbers] for one in fields(self)))


@dataclass(frozen=True, slots=True)
class ContactChanges:
    """Derivatives of contact; names are those of `ContactState`."""

    traction: Array  #: traction on the strand, x, y and along it (n, 3, k), Pa
    place: Array
    normal: Array
    gap: Array
    pressure: Array
    friction: Array
    withdrawal_resistance: Array

    def numbers(self) -> dict[str, Array]:
        """Derivatives of the state, by its names."""
        names = (one.name for one in fields(self) if one.name != "traction")
        return {name: getattr(self, name) for name in names}


class LinearisedContact:
    """Contact at the end of a step.

    Args:
        wall: Contact evaluated at its end.
        old: State at its start.
        now: Motion of the slice at its end. before: Motion at its start.
    """

    def __init__(self, wall: WallContact, old: ContactState, now: Motion, before: Motion) -> None:
        self._wall, self._old = wall, old
        self.place = WallMet(wall.strand, wall.contact.wall, wall.position, now)
        self._closed = wall.status[0].astype(float)[:, None]
        moved = wall.strand.moved(*now) - wall.strand.moved(*before)
        along = np.einsum("ni,ni->n", self.place.along, moved)
        self._moved = moved
        self._slip = np.column_stack([along, np.full(len(along), wall.slip)])
        self._wets = (wall.liquid.pool > 0.0) & np.isfinite(self.place.gap)
        self._near = np.minimum(self.place.gap, wall.strand.size)
        self._pressure = self._pressed()
        self._lever = np.column_stack([np.ones(len(along)), wall.facets.position])
        self._sliding = self._return(wall)

    def _pressed(self) -> Array:
        """Pressure along the wall's normal (n,), Pa, without that of liquid."""
        drawn = -self._wall.stiffness * self._near
        if self._wall.stress is not None:
            drawn = drawn - np.where(self._wets, 0.0, self._normal_stress())
        return drawn * self._closed[:, 0]

    def _normal_stress(self) -> Array:
        stress = self._wall.stress
        assert stress is not None
        x, y = self.place.normal.T
        s = stress.response.stress.T
        return np.asarray(x * x * s[0] + y * y * s[1] + SQRT2 * x * y * s[3] - stress.liquid)

    def _return(self, side: WallContact) -> Sliding | None:
        """Friction by the law of `side`, for the present trial friction."""
        law = side.contact.friction
        if law is None:
            return None
        trial = self._old.friction - self._wall.stiffness[:, None] * self._slip
        closed, slides = self._wall.status
        found = return_friction(
            law, trial, self._pressure, side.stiffness, side.duration, (closed, slides)
        )
        for part in (found.traction, found.by_pressure, found.by_trial):
            part[self._wall.liquid.molten] = 0.0
        return found

    def by_law(self, above: WallContact, below: WallContact) -> Array:
        """Difference of friction between the laws of two sides (n, 2), Pa."""
        one, other = self._return(above), self._return(below)
        if one is None or other is None:
            return np.zeros_like(self._slip)
        return np.asarray(one.traction - other.traction)

    def changes(
        self, given: GivenChanges, moved: Array, stress: Array | None, liquid: Array | None
    ) -> ContactChanges:
        """Return the derivatives of contact.

        Args:
            given: Derivatives of the input other than the motion.
            moved: Motion of the points at the end of the step (n, 2, k), m.
            stress: Derivative of the stress at the points (n, 4, k), Pa, for Nitsche's method.
            liquid: Derivative of the pressure in the liquid (n, k), Pa, for Nitsche's method.
        """
        place, wall = self.place, self._wall
        normal, gap = place.change(moved)
        normal, gap = normal + given.normal, gap + given.gap
        near = np.where((place.gap < wall.strand.size)[:, None], gap, 0.0)
        drawn = -given.stiffness * self._near[:, None] - wall.stiffness[:, None] * near
        if stress is not None and liquid is not None:
            drawn -= np.where(self._wets[:, None], 0.0, self._drawn(normal, stress) - liquid)
        pressure = self._closed * drawn
        pool = np.where(self._wets[:, None], given.pool, 0.0)
        n = place.normal[:, :, None]
        borne = (
            pressure[:, None] * n + self._pressure[:, None, None] * normal
            + pool[:, None] * place.strand[:, :, None]
        )  # fmt: skip
        friction, traction = self._rubbed(given, moved, normal, pressure)
        traction[:, :2] -= borne
        resistance = given.resistance - self._resistance(given, friction)
        if self._wets.any():
            pressure, normal = self._directed(borne, pressure, normal)
        return ContactChanges(traction, moved, normal, gap, pressure, friction, resistance)

    def _drawn(self, normal: Array, stress: Array) -> Array:
        """Change of the stress along the normal (n, k)."""
        (x, y), (dx, dy) = self.place.normal.T[:, :, None], (normal[:, 0], normal[:, 1])
        assert self._wall.stress is not None
        s = self._wall.stress.response.stress.T[:, :, None]
        found = x * x * stress[:, 0] + y * y * stress[:, 1] + SQRT2 * x * y * stress[:, 3]
        found += 2.0 * (x * dx * s[0] + y * dy * s[1]) + SQRT2 * (dx * y + x * dy) * s[3]
        return np.asarray(found)

    def _rubbed(
        self, given: GivenChanges, moved: Array, normal: Array, pressure: Array
    ) -> tuple[Array, Array]:
        """Derivatives of friction (n, 2, k), and of its traction (n, 3, k)."""
        traction = np.zeros((len(normal), 3, normal.shape[2]))
        if self._sliding is None:
            return np.zeros_like(normal), traction
        along, now = turned(normal), self._sliding.traction
        slip = np.empty_like(normal)
        slip[:, 0] = dot(self._moved, along) + dot(self.place.along, moved - given.before)
        slip[:, 1] = given.slip
        trial = given.friction - given.stiffness[:, None] * self._slip[:, :, None]
        trial -= self._wall.stiffness[:, None, None] * slip
        friction = self._sliding.by_trial @ trial + given.law
        friction += self._sliding.by_pressure[:, :, None] * pressure[:, None]
        traction[:, :2] = now[:, 0, None, None] * along
        traction[:, :2] += self.place.along[:, :, None] * friction[:, None, 0]
        traction[:, 2] = friction[:, 1]
        return friction, traction

    def _resistance(self, given: GivenChanges, friction: Array) -> Array:
        """Derivative of the step's contribution of friction to the withdrawal resistance (3, k)."""
        if self._sliding is None:
            return np.zeros_like(given.resistance)
        wall = self._wall
        weighted = self._lever * wall.facets.weight[:, None]
        now = np.outer(weighted.T @ self._sliding.traction[:, 1], given.travel)
        return reductions.totals(
            wall.section.comm, now + wall.travel * (weighted.T @ friction[:, 1])
        )

    def _directed(self, borne: Array, pressure: Array, normal: Array) -> tuple[Array, Array]:
        """Pressure and its direction, where liquid presses along the strand's normal."""
        now = self._wall.now
        assert now is not None
        presses = self._wets & (now.pressure != 0.0)
        whole = np.where(presses, now.pressure, 1.0)[:, None]
        along = dot(now.normal, borne)
        turns = (borne - now.normal[:, :, None] * along[:, None]) / whole[:, None]
        pressure = np.where(presses[:, None], along, pressure)
        return pressure, np.where(presses[:, None, None], turns, normal)

    def forces(self, changes: ContactChanges) -> tuple[Array, Array]:
        """Derivatives of the forces in equilibrium with the stress (collective).

        Returns:
            Forces on this rank's nodes, including ghosts (dofs, k), N/m; work on each generalized
            strain (4, k).
        """
        wall = self._wall
        across = -(wall.facets.weight * wall.facets.position[:, 1]) @ changes.traction[:, 1]
        across = reductions.totals(wall.section.comm, across)
        work = np.vstack([-changes.withdrawal_resistance, across[None]])
        return -wall.strand.forces(changes.traction[:, :2]), work
