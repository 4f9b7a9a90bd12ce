"""Support of faces by rolls, which bulge in between: an elastic foundation moving with the slice.

A `Foundation`, an object with two methods, gives the foundation at each moment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.constants import same_or_before
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.forms import finite_strain, supports
from castfem.forms.mechanics import Direction, of_generalized_strains
from castfem.physics.contact.facets import Facets
from castfem.physics.contact.interaction import NOTHING_ADDED, Interaction, Motion, Solid
from castfem.physics.contact.settings import ALWAYS, SurfaceInteraction, still

Memory = Mapping[str, Array]
POINTS = 3  # per facet; as many as for other interactions with the same facets, such as a wall


@dataclass(frozen=True, slots=True)
class Bed:
    """Support of a face by rolls at one moment, see `castfem.forms.supports`.

    All values are those at the slice's position, constant over the face.

    Raises:
        InputError: The stiffness is negative, `within` is not between 0 and 1, or a value is NaN.
    """

    #: p transmitted by the shell to the rolls in the rest position, Pa: that of the liquid core, as
    #: from the slice's `Ferrostatic.pressure`; zero where it is solid
    pressure: float = 0.0
    stiffness: float = 0.0  #: K, Pa/m: of the order of pressure over bulge
    bulge: float = 0.0  #: w at the middle of the face, outwards, m; negative where the shell dips
    #: s of the rolls, outwards from the face of the undeformed section, m: half of the change of
    #: the aperture, plus the misalignment of a roll
    offset: float = 0.0
    #: c, the fraction of K within the rest position: that of the pressure that the shell transmits.
    #: 1 with a liquid core, 0 for a solid strand, which rolls cannot pull
    within: float = 1.0

    def __post_init__(self) -> None:
        """Check the values."""
        if not np.isfinite(astuple(self)).all():
            raise InputError(
                f"rolls: pressure, stiffness, bulge, offset, share {astuple(self)}: no numbers"
            )
        if not 0.0 <= self.within <= 1.0:
            raise InputError(f"rolls: share {self.within:g} of the stiffness; it must be 0 to 1")
        if self.stiffness < 0.0:
            raise InputError(f"rolls: stiffness {self.stiffness:g} Pa/m; it must not be negative")

    @property
    def rest(self) -> float:
        """Rest position of the face, outwards, m."""
        return self.bulge + self.offset


class Foundation(Protocol):
    """Gives the support of a slice step by step; the interface of bulging models.

    It has no state that a step changes, since steps are tried, rejected and repeated. What it must
    remember between steps, such as the bulge of the present pitch, is in `memory`: a dictionary of
    small arrays, equal on all ranks. It is committed with the state, saved in checkpoints and
    passed back; it is never modified.
    """

    def initial(self) -> Memory:
        """Memory at the meniscus; names and shapes never change."""

    def beds(
        self, memory: Memory, start: float, end: float, before: Array, temperature: Array
    ) -> tuple[Mapping[str, Bed], Memory]:
        """Return the beds at the end of a step, and the memory if it is accepted (collective).

        The result must depend only on the arguments. Where p and K jump, from one pitch to the
        next, `RollSupport.knots` has the positions, and windows end there.

        Args:
            memory: Memory of the committed state.
            start: Start of the step, s.
            end: End of the step, s.
            before: Temperatures of this rank's own vertices at the start (owned,), K.
            temperature: Temperatures at the end, which give the shell's profile and the solid
                fraction of the core.

        Returns:
            A bed for each name in `RollSupport.on`, by that name, equal on all ranks.
        """


@runtime_checkable
class StretchingFoundation(Foundation, Protocol):
    """A foundation whose bulge also strains the slice along the strand."""

    def axial_strain(
        self,
        memory: Memory,
        new: Memory,
        start: float,
        end: float,
        places: Array,
        *,
        front: bool = False,
    ) -> Array | None:
        """Axial strain (n,) added to the slice by bulging in a step; None for none.

        Args:
            memory: Memory of the committed state.
            new: Memory returned by `beds`.
            start: Start of the step, s.
            end: End of the step, s.
            places: Places in the undeformed section (n, 2), m.
            front: Continue beyond the inside of the shell, since material freezing to it is
                strained as well.
        """  # fmt: skip


@dataclass(frozen=True)
class GivenFoundation:
    """Beds given as functions of time, without memory."""

    given: Mapping[str, Callable[[float], Bed]]  #: bed of each group over time, s

    def initial(self) -> Memory:
        """See `Foundation`."""
        return {}

    def beds(
        self, memory: Memory, start: float, end: float, before: Array, temperature: Array
    ) -> tuple[Mapping[str, Bed], Memory]:
        """See `Foundation`."""
        return {name: bed(end) for name, bed in self.given.items()}, memory


@dataclass(frozen=True, slots=True)
class RollSupport(SurfaceInteraction):
    """Support of boundary groups by rolls.

    Raises:
        InputError: The range is empty.
    """

    #: groups, such as "wide_face_intrados"; a name matches all groups that begin with it
    on: tuple[str, ...]
    foundation: Foundation  #: gives their beds
    #: position of the slice below the meniscus over time (s), m
    position: Callable[[float], float] = still
    #: first and last roll, m: steps that end beyond the first, up to the last, are supported.
    #: Without limits it restrains the section in every step, and no point is fixed besides
    between: tuple[float, float] = ALWAYS
    #: further positions at which a coupling window must end, m, such as rolls
    knots: tuple[float, ...] = ()
    #: whether the bed of a face above a liquid core pulls where the face is far within its rest
    #: position; otherwise the face leaves it
    pull: bool = True
    points: int = POINTS  #: quadrature points per facet
    #: groups of `on` whose beds have no stiffness in some steps: motions restrained only by them
    #: are restrained by points
    loose: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the range."""
        if not self.between[0] < self.between[1]:
            raise InputError(
                f"rolls: there are none between {self.between[0]:g} and {self.between[1]:g} m"
            )

    def active(self, time: float) -> bool:
        """Whether a step that ends at `time` (s) is supported."""
        place, (first, last) = self.position(time), self.between
        return not same_or_before(place, first) and same_or_before(place, last)

    def build(self, section: Section, solid: Solid, motion: Motion) -> WinklerFoundation:
        """See `SurfaceInteraction`."""
        return WinklerFoundation(section, self, solid, motion)


