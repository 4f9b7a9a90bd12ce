"""The liquid core of a slab between its rolls: its pressure, and where the shell ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from castfem.fem.line_probes import Profile
from castfem.base.types import Array

if TYPE_CHECKING:
    from castfem.physics.materials import Steel
    from castfem.physics.mechanics.ferrostatic import Ferrostatic


@dataclass(frozen=True, slots=True)
class Core:
    """The liquid within.

    Attributes:
        head: Its pressure over time, Pa.
        share: Of it that is felt at temperatures (n,), K.
    """

    head: Callable[[float], float]
    share: Callable[[Array], Array]

    def share_handed_on(self, profile: Profile) -> float:
        """Share of the pressure handed on: none through liquid, none of a solid core."""
        surface, core = self.share(np.array([profile.temperature[0], profile.temperature.max()]))
        return float(max(core - surface, 0.0))

    def handed_on(self, profile: Profile, time: float) -> float:
        """The pressure that it hands on, Pa."""
        return float(self.head(time) * self.share_handed_on(profile))


def front_of(steel: Steel, solid_fraction: float) -> float:
    """Temperature at which the steel has a solid fraction, K."""
    if solid_fraction >= 1.0:
        return steel.solidus
    if solid_fraction <= 0.0:
        return steel.liquidus

    def excess(temperature: float) -> float:
        return float(np.asarray(steel.solid_fraction(np.array([temperature])))[0]) - solid_fraction

    return float(brentq(excess, steel.solidus, steel.liquidus, xtol=1e-6))


def core_of(liquid: Ferrostatic | None) -> Core:
    """The pressure within; none where the case leaves it out."""
    if liquid is None:
        return Core(lambda time: 0.0, np.zeros_like)
    return Core(liquid.head, lambda heat: np.asarray(liquid.share(heat)))
