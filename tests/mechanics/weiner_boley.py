"""A strip that models the solidifying half-space of Weiner and Boley."""

from __future__ import annotations

from typing import Any

import numpy as np
from thermal.setups import ThermalSetup

from castfem import meshes
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.closed_forms.half_space import POISSON, SURFACE, YIELD, YOUNG, HalfSpace
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.parameters import load_law
from castfem.physics.materials import load_steel
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.supports import PrescribedDisplacement
from castfem.physics.thermal.flux_laws import PrescribedTemperature
from mechanics.cooled import CooledSlice

POURED = 1495.0  # degC


class Strip(CooledSlice):
    """A strip one cell wide that may strain uniformly along y and z; heat balance first.

    `ratio` is the stiffness of the liquid over that of the solid; `settings` changes the `Slice`.
    """

    def __init__(
        self,
        size: float,
        ratio: float = 1e-6,
        cell: str = "quadrilateral",
        law: str = "weiner_boley",
        carbon: float = 0.1,
        options: dict[str, Any] | None = None,
        length: float = 0.03,
        **settings: Any,
    ) -> None:
        steel = load_steel("weiner_boley")
        mesh = meshes.build(
            "strip", length=length, width=size, surface_size=size, core_size=size, cell=cell
        )
        curve = steel.thermal_curve(1200.0, 1800.0, POURED + ZERO_CELSIUS)
        thermal = ThermalSetup(mesh, curve, POURED + ZERO_CELSIUS)
        thermal.cool(("surface", PrescribedTemperature(SURFACE + ZERO_CELSIUS)))
        elasticity = Elasticity.constant(YOUNG, POISSON, Solidity.of(steel, stiffness_ratio=ratio))
        slice_ = Slice(
            load_law(law, elasticity, carbon=carbon),
            steel.thermal_strain,
            # Both long sides stay straight; the strain along y is a generalized strain.
            PlainPlanes(("a0", "across")),
            (
                PrescribedDisplacement(("side_low",), 1),
                PrescribedDisplacement(("side_high",), 1),
                PrescribedDisplacement(("surface",), 0),
            ),
            pin=False,
            **settings,
        )
        super().__init__(thermal, slice_, options=options)

    @property
    def depth(self) -> Array:
        """Return the depths of the points, m."""
        return self.problem.points.deviator.position[:, 0]

    @property
    def stress(self) -> Array:
        """Return the stress at the points (n, 4), Pa."""
        return self.problem.points.recovered(self.state.stress)

    def error(self, exact: HalfSpace) -> float:
        """Return the rms error of sigma_zz in the shell, relative to 20 MPa."""
        time = self.state.time
        inside = self.depth < exact.shell(time)
        difference = self.stress[inside, 2] - exact.stress(self.depth[inside], time)
        return float(np.sqrt(np.mean(difference**2)) / YIELD)
