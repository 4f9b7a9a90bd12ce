"""A form that would be integrated by a wrong rule is refused; others give their number."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh

from castfem.fem.compat import CELLS, CellForm, compile_form, jit_options

TOP, OTHERS = 1, 2


@pytest.fixture(scope="module")
def square() -> tuple[mesh.Mesh, mesh.MeshTags]:
    """A unit square, whose top has a tag of its own."""
    cells = mesh.create_unit_square(MPI.COMM_SELF, 2, 2, mesh.CellType.quadrilateral)
    cells.topology.create_connectivity(1, 2)
    facets = mesh.exterior_facet_indices(cells.topology)
    high = mesh.compute_midpoints(cells, 1, facets)[:, 1] > 0.99
    return cells, mesh.meshtags(cells, 1, facets, np.where(high, TOP, OTHERS).astype(np.int32))


def perimeter(square: tuple[mesh.Mesh, mesh.MeshTags], tags: tuple[int, ...], degree: int):  # type: ignore[no-untyped-def]
    rule = {"quadrature_rule": "default", "quadrature_degree": degree}
    ds = ufl.Measure("ds", domain=square[0], subdomain_data=square[1], metadata=rule)
    return fem.Constant(square[0], 2.0) * ds(tags)


def test_two_rules_on_a_shared_tag_are_refused(square: tuple[mesh.Mesh, mesh.MeshTags]) -> None:
    both = perimeter(square, (TOP, OTHERS), 3) + perimeter(square, (TOP,), 5)
    with pytest.raises(ValueError, match="two quadrature rules share the tag 1"):
        compile_form(both)
    one = fem.Constant(square[0], 0.0) * ufl.dx(CELLS, domain=square[0])
    with pytest.raises(ValueError, match="two quadrature rules share the tag 1"):
        CellForm(square[0], both + one)


@pytest.mark.parametrize(
    ("tags", "degree"), [((TOP,), 3), ((TOP, OTHERS), 5)], ids=["one rule", "the same tags"]
)
def test_one_rule_or_the_same_tags_are_right(
    square: tuple[mesh.Mesh, mesh.MeshTags], tags: tuple[int, ...], degree: int
) -> None:
    both = perimeter(square, (TOP, OTHERS), 3) + perimeter(square, tags, degree)
    exact = 2.0 * 4.0 + 2.0 * (4.0 if OTHERS in tags else 1.0)
    assert fem.assemble_scalar(compile_form(both)) == pytest.approx(exact, rel=1e-12)


LEFT, BOTTOM, RIGHT, ABOVE = range(4)


@pytest.fixture(scope="module")
def sides() -> tuple[mesh.Mesh, mesh.MeshTags]:
    """A rectangle each of whose sides has a tag."""
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
    """A load on the cells and, each on its sides, loads 1, x, ..."""
    cells, tags = sides
    rule = {"quadrature_rule": "default", "quadrature_degree": 3}
    ds = ufl.Measure("ds", domain=cells, subdomain_data=tags, metadata=rule)
    dx = ufl.Measure("dx", domain=cells, subdomain_id=volume, metadata=rule)
    v = ufl.TestFunction(fem.functionspace(cells, ("Lagrange", 1)))
    x = ufl.SpatialCoordinate(cells)
    return sum((x[0] ** n * v * ds(on) for n, on in enumerate(loads)), ufl.sin(x[1]) * v * dx)


def test_a_form_is_compiled_once_for_all_sides(sides: tuple[mesh.Mesh, mesh.MeshTags]) -> None:
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
def test_renumbered_tags_change_no_bit(
    sides: tuple[mesh.Mesh, mesh.MeshTags], loads: tuple[tuple[int, ...], ...]
) -> None:
    form = pressed(sides, *loads)
    on_cells = CellForm(sides[0], pressed(sides, *loads, volume=CELLS))
    expected = fem.assemble_vector(fem.form(form, jit_options=jit_options())).array
    for found in (compile_form(form), on_cells.on(np.arange(6, dtype=np.int32))):
        assert fem.assemble_vector(found).array.tobytes() == expected.tobytes()
