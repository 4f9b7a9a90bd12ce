"""Factorisations: failures, fallback, LU for unsymmetric laws, memory, cells without stress."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
import ufl
from dolfinx import fem, la
from scipy import sparse

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.fem import factorisation
from castfem.fem.bordered_system import BorderedSystem
from castfem.fem.compat import CELLS, CellForm, assemble_into, create_matrix
from castfem.fem.dof_values import matrix_of_nodes
from castfem.fem.factorisation import OWN, has_minimum_degree
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.hardening_laws import NortonHoff, UnifiedSteel
from castfem.physics.mechanics.state import Balance
from mechanics.casting import CastSetup, billet_mesh, in_its_mould
from mechanics.setups import RING_GROUPS, SliceSetup, box, expansion, mapped, ring

WITHOUT_PIVOTING = {"ksp_type": "preonly", "pc_type": "lu", **OWN}
needs_minimum_degree = pytest.mark.skipif(not has_minimum_degree(), reason="PETSc without amd")
MUMPS = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}


def petsc(matrix: Any) -> PETSc.Mat:
    rows = matrix.tocsr()
    result = PETSc.Mat().createAIJ(
        rows.shape, csr=(rows.indptr, rows.indices, rows.data), comm=PETSc.COMM_SELF
    )
    result.assemble()
    return result


def laplacian(n: int) -> Any:
    return sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))  # type: ignore[call-overload]


class Bordered:
    """A bordered system with a replaceable block, solved as by SNES."""

    def __init__(self, matrix: Any, scalars: int, options: dict[str, Any]) -> None:
        self.matrix = petsc(matrix)
        self.bordered = BorderedSystem(self.matrix, scalars, "spoilt_", options)
        rng = np.random.default_rng(1)
        self.bordered.columns[:] = self.bordered.rows[:] = rng.random(self.bordered.columns.shape)
        self.bordered.corner[:] = 3.0 * np.eye(scalars)
        self.ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        self.ksp.setOperators(self.bordered.operator)
        self.bordered.use_with(self.ksp)

    def error(self) -> float:
        """Solve, and return the relative residual; NaN if the solver fails."""
        self.bordered.updated()
        rhs, solution = self.bordered.vector(), self.bordered.vector()
        rhs.set(1.0)
        self.ksp.solve(rhs, solution)
        if self.ksp.getConvergedReason() < 0:
            return float("nan")
        product = rhs.duplicate()
        self.bordered.operator.mult(solution, product)
        return float((product - rhs).norm() / rhs.norm())

    def close(self) -> None:
        self.ksp.destroy()
        self.bordered.destroy()
        self.matrix.destroy()


@pytest.fixture(params=[0, 2])
def bordered(request: pytest.FixtureRequest) -> Iterator[Bordered]:
    system = Bordered(laplacian(30), request.param, MUMPS)
    yield system
    system.close()


def test_singular_block_is_reported_and_has_no_after_effect(bordered: Bordered) -> None:
    """Regular and singular blocks alternate: each result is that of the current block."""
    assert bordered.error() < 1e-12
    for regular in (False, True, False, False, True):
        for column in (14, 15, 16):
            value = {14: -1.0, 15: 2.0, 16: -1.0}[column] if regular else 0.0
            bordered.matrix.setValue(15, column, value)
            bordered.matrix.setValue(column, 15, value)
        bordered.matrix.assemble()
        error = bordered.error()
        assert (error < 1e-12) == regular
        assert bordered.bordered.failure == ("" if regular else "the equations are singular")


def test_workspace_grows_when_it_runs_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Delayed pivots make the factors larger than MUMPS estimated."""
    rng = np.random.default_rng(3)
    n = 60
    block = sparse.random(n * n, n * n, 3.0 / (n * n), random_state=rng)
    saddle = sparse.bmat([[None, block + laplacian(n * n)], [(block + laplacian(n * n)).T, None]])
    tight = MUMPS | {"mat_mumps_icntl_14": -50}  # half the estimate; later MUMPS estimate enough
    rooms: list[int] = []
    original = factorisation._given
    monkeypatch.setattr(
        factorisation, "_given", lambda name, room: (rooms.append(room), original(name, room))[1]
    )
    system = Bordered(saddle, 1, tight)
    assert system.error() < 1e-8
    assert rooms
    assert not any("icntl_14" in name for name in PETSc.Options().getAll())
    system.close()


