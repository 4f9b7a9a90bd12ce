"""The linear systems of a stage: solved iteratively, factorised if that fails."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

from castfem import meshes
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.build.law import try_solver
from castfem.model.build.simulation import build
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.operators import FACTORED, ITERATED
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import VERTEX
from thermal.setups import ThermalSetup, constant_steel

STEEL = constant_steel(1725.0, 1775.0, datum=1815.0)


def cooled(step: float, tolerance: float = VERTEX.tight, **options: Any) -> ThermalSetup:
    mesh = meshes.build(
        "rectangle", width=0.125, height=0.125, corner_radius=0.005, symmetry="quarter",
        surface_size=1e-3, core_size=8e-3, cell="quadrilateral",
    )  # fmt: skip
    setup = ThermalSetup(mesh, STEEL, 1815.0, options=options, tolerance=tolerance)
    names = [g for g in mesh.groups if not g.startswith("symmetry")]
    setup.cool(*((name, flux_laws.Contact(1600.0, 433.15, 0.15)) for name in names))
    return setup.advance(10.0, step)


def test_iteration_and_factorisation_agree() -> None:
    iterated = cooled(0.25)
    factorised = cooled(0.25, ksp_type="preonly", pc_type="lu")
    assert FACTORED not in iterated.problem._solvers
    one, other = (s.state.point.temperature for s in (iterated, factorised))
    assert np.abs(one - other).max() < 1e-6
    assert iterated.state.removed == pytest.approx(factorised.state.removed, rel=1e-9)
    # Newton's method needs no more iterations.
    assert iterated.problem.iterations <= factorised.problem.iterations + 3


@pytest.mark.parametrize("liquidus", [1775.0, 1725.0])
def test_correction_is_that_of_newton(liquidus: float) -> None:
    """It reduces the residual to 0 at first order, also for isothermal freezing.

    The matrix is symmetric, as the solver requires.
    """
    mesh = meshes.build(
        "rectangle", width=0.02, height=0.02, corner_radius=0.0, symmetry="quarter",
        surface_size=2e-3, core_size=2e-3, cell="quadrilateral",
    )  # fmt: skip
    setup = ThermalSetup(mesh, constant_steel(1725.0, liquidus, datum=1815.0), 1815.0)
    sides = [g for g in mesh.groups if not g.startswith("symmetry")]
    setup.cool(
        (sides[0], flux_laws.Contact(1600.0, 433.15, 0.15)),
        (sides[1], flux_laws.PrescribedTemperature(1500.0)),
    )
    problem, h = setup.problem, np.random.default_rng(3).uniform(-5e9, 0.0, setup.section.owned)
    h[problem.fixed] = problem.fixed_enthalpy
    problem._base, problem._tau = np.zeros_like(h), 0.1
    x, r, y = (problem._theta.duplicate() for _ in range(3))

    def residual(enthalpy: Array) -> Array:
        x.setArray(enthalpy)
        problem.residual(x, r)
        return r.getArray().copy()

    before = residual(h)
    matrix = problem.new_matrix()
    problem.jacobian(x, matrix)
    isothermal = problem._state.point.conduction_slope == 0.0
    assert isothermal.any() == (liquidus == 1725.0) and len(problem.fixed) > 3
    assert matrix.isSymmetric(1e-12)
    dense = matrix[:, :]
    y.setArray(np.linalg.solve(dense, before))
    problem._correct(x, y)
    share = 1e-6  # of the correction: no vertex moves to another piece of the curve
    after = residual(h - share * y.getArray())
    assert np.abs(after - (1.0 - share) * before).max() < 1e-6 * share * np.abs(before).max()
    assert (y.getArray()[problem.fixed] == 0.0).all()


def linear_iterations(problem: ThermalProblem) -> int:
    """Return the number of linear iterations of the last stage."""
    return int(problem._solver(ITERATED).snes.getLinearSolveIterations())


def test_tolerance_follows_the_error_of_the_step() -> None:
    """For a step error of 0.5 K a vertex may be out of balance by 2e-4 of that."""
    tight, relaxed = cooled(0.25), cooled(0.25, tolerance=0.5 * VERTEX.of_step)
    one, other = (s.state.point.temperature for s in (tight, relaxed))
    assert 0.0 < np.abs(one - other).max() < 1e-4
    assert relaxed.state.removed == pytest.approx(tight.state.removed, rel=1e-7)
    assert relaxed.problem.iterations <= tight.problem.iterations
    assert linear_iterations(relaxed.problem) < 0.7 * linear_iterations(tight.problem)
    assert relaxed.worst_balance < 1e-12


def test_tolerance_is_limited_for_large_step_errors() -> None:
    """2e-4 of a million kelvin would accept the initial guess of each step."""
    case = small({"thermal.time": {"adaptive": {"tolerance": "1e6 K"}}})
    simulation = build(case, MPI.COMM_SELF)
    tolerance = simulation.problem.tolerance
    simulation.destroy()
    tight, loose = cooled(0.25), cooled(0.25, tolerance=tolerance)
    one, other = (s.state.point.temperature for s in (tight, loose))
    assert np.abs(one - other).max() < 2e-2
    assert loose.problem.iterations > 0.4 * tight.problem.iterations


def test_reduction_of_the_user_has_priority() -> None:
    default = cooled(5.0, tolerance=1e-2)
    chosen = cooled(5.0, tolerance=1e-2, ksp_rtol=1e-12)
    solvers = [setup.problem._solver(ITERATED).snes.getKSP() for setup in (default, chosen)]
    assert solvers[0].getTolerances()[0] > 1e-9
    assert solvers[1].getTolerances()[0] == 1e-12


def test_failed_iteration_is_replaced_by_factorisation() -> None:
    failing = cooled(1.0, ksp_max_it=1, ksp_rtol=1e-12)
    regular = cooled(1.0)
    assert FACTORED in failing.problem._solvers
    one, other = (s.state.point.temperature for s in (failing, regular))
    assert np.abs(one - other).max() < 1e-6


@pytest.mark.parametrize(
    ("name", "value"),
    [("snes_type", "newtontr"), ("snes_type", "ngmres"), ("snes_linesearch_type", "bt")],
)
def test_methods_that_multiply_by_the_matrix_are_rejected(name: str, value: str) -> None:
    """They assume the matrix of the enthalpy, and would fail in the first step."""
    with pytest.raises(InputError, match=rf'{name} = "{value}": needs the matrix of the enthalpy'):
        cooled(1.0, **{name: value})
    changes = {"thermal.solver": {name: value}}
    with pytest.raises(InputError, match=r"give (newtonls|basic or l2 or cp)"):
        try_solver("thermal", small(changes).thermal.solver)


@pytest.mark.parametrize("search", ["l2", "cp"])
def test_line_searches_by_the_residual_agree(search: str) -> None:
    searched, plain = cooled(1.0, snes_linesearch_type=search), cooled(1.0)
    one, other = (s.state.point.temperature for s in (searched, plain))
    assert np.abs(one - other).max() < 1e-6
    assert FACTORED not in searched.problem._solvers


@pytest.mark.parametrize("step", [1e3, 1e5])
def test_very_long_steps_are_stable(step: float) -> None:
    """The section is almost steady after one step: the stage is almost a Laplacian."""
    setup = cooled(10.0)
    setup.advance(10.0 + step, step)
    temperature = setup.state.point.temperature
    assert temperature.min() > 433.15 - 1e-3
    assert temperature.max() < 1815.0 + 1e-3
    assert abs(setup.results[-1].balance) < 1e-9
