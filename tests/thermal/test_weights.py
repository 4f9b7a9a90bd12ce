"""Areas and lengths of the vertices add up to those of the section, curved cells or not."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem

from castfem import meshes
from castfem.base.types import Array
from castfem.forms.heat import surface_stretch
from castfem.meshes import SectionMesh
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel

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
    """Bends the surface within its facets."""
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
    if order == 2:  # the geometry itself: of fourth order in the size of a cell
        assert arc.sum() == pytest.approx(0.5 * np.pi * RADIUS, rel=3e-3 * (size / 4e-3) ** 3)
        exact = SIDE**2 - (1 - np.pi / 4) * RADIUS**2
        assert area.sum() == pytest.approx(exact, rel=1e-4 * (size / 4e-3) ** 3)
    straight = sum(shares(setup, name).sum() for name in ("wide", "narrow"))
    assert straight == pytest.approx(2 * (SIDE - RADIUS), rel=1e-12)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_surface_that_has_moved_keeps_its_true_length(cell: str) -> None:
    setup = ThermalSetup(section(cell, 4e-3, 2), STEEL, 1800.0, moves=True)
    law = flux_laws.Contact(1600.0, 433.15, 0.15)
    setup.cool(("wide", law), ("narrow", law), ("corner", law)).move(wave)
    shape, mesh = setup.problem.shape, setup.section.mesh
    assert shape is not None
    stretch = surface_stretch(shape.gradient, shape.thickness, ufl.FacetNormal(mesh))
    for name in ("wide", "narrow", "corner"):
        ds = ufl.Measure(
            "ds", domain=mesh, subdomain_data=setup.section.facet_tags,
            metadata={"quadrature_degree": 40},
        )(tuple(setup.section.matching([name])))  # fmt: skip
        length = fem.assemble_scalar(fem.form(stretch * ds))
        assert shares(setup, name).sum() == pytest.approx(length, rel=1e-6)
