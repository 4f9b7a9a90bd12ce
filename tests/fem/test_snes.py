"""The SNES solver of castfem: options, failures, exceptions, and compiled forms."""

from __future__ import annotations

import gc
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh

from castfem.base.errors import InputError
from castfem.fem.compat import CELLS, CellForm, compile_form, jit_options
from castfem.fem.snes import SnesSolver


class Square:
    """The equations x^2 = a for n unknowns."""

    def __init__(self, a: float, n: int = 3) -> None:
        self.a = a
        self.vector = PETSc.Vec().createSeq(n)
        self.matrix = PETSc.Mat().createAIJ([n, n], nnz=1, comm=PETSc.COMM_SELF)
        for i in range(n):
            self.matrix.setValue(i, i, 1.0)
        self.matrix.assemble()

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        out.setArray(x.getArray(readonly=True) ** 2 - self.a)

    def jacobian(self, x: PETSc.Vec, out: PETSc.Mat) -> None:
        slope = x.duplicate()
        slope.setArray(2.0 * x.getArray(readonly=True))
        out.setDiagonal(slope)
        out.assemble()

    def norms(self, x: PETSc.Vec, f: PETSc.Vec) -> dict[str, float]:
        return {"square": float(np.abs(f.getArray(readonly=True)).max()) / 1e-12}


def solver(problem: Square, prefix: str = "square_", **options: Any) -> SnesSolver:
    return SnesSolver(problem, problem.vector, problem.matrix, prefix, options)


def test_solver_returns_solution_and_iterations() -> None:
    problem = Square(2.0)
    snes = solver(problem, ksp_type="preonly", pc_type="lu", snes_linesearch_type="basic")
    snes.x.set(1.0)
    result = snes.solve()
    assert result.converged
    assert result.iterations == len(result.norms) - 1 == 5
    assert snes.x.getArray() == pytest.approx(np.sqrt(2.0), rel=1e-12)
    snes.destroy()


def test_rejected_correction_ends_the_solve() -> None:
    """The unknowns are unchanged, and the next solve starts again."""
    problem, rejected = Square(4.0), [False]

    def shorten(x: PETSc.Vec, correction: PETSc.Vec) -> bool | None:
        return None if rejected[0] else False

    snes = SnesSolver(problem, problem.vector, problem.matrix, "square_", {}, shorten=shorten)
    snes.x.set(5.0)
    rejected[0] = True
    result = snes.solve()
    assert not result.converged and result.reason == "DIVERGED_LINE_SEARCH"
    assert np.array_equal(snes.x.getArray(), [5.0] * 3) and result.iterations <= 1
    rejected[0] = False
    assert snes.solve().converged
    assert snes.x.getArray() == pytest.approx([2.0] * 3, rel=1e-12)


def test_options_that_fail_in_petsc_are_reported() -> None:
    """PETSc has no ILU of a matrix on several ranks, which it detects when it factorises."""
    problem = Square(2.0)
    problem.matrix.convert("mpiaij")
    snes = solver(problem, pc_type="ilu", snes_max_it=9)
    snes.x.set(1.0)
    message = r'square solver, pc_type = "ilu": PETSc refuses: .*ILU and matrix type mpiaij; its'
    with pytest.raises(InputError, match=message):
        snes.solve()
    snes.destroy()


def test_every_option_reaches_snes_ksp_and_pc() -> None:
    snes = solver(
        Square(2.0),
        snes_type="newtontr",
        snes_max_it=17,
        snes_rtol=1e-5,
        snes_atol=1e-6,
        snes_stol=1e-7,
        ksp_type="gmres",
        ksp_rtol=1e-4,
        ksp_max_it=33,
        pc_type="jacobi",
    )
    rtol, atol, stol, max_it = snes.snes.getTolerances()
    assert (rtol, atol, stol, max_it) == (1e-5, 1e-6, 1e-7, 17)
    assert snes.snes.getType() == "newtontr"
    ksp = snes.snes.getKSP()
    assert ksp.getType() == "gmres"
    assert ksp.getTolerances()[0] == 1e-4
    assert ksp.getTolerances()[3] == 33
    assert ksp.getPC().getType() == "jacobi"
    snes.destroy()


