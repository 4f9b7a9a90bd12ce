"""Heat in a deformed slice: conduction, surface flux and conservation.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import replace

from petsc4py import PETSc

import numpy as np
import pytest
import ufl
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem.compat import assemble_owned
from castfem.forms import heat
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel
from thermal.test_extremes import CAST, WALL, billet

STEEL = constant_steel(1725.15, 1775.65, datum=CAST)
CONTACT = flux_laws.Contact(5e3, WALL, 0.15)
COARSE = {"surface_size": 2e-3, "core_size": 1.2e-2}


def cooled(setup: ThermalSetup) -> ThermalSetup:
    return setup.cool(("wide", CONTACT), ("narrow", CONTACT), ("corner", CONTACT))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize(
    "gradient", [((1.1, 0.0), (0.0, 0.8)), ((1.0, 0.3), (0.0, 1.0)), ((0.6, -0.8), (0.8, 0.6))]
)
def test_deformed_slice_is_that_of_a_deformed_mesh(
    gradient: tuple[tuple[float, float], ...], cell: str
) -> None:
    """Stretched, sheared or rotated at constant volume, it cools like a section of that shape."""
    f = np.array(gradient)
    thickness = 1.0 / float(np.linalg.det(f))
    mesh = billet(5e-3, cell, **COARSE)
    expected = cooled(ThermalSetup(replace(mesh, points=mesh.points @ f.T), STEEL, CAST))
    moved = cooled(ThermalSetup(mesh, STEEL, CAST, moves=True))
    moved.move(lambda x: (f - np.eye(2)) @ x[:2], thickness - 1.0)
    for setup in (expected, moved):
        setup.advance(3.0, 0.25)
    found, reference = moved.state.point.temperature, expected.state.point.temperature
    assert reference.min() < 1300.0
    assert found == pytest.approx(reference, rel=1e-9)
    assert moved.state.removed == pytest.approx(thickness * expected.state.removed, rel=1e-9)


def test_heat_is_conserved_while_the_slice_deforms() -> None:
    """The balance of every step is exact, and the deformation adds or removes no heat."""
    setup = cooled(ThermalSetup(billet(5e-3, **COARSE), STEEL, CAST, moves=True))
    start = setup.state.enthalpy
    for turn in range(8):
        size = 0.02 * (-1) ** turn

        def wave(x: Array, size: float = size) -> Array:
            return size * np.stack([x[0] * np.cos(40.0 * x[1]), x[1] * np.cos(50.0 * x[0])])

        setup.move(wave, 0.5 * size).advance(0.5 * (turn + 1), 0.25)
    lost = setup.problem.area @ (start - setup.state.enthalpy)
    assert setup.worst_balance < 1e-12
    assert lost == pytest.approx(setup.state.removed, rel=1e-12)
    assert setup.low > WALL and setup.high < CAST + 0.01 * (CAST - WALL)


def test_folded_liquid_conducts_as_undeformed() -> None:
    setup = cooled(ThermalSetup(billet(5e-3, **COARSE), STEEL, CAST, moves=True))
    still = cooled(ThermalSetup(billet(5e-3, **COARSE), STEEL, CAST))
    setup.move(lambda x: np.stack([-2.0 * x[0], np.zeros_like(x[0])]))  # turned inside out
    for one in (setup, still):
        one.advance(2.0, 0.25)
    assert setup.state.point.temperature == pytest.approx(still.state.point.temperature, rel=1e-9)


def test_residual_matches_the_enthalpy_form() -> None:
    """The residual by vertices is the assembled form (23) of `forms.heat`."""
    setup = cooled(ThermalSetup(billet(5e-3, **COARSE), STEEL, CAST)).advance(2.0, 0.25)
    section, problem, step = setup.section, setup.problem, 0.1
    space = section.vertex_space
    old, point = setup.state.enthalpy, setup.curve.at(setup.state.enthalpy - 3e6)
    new, base, theta, flux = (fem.Function(space) for _ in range(4))
    q = CONTACT.flux(point.temperature, 0.0)[0]
    for function, values in ((new, old - 3e6), (base, old), (theta, point.conduction), (flux, q)):
        function.x.array[:] = values
    v, dx = ufl.TestFunction(space), heat.slice_measure(section.mesh)
    tags = tuple(t for t, name in enumerate(section.groups) if name in section.outer_groups)
    ds = heat.surface_measure(section.mesh, section.facet_tags)(tags)
    form = heat.residual_enthalpy(
        new, base, theta, flux, fem.Constant(section.mesh, step), v, dx, ds
    )
    expected = assemble_owned(fem.form(form), section.owned)
    problem.solve_stage(old, old, step, 0.0)
    unknown, out = (PETSc.Vec().createWithArray(a.copy()) for a in (old - 3e6, old))
    problem.residual(unknown, out)
    assert out.getArray() == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
