"""What contact has to know of the strand: how it moves, and what it is made of.

The mechanics, which build on contact, have both.
"""

from __future__ import annotations

from typing import Protocol

from dolfinx import fem

from castfem.base.types import Array
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
