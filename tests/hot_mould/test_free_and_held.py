"""Tubes whose distortion is known exactly: free ones, and bars between supports."""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
import pytest

from castfem.base.errors import RunFailure
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import CONDUCTIVITY, EXPANSION, Copper
from castfem.physics.mould.hot.distortion import Distortion
from castfem.physics.mould.hot.solvers import LinearSolver

from .tubes import COLD, plain_copper, square_tube

ALPHA, E = 17e-6, 117e9
MIDDLE = np.full((1, 3), 0.5)


def test_uniform_temperature_frees_it_of_stress() -> None:
    tube = square_tube()
    distortion = Distortion(tube, plain_copper(), "free")
    warm = tube.function(COLD + 120.0)
    found = distortion.solve(warm)
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    assert moved == pytest.approx(120.0 * ALPHA * x, abs=1e-14)
    assert found.largest_stress < 1e-8 * E * ALPHA * 120.0


def test_linear_temperature_frees_it_of_stress() -> None:
    """The patch test: u = alpha g (x z, y z, (z^2 - x^2 - y^2)/2) of T - T_cold = g z.

    On cells of straight edges, tapered ones too, elements of second order hold it exactly.
    """
    tube, g = square_tube((2, 3, 3)), 500.0
    x = tube.scalars.tabulate_dof_coordinates()
    warm = tube.function()
    warm.x.array[:] = COLD + g * x[:, 2]
    distortion = Distortion(tube, plain_copper(), "free")
    found = distortion.solve(warm)
    moved = found.displacement.x.array.reshape(-1, 3)
    first, second, z = x.T
    exact = ALPHA * g * np.stack([first * z, second * z, 0.5 * (z**2 - first**2 - second**2)], 1)
    shift = (moved - exact)[:, 2]
    assert np.ptp(shift) < 1e-13
    assert moved[:, :2] == pytest.approx(exact[:, :2], abs=1e-13)
    assert found.largest_stress < 1e-7 * E * ALPHA * g * 0.2


def test_bar_between_supports() -> None:
    """It cannot grow longer: sigma_z = -E alpha dT, and swells by (1 + nu) alpha dT."""
    tube, rise = square_tube(taper=0.0), 80.0
    distortion = Distortion(tube, plain_copper(), "between")
    warm = tube.function(COLD + rise)
    found = distortion.solve(warm)
    sigma, _ = distortion.stress_at(found.displacement, warm, MIDDLE)
    wanted = np.diag([0.0, 0.0, -E * ALPHA * rise])
    assert sigma == pytest.approx(np.broadcast_to(wanted, sigma.shape), abs=1e-6 * E * ALPHA * rise)
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    assert moved[:, :2] == pytest.approx((1.0 + 0.34) * ALPHA * rise * x[:, :2], abs=1e-13)


@pytest.mark.parametrize("support", ["hung", "clamped"])
def test_supports_hold_the_top(support: str) -> None:
    tube = square_tube()
    found = Distortion(tube, plain_copper(), support).solve(tube.function(COLD + 100.0))  # type: ignore[arg-type]
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    top = np.isclose(x[:, 2], 0.0)
    held = moved[top] if support == "clamped" else moved[top, 2:]
    assert np.abs(held).max() == 0.0
    assert moved[~top, 2].max() > 1e-4
    if support == "hung":  # nothing keeps it from growing as a free one does
        assert moved == pytest.approx(100.0 * ALPHA * x, abs=1e-13)


def _heated(method: str, cells: tuple[int, int, int]) -> tuple[Array, Array, tuple[int, int]]:
    tube = square_tube(cells)
    copper = Copper()
    load = FaceLoad(flux=2.5e6, coefficient=3e4, water=313.0)
    heated = Conduction(tube, copper, method).solve(load)  # type: ignore[arg-type]
    found = Distortion(tube, copper, "hung", method).solve(heated.temperature)  # type: ignore[arg-type]
    counts = heated.solved.iterations, found.solved.iterations
    return heated.temperature.x.array, found.displacement.x.array, counts


@pytest.mark.parametrize("cells", [(2, 2, 12), (3, 3, 8)])
def test_multigrid_is_the_direct_solver(cells: tuple[int, int, int]) -> None:
    """Three cells through the wall have some whose nodes are all within."""
    direct, exact, none = _heated("direct", cells)
    kelvin, moved, counts = _heated("multigrid", cells)
    assert none == (0, 0)
    assert kelvin == pytest.approx(direct, abs=1e-6)
    assert moved == pytest.approx(exact, abs=1e-7 * float(np.abs(exact).max()))
    # Aggregates, where PETSc comes without hypre, suit the heat in flat cells less.
    most = 30 if PETSc.Sys.hasExternalPackage("hypre") else 60
    assert 0 < counts[0] < most and 0 < counts[1] < 100


def test_solver_that_does_not_converge_says_so() -> None:
    matrix = PETSc.Mat().createAIJ((4, 4), nnz=1)
    for i in range(4):
        matrix.setValue(i, i, 10.0**i)
    matrix.assemble()
    options = {"ksp_type": "cg", "pc_type": "none", "ksp_max_it": 1, "ksp_rtol": 1e-12}
    solver = LinearSolver(matrix, "mould_test_", options)
    with pytest.raises(RunFailure, match="hot mould: the mould_test solver does not converge"):
        solver.solve(np.array([1.0, 1.0, 1.0, 1.0]))
    solver.destroy()
    matrix.destroy()


def test_copper_over_temperature() -> None:
    copper = Copper()
    kelvin = np.linspace(200.0, 900.0, 141)
    theta = copper.conduction_integral(kelvin)
    assert copper.temperature(theta) == pytest.approx(kelvin, abs=1e-9)
    middle = 0.5 * (kelvin[1:] + kelvin[:-1])
    assert np.diff(theta) / np.diff(kelvin) == pytest.approx(CONDUCTIVITY(middle), abs=0.1)
    assert copper.thermal_strain(copper.cold) == 0.0
    # From 20 degC to 200 degC the table's own mean coefficient.
    swelled = copper.thermal_strain(473.15) - copper.thermal_strain(293.15)
    assert swelled == pytest.approx(float(EXPANSION(473.15)) * 180.0, rel=1e-12)
    constant = Copper(expansion=Constant(17e-6))
    assert constant.thermal_strain(398.15) == pytest.approx(17e-6 * 100.0, rel=1e-12)
