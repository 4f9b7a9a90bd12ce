"""What a slice is made of, how it is held and what acts on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.contact.surface_interaction import SurfaceInteraction
from castfem.physics.mechanics.ferrostatic import Ferrostatic
from castfem.physics.mechanics.planes import PlainPlanes, Planes
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure, Traction


@dataclass(frozen=True, slots=True)
class Slice:
    """What a slice is made of and how it is held.

    Attributes:
        law: Constitutive law.
        thermal_strain: Linear thermal strain over temperature, K; 0 in mushy zone and liquid.
        planes: Motion of the bounding planes.
        held: Prescribed displacements beside the lines of symmetry.
        loads: Surface loads.
        ferrostatic: Pressure of the liquid; None for none.
        large_strain: Objective update on the deformed slice.
        pin: Hold by points, or springs, the rigid motions that symmetry and held leave.
        integration: Quadrature rules; the usual ones if None.
        interactions: What acts on its surface: a mould's wall, rolls.
        liquid: "fed" from above, so that it carries its pressure alone; or "elastic", a body of its
            own stiffness.
    """

    law: Law
    thermal_strain: Callable[[Array], Array]
    planes: Planes = field(default_factory=PlainPlanes)
    held: tuple[PrescribedDisplacement, ...] = ()
    loads: tuple[Traction | SurfacePressure, ...] = ()
    ferrostatic: Ferrostatic | None = None
    large_strain: bool = False
    pin: bool = True
    integration: Integration | None = None
    interactions: tuple[SurfaceInteraction, ...] = ()
    liquid: Literal["fed", "elastic"] = "elastic"

    def head(self, time: float) -> float:
        """Largest pressure of the liquid at `time` (s), Pa."""
        return 0.0 if self.ferrostatic is None else self.ferrostatic.head(time)

    def young_at_solidus(self) -> float:
        """Young's modulus of what has just become coherent, Pa."""
        elasticity = self.law.elasticity
        return float(elasticity.young(np.array([elasticity.solidity.solidus]))[0])