@dataclass(frozen=True, slots=True)
class RollSupportState:
    """Committed state of a support by rolls."""

    #: beds at the end of the step, by name; without stiffness while the support is not active
    beds: Mapping[str, Bed]
    memory: Memory  #: memory of the foundation
    force: Array  #: force on the beds, outwards (named groups,), N per m of undeformed strand
    moved: Array  #: mean displacement of each of the groups along its normal, m
    withdrawal_resistance: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def added(self) -> tuple[float, float]:
        """See `castfem.physics.contact.interaction.BearsRolls`."""
        if "added" not in self.memory:
            return NOTHING_ADDED
        lower, after = self.memory["added"][:, 1:].sum(axis=0)
        return float(lower), float(after)


class WinklerFoundation(Interaction):
    """Support of a slice by rolls, one step at a time.

    Args:
        section: The distributed section.
        given: Settings of the support.
        solid: Material of the slice.
        motion: Displacement and generalized strains of the mechanical problem.

    Raises:
        InputError: A group does not exist.
    """

    name = "rolls"

    def __init__(self, section: Section, given: RollSupport, solid: Solid, motion: Motion) -> None:
        super().__init__(section, motion, given.on)
        self.given, mesh = given, section.mesh
        self._now = None
        if solid.large_strain:
            self._now = finite_strain.deformation(motion.u, motion.generalized_strains, mesh)
        self._values = {n: fem.Constant(mesh, np.zeros(4)) for n in given.on}  # p, K, w + s, c
        rule = {"quadrature_rule": "default", "quadrature_degree": 2 * given.points - 1}
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=section.facet_tags, metadata=rule)
        self._faces = {n: ds(tuple(section.required((n,)))) for n in given.on}
        across = of_generalized_strains(motion.generalized_strains, mesh).shift
        self._moved = ufl.dot(ufl.FacetNormal(mesh), motion.u + across)
        self._read: list[tuple[fem.Form, ...]] = []

    def _pressures(self) -> list[tuple[ufl.Measure, ufl.core.expr.Expr, ufl.core.expr.Expr]]:
        """Surface of each group, its pressure f and its stiffness."""
        found = []
        for name, ds in self._faces.items():
            p, most, rest, within = self._values[name]
            stiffness = supports.bed_stiffness(most, within, rest, self._moved)
            f = supports.bed_pressure(p, stiffness, rest, self._moved)
            if not self.given.pull:
                f, stiffness = supports.pushed(f, stiffness, most)
            found.append((ds, f, stiffness))
        return found

    def virtual_work(self, virtual: Direction) -> ufl.Form:
        """See `Interaction`."""
        mesh = self.section.mesh
        parts = [
            supports.virtual_work(f, virtual, self._now, mesh, ds) for ds, f, _ in self._pressures()
        ]
        return sum(parts[1:], parts[0])

    def tangent(self, by: Direction, virtual: Direction) -> ufl.Form:
        """See `Interaction`."""
        mesh = self.section.mesh
        parts = [
            supports.tangent(f, stiffness, by, virtual, self._now, mesh, ds)
            for ds, f, stiffness in self._pressures()
        ]
        return sum(parts[1:], parts[0])

    def always_held(self) -> tuple[Array, Array]:
        """See `Interaction`: only rolls without limits restrain in every step."""
        firm = tuple(name for name in self.given.on if name not in self.given.loose)
        if self.given.between != ALWAYS or not firm:
            return super().always_held()
        facets = Facets(self.section, self.section.required(firm), 2)
        return facets.position, facets.normal

    def initial(self) -> RollSupportState:
        """See `Interaction`."""
        nothing = np.zeros(len(self._faces))
        beds = {name: Bed() for name in self._faces}
        return RollSupportState(beds, self.given.foundation.initial(), nothing, nothing)

    def begin(
        self, old: RollSupportState, start: float, end: float, before: Array, after: Array
    ) -> None:
        """See `Interaction`."""
        super().begin(old, start, end, before, after)
        self._beds: Mapping[str, Bed] = {name: Bed() for name in self._faces}
        self._memory, self._times = old.memory, (start, end)
        if self.given.active(end):
            step = old.memory, start, end, before, after
            self._beds, self._memory = self.given.foundation.beds(*step)
            if missing := [name for name in self._faces if name not in self._beds]:
                raise InputError(
                    f"{', '.join(missing)}: rolls are to support it, but it has no bed"
                )
        for name, value in self._values.items():
            bed = self._beds[name]
            value.value[:] = bed.pressure, bed.stiffness, bed.rest, bed.within

    def axial_strain(self, places: Array) -> Array | None:
        """See `Interaction`."""
        foundation, (start, end) = self.given.foundation, self._times
        if not (self.given.active(end) and isinstance(foundation, StretchingFoundation)):
            return None
        return foundation.axial_strain(self._old.memory, self._memory, start, end, places)

    def front_strain(
        self, old: RollSupportState, new: RollSupportState, span: tuple[float, float], places: Array
    ) -> Array | None:
        """See `Interaction`: that of the bulge, if the slice has it (`axial_strain`)."""
        foundation = self.given.foundation
        if not (self.given.active(span[1]) and isinstance(foundation, StretchingFoundation)):
            return None
        return foundation.axial_strain(old.memory, new.memory, *span, places, front=True)

    def _readings(self) -> list[tuple[fem.Form, ...]]:
        """Integrals for each group: force along its normal, displacement, length."""
        mesh, found = self.section.mesh, []
        normal = Direction(None, ufl.FacetNormal(mesh), None)
        for ds, f, _ in self._pressures():
            force = supports.virtual_work(f, normal, self._now, mesh, ds)
            length = fem.Constant(mesh, np.float64(1.0)) * ds
            parts = {"force": force, "moved": self._moved * ds, "length": length}
            found.append(tuple(self.section.compile(f"rolls.{n}", p) for n, p in parts.items()))
        return found

    def state(self) -> RollSupportState:
        """See `Interaction`."""
        if not self._read:
            self._read = self._readings()
        found = [[fem.assemble_scalar(form) for form in forms] for forms in self._read]
        sums = reductions.totals(self.section.comm, np.ravel(found)).reshape(-1, 3)
        return RollSupportState(self._beds, self._memory, sums[:, 0], sums[:, 1] / sums[:, 2])

    def arrays(self, state: RollSupportState) -> dict[str, Array | None]:
        """See `Interaction`."""
        beds = np.array([astuple(state.beds[name]) for name in self._values])
        found = {"beds": beds, "force": state.force, "moved": state.moved}
        found |= {f"memory_{name}": np.asarray(v) for name, v in state.memory.items()}
        root = self.section.comm.rank == 0
        return {f"rolls_{name}": values if root else None for name, values in found.items()}

    def restored(self, arrays: dict[str, Array]) -> RollSupportState:
        """See `Interaction`."""
        rows = np.asarray(arrays["rolls_beds"], float)
        beds = {name: Bed(*map(float, row)) for name, row in zip(self._values, rows, strict=True)}
        memory = {n: np.array(arrays[f"rolls_memory_{n}"]) for n in self.initial().memory}
        force, moved = (np.array(arrays[f"rolls_{n}"], float) for n in ("force", "moved"))
        return RollSupportState(beds, memory, force, moved)
