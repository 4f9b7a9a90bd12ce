"""What a slice is told of a thing that acts on its surface: a wall, rolls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from castfem.fem.section import Section
    from castfem.physics.contact.interaction import Interaction
    from castfem.physics.contact.interfaces import Motion, Solid

ALWAYS = (float("-inf"), float("inf"))
"""Range of positions of what acts on the whole way, m."""


class SurfaceInteraction(ABC):
    """Settings of something that acts on boundary groups; what they leave out is as it is here."""

    @property
    def between(self) -> tuple[float, float]:
        """Positions between which it may act, m; a coupling window ends at each."""
        return ALWAYS

    @property
    def knots(self) -> tuple[float, ...]:
        """Further positions at which a window has to end, m."""
        return ()

    @property
    def holds(self) -> bool:
        """Whether it bears loads that are not in equilibrium, as a wall does.

        Motions as a rigid body that nothing else holds then are left to it, and to weak springs for
        the time that it does not act: points held rigidly would bear its share.
        """
        return True

    @property
    def holds_liquid(self) -> bool:
        """Whether it holds liquid that comes to the surface."""
        return False

    @property
    def has_friction(self) -> bool:
        """Whether it has friction along the strand."""
        return False

    @abstractmethod
    def build(self, section: Section, solid: Solid, motion: Motion) -> Interaction:
        """What computes it on a section (collective).

        Raises:
            InputError: If a group does not exist.
        """
