"""Definition of a slice: material, supports, loads, and the pressure of its liquid core.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.contact.settings import SurfaceInteraction
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes, Planes, TimeHistory
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure, Traction

# Effective pressure at a solid fraction: (219), and the two extremes of Fig. 63.
SHARES: dict[str, Callable[[Array], Array]] = {
    "proportional": lambda solid: 1.0 - solid,
    "full": lambda solid: np.where(solid < 1.0, 1.0, 0.0),
    "none": lambda solid: np.where(solid > 0.0, 0.0, 1.0),
}


@dataclass(frozen=True, slots=True)
class Ferrostatic:
    """Pressure p = gamma D (1 - fs) (219) at each point, from its temperature.

    It acts as -p div v in the plane. Between liquid and solid cells the nodal forces add up to
    gamma D times the projected length of the front for any mesh in between, since the shape
    functions add up to one.

    Where liquid reaches the surface, as below the meniscus before a shell has formed, nothing in
    the slice could support it except its artificial stiffness, and the section would swell by
    millimetres that freeze into the shell. There the pressure is supported from outside, by the
    mould, and only the pressure on the front acts on the slice.
    """

    head: TimeHistory  #: pressure gamma D over time, Pa
    solid_fraction: Callable[[Array], Array]  #: solid fraction over temperature, K
    #: pressure in the mushy zone: "proportional" to the liquid (219), "full" until all is solid, or
    #: "none" as soon as anything is (Fig. 63)
    mushy_zone: Literal["proportional", "full", "none"] = "proportional"
    #: pressure where the surface is liquid: "held" from outside, or "free"
    outside: Literal["held", "free"] = "held"

    def __post_init__(self) -> None:
        """Check the names."""
        if self.outside not in ("held", "free"):
            raise InputError(f'ferrostatic.outside: "{self.outside}"; one of held, free')
        if self.mushy_zone not in SHARES:
            raise InputError(
                f'ferrostatic.mushy_zone: "{self.mushy_zone}"; one of {", ".join(SHARES)}'
            )

    def pressure(self, temperature: Array, time: float) -> Array:
        """Pressure at points with these temperatures (n,), K, at `time` (s): (n,), Pa."""
        return np.asarray(self.head(time) * self.share(temperature))

    def share(self, temperature: Array) -> Array:
        """Fraction of the full pressure at temperatures (n,), K."""
        return SHARES[self.mushy_zone](np.asarray(self.solid_fraction(temperature)))


@dataclass(frozen=True, slots=True)
class Slice:
    """Material, supports and loads of a slice."""

    law: Law  #: constitutive law
    #: linear thermal strain over temperature, K; 0 in mushy zone and liquid
    thermal_strain: Callable[[Array], Array]
    planes: Planes = field(default_factory=PlainPlanes)  #: motion of the bounding planes
    #: prescribed displacements, besides the lines of symmetry
    held: tuple[PrescribedDisplacement, ...] = ()
    loads: tuple[Traction | SurfacePressure, ...] = ()  #: surface loads
    ferrostatic: Ferrostatic | None = None  #: pressure of the liquid; None for none
    large_strain: bool = False  #: objective update on the deformed slice
    #: whether to fix, by points or springs, rigid body motions left by symmetry and `held`
    pin: bool = True
    integration: Integration | None = None  #: quadrature rules; None for the default
    #: interactions with its surface: wall of the mould, rolls
    interactions: tuple[SurfaceInteraction, ...] = ()
    #: "fed" from above, so that it carries only its pressure; or an "elastic" body with its own
    #: stiffness
    liquid: Literal["fed", "elastic"] = "elastic"

    def head(self, time: float) -> float:
        """Largest pressure of the liquid at `time` (s), Pa."""
        return 0.0 if self.ferrostatic is None else self.ferrostatic.head(time)

    def young_at_solidus(self) -> float:
        """Young's modulus of steel that has just become coherent, Pa."""
        elasticity = self.law.elasticity
        return float(elasticity.young(np.array([elasticity.solidity.solidus]))[0])