def recorded(problem: Square, **options: Any) -> tuple[SnesSolver, list[str]]:
    """Return a solver and a list that records an option of PETSc's database while it solves."""
    snes, seen = solver(problem, **options), []
    jacobian = problem.jacobian

    def record(x: PETSc.Vec, out: PETSc.Mat) -> None:
        seen.append(PETSc.Options().getString("square_mat_mumps_icntl_14", ""))
        jacobian(x, out)

    problem.jacobian = record  # type: ignore[method-assign]
    snes.x.set(1.0)
    return snes, seen


def test_options_are_set_only_while_their_solver_solves() -> None:
    """Options read in the first factorisation are set even if another solver was made later."""
    first, seen = recorded(Square(2.0), mat_mumps_icntl_14=80, ksp_type="preonly", pc_type="lu")
    second, others = recorded(Square(2.0), mat_mumps_icntl_14=33, ksp_type="preonly", pc_type="lu")
    assert not any(name.startswith("square_") for name in PETSc.Options().getAll())
    for snes in (first, second):
        assert snes.solve().converged
        assert not any(name.startswith("square_") for name in PETSc.Options().getAll())
    assert set(seen) == {"80"} and set(others) == {"33"}


@pytest.mark.parametrize(
    ("asked", "expected"), [((), [True, False]), (("ksp_type",), [True, True])]
)
def test_options_of_the_user_are_set_at_each_solve(
    monkeypatch: pytest.MonkeyPatch, asked: tuple[str, ...], expected: list[bool]
) -> None:
    """PETSc reads some options at each solve, but none of castfem's own."""
    problem, present, original = Square(2.0), [], Square.jacobian

    def jacobian(self: Square, x: PETSc.Vec, out: PETSc.Mat) -> None:
        present.append(PETSc.Options().hasName("square_ksp_type"))
        original(self, x, out)

    monkeypatch.setattr(Square, "jacobian", jacobian)
    options = {"ksp_type": "preonly", "pc_type": "lu"}
    snes = SnesSolver(problem, problem.vector, problem.matrix, "square_", options, asked=asked)
    found = []
    for _ in expected:
        present.clear()
        snes.x.set(1.0)
        assert snes.solve().converged
        found.append(all(present))
    assert found == expected
    snes.destroy()


def test_options_are_removed_when_a_callback_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Square(2.0)
    snes = solver(problem, mat_mumps_icntl_14=80)
    monkeypatch.setattr(problem, "jacobian", lambda *_: 1 / 0)
    snes.x.set(1.0)
    with pytest.raises(ZeroDivisionError):
        snes.solve()
    assert not PETSc.Options().hasName("square_mat_mumps_icntl_14")


def test_option_that_petsc_never_reads_is_reported_once(told: pytest.LogCaptureFixture) -> None:
    snes = solver(
        Square(2.0), ksp_type="preonly", pc_type="lu", snes_linesearch_type="basic", snes_maxit=1
    )
    for _ in range(2):
        snes.x.set(1.0)
        assert snes.solve().iterations == 5
    assert [r.getMessage() for r in told.records] == [
        'square solver: PETSc has not read snes_maxit = "1": its name is wrong, or it is unused'
    ]


def test_defaults_that_petsc_never_reads_are_not_reported(told: pytest.LogCaptureFixture) -> None:
    problem = Square(2.0)
    options = {"snes_type": "newtontr", "snes_linesearch_type": "basic", "pc_typ": "lu"}
    snes = SnesSolver(
        problem, problem.vector, problem.matrix, "square_", options, asked=("pc_typ",)
    )
    snes.x.set(1.0)
    snes.solve()
    assert len(told.records) == 1 and "pc_typ" in told.text


