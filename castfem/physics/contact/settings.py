"""Settings of the interactions with the surface of a slice, and of contact with a wall.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from castfem.base.errors import InputError
from castfem.physics.contact.friction import Friction
from castfem.physics.mould.wall import Wall

if TYPE_CHECKING:
    from castfem.fem.section import Section
    from castfem.physics.contact.interaction import Interaction, Motion, Solid
    from castfem.physics.contact.wall_contact import WallContact


ALWAYS = (float("-inf"), float("inf"))
"""Range of an interaction along the whole strand, m."""


class SurfaceInteraction(ABC):
    """Settings of an interaction with boundary groups, with defaults."""

    @property
    def between(self) -> tuple[float, float]:
        """Positions between which it may be active, m; a coupling window ends at each."""
        return ALWAYS

    @property
    def knots(self) -> tuple[float, ...]:
        """Further positions at which a window must end, m."""
        return ()

    @property
    def holds(self) -> bool:
        """Whether it carries loads that are not in equilibrium, like a wall.

        Rigid body motions without another restraint are left to it, and to weak springs while it is
        not active: rigidly fixed points would carry part of its load.
        """
        return True

    @property
    def holds_liquid(self) -> bool:
        """Whether it contains liquid that reaches the surface."""
        return False

    @property
    def has_friction(self) -> bool:
        """Whether it has friction along the strand."""
        return False

    @abstractmethod
    def build(self, section: Section, solid: Solid, motion: Motion) -> Interaction:
        """Build the object that computes it on a section (collective).

        Raises:
            InputError: A group does not exist.
        """


METHODS = ("penalty", "nitsche")
FACTOR = 10.0  # K_p over bulk modulus / height of the surface cells, see docs/contact.md
# Nitsche's tangent of elastic steel is coercive from 8.1 on at Poisson's ratio 0.4, that of the
# solidus; cells thinner than average need more.
LEAST_NITSCHE = 9.0


def still(time: float) -> float:
    """Return 0 at any time: no motion."""
    return 0.0


@dataclass(frozen=True, slots=True)
class Contact(SurfaceInteraction):
    """Settings of contact between boundary groups and a rigid wall.

    Raises:
        InputError: A value is impossible.
    """

    wall: Wall  #: the wall
    on: tuple[str, ...]  #: groups; a name matches all groups that begin with it
    #: position of the slice below the meniscus over time (s), m
    position: Callable[[float], float] = still
    method: Literal["penalty", "nitsche"] = "penalty"  #: "penalty" (239) or "nitsche"
    #: contact stiffness K_p over bulk modulus (local and present) / mean height of the surface
    #: cells; `FACTOR` if None
    factor: float | None = None
    friction: Friction | None = None  #: friction law; None for a wall without friction
    #: displacement of the wall along the strand over time (s), m: its oscillation
    stroke: Callable[[float], float] = still
    #: quadrature points per facet; two, one for each of the two displacements that a facet adds to
    #: the surface, are the most that can meet a wall of any shape
    points: int = 2

    def __post_init__(self) -> None:
        """Check the values."""
        if self.method not in METHODS:
            raise InputError(f'contact.method: "{self.method}"; one of {", ".join(METHODS)}')
        if self.factor is not None and not self.factor > 0.0:
            raise InputError(f"contact.factor: {self.factor}; it must be positive")
        if self.points not in (2, 3, 4):
            raise InputError(f"contact.points: {self.points}; 2, 3 or 4")

    @property
    def strength(self) -> float:
        """The factor, with its default."""
        return FACTOR if self.factor is None else self.factor

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric at small strain."""
        return self.method == "penalty" and self.friction is None

    @property
    def holds_liquid(self) -> bool:
        """See `SurfaceInteraction`."""
        return True

    @property
    def has_friction(self) -> bool:
        """See `SurfaceInteraction`."""
        return self.friction is not None

    def build(self, section: Section, solid: Solid, motion: Motion) -> WallContact:
        """See `SurfaceInteraction`."""
        from castfem.physics.contact.wall_contact import WallContact

        return WallContact(section, self, solid, motion)