@needs_minimum_degree
@pytest.mark.parametrize(("pivot", "mumps"), [(4.0, False), (1e-12, True), (1e-30, True)])
def test_matrix_that_needs_pivots_is_solved_by_mumps(pivot: float, mumps: bool) -> None:
    """Without pivoting a tiny first pivot costs all digits; the next matrix needs no fallback."""
    matrix = sparse.diags([1.0, pivot, 1.0], [-1, 0, 1], shape=(40, 40))  # type: ignore[call-overload]
    system = Bordered(matrix, 1, WITHOUT_PIVOTING)
    solver = system.bordered.solver
    assert system.error() < 1e-12
    assert (solver._fallback is not None) == mumps
    for row in range(40):
        system.matrix.setValue(row, row, 4.0)
    system.matrix.assemble()
    used: list[str] = []
    solved = solver._solved
    solver._solved = lambda by, *pair: (  # type: ignore[method-assign]
        used.append(by[0].getPC().getFactorSolverType()),
        solved(by, *pair),
    )[1]
    assert system.error() < 1e-12
    assert used == ["petsc"]
    system.close()


@needs_minimum_degree
def test_dense_factors_are_those_of_mumps() -> None:
    """From the first solution on, so that a resumed run has the same results."""
    system = Bordered(
        sparse.random(300, 300, 0.1, random_state=1) + 20 * sparse.eye(300), 1, WITHOUT_PIVOTING
    )
    for _ in range(2):
        assert system.error() < 1e-12
        assert system.bordered.solver._fallback is not None
    system.close()
    system = Bordered(laplacian(300), 1, WITHOUT_PIVOTING)
    assert system.error() < 1e-10
    assert system.bordered.solver._fallback is None
    system.close()


def test_unused_problem_is_freed() -> None:
    """PETSc refers back to the problem by its callbacks, which Python's collector cannot see."""
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)))
    setup.step(1.0, 10.0)
    problem = setup.problem
    references = [weakref.ref(one) for one in (problem, problem.solver, problem.bordered)]
    del setup, problem
    gc.collect()
    assert [reference() for reference in references] == [None, None, None]


HOT = 1350.0
STIFF = Elasticity.constant(15e9, 0.3)
CURVE = (Constant(40e6), Constant(0.0), Constant(0.14), Constant(0.16))


def law(name: str, hardening: str) -> UnifiedSteel | NortonHoff:
    if name == "steel":
        return UnifiedSteel(STIFF, 0.1, np.zeros_like, hardening=hardening)  # type: ignore[arg-type]
    return NortonHoff(STIFF, *CURVE, hardening=hardening)  # type: ignore[arg-type]


def cycled(name: str, hardening: str) -> SliceSetup:
    """Run two cycles of a nonuniform temperature whose pattern rotates, and the flow with it."""
    setup = SliceSetup(
        mapped(4, 4, box(0.1, 0.1)), law(name, hardening), expansion(2e-5), start=HOT
    )
    for step in range(1, 25):
        turn = 2.0 * np.pi * step / 12.0

        def uneven(x: Array, y: Array, turn: float = turn) -> Array:
            along, aside = np.sin(turn), np.sin(1.5 * turn)
            return np.asarray(HOT - 80.0 * along * (x / 0.1) ** 2 - 80.0 * aside * (y / 0.1) ** 2)

        setup.step(float(step), uneven)
    return setup


