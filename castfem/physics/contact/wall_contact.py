"""Contact of one slice with its wall: traction on the surface, and its derivatives.

Everything is evaluated at the facets' quadrature points with numpy; the forms of
`castfem.forms.contact` use the results as functions.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.types import Array, Flags
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.forms import contact as forms
from castfem.forms.mechanics import Direction
from castfem.physics.contact.facets import SurfaceMean
from castfem.physics.contact.friction import return_friction
from castfem.physics.contact.interaction import DifferentiableInteraction, Motion, Solid
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import (
    OPEN,
    SLIP,
    STICK,
    ContactCheckpoint,
    ContactEvaluation,
    ContactState,
)
from castfem.physics.contact.surface_liquid import SurfaceLiquid
from castfem.physics.contact.surface_stress import SurfaceStress
from castfem.physics.contact.wall_surface import WallSurface

# Columns of the coefficients of the forms.
TRACTION, BY_PRESSURE, BY_SLIP, NORMAL = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
STIFFNESS, BY_STRAIN, BY_TURN, POOL, WIDTH = 11, slice(12, 16), 16, 17, 18


class WallContact(DifferentiableInteraction):
    """Contact of a slice, one step at a time.

    Args:
        section: The distributed section.
        contact: Settings of the contact.
        solid: Material of the slice.
        motion: Displacement and generalized strains of the mechanical problem.
        like: Contact of another slice on the same mesh, whose surface is shared; this one is not
            evaluated.

    Attributes:
        surface: Data shared with other slices. facets: The points.
        strand: Geometry of the points, and distance to the wall.
        symmetric: Whether contact leaves a symmetric tangent symmetric.
        at_vertices: Operator from vertex values to the points.
        liquid: Solid and liquid points of the surface in the step.
        stiffness: Stiffness K_p of the step at the points (n,), Pa/m.
        position: Position of the slice at its end, below the meniscus, m. duration: Duration of the
            step, s.
        slip: Slip along the strand over the step, m.
        stress: Stress of the solid at the points, for Nitsche's method; None with the penalty.
        now: Result of the last evaluation.

    Raises:
        InputError: A group does not exist.
    """

    name = "contact"

    def __init__(
        self,
        section: Section,
        contact: Contact,
        solid: Solid,
        motion: Motion,
        like: WallContact | None = None,
    ) -> None:
        super().__init__(section, motion, contact.on)
        self.contact, self._solid, self._large = contact, solid, solid.large_strain
        self.symmetric = contact.symmetric
        self.surface: WallSurface = (
            WallSurface.of(section, contact, solid, motion, WIDTH) if like is None else like.surface
        )
        surface, fluid = self.surface, None if like is None else like.liquid
        self.facets, self.strand = surface.facets, surface.strand
        self.at_vertices = surface.temperatures.at_vertices
        has_friction = contact.friction is not None
        self.liquid: SurfaceLiquid = SurfaceLiquid(surface.temperatures, solid, has_friction, fluid)
        strained = surface.strained
        self.stress = None if strained is None else SurfaceStress(strained, solid.law)
        self._action = self._wall_action()
        self._travel = fem.Constant(section.mesh, np.float64(0.0))
        self.now: ContactEvaluation | None = None

    def of_slice(self, given: Contact, solid: Solid) -> WallContact:
        """See `DifferentiableInteraction`."""
        return WallContact(self.section, given, solid, self._motion, self)

    @property
    def travel(self) -> float:
        """Travel of the strand in the step, m."""
        return float(self._travel.value)

    # Forms compiled by the mechanical problem.

    def virtual_work(self, virtual: Direction) -> ufl.Form:
        """See `Interaction`."""
        return forms.virtual_work(
            self._action, self.surface.geometry, virtual, self._travel, self.facets.measure
        )

    def tangent(self, by: Direction, virtual: Direction) -> ufl.Form:
        """See `Interaction`."""
        return forms.stiffness(
            self._action, self.surface.geometry, by, virtual, self._travel, self.facets.measure
        )

    def _wall_action(self) -> forms.WallAction:
        """The action of the wall, for the forms."""
        f, nitsche = self.surface.given.function, self.stress is not None
        return forms.WallAction(
            traction=_part(f, TRACTION),
            by_pressure=_part(f, BY_PRESSURE),
            by_slip=_part(f, BY_SLIP),
            normal=_part(f, NORMAL),
            stiffness=f[STIFFNESS],
            by_strain=_part(f, BY_STRAIN) if nitsche else None,
            by_turn=f[BY_TURN] if nitsche and self._large else None,
            pool=f[POOL] if self._large and self.liquid.fed else None,
        )

    # A step.

    def initial(self) -> ContactState:
        """State of a strand that has never touched anything."""
        n, law = self.facets.count, self._solid.law
        rows = 0 if self.stress is None else n
        return ContactState(
            friction=np.zeros((n, 2)),
            withdrawal_resistance=np.zeros(3),
            stress=np.zeros((rows, 4)),
            internal=law.initial_state(rows),
            place=self.facets.position.copy(),
            normal=self.facets.normal.copy(),
            gap=np.full(n, np.inf),
            pressure=np.zeros(n),
            status=np.zeros(n, np.int8),
            weight=self.facets.weight.copy(),
        )

    def begin(
        self, old: ContactState, start: float, end: float, before: Array, after: Array
    ) -> None:
        """See `Interaction`."""
        contact, solid = self.contact, self._solid
        self._old, self.duration = old, end - start
        self._kept_closed: Flags = np.zeros(self.facets.count, dtype=bool)
        self.position = contact.position(end)
        travelled = self.position - contact.position(start)
        self._travel.value = travelled
        self.slip = travelled - (contact.stroke(end) - contact.stroke(start))
        self.liquid.begin(old.gap, before, after, end)
        # Not from the tangent, of which a point that freezes within the step has only a part. The
        # stiffness of the solid is used for liquid, too, which presses with its ferrostatic
        # pressure: otherwise its penetration would be pushed out when it freezes.
        elasticity, surface = solid.law.elasticity, self.liquid.temperatures[1]
        bulk = elasticity.moduli(np.minimum(surface, elasticity.solidity.solidus))[1]
        self.stiffness: Array = np.asarray(
            contact.strength * bulk / self.surface.height, np.float64
        )
        stiffest = reductions.largest(self.section.comm, self.stiffness)
        self._rounding = 8 * np.finfo(float).eps * max(stiffest, 0.0)
        if self.stress is not None:
            self.stress.begin(old, *self.liquid.of_stress(), self.duration, solid)

    def gap(self, position: float, displacement: Array, generalized_strains: Array) -> Array:
        """Distance to the wall along its normal at the points (n,), m; inf without a wall.

        Args:
            position: Position of the slice below the meniscus, m.
            displacement: Displacement of all nodes of this rank, m.
            generalized_strains: Generalized strains (4,).
        """
        surface = self.strand
        moved = surface.moved(displacement, generalized_strains)
        strand = surface.facing(displacement, generalized_strains)[0]
        return surface.gap_to(surface.meet(self.contact.wall, position, moved, strand))[1]

    def refusal(self) -> str:
        """See `Interaction`: a breakout."""
        return self.liquid.breakout()

    def evaluate(self) -> float:
        """Evaluate contact for the present displacement and generalized strains.

        Returns:
            Stress at the stiffest point from rounding of positions, Pa.
        """
        motion, surface = self._motion, self.strand
        moved = surface.moved(motion.u.x.array, motion.generalized_strains.value)
        before = surface.moved(motion.u_old.x.array, motion.generalized_strains_old.value)
        strand, stretch = surface.facing(motion.u.x.array, motion.generalized_strains.value)
        n, gap, curvature = surface.gap_to(
            surface.meet(self.contact.wall, self.position, moved, strand)
        )
        near = np.minimum(gap, surface.size)
        stress: Array | float = 0.0
        if self.stress is not None:
            stress, by_strain, by_turn = self.stress.evaluate(n)
            pressure = forms.nitsche_pressure(self.stiffness, near, stress)
        else:
            pressure = forms.penalty_pressure(self.stiffness, near)
        drawn = -stress - self.stiffness * near
        pool = np.where(np.isfinite(gap), self.liquid.pool, 0.0)
        wets = pool > 0.0
        if self.stress is not None:
            drawn[wets] = -self.stiffness[wets] * near[wets]
            by_strain[wets], by_turn[wets] = 0.0, 0.0
        pressure = np.where(self._kept_closed | wets, drawn, pressure)
        # Points that just touch count as closed: otherwise a block laid on a wall would have no
        # support at first.
        closed = (drawn >= 0.0) | self._kept_closed | wets
        coefficients: Array = np.zeros((self.facets.count, WIDTH))
        coefficients[:, NORMAL], coefficients[:, STIFFNESS] = n, self.stiffness * closed
        if self.stress is not None:
            coefficients[:, BY_STRAIN] = by_strain * closed[:, None]
            coefficients[:, BY_TURN] = by_turn * closed
        # The liquid's pressure along the strand's own normal exactly balances that inside: along
        # the wall's normal, the difference would push a surface without stiffness round its arcs.
        borne = pressure[:, None] * n + pool[:, None] * strand
        coefficients[:, TRACTION.start : 2] = -borne
        coefficients[:, POOL] = pool
        # Along a concave wall the pressure turns against sliding points.
        along = np.column_stack([-n[:, 1], n[:, 0]])
        coefficients[:, BY_SLIP.start : BY_SLIP.stop - 1] = -(curvature * pressure)[:, None] * along
        coefficients[:, BY_PRESSURE.start : 5] = -n
        slides: Flags = closed
        friction: Array = np.zeros((self.facets.count, 2))
        if self.contact.friction is not None:
            slides, friction = self._with_friction(coefficients, along, moved - before, pressure)
        self.surface.given.fill(coefficients)
        if wets.any():
            pressure, n = _directed(borne, n, wets, pressure)
        strain = np.zeros((0, 4)) if self.stress is None else self.stress.strain
        place = self.facets.position + moved
        self.now = ContactEvaluation(
            place, n, gap, pressure, friction, closed, slides, stretch, coefficients, strain
        )
        far = float(np.abs(moved).max(initial=0.0))
        return self._rounding * reductions.largest(self.section.comm, np.array([far]))

    def _with_friction(
        self, coefficients: Array, along: Array, slip: Array, pressure: Array
    ) -> tuple[Flags, Array]:
        """Add friction to the coefficients of the forms; return sliding points and their friction.

        It acts on solid points: liquid and mushy zone cannot be held back. With fed liquid the cell
        must have solid points below the surface, which carry it.
        """
        assert self.contact.friction is not None
        moved = np.column_stack(
            [np.einsum("ni,ni->n", along, slip), np.full(len(along), self.slip)]
        )
        trial = self._old.friction - self.stiffness[:, None] * moved
        answer = return_friction(
            self.contact.friction, trial, pressure, self.stiffness, self.duration
        )
        for part in (answer.traction, answer.by_pressure, answer.by_trial):
            part[self.liquid.molten] = 0.0
        frame = np.zeros((len(along), 3, 2))
        frame[:, :2, 0], frame[:, 2, 1] = along, 1.0
        coefficients[:, TRACTION] += np.einsum("nij,nj->ni", frame, answer.traction)
        coefficients[:, BY_PRESSURE] += np.einsum("nij,nj->ni", frame, answer.by_pressure)
        by_slip = -self.stiffness[:, None] * answer.by_trial[:, :, 0]
        coefficients[:, BY_SLIP] += np.einsum("nij,nj->ni", frame, by_slip)
        return answer.slides | self.liquid.molten, answer.traction

    def hold(self, on: bool) -> bool:
        """See `Interaction`: points that have left the wall meanwhile are released."""
        self._kept_closed = np.zeros(self.facets.count, dtype=bool)
        if on:
            before = self._motion.u_old.x.array, self._motion.generalized_strains_old.value
            gap = self.gap(self.position, *before)
            # A wall farther away than this fraction of the height of surface cells is not held.
            self._kept_closed = (self._old.pressure > 0.0) & (gap < 0.01 * self.surface.height)
        return reductions.largest(self.section.comm, self._kept_closed.astype(float)) > 0.0

    @property
    def status(self) -> tuple[Flags, Flags]:
        """Points (n,) that touched at the last evaluation, and points that slid."""
        assert self.now is not None
        return self.now.closed, self.now.slides

    def evaluated(self) -> ContactEvaluation | None:
        """See `Interaction`."""
        return self.now

    def kink(self, base: ContactEvaluation | None) -> float:
        """Deviation of the pressure from its linear prediction at `base` for the motion since (N).

        Friction is left out: it would detect a surface that has turned too far against it.

        Returns:
            Work of the pressure in the motion minus its linear prediction, N/m
            times m (collective).
        """
        now = self.now
        if base is None:
            return 0.0
        assert now is not None
        moved = np.einsum("ni,ni->n", base.coefficients[:, NORMAL], now.place - base.place)
        foreseen = base.pressure + base.coefficients[:, STIFFNESS] * moved
        if len(now.strain):
            change = now.strain - base.strain
            foreseen -= np.einsum("ni,ni->n", base.coefficients[:, BY_STRAIN], change)
        weights = self.facets.weight * now.stretch
        return reductions.total(
            self.section.comm, float(weights @ (moved * (now.pressure - foreseen)))
        )

    def strain_by_pressure(
        self, state: ContactState, temperature: Array
    ) -> tuple[Array, Array] | None:
        """See `Interaction`."""
        elasticity = self._solid.law.elasticity
        at = np.minimum(self.at_vertices @ temperature, elasticity.solidity.solidus)
        return np.asarray(state.pressure / (3.0 * elasticity.moduli(at)[1])), state.place

    @cached_property
    def _checkpoint(self) -> ContactCheckpoint:
        return ContactCheckpoint(self.facets)

    def arrays(self, state: ContactState) -> dict[str, Array | None]:
        """See `Interaction`."""
        return self._checkpoint.arrays(state)

    def restored(self, arrays: dict[str, Array]) -> ContactState:
        """See `Interaction`."""
        return self._checkpoint.state(arrays, self.initial())

    @cached_property
    def mean(self) -> SurfaceMean:
        """Averages over a length of the surface (collective at first use)."""
        return SurfaceMean(self.facets)

    def thickness(self, state: ContactState, generalized_strains: Array) -> Array:
        """Thickness of the slice at the points over the undeformed one (n,); 1 at small strain."""
        if not self._large:
            return np.ones(self.facets.count)
        return np.asarray(1.0 + self._lever(state.place) @ generalized_strains[:3])

    def state(self) -> ContactState:
        """The state of the last evaluation (collective)."""
        now = self.now
        assert now is not None
        closed = now.pressure > 0.0
        weight = self.facets.weight * now.stretch
        stress = None if self.stress is None else self.stress.response
        return ContactState(
            friction=now.friction.copy(),
            withdrawal_resistance=self._old.withdrawal_resistance - self._step_resistance(now),
            stress=np.zeros((0, 4)) if stress is None else stress.stress.copy(),
            internal=self._old.internal if stress is None else stress.state.copy(),
            place=now.place,
            normal=now.normal,
            gap=now.gap,
            pressure=now.pressure,
            status=np.where(closed, np.where(now.slides, SLIP, STICK), OPEN).astype(np.int8),
            weight=weight,
        )

    def _step_resistance(self, now: ContactEvaluation) -> Array:
        """Friction over the travel of the step: its force and moments (3,), N and N m."""
        if self.contact.friction is None:
            return np.zeros(3)
        lever = self._lever(now.place)
        force = now.friction[:, 1] * self.facets.weight * now.stretch
        total = reductions.totals(self.section.comm, lever.T @ force)
        return total * float(self._travel.value)

    def _lever(self, place: Array) -> Array:
        x = place if self._large else self.facets.position
        return np.column_stack([np.ones(len(x)), x])


def _directed(borne: Array, normal: Array, wets: Flags, pressure: Array) -> tuple[Array, Array]:
    """Pressure and its direction, where liquid presses along the strand's normal, not the wall's.

    Args:
        borne: Traction carried by the wall (n, 2), Pa.
        normal: Normal of the wall (n, 2).
        wets: Points with liquid (n,).
        pressure: Pressure along the wall's normal (n,), Pa.
    """
    found = np.copysign(np.hypot(*borne.T), np.einsum("ni,ni->n", borne, normal))
    pressure, normal = np.where(wets, found, pressure), normal.copy()
    normal[wets] = borne[wets] / pressure[wets, None]
    return pressure, normal


def _part(function: fem.Function, columns: slice) -> ufl.core.expr.Expr:
    return ufl.as_vector([function[i] for i in range(columns.start, columns.stop)])
