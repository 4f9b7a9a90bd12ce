"""What acts on the strand's surface, a wall or rolls: one interface for all.

Each is described to a slice by an object of settings (`SurfaceInteraction`), which builds the
object that computes it (`Interaction`). A new kind of support is a subclass of `Interaction` with
its forms, and its settings; docs/architecture.md counts the lines.

What contact has to know of the strand, `Motion` and `Solid`, the mechanics have, which build on it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.forms.mechanics import Direction, of_generalized_strains
from castfem.physics.constitutive.base import Law


class Motion(Protocol):
    """Displacement and generalized strains, now and at the start of the step."""

    @property
    def u(self) -> fem.Function:
        """Displacement now, m."""

    @property
    def u_old(self) -> fem.Function:
        """Displacement at the start of the step, m."""

    @property
    def generalized_strains(self) -> fem.Constant:
        """Generalized strains now (4,)."""

    @property
    def generalized_strains_old(self) -> fem.Constant:
        """Generalized strains at the start of the step (4,)."""

    @property
    def one(self) -> fem.Constant:
        """A direction of the generalized strains (4,)."""


class Liquid(Protocol):
    """Liquid steel, which presses from within."""

    @property
    def outside(self) -> str:
        """What holds liquid at the surface: "held" if something does beside the wall."""

    def pressure(self, temperature: Array, time: float) -> Array:
        """Ferrostatic pressure at temperatures (n,), K, and a time, s: (n,), Pa."""


class Solid(Protocol):
    """What the strand is made of."""

    @property
    def law(self) -> Law:
        """Constitutive law."""

    @property
    def ferrostatic(self) -> Liquid | None:
        """Its liquid; None where it does not press."""

    @property
    def liquid(self) -> str:
        """Whether its liquid is "fed", or an "elastic" body."""

    @property
    def large_strain(self) -> bool:
        """Whether geometry is that of the deformed slice."""

    def thermal_strain(self, temperature: Array, /) -> Array:
        """Linear thermal strain at temperatures (n,), K."""


class InteractionState(Protocol):
    """What of an interaction belongs to the committed state; nothing ever writes into it."""

    @property
    def withdrawal_resistance(self) -> Array:
        """Axial force of its friction on the strand so far, N, and moments, N m, (3,)."""


NOTHING_ADDED = (0.0, 0.0)


@runtime_checkable
class BearsRolls(Protocol):
    """State of an interaction of rolls, which know what they bear."""

    @property
    def added(self) -> tuple[float, float]:
        """What the pair at the end of this pitch and the next bear where rolls are not alike.

        On both faces, beyond the pressure of the length of strand that is theirs, N per metre of
        width.
        """


@dataclass(frozen=True, slots=True)
class NoHistory:
    """State of an interaction that remembers nothing."""

    withdrawal_resistance: Array = field(default_factory=lambda: np.zeros(3))


class Interaction(ABC):
    """Something that acts on the surface of a slice, one step at a time.

    A step is: `begin`; then, as often as Newton's method asks, `evaluate` after which the forms are
    assembled; then `state`. Subclasses say what the forms are; what they leave out has no effect.

    Args:
        section: The distributed section.
        motion: Displacement and generalized strains of the mechanical problem.
        on: Groups it acts on.

    Attributes:
        name: Stands before the names of its compiled forms and of its arrays in a checkpoint.
        symmetric: Whether its tangent is, at small strain.
        tags: Of the groups.

    Raises:
        InputError: If a group does not exist.
    """

    name: ClassVar[str]
    symmetric: bool = True

    def __init__(self, section: Section, motion: Motion, on: tuple[str, ...]) -> None:
        self.tags = section.required(on)
        self.section, self._motion = section, motion
        self._old: Any = NoHistory()
        self._generalized_work: fem.Form | None = None

    # What the mechanical problem compiles.

    @abstractmethod
    def virtual_work(self, virtual: Direction) -> ufl.Form:
        """-Int t . v ds of its traction t, Pa, on a virtual motion, to be added to the stress'."""

    @abstractmethod
    def tangent(self, by: Direction, virtual: Direction) -> ufl.Form:
        """Derivative of `virtual_work` along a motion."""

    def always_held(self) -> tuple[Array, Array]:
        """Places of the surface (n, 2), m, whose displacement along directions (n, 2) it holds.

        That is in every step: what acts in some alone has none.
        """
        return np.zeros((0, 2)), np.zeros((0, 2))

    # A step.

    def initial(self) -> Any:
        """State of a strand on which it has never acted."""
        return NoHistory()

    def begin(self, old: Any, start: float, end: float, before: Array, after: Array) -> None:
        """Prepare a step (collective).

        Args:
            old: Committed state, as `initial` or `state` gave it.
            start: Of the step, s.
            end: Of the step, s.
            before: Temperatures of the owned vertices at its start, K.
            after: At its end, K.
        """
        self._old = old

    def axial_strain(self, places: Array) -> Array | None:
        """Axial strain (n,) that it adds in the step begun at places (n, 2), m; None for none."""
        return None

    def front_strain(
        self, old: Any, new: Any, span: tuple[float, float], places: Array
    ) -> Array | None:
        """Axial strain (n,) that it brings to what freezes to the shell; None for none.

        Args:
            old: Its state at the start.
            new: At the end.
            span: Both times, s.
            places: In the undeformed section (n, 2), m.
        """
        return None

    def refusal(self) -> str:
        """Why the step that was begun cannot be taken; empty if it can (collective)."""
        return ""

    def evaluate(self) -> float:
        """Act on the displacement and the generalized strains that the motion holds (collective).

        Returns:
            Stress that rounding makes of it, Pa.
        """
        return 0.0

    def work_on(self, directions: Array) -> Array:
        """Work on directions (4, k) of the generalized strains, N/m each (collective).

        That of the friction on the strand so far is taken off.
        """
        if not directions.shape[1]:
            return np.zeros(0)
        form, work = self._work_form(), np.zeros(directions.shape[1])
        for i, direction in enumerate(directions.T):
            self._motion.one.value[:] = direction
            work[i] = fem.assemble_scalar(form)
        resistance = directions[:3].T @ self._old.withdrawal_resistance
        return reductions.totals(self.section.comm, work) - resistance

    def _work_form(self) -> fem.Form:
        """Work on the direction that the motion holds; compiled at first use."""
        if self._generalized_work is None:
            form = self.virtual_work(of_generalized_strains(self._motion.one, self.section.mesh))
            self._generalized_work = self.section.compile(f"{self.name}.generalized_work", form)
        return self._generalized_work

    def hold(self, on: bool) -> bool:
        """Keep closed what was so at the start of the step, or let it open again (collective).

        Returns:
            Whether there is anything to keep.
        """
        return False

    def evaluated(self) -> Any:
        """What was evaluated last, for `kink`."""
        return None

    def kink(self, base: Any) -> float:
        """Work of its traction since `base`, less what its tangent there foresaw (collective)."""
        return 0.0

    def state(self) -> Any:
        """The state that was evaluated last (collective)."""
        return self._old

    # What others ask of a state.

    def strain_by_pressure(self, state: Any, temperature: Array) -> tuple[Array, Array] | None:
        """Elastic strain that its pressure makes as a mean stress (n,), and the places (n, 2), m.

        Args:
            state: Which is to be judged.
            temperature: Of the local vertices, ghosts included, K.

        Returns:
            None where it is not to be judged by that.
        """
        return None

    def arrays(self, state: Any) -> dict[str, Array | None]:
        """A state as arrays that do not depend on the ranks, whole on rank 0 (collective)."""
        return {}

    def restored(self, arrays: dict[str, Array]) -> Any:
        """The inverse of `arrays`, which every rank has (collective)."""
        return self.initial()


class DifferentiableInteraction(Interaction):
    """One that can be begun with other numbers: derivatives are carried through it.

    A kind of support that is none of these runs, but has no derivatives.
    """

    @abstractmethod
    def of_slice(self, given: Any, solid: Solid) -> DifferentiableInteraction:
        """The same for another slice on the same mesh, which begins its steps and is not evaluated.

        What is liquid here is so there.

        Args:
            given: Its settings.
            solid: What the other slice is made of.
        """