def test_command_line_has_priority() -> None:
    database = PETSc.Options()
    database.setValue("square_snes_max_it", 3)
    try:
        snes = solver(Square(2.0), snes_max_it=50)
        assert snes.snes.getTolerances()[3] == 3
        assert database.hasName("square_snes_max_it")
        snes.destroy()
    finally:
        database.delValue("square_snes_max_it")


def test_unknown_option_is_rejected() -> None:
    with pytest.raises(InputError, match=r"'tolerance'.*snes_"):
        solver(Square(2.0), tolerance=1e-3)


def test_value_rejected_by_petsc_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r'^refused solver, ksp_type = "none_such": .* KSP type'):
        solver(
            Square(2.0),
            prefix="refused_",
            ksp_rtol=1e-3,
            ksp_type="none_such",
            mat_mumps_icntl_14=80,
        )
    assert not any(name.startswith("refused_") for name in PETSc.Options().getAll())


@pytest.mark.parametrize(("start", "a", "reason"), [(0.9, -1.0, "MAX_IT"), (np.nan, 2.0, "NAN")])
def test_failure_has_its_reason(start: float, a: float, reason: str) -> None:
    snes = solver(
        Square(a), ksp_type="preonly", pc_type="lu", snes_linesearch_type="basic", snes_max_it=8
    )
    snes.x.set(start)
    result = snes.solve()
    assert not result.converged
    assert reason in result.reason
    assert reason in result.describe()
    snes.destroy()


