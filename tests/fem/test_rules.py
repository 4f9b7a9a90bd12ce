"""A form that would be integrated by a wrong rule is refused; others give their number."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh

from castfem.fem.dolfinx_compat import CELLS, CellForm, compile_form

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
