"""Factorisations: failed, forgotten, repeated; by LU for a law with a strain tensor; freed."""

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
    made = PETSc.Mat().createAIJ(
        rows.shape, csr=(rows.indptr, rows.indices, rows.data), comm=PETSc.COMM_SELF
    )
    made.assemble()
    return made


def laplacian(n: int) -> Any:
    return sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))  # type: ignore[call-overload]


class Bordered:
    """A bordered system whose block may be spoilt, and SNES' way of solving with it."""

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
        """Of a solution, relative; NaN if there is none."""
        self.bordered.updated()
        right, found = self.bordered.vector(), self.bordered.vector()
        right.set(1.0)
        self.ksp.solve(right, found)
        if self.ksp.getConvergedReason() < 0:
            return float("nan")
        again = right.duplicate()
        self.bordered.operator.mult(found, again)
        return float((again - right).norm() / right.norm())

    def close(self) -> None:
        self.ksp.destroy()
        self.bordered.destroy()
        self.matrix.destroy()


@pytest.fixture(params=[0, 2])
def bordered(request: pytest.FixtureRequest) -> Iterator[Bordered]:
    made = Bordered(laplacian(30), request.param, MUMPS)
    yield made
    made.close()


def test_a_singular_block_is_told_and_forgotten(bordered: Bordered) -> None:
    """First sound, then a row of zeros, then sound again: each answer is that of its own block."""
    assert bordered.error() < 1e-12
    for sound in (False, True, False, False, True):
        for column in (14, 15, 16):
            value = {14: -1.0, 15: 2.0, 16: -1.0}[column] if sound else 0.0
            bordered.matrix.setValue(15, column, value)
            bordered.matrix.setValue(column, 15, value)
        bordered.matrix.assemble()
        error = bordered.error()
        assert (error < 1e-12) == sound
        assert bordered.bordered.failure == ("" if sound else "the equations are singular")


def test_more_room_is_given_where_it_runs_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pivots that have to wait make the factors larger than MUMPS has expected."""
    rng = np.random.default_rng(3)
    n = 60
    block = sparse.random(n * n, n * n, 3.0 / (n * n), random_state=rng)
    saddle = sparse.bmat([[None, block + laplacian(n * n)], [(block + laplacian(n * n)).T, None]])
    tight = MUMPS | {"mat_mumps_icntl_14": -50}  # half of it; later MUMPS expect enough
    rooms: list[int] = []
    given = factorisation._given
    monkeypatch.setattr(
        factorisation, "_given", lambda name, room: (rooms.append(room), given(name, room))[1]
    )
    made = Bordered(saddle, 1, tight)
    assert made.error() < 1e-8
    assert rooms
    assert not any("icntl_14" in name for name in PETSc.Options().getAll())
    made.close()


@needs_minimum_degree
@pytest.mark.parametrize(("pivot", "mumps"), [(4.0, False), (1e-12, True), (1e-30, True)])
def test_what_needs_pivots_is_solved_by_mumps(pivot: float, mumps: bool) -> None:
    """Without pivoting a first entry that is tiny costs all digits; the next step is its own."""
    matrix = sparse.diags([1.0, pivot, 1.0], [-1, 0, 1], shape=(40, 40))  # type: ignore[call-overload]
    made = Bordered(matrix, 1, WITHOUT_PIVOTING)
    solver = made.bordered.solver
    assert made.error() < 1e-12
    assert (solver._fallback is not None) == mumps
    for row in range(40):
        made.matrix.setValue(row, row, 4.0)
    made.matrix.assemble()
    used: list[str] = []
    solved = solver._solved
    solver._solved = lambda by, *pair: (  # type: ignore[method-assign]
        used.append(by[0].getPC().getFactorSolverType()),
        solved(by, *pair),
    )[1]
    assert made.error() < 1e-12
    assert used == ["petsc"]
    made.close()


@needs_minimum_degree
def test_full_factors_are_those_of_mumps() -> None:
    """From the first solution on, so that a resumed run has the same."""
    made = Bordered(sparse.random(300, 300, 0.1, random_state=1) + 20 * sparse.eye(300), 1,
                    WITHOUT_PIVOTING)  # fmt: skip
    for _ in range(2):
        assert made.error() < 1e-12
        assert made.bordered.solver._fallback is not None
    made.close()
    made = Bordered(laplacian(300), 1, WITHOUT_PIVOTING)
    assert made.error() < 1e-10
    assert made.bordered.solver._fallback is None
    made.close()


def test_a_problem_that_is_left_is_freed() -> None:
    """PETSc calls back what solves it; Python's collector does not see that."""
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)))
    setup.step(1.0, 10.0)
    problem = setup.problem
    left = [weakref.ref(one) for one in (problem, problem.solver, problem.bordered)]
    del setup, problem
    gc.collect()
    assert [reference() for reference in left] == [None, None, None]


HOT = 1350.0
STIFF = Elasticity.constant(15e9, 0.3)
CURVE = (Constant(40e6), Constant(0.0), Constant(0.14), Constant(0.16))


def law(name: str, hardening: str) -> UnifiedSteel | NortonHoff:
    if name == "steel":
        return UnifiedSteel(STIFF, 0.1, np.zeros_like, hardening=hardening)  # type: ignore[arg-type]
    return NortonHoff(STIFF, *CURVE, hardening=hardening)  # type: ignore[arg-type]