@pytest.mark.parametrize("kind", [KeyboardInterrupt, InputError, ZeroDivisionError])
@pytest.mark.parametrize("where", ["residual", "jacobian", "norms"])
def test_exceptions_of_callbacks_are_raised(
    where: str, kind: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = Square(2.0)
    snes = solver(problem)
    snes.x.set(1.0)

    def stopped(*_: Any) -> None:
        raise kind("stop")

    class Garbage:
        """An object in a cycle, which only the garbage collector can free."""

        def __init__(self) -> None:
            self.itself = self

    monkeypatch.setattr(problem, where, stopped)
    for _ in range(20):
        gc.collect()
        garbage = [Garbage() for _ in range(50)]
        del garbage
        before = gc.get_threshold()
        gc.set_threshold(1)  # PETSc's Python interface crashes if garbage is collected meanwhile
        try:
            with pytest.raises(kind, match="stop"):
                snes.solve()
        finally:
            gc.set_threshold(*before)
        assert gc.isenabled()
    assert not snes.watch._stack


# A form that would be integrated by a wrong rule is rejected; others have their value.


TOP, OTHERS = 1, 2


@pytest.fixture(scope="module")
def square() -> tuple[mesh.Mesh, mesh.MeshTags]:
    """Return a unit square with a separate tag on its top."""
    cells = mesh.create_unit_square(MPI.COMM_SELF, 2, 2, mesh.CellType.quadrilateral)
    cells.topology.create_connectivity(1, 2)
    facets = mesh.exterior_facet_indices(cells.topology)
    high = mesh.compute_midpoints(cells, 1, facets)[:, 1] > 0.99
    return cells, mesh.meshtags(cells, 1, facets, np.where(high, TOP, OTHERS).astype(np.int32))


def perimeter(square: tuple[mesh.Mesh, mesh.MeshTags], tags: tuple[int, ...], degree: int):  # type: ignore[no-untyped-def]
    rule = {"quadrature_rule": "default", "quadrature_degree": degree}
    ds = ufl.Measure("ds", domain=square[0], subdomain_data=square[1], metadata=rule)
    return fem.Constant(square[0], 2.0) * ds(tags)


def test_two_rules_on_a_shared_tag_are_rejected(square: tuple[mesh.Mesh, mesh.MeshTags]) -> None:
    both = perimeter(square, (TOP, OTHERS), 3) + perimeter(square, (TOP,), 5)
    with pytest.raises(ValueError, match="two quadrature rules share the tag 1"):
        compile_form(both)
    on_cells = fem.Constant(square[0], 0.0) * ufl.dx(CELLS, domain=square[0])
    with pytest.raises(ValueError, match="two quadrature rules share the tag 1"):
        CellForm(square[0], both + on_cells)


@pytest.mark.parametrize(
    ("tags", "degree"), [((TOP,), 3), ((TOP, OTHERS), 5)], ids=["one rule", "the same tags"]
)
def test_one_rule_or_equal_tags_are_integrated(
    square: tuple[mesh.Mesh, mesh.MeshTags], tags: tuple[int, ...], degree: int
) -> None:
    both = perimeter(square, (TOP, OTHERS), 3) + perimeter(square, tags, degree)
    exact = 2.0 * 4.0 + 2.0 * (4.0 if OTHERS in tags else 1.0)
    assert fem.assemble_scalar(compile_form(both)) == pytest.approx(exact, rel=1e-12)


LEFT, BOTTOM, RIGHT, ABOVE = range(4)


@pytest.fixture(scope="module")
def sides() -> tuple[mesh.Mesh, mesh.MeshTags]:
    """Return a rectangle with a tag on each side."""
    corners = [(0.0, 0.0), (1.3, 0.7)]
    cells = mesh.create_rectangle(MPI.COMM_SELF, corners, (3, 2), mesh.CellType.quadrilateral)
    cells.topology.create_connectivity(1, 2)
    facets = mesh.exterior_facet_indices(cells.topology)
    x, y, _ = mesh.compute_midpoints(cells, 1, facets).T
    where = [x < 1e-9, y < 1e-9, x > 1.3 - 1e-9]
    tags = np.select(where, [LEFT, BOTTOM, RIGHT], ABOVE).astype(np.int32)
    return cells, mesh.meshtags(cells, 1, facets, tags)


def pressed(
    sides: tuple[mesh.Mesh, mesh.MeshTags],
    *loads: tuple[int, ...],
    volume: str | int = "everywhere",
) -> ufl.Form:
    """Return a form with a load on the cells and loads 1, x, ... on sides."""
    cells, tags = sides
    rule = {"quadrature_rule": "default", "quadrature_degree": 3}
    ds = ufl.Measure("ds", domain=cells, subdomain_data=tags, metadata=rule)
    dx = ufl.Measure("dx", domain=cells, subdomain_id=volume, metadata=rule)
    v = ufl.TestFunction(fem.functionspace(cells, ("Lagrange", 1)))
    x = ufl.SpatialCoordinate(cells)
    return sum((x[0] ** n * v * ds(on) for n, on in enumerate(loads)), ufl.sin(x[1]) * v * dx)


def test_form_is_compiled_once_for_all_sides(sides: tuple[mesh.Mesh, mesh.MeshTags]) -> None:
    on = {tags: compile_form(pressed(sides, tags)) for tags in ((LEFT,), (ABOVE,), (LEFT, ABOVE))}
    volume = 1.3 * (1.0 - np.cos(0.7))
    for (tags, form), length in zip(on.items(), (0.7, 1.3, 2.0), strict=True):
        assert form.module is on[LEFT,].module, tags
        assert fem.assemble_vector(form).array.sum() == pytest.approx(volume + length, rel=1e-5)


@pytest.mark.parametrize(
    "loads",
    [((LEFT, RIGHT, ABOVE), (BOTTOM,)), ((LEFT, BOTTOM), (BOTTOM, RIGHT))],
    ids=["one between others", "overlapping"],
)
def test_renumbered_tags_give_identical_results(
    sides: tuple[mesh.Mesh, mesh.MeshTags], loads: tuple[tuple[int, ...], ...]
) -> None:
    form = pressed(sides, *loads)
    on_cells = CellForm(sides[0], pressed(sides, *loads, volume=CELLS))
    expected = fem.assemble_vector(fem.form(form, jit_options=jit_options())).array
    for found in (compile_form(form), on_cells.on(np.arange(6, dtype=np.int32))):
        assert fem.assemble_vector(found).array.tobytes() == expected.tobytes()
