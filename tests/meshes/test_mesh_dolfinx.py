"""The node orders are those of DOLFINx: its area, its exterior facets, its curved sides."""

from __future__ import annotations

import inspect
import itertools
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from castfem.meshes import SectionMesh, build

from .sections import BEAM, ROUND, ROUNDED

basix_ufl = pytest.importorskip("basix.ufl")
dolfinx = pytest.importorskip("dolfinx")
ufl = pytest.importorskip("ufl")


def to_dolfinx(mesh: SectionMesh) -> Any:
    """The mesh as a DOLFINx mesh on one rank, whatever the order of its arguments."""
    element = basix_ufl.element("Lagrange", mesh.cell, mesh.order, shape=(2,))
    create = dolfinx.mesh.create_mesh
    names = list(inspect.signature(create).parameters)
    values = {"comm": MPI.COMM_SELF, "cells": mesh.cells, "x": mesh.points, "e": element}
    return create(**{name: values[name] for name in names if name in values})


def integral(form: Any) -> float:
    return float(dolfinx.fem.assemble_scalar(dolfinx.fem.form(form)))


@pytest.mark.parametrize(
    ("parameters", "cell", "order"),
    [
        (parameters, cell, order)
        for parameters, (cell, order) in itertools.product(
            (ROUNDED, ROUND), itertools.product(("quadrilateral", "triangle"), (1, 2))
        )
    ]
    + [(BEAM, "quadrilateral", 2)],
)
def test_dolfinx_sees_the_same_mesh(parameters: dict[str, Any], cell: str, order: int) -> None:
    source = build(**parameters, cell=cell, order=order, symmetry="half")
    mesh = to_dolfinx(source)
    x = ufl.SpatialCoordinate(mesh)
    normal = ufl.FacetNormal(mesh)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4})
    ds = ufl.Measure("ds", mesh, metadata={"quadrature_degree": 6})
    area = source.quality().area
    assert integral(1.0 * dx) == pytest.approx(area, rel=1e-12)
    # Gauss' theorem ties the sides' curvature to the inside; the moments tie nodes to places.
    assert integral(0.5 * ufl.dot(x, normal) * ds) == pytest.approx(area, rel=1e-10)
    assert integral(x[1] * dx) == pytest.approx(0.0, abs=1e-12 * area)

    topology = mesh.topology
    topology.create_connectivity(1, 2)
    topology.create_connectivity(1, 0)
    exterior = dolfinx.mesh.exterior_facet_indices(topology)
    assert len(exterior) == len(source.facets)
    nodes = dolfinx.mesh.entities_to_geometry(mesh, 1, exterior)[:, :2]
    original = np.asarray(mesh.geometry.input_global_indices)[nodes]
    theirs = {tuple(sorted(pair)) for pair in original.tolist()}
    assert theirs == {tuple(sorted(pair)) for pair in source.facets.tolist()}
