"""Faces borne by rolls, which bulge between them: an elastic foundation that moves with the slice.

What the foundation is at each moment comes from a `Foundation`, an object with two methods.
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
POINTS = 3  # of a facet; as many as others have that act on the same facets, a wall say


@dataclass(frozen=True, slots=True)
class Bed:
    """How rolls bear a face at one moment, see `castfem.forms.supports`.

    All are of the slice's place then, the same all over the face.

    Raises:
        InputError: If the stiffness is negative, the share not one, or a value no number.
    """

    #: p that the shell hands on to the rolls where it is at rest, Pa: that of the core within, as
    #: the slice's `Ferrostatic.pressure` gives it; nothing where it is solid
    pressure: float = 0.0
    stiffness: float = 0.0  #: K, Pa/m: of the order of the pressure over the bulge
    bulge: float = 0.0  #: w of the middle of the face, outward, m; negative where the shell dips
    #: s of the rolls, outward, from the face of the undeformed section, m: half of the change of
    #: the aperture, and what a roll is out of line
    offset: float = 0.0
    #: c, the share of K that the face meets within its rest: that of the pressure which the shell
    #: hands on. 1 under a liquid core, 0 of a solid strand, which rolls cannot pull.
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
        """Where the face is at rest, outward, m."""
        return self.bulge + self.offset


class Foundation(Protocol):
    """Tells the beds of a slice, step by step: what a model of bulging has to give.

    It keeps nothing of its own that a step changes: steps are tried, refused and repeated. What it
    has to remember from step to step, as the bulge of the pitch that the slice is in, is `memory`:
    a dictionary of small arrays, the same on every rank. It is committed with the state, saved in
    checkpoints and given back; it is never written into.
    """

    def initial(self) -> Memory:
        """What it remembers at the meniscus; the same names and shapes as ever after."""

    def beds(
        self, memory: Memory, start: float, end: float, before: Array, temperature: Array
    ) -> tuple[Mapping[str, Bed], Memory]:
        """The beds at the end of a step, and what to remember if it is kept (collective).

        It must depend on its arguments alone. Where p and K jump, from one pitch to the next, the
        places stand in `RollSupport.knots`, and windows end there.

        Args:
            memory: As the committed state has it.
            start: Of the step, s.
            end: Of the step, s.
            before: Temperatures of this rank's own vertices at its start (owned,), K.
            temperature: Likewise at its end, from which the shell's profile and the solid fraction
                of the core come.

        Returns:
            A bed for each name in `RollSupport.on`, by that name, the same on every rank.
        """


@runtime_checkable
class StretchingFoundation(Foundation, Protocol):
    """A foundation whose bulge strains the slice along the strand, too."""

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
        """Axial strain (n,) that bulging adds to the slice in a step; None for none.

        Args:
            memory: As the committed state has it.
            new: As `beds` made it.
            start: Of the step, s.
            end: Of the step, s.
            places: In the undeformed section (n, 2), m.
            front: Go on beyond the inside of the shell, as what freezes to it is strained along.
        """  # fmt: skip


@dataclass(frozen=True)
class GivenFoundation:
    """Beds that are given over time, and remember nothing."""

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
        InputError: If the range is empty.
    """

    #: groups, such as "wide_face_intrados"; a name covers all that begin with it
    on: tuple[str, ...]
    foundation: Foundation  #: tells their beds
    position: Callable[[float], float] = still  #: of the slice below the meniscus over time (s), m
    #: first and last roll, m: a step that ends beyond the first, or at the last, is borne. Without
    #: ends it holds the section in every step, and no point is held beside it.
    between: tuple[float, float] = ALWAYS
    #: further positions at which a coupling window has to end, m: rolls, say
    knots: tuple[float, ...] = ()
    #: whether the bed of a face above a liquid core pulls where the face is far within its rest;
    #: otherwise the face leaves it
    pull: bool = True
    points: int = POINTS  #: quadrature points a facet
    #: groups of `on` whose beds have no stiffness in some of the steps: what they alone would hold
    #: is left to points
    loose: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the range."""
        if not self.between[0] < self.between[1]:
            raise InputError(
                f"rolls: there are none between {self.between[0]:g} and {self.between[1]:g} m"
            )

    def active(self, time: float) -> bool:
        """Whether a step that ends at `time` (s) is borne."""
        place, (first, last) = self.position(time), self.between
        return not same_or_before(place, first) and same_or_before(place, last)

    def build(self, section: Section, solid: Solid, motion: Motion) -> WinklerFoundation:
        """See `SurfaceInteraction`."""
        return WinklerFoundation(section, self, solid, motion)


@dataclass(frozen=True, slots=True)
class RollSupportState:
    """What of a support by rolls belongs to the committed state."""

    beds: Mapping[str, Bed]  #: in force at its end, by name; of no stiffness while it does not act
    memory: Memory  #: of the foundation
    force: Array  #: that the beds bear, outward (groups named,), N per m of undeformed strand
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
        given: The support wanted.
        solid: What the slice is made of.
        motion: Displacement and generalized strains of the mechanical problem.

    Raises:
        InputError: If a group does not exist.
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
        """Surface of each group, its pressure f and the stiffness that it meets."""
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
        """See `Interaction`: only rolls without a first and a last one hold in every step."""
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
            told = old.memory, start, end, before, after
            self._beds, self._memory = self.given.foundation.beds(*told)
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
        """Of each group: force along its normal, integral of its displacement, length."""
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
