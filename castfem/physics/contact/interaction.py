"""Common interface of interactions with the strand's surface: a wall, or rolls.

A settings object (`SurfaceInteraction`) describes each of them to a slice, and builds the object
that computes it (`Interaction`). A new kind of support needs a subclass of `Interaction` with its
forms, and its settings; see docs/architecture.md.

The mechanics, which build on this module, implement `Motion` and `Solid`.
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
    """Displacement and generalized strains, at present and at the start of the step."""

    @property
    def u(self) -> fem.Function:
        """Present displacement, m."""

    @property
    def u_old(self) -> fem.Function:
        """Displacement at the start of the step, m."""

    @property
    def generalized_strains(self) -> fem.Constant:
        """Present generalized strains (4,)."""

    @property
    def generalized_strains_old(self) -> fem.Constant:
        """Generalized strains at the start of the step (4,)."""

    @property
    def one(self) -> fem.Constant:
        """Direction of the generalized strains (4,)."""


class Liquid(Protocol):
    """Liquid steel, whose pressure acts from inside."""

    @property
    def outside(self) -> str:
        """Whether something besides the wall holds liquid at the surface: "held" if so."""

    def pressure(self, temperature: Array, time: float) -> Array:
        """Ferrostatic pressure at temperatures (n,), K, and a time, s: (n,), Pa."""


class Solid(Protocol):
    """Material of the strand."""

    @property
    def law(self) -> Law:
        """Constitutive law."""

    @property
    def ferrostatic(self) -> Liquid | None:
        """Its liquid; None if it exerts no pressure."""

    @property
    def liquid(self) -> str:
        """Kind of its liquid: "fed", or an "elastic" body."""

    @property
    def large_strain(self) -> bool:
        """Whether the geometry is that of the deformed slice."""

    def thermal_strain(self, temperature: Array, /) -> Array:
        """Linear thermal strain at temperatures (n,), K."""


class InteractionState(Protocol):
    """The part of an interaction in the committed state; it is never modified."""

    @property
    def withdrawal_resistance(self) -> Array:
        """Accumulated axial force of its friction on the strand, N, and moments, N m, (3,)."""


NOTHING_ADDED = (0.0, 0.0)


@runtime_checkable
class BearsRolls(Protocol):
    """State of an interaction with rolls, including their extra loads."""

    @property
    def added(self) -> tuple[float, float]:
        """Extra loads of the pair at the end of this pitch and of the next, where rolls differ.

        On both faces together, beyond the pressure on their tributary length of strand, N per metre
        of width.
        """


@dataclass(frozen=True, slots=True)
class NoHistory:
    """State of an interaction without memory."""

    withdrawal_resistance: Array = field(default_factory=lambda: np.zeros(3))


class Interaction(ABC):
    """An interaction with the surface of a slice, one step at a time.

    A step consists of `begin`; then, as often as Newton's method requires, `evaluate`, after which
    the forms are assembled; then `state`. Subclasses define the forms; the default implementations
    have no effect.

    Args:
        section: The distributed section.
        motion: Displacement and generalized strains of the mechanical problem.
        on: Boundary groups on which it acts.

    Attributes:
        name: Prefix of its compiled forms and of its arrays in a checkpoint.
        symmetric: Whether its tangent is symmetric at small strain.
        tags: Tags of the groups.

    Raises:
        InputError: A group does not exist.
    """

    name: ClassVar[str]
    symmetric: bool = True

    def __init__(self, section: Section, motion: Motion, on: tuple[str, ...]) -> None:
        self.tags = section.required(on)
        self.section, self._motion = section, motion
        self._old: Any = NoHistory()
        self._generalized_work: fem.Form | None = None

    # Forms compiled by the mechanical problem.

    @abstractmethod
    def virtual_work(self, virtual: Direction) -> ufl.Form:
        """-Int t . v ds of its traction t, Pa, for a virtual motion, to be added to the stress'."""

    @abstractmethod
    def tangent(self, by: Direction, virtual: Direction) -> ufl.Form:
        """Derivative of `virtual_work` along a motion."""

    def always_held(self) -> tuple[Array, Array]:
        """Places of the surface (n, 2), m, whose displacement it restrains in directions (n, 2).

        Only what is restrained in every step counts.
        """
        return np.zeros((0, 2)), np.zeros((0, 2))

    # A step.

    def initial(self) -> Any:
        """Initial state, before it has ever acted."""
        return NoHistory()

    def begin(self, old: Any, start: float, end: float, before: Array, after: Array) -> None:
        """Prepare a step (collective).

        Args:
            old: Committed state, from `initial` or `state`.
            start: Start of the step, s.
            end: End of the step, s.
            before: Temperatures of the owned vertices at its start, K.
            after: Temperatures at its end, K.
        """
        self._old = old

    def axial_strain(self, places: Array) -> Array | None:
        """Axial strain (n,) that it adds in the current step at places (n, 2), m; None for none."""
        return None

    def front_strain(
        self, old: Any, new: Any, span: tuple[float, float], places: Array
    ) -> Array | None:
        """Axial strain (n,) of material that freezes to the shell; None for none.

        Args:
            old: State at the start.
            new: State at the end.
            span: Both times, s.
            places: Places in the undeformed section (n, 2), m.
        """
        return None

    def refusal(self) -> str:
        """Reason why the current step cannot be taken; "" if it can (collective)."""
        return ""

    def evaluate(self) -> float:
        """Evaluate the traction for the present displacement and generalized strains (collective).

        Returns:
            Stress caused by rounding, Pa.
        """
        return 0.0

    def work_on(self, directions: Array) -> Array:
        """Work on directions (4, k) of the generalized strains, N/m each (collective).

        The accumulated friction on the strand is subtracted.
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
        """Work on the direction stored in the motion; compiled at first use."""
        if self._generalized_work is None:
            form = self.virtual_work(of_generalized_strains(self._motion.one, self.section.mesh))
            self._generalized_work = self.section.compile(f"{self.name}.generalized_work", form)
        return self._generalized_work

    def hold(self, on: bool) -> bool:
        """Keep contacts closed that were so at the start of the step, or let them go (collective).

        Returns:
            Whether there are such contacts.
        """
        return False

    def evaluated(self) -> Any:
        """Result of the last evaluation, for `kink`."""
        return None

    def kink(self, base: Any) -> float:
        """Work of its traction since `base`, minus that predicted by its tangent (collective)."""
        return 0.0

    def state(self) -> Any:
        """State of the last evaluation (collective)."""
        return self._old

    # Questions about a state.

    def strain_by_pressure(self, state: Any, temperature: Array) -> tuple[Array, Array] | None:
        """Elastic strain of its pressure as a mean stress (n,), and the places (n, 2), m.

        Args:
            state: State in question.
            temperature: Temperatures of the local vertices, including ghosts, K.

        Returns:
            None if this is no criterion for it.
        """
        return None

    def arrays(self, state: Any) -> dict[str, Array | None]:
        """State as arrays that do not depend on the ranks, complete on rank 0 (collective)."""
        return {}

    def restored(self, arrays: dict[str, Array]) -> Any:
        """Inverse of `arrays`, which are on every rank (collective)."""
        return self.initial()


class DifferentiableInteraction(Interaction):
    """An interaction that can be evaluated with other data, so that derivatives can be computed.

    Other kinds of support can be run, but have no derivatives.
    """

    @abstractmethod
    def of_slice(self, given: Any, solid: Solid) -> DifferentiableInteraction:
        """Make one for another slice on the same mesh, which begins its steps and is not evaluated.

        Liquid is taken where it is in this slice.

        Args:
            given: Settings.
            solid: Material of the other slice.
        """
