"""A solidifying billet for the tests: heat balance, then mechanics, in memory."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
from thermal.setups import ThermalSetup

from castfem import meshes
from castfem.physics.constitutive.elasticity import Solidity
from castfem.physics.constitutive.parameters import load_elasticity, load_law
from castfem.physics.contact.settings import Contact
from castfem.physics.machine import Machine, Steady
from castfem.physics.materials import load_steel
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes, allowed_strains
from castfem.physics.mechanics.slice_definition import Ferrostatic, Slice
from castfem.physics.mechanics.supports import SPRING
from castfem.physics.mould import Mould, RectangleCavity, Taper, same
from castfem.physics.thermal import flux_laws
from mechanics.cooled import CooledSlice

STEEL = load_steel("carbon_042")


def billet_mesh(symmetry: str = "quarter", **settings: Any) -> meshes.SectionMesh:
    sizes: dict[str, Any] = {"surface_size": 1e-3, "core_size": 1e-2, "cell": "quadrilateral"}
    sizes |= {"width": 0.125, "height": 0.125} | settings
    return meshes.build("rectangle", symmetry=symmetry, **sizes)


def in_its_mould(mesh: meshes.SectionMesh) -> dict[str, Any]:
    """Return arguments of `CastSetup` for a billet in a mould of 1 %/m taper, with springs."""
    cavity = RectangleCavity(0.125, 0.125, 0.0)
    wall = Mould(cavity, 0.6, same(Taper.single(0.01, 0.6)), None, None)
    sides = tuple(g for g in mesh.groups if not g.startswith("symmetry"))
    contact = Contact(wall, sides, lambda time: 0.06 * time)
    return {"interactions": (contact,), "springs": SPRING}


class CastSetup(CooledSlice):
    """A strand section that solidifies and strains; `settings` changes the `Slice`.

    `ratio` is the stiffness of the liquid over that of the solid, `cooling` a heat transfer
    coefficient in W/m2K; `springs` replaces pins, as stiffness over Young's modulus.
    """

    def __init__(
        self,
        mesh: meshes.SectionMesh,
        comm: MPI.Comm = MPI.COMM_SELF,
        ratio: float = 1e-5,
        options: dict[str, Any] | None = None,
        cooling: float = 1600.0,
        springs: float | None = None,
        **settings: Any,
    ) -> None:
        start = STEEL.liquidus + 20.0
        curve = STEEL.thermal_curve(400.0, start + 2.0, start)
        thermal = ThermalSetup(mesh, curve, start, comm=comm)
        names = [g for g in mesh.groups if not g.startswith("symmetry")]
        thermal.cool(*((n, flux_laws.Contact(cooling, 433.15, 0.15)) for n in names))
        section = thermal.section
        elasticity = load_elasticity("elastic_steel", Solidity.of(STEEL, stiffness_ratio=ratio))
        slice_: dict[str, Any] = {
            "law": load_law("norton_hoff_kozlowski", elasticity),
            "planes": PlainPlanes(allowed_strains(section.groups)),
            "ferrostatic": Ferrostatic(Machine(Steady(0.06)).head(7000.0), STEEL.solid_fraction),
        }
        definition = Slice(thermal_strain=STEEL.thermal_strain, **(slice_ | settings))
        super().__init__(thermal, definition, options=options, springs=springs)

    def frozen(self, until: float, step: float) -> CastSetup:
        """Solidify without mechanics, which begins free of stress at `until` (s)."""
        self.thermal.advance(until, step)
        self.state = self.stepper.initial(until, self.thermal.state.point.temperature)
        return self

    @property
    def stress(self) -> np.ndarray:
        """Return the stress at the owned vertices (owned, 4), Pa."""
        points = self.problem.points
        return points.at_vertices(points.recovered(self.state.stress))

    @property
    def moved(self) -> np.ndarray:
        """Return the displacement of the owned vertices (owned, 2), m."""
        return self.problem.points.nodal(self.state.displacement)

    @property
    def vertices(self) -> np.ndarray:
        """Return the positions of the owned vertices (owned, 2), m."""
        section = self.thermal.section
        return section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2]
