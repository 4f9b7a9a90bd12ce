"""Contact of one slice with its wall: what the wall does to the surface, and how that changes.

Everything is evaluated at the facets' quadrature points with numpy; the forms of
`castfem.forms.contact` see the results as functions.
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

# Columns of what the forms see.
TRACTION, BY_PRESSURE, BY_SLIP, NORMAL = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
STIFFNESS, BY_STRAIN, BY_TURN, POOL, WIDTH = 11, slice(12, 16), 16, 17, 18


class WallContact(DifferentiableInteraction):
    """Contact of a slice, one step at a time.

    Args:
        section: The distributed section.
        contact: The contact wanted.
        solid: What the slice is made of.
        motion: Displacement and generalized strains of the mechanical problem.
        like: Of another slice on the same mesh, whose surface it shares: this one is not evaluated.

    Attributes:
        surface: What it shares with others. facets: Points.
        strand: Where they are, and how far off the wall is.
        symmetric: Whether contact leaves a symmetric tangent symmetric.
        at_vertices: Operator from vertex values to the points.
        liquid: What of the surface is solid in the step, and what its liquid does.
        stiffness: K_p of the step at the points (n,), Pa/m.
        position: Of the slice at its end, below the meniscus, m. duration: Of the step, s.
        slip: Along the strand, over the step, m.
        stress: Of the solid at the points, for Nitsche's method; None with the penalty.
        now: What was evaluated last.

    Raises:
        InputError: If a group does not exist.
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
        """See `DifferentiableInteraction`: what is liquid here is so there."""
        return WallContact(self.section, given, solid, self._motion, self)

    @property
    def travel(self) -> float:
        """How far the strand goes down in the step, m."""
        return float(self._travel.value)

    # What the mechanical problem compiles.

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
        """What the forms see."""
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
        """Of a strand that has never touched anything."""
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
        # Not the tangent's, which of a point that freezes within the step has a share alone.
        # Liquid presses with what its depth gives, not with its stiffness: it is met as the solid
        # that it becomes, or what it sank into the wall would be pushed out as it freezes.
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
        """Distance to the wall along its normal at the points (n,), m; inf where none is met.

        Args:
            position: Of the slice below the meniscus, m.
            displacement: Of all nodes of this rank, m.
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
        """Meet the wall with the displacement and the generalized strains the fields hold.

        Returns:
            Stress that rounding of positions makes at the stiffest point, Pa.
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
        # What just touches holds, too: a block laid on a wall would have no support at first.
        closed = (drawn >= 0.0) | self._kept_closed | wets
        coefficients: Array = np.zeros((self.facets.count, WIDTH))
        coefficients[:, NORMAL], coefficients[:, STIFFNESS] = n, self.stiffness * closed
        if self.stress is not None:
            coefficients[:, BY_STRAIN] = by_strain * closed[:, None]
            coefficients[:, BY_TURN] = by_turn * closed
        # The pool's pressure along the strand's own normal balances that inside to the last digit:
        # along the wall's, the difference would push a surface without stiffness round its arcs.
        borne = pressure[:, None] * n + pool[:, None] * strand
        coefficients[:, TRACTION.start : 2] = -borne
        coefficients[:, POOL] = pool
        # Along a hollow wall the pressure turns against what slides.
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
        """Add friction to what the forms see; whether points slide, and their friction.

        It acts on what is solid: liquid and mushy zone have nothing that could be held back.  Where
        liquid is fed the cell must have solid points below the surface, which carry it.
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
            # A wall farther away than this share of the surface cells holds nothing.
            self._kept_closed = (self._old.pressure > 0.0) & (gap < 0.01 * self.surface.height)
        return reductions.largest(self.section.comm, self._kept_closed.astype(float)) > 0.0

    @property
    def status(self) -> tuple[Flags, Flags]:
        """Which points (n,) touched when they were evaluated last, and which slid."""
        assert self.now is not None
        return self.now.closed, self.now.slides

    def evaluated(self) -> ContactEvaluation | None:
        """See `Interaction`."""
        return self.now

    def kink(self, base: ContactEvaluation | None) -> float:
        """How far the pressure is from what its tangent at `base` foresaw for the motion since (N).

        Friction is left out: a surface that turns round against it has gone too far.

        Returns:
            The work that the pressure does against the motion, as it is, less as foreseen, N/m
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
        """Means over a length of the surface (collective when it is first asked for)."""
        return SurfaceMean(self.facets)

    def thickness(self, state: ContactState, generalized_strains: Array) -> Array:
        """Thickness of the slice at the points over the undeformed one (n,); 1 at small strain."""
        if not self._large:
            return np.ones(self.facets.count)
        return np.asarray(1.0 + self._lever(state.place) @ generalized_strains[:3])

    def state(self) -> ContactState:
        """The state that was evaluated last (collective)."""
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
        """Friction over the travel of the step, its force and moments (3,), N and N m."""
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
        borne: What the wall bears (n, 2), Pa.
        normal: Of the wall (n, 2).
        wets: Where there is liquid (n,).
        pressure: Along the wall's normal (n,), Pa.
    """
    found = np.copysign(np.hypot(*borne.T), np.einsum("ni,ni->n", borne, normal))
    pressure, normal = np.where(wets, found, pressure), normal.copy()
    normal[wets] = borne[wets] / pressure[wets, None]
    return pressure, normal


def _part(function: fem.Function, columns: slice) -> ufl.core.expr.Expr:
    return ufl.as_vector([function[i] for i in range(columns.start, columns.stop)])