@pytest.mark.parametrize("name", ["steel", "hoff"])
def test_reversals_need_few_newton_iterations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With MUMPS, which uses the symmetry of a symmetric matrix."""
    monkeypatch.setattr(factorisation, "LIMITS", factorisation.OwnLimits(rows=0))
    plain, signed = cycled(name, "accumulated"), cycled(name, "signed")
    for setup, kind in ((plain, "cholesky"), (signed, "lu")):
        solver = setup.problem.bordered.solver
        assert (solver._fallback[0] if solver._fallback else solver.ksp).getPC().getType() == kind
    counts = [np.array([r.newton for r in setup.results]) for setup in (plain, signed)]
    assert counts[1].max() <= 8
    assert counts[1].sum() <= 1.3 * counts[0].sum()
    flowed = [s.problem.slice.law.strain(s.state.internal[: s.problem.points.deviator_points])
              for s in (plain, signed)]  # fmt: skip
    assert flowed[1].max() > 1e-4
    assert flowed[0].max() > 2.0 * flowed[1].max()  # accumulated strain only grows


# Deep liquid is excluded from the equations of a step: the result is that of all cells.


def billet(
    all_cells: bool, cell: str = "quadrilateral", comm: MPI.Comm = MPI.COMM_SELF
) -> CastSetup:
    """Set up a billet in its mould; with `all_cells` every step includes every cell."""
    mesh = billet_mesh(cell=cell, surface_size=2e-3, core_size=1.5e-2)
    setup = CastSetup(mesh, comm, liquid="fed", **in_its_mould(mesh))
    liquid = setup.problem.liquid
    if all_cells:
        every = np.arange(setup.problem.section.cells, dtype=np.int32)
        liquid.cells_to = lambda layer: every  # type: ignore[method-assign]
    return setup


def run(setup: CastSetup) -> list[tuple[int, Array, Array, Balance]]:
    """Take some steps: active points, displacement, stress and forces after each."""
    found = []
    for time in (1.5, 3.0, 4.5, 6.0):
        setup.advance(time, 1.5)
        balance = setup.results[-1].balance
        assert balance is not None
        state = setup.state
        found.append((setup.problem.active.count, state.displacement, state.stress, balance))
    return found


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_cells_without_stress_change_nothing(cell: str) -> None:
    active, full = run(billet(False, cell)), run(billet(True, cell))
    for (_, *one, forces), (_, *other, all_forces) in zip(active, full, strict=True):
        for found, expected in zip(one, other, strict=True):
            assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
        pairs = (forces.axial[1:], all_forces.axial[1:]), (forces.support, all_forces.support)
        for found, expected in pairs:
            assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
    counts = [count for count, *_ in active]
    assert counts == sorted(counts)
    assert counts[0] < 0.5 * full[0][0] and counts[0] < counts[-1] < full[0][0]


@pytest.mark.mpi
def test_ranks_agree() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        setup = billet(False, comm=comm)
        setup.advance(1.5, 1.5).advance(3.0, 1.5)
        balance = setup.results[-1].balance
        found.append(np.concatenate([balance.support, balance.axial[1:]]))
    assert np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(found[0]).max()


def test_remelted_steel_has_no_stress() -> None:
    """Cells that melt again carry only the pressure."""
    found = []
    for all_cells in (False, True):
        setup = billet(all_cells).advance(4.5, 1.5)
        frozen = setup.problem.active.count
        heat = np.full_like(setup.state.temperature, setup.state.temperature.max())
        result = setup.stepper.step(setup.state, setup.state.time + 1e-3, heat)
        assert result.converged and result.balance is not None and setup.problem.liquid is not None
        assert not result.state.stress[~setup.problem.liquid.carries].any()
        assert all_cells or setup.problem.active.count < frozen
        found.append(result)
    part, every = found
    one, other = part.state.displacement, every.state.displacement
    assert np.abs(one - other).max() < 1e-7 * np.abs(other).max()
    assert part.balance.support == pytest.approx(every.balance.support, rel=1e-7)


def example_forms(section: Any) -> tuple[ufl.Form, ufl.Form, fem.FunctionSpace]:
    """Return a vector and a matrix with a term on cells and one on a part of the surface."""
    mesh = section.mesh
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=mesh, subdomain_id=CELLS)
    tags = tuple(section.matching(["outer"]))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=section.facet_tags)(tags)
    x = ufl.SpatialCoordinate(mesh)
    factor, scale = fem.Function(space), fem.Constant(mesh, 3.0)
    factor.interpolate(lambda at: at[:2] + 1.0)
    vector = ufl.inner(factor, v) * dx + scale * v[0] * x[0] * ds
    matrix = ufl.inner(ufl.grad(u), ufl.grad(v)) * factor[0] * dx + scale * ufl.inner(u, v) * ds
    return vector, matrix, space


def assembled(form: fem.Form) -> Array:
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(la.InsertMode.add)
    return np.array(vector.array)


def test_forms_on_parts_of_the_cells_add_up() -> None:
    section = SliceSetup(mapped(6, 3, ring(0.02, 0.05), "quadrilateral", 2, RING_GROUPS)).section
    vector, matrix, space = example_forms(section)
    form = CellForm(section.mesh, vector)
    every = np.arange(section.cells, dtype=np.int32)
    one, other = every[every % 3 == 0], every[every % 3 != 0]
    total = assembled(form.on(every))
    parts = assembled(form.on(one)) + assembled(form.on(other, False))
    assert np.abs(total - parts).max() < 1e-14 * np.abs(total).max()
    assert np.abs(assembled(form.on(every, False)) - total).max() > 0.1 * np.abs(total).max()

    compiled = CellForm(section.mesh, matrix)
    full = create_matrix(compiled.on(every))
    assemble_into(full, compiled.on(every), [])
    nodes = np.zeros(space.dofmap.index_map.size_local, dtype=bool)
    nodes[np.asarray(space.dofmap.list)[one]] = True
    part, rows = matrix_of_nodes(full, space, nodes)
    assert len(rows) == 2 * nodes.sum() < full.getSize()[0]
    condition = fem.dirichletbc(fem.Function(space), np.flatnonzero(nodes)[:3].astype(np.int32))
    for form_ in (compiled.on(every), compiled.on(one, False)):
        assemble_into(full, form_, [condition])
        assemble_into(part, form_, [condition])
        expected = full[:, :][np.ix_(rows, rows)]
        assert np.abs(part[:, :] - expected).max() < 1e-14 * np.abs(expected).max()
    for each in (full, part):
        each.destroy()