def swung(name: str, hardening: str) -> SliceSetup:
    """Two swings of an uneven temperature whose pattern turns, so that flow does, too."""
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
def test_newton_needs_no_more_through_reversals(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By MUMPS, which factors a symmetric matrix as one."""
    monkeypatch.setattr(factorisation, "LIMITS", factorisation.OwnLimits(rows=0))
    plain, signed = swung(name, "accumulated"), swung(name, "signed")
    for setup, kind in ((plain, "cholesky"), (signed, "lu")):
        solver = setup.problem.bordered.solver
        assert (solver._fallback[0] if solver._fallback else solver.ksp).getPC().getType() == kind
    counts = [np.array([r.newton for r in setup.results]) for setup in (plain, signed)]
    assert counts[1].max() <= 8
    assert counts[1].sum() <= 1.3 * counts[0].sum()
    flowed = [s.problem.slice.law.strain(s.state.internal[: s.problem.points.deviator_points])
              for s in (plain, signed)]  # fmt: skip
    assert flowed[1].max() > 1e-4
    assert flowed[0].max() > 2.0 * flowed[1].max()  # what is accumulated only grows


# Deep liquid takes no part in the equations of a step: the answer is that of all cells.


def billet(whole: bool, cell: str = "quadrilateral", comm: MPI.Comm = MPI.COMM_SELF) -> CastSetup:
    """A billet in its mould; with `whole` every cell takes part in every step."""
    mesh = billet_mesh(cell=cell, surface_size=2e-3, core_size=1.5e-2)
    made = CastSetup(mesh, comm, liquid="fed", **in_its_mould(mesh))
    liquid = made.problem.liquid
    if whole:
        every = np.arange(made.problem.section.cells, dtype=np.int32)
        liquid.cells_to = lambda layer: every  # type: ignore[method-assign]
    return made


def taken(made: CastSetup) -> list[tuple[int, Array, Array, Balance]]:
    """Some steps: active points, displacement, stress and forces after each."""
    found = []
    for time in (1.5, 3.0, 4.5, 6.0):
        made.advance(time, 1.5)
        balance = made.results[-1].balance
        assert balance is not None
        state = made.state
        found.append((made.problem.active.count, state.displacement, state.stress, balance))
    return found


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_cells_without_stress_change_nothing(cell: str) -> None:
    part, whole = taken(billet(False, cell)), taken(billet(True, cell))
    for (_, *one, here), (_, *other, there) in zip(part, whole, strict=True):
        for mine, its in zip(one, other, strict=True):
            assert np.abs(mine - its).max() < 1e-7 * np.abs(its).max()
        for mine, its in ((here.axial[1:], there.axial[1:]), (here.support, there.support)):
            assert np.abs(mine - its).max() < 1e-7 * np.abs(its).max()
    counts = [count for count, *_ in part]
    assert counts == sorted(counts)
    assert counts[0] < 0.5 * whole[0][0] and counts[0] < counts[-1] < whole[0][0]


@pytest.mark.mpi
def test_ranks_agree() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        made = billet(False, comm=comm)
        made.advance(1.5, 1.5).advance(3.0, 1.5)
        balance = made.results[-1].balance
        found.append(np.concatenate([balance.support, balance.axial[1:]]))
    assert np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(found[0]).max()


def test_steel_that_melts_again_leaves_no_stress() -> None:
    """Cells that had a shell, and are liquid again, bear nothing but the pressure."""
    found = []
    for whole in (False, True):
        made = billet(whole).advance(4.5, 1.5)
        frozen = made.problem.active.count
        heat = np.full_like(made.state.temperature, made.state.temperature.max())
        result = made.stepper.step(made.state, made.state.time + 1e-3, heat)
        assert result.converged and result.balance is not None and made.problem.liquid is not None
        assert not result.state.stress[~made.problem.liquid.carries].any()
        assert whole or made.problem.active.count < frozen
        found.append(result)
    part, every = found
    one, other = part.state.displacement, every.state.displacement
    assert np.abs(one - other).max() < 1e-7 * np.abs(other).max()
    assert part.balance.support == pytest.approx(every.balance.support, rel=1e-7)


def measured(section: Any) -> tuple[ufl.Form, ufl.Form, fem.FunctionSpace]:
    """A vector and a matrix with a term on cells and one on a part of the surface."""
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


def test_a_form_on_parts_of_the_cells_adds_up() -> None:
    section = SliceSetup(mapped(6, 3, ring(0.02, 0.05), "quadrilateral", 2, RING_GROUPS)).section
    vector, matrix, space = measured(section)
    form = CellForm(section.mesh, vector)
    every = np.arange(section.cells, dtype=np.int32)
    one, other = every[every % 3 == 0], every[every % 3 != 0]
    whole = assembled(form.on(every))
    parts = assembled(form.on(one)) + assembled(form.on(other, False))
    assert np.abs(whole - parts).max() < 1e-14 * np.abs(whole).max()
    assert np.abs(assembled(form.on(every, False)) - whole).max() > 0.1 * np.abs(whole).max()

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
        wanted = full[:, :][np.ix_(rows, rows)]
        assert np.abs(part[:, :] - wanted).max() < 1e-14 * np.abs(wanted).max()
    for thing in (full, part):
        thing.destroy()
