"""Areas and lengths of the vertices add up to those of the section, also on several ranks."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem

from castfem import meshes
from castfem.base.types import Array
from castfem.fem.probes import LineProbes
from castfem.forms.heat import surface_stretch
from castfem.meshes import SectionMesh
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel
from thermal.test_extremes import CAST, WALL, billet

RADIUS, SIDE = 5e-3, 0.0625
STEEL = constant_steel(1725.15, 1775.65)


def section(cell: str, size: float, order: int) -> SectionMesh:
    return meshes.build(
        shape="rectangle", width=2 * SIDE, height=2 * SIDE, corner_radius=RADIUS,
        symmetry="quarter", cell=cell, order=order, surface_size=size, corner_size=size,
        core_size=8e-3,
    )  # fmt: skip


def shares(setup: ThermalSetup, name: str) -> Array:
    return setup.surface.patch(setup.section.matching([name])).weights


def wave(x: Array) -> Array:
    """Return a displacement that bends the surface within its facets."""
    return 1e-3 * np.stack([np.sin(300.0 * x[1]), np.sin(200.0 * x[0])])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("size", [0.8e-3, 2e-3, 4e-3])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_area_and_perimeter_are_those_of_the_section(cell: str, size: float, order: int) -> None:
    mesh = section(cell, size, order)
    setup = ThermalSetup(mesh, STEEL, 1800.0)
    area = setup.problem.area
    assert area.sum() == pytest.approx(mesh.quality().area, rel=1e-12)
    assert area.min() > 0.0
    arc = shares(setup, "corner")
    assert arc.min() > 0.0
    length = fem.assemble_scalar(
        fem.form(
            fem.Constant(setup.section.mesh, 1.0)
            * ufl.Measure(
                "ds", domain=setup.section.mesh, subdomain_data=setup.section.facet_tags,
                metadata={"quadrature_degree": 40},
            )(tuple(setup.section.matching(["corner"])))
        )
    )  # fmt: skip
    assert arc.sum() == pytest.approx(length, rel=1e-10)
    if order == 2:  # the geometry is of fourth order in the cell size
        assert arc.sum() == pytest.approx(0.5 * np.pi * RADIUS, rel=3e-3 * (size / 4e-3) ** 3)
        exact = SIDE**2 - (1 - np.pi / 4) * RADIUS**2
        assert area.sum() == pytest.approx(exact, rel=1e-4 * (size / 4e-3) ** 3)
    straight = sum(shares(setup, name).sum() for name in ("wide", "narrow"))
    assert straight == pytest.approx(2 * (SIDE - RADIUS), rel=1e-12)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_deformed_surface_has_its_true_length(cell: str) -> None:
    setup = ThermalSetup(section(cell, 4e-3, 2), STEEL, 1800.0, moves=True)
    law = flux_laws.Contact(1600.0, 433.15, 0.15)
    setup.cool(("wide", law), ("narrow", law), ("corner", law)).move(wave)
    shape, mesh = setup.problem.shape, setup.section.mesh
    stretch = surface_stretch(shape.gradient, shape.thickness, ufl.FacetNormal(mesh))
    for name in ("wide", "narrow", "corner"):
        ds = ufl.Measure(
            "ds", domain=mesh, subdomain_data=setup.section.facet_tags,
            metadata={"quadrature_degree": 40},
        )(tuple(setup.section.matching([name])))  # fmt: skip
        length = fem.assemble_scalar(fem.form(stretch * ds))
        assert shares(setup, name).sum() == pytest.approx(length, rel=1e-6)


def cooled(
    comm: MPI.Comm, cell: str = "quadrilateral", radius: float = 5e-3, until: float = 4.0
) -> ThermalSetup:
    curve = constant_steel(1725.15, 1775.65, datum=CAST)
    setup = ThermalSetup(billet(radius, cell), curve, CAST, comm=comm)
    law = flux_laws.Contact(1600.0, WALL, 0.15)
    setup.cool(("wide", law), ("narrow", law), *([("corner", law)] if radius else []))
    return setup.advance(until, 0.1)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_results_are_independent_of_ranks(cell: str) -> None:
    serial, parallel = cooled(MPI.COMM_SELF, cell), cooled(MPI.COMM_WORLD, cell)
    one = serial.section.gather(serial.state.point.temperature)
    many = parallel.section.gather(parallel.state.point.temperature)
    if MPI.COMM_WORLD.rank == 0:
        assert one is not None and many is not None
        assert np.abs(many / one - 1).max() < 1e-8
    assert parallel.state.removed == pytest.approx(serial.state.removed, rel=1e-8)
    assert parallel.worst_balance < 1e-9
    lines = {n: LineProbes(s.section).sample(s.state.point.temperature) for n, s in
             (("one", serial), ("many", parallel))}  # fmt: skip
    for name, profile in lines["one"].items():
        found = lines["many"][name]
        assert found.temperature == pytest.approx(profile.temperature, rel=1e-8)
        assert found.isotherm_depth(1725.15) == pytest.approx(
            profile.isotherm_depth(1725.15), rel=1e-8
        )


@pytest.mark.mpi
def test_gather_and_scatter_are_inverse() -> None:
    setup = ThermalSetup(billet(0.0), constant_steel(1725.15, 1775.65), CAST, comm=MPI.COMM_WORLD)
    section = setup.section
    values = np.arange(section.owned) + 1000.0 * section.comm.rank
    assert np.array_equal(section.scatter(section.gather(values)), values)
