"""Unstructured triangles and gmsh; node orders, facets and curved sides in DOLFINx."""

from __future__ import annotations

import inspect
import itertools
import signal
from collections.abc import Iterator
from typing import Any

from mpi4py import MPI

import gmsh
import numpy as np
import pytest

from castfem.meshes import SectionMesh, build
from castfem.meshes.quality import measure
from castfem.meshes.triangles import clear_boundary, make_delaunay

from .sections import BEAM, ROUND, ROUNDED, SLAB


@pytest.fixture
def _own_gmsh() -> Iterator[None]:
    gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


@pytest.mark.parametrize("parameters", [ROUNDED, SLAB, ROUND, BEAM])
def test_triangles_are_delaunay_and_well_shaped(parameters: dict[str, Any]) -> None:
    q = build(**parameters, cell="triangle").quality()
    assert q.min_cotangent >= -1e-10  # P1 stiffness is an M-matrix
    assert q.min_angle > 25.0
    assert q.max_angle < 115.0
    assert q.max_growth < 1.9


def test_triangles_have_the_sizes_of_surface_and_core() -> None:
    mesh = build(**ROUNDED, cell="triangle")
    outer = [i for i, g in enumerate(mesh.groups) if g in mesh.outer_groups]
    ends = mesh.points[mesh.facets[np.isin(mesh.facet_group, outer)]]
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    assert lengths.max() < 1.15e-3 and lengths.min() > 0.6e-3
    centre = mesh.points[mesh.cells].mean(axis=1)
    inner = np.hypot(*centre.T) < 0.01
    sides = mesh.points[mesh.cells[inner]] - np.roll(mesh.points[mesh.cells[inner]], 1, axis=1)
    assert 5e-3 < np.hypot(*sides.reshape(-1, 2).T).mean() < 9e-3


def test_corner_size_refines_the_corner() -> None:
    fine = build(**ROUNDED | {"corner_size": 0.25e-3}, cell="triangle")
    corner = fine.groups.index("corner")
    ends = fine.points[fine.facets[fine.facet_group == corner]]
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    assert 0.15e-3 < lengths.mean() < 0.3e-3


def test_tiny_radius_has_at_least_two_facets() -> None:
    mesh = build(**ROUNDED | {"corner_radius": 0.3e-3}, cell="triangle", order=2)
    assert np.count_nonzero(mesh.facet_group == mesh.groups.index("corner")) >= 2


def test_unused_gmsh_stays_uninitialised() -> None:
    assert not gmsh.isInitialized()
    handler = signal.getsignal(signal.SIGINT)
    build(**ROUND, cell="triangle")
    assert not gmsh.isInitialized()
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.usefixtures("_own_gmsh")
def test_gmsh_of_the_caller_is_unchanged(capfd: pytest.CaptureFixture[str]) -> None:
    expected = build(**ROUND, cell="triangle")
    gmsh.model.add("mine")
    gmsh.model.geo.addPoint(0.0, 0.0, 0.0)
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.Algorithm", 8)
    gmsh.option.setNumber("Mesh.MeshSizeFactor", 3.0)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    capfd.readouterr()
    mesh = build(**ROUND, cell="triangle")
    assert capfd.readouterr() == ("", "")
    assert mesh.points.tobytes() == expected.points.tobytes()
    assert gmsh.isInitialized()
    assert gmsh.model.getCurrent() == "mine"
    assert not [name for name in gmsh.model.list() if name.startswith("castfem")]
    assert gmsh.model.getEntities(0) == [(0, 1)]
    assert gmsh.option.getNumber("Mesh.Algorithm") == 8
    assert gmsh.option.getNumber("Mesh.MeshSizeFactor") == 3.0
    assert gmsh.option.getNumber("Mesh.ElementOrder") == 2


@pytest.mark.usefixtures("_own_gmsh")
def test_failure_inside_gmsh_leaves_no_model(monkeypatch: pytest.MonkeyPatch) -> None:
    gmsh.model.add("mine")

    def fail(_: int) -> None:
        raise RuntimeError("no mesh")

    monkeypatch.setattr(gmsh.model.mesh, "generate", fail)
    with pytest.raises(RuntimeError, match="no mesh"):
        build(**ROUND, cell="triangle")
    assert gmsh.model.getCurrent() == "mine"
    assert not [name for name in gmsh.model.list() if name.startswith("castfem")]


def test_flips_give_a_delaunay_mesh_of_equal_area() -> None:
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9), indexing="ij")
    inner = (x > 0.0) & (x < 1.0) & (y > 0.0) & (y < 1.0)
    x, y = (c + inner * rng.uniform(-0.04, 0.04, c.shape) for c in (x, y))
    points = np.stack([x.ravel(), 0.4 * y.ravel()], axis=1)  # flat: the diagonals are wrong
    i = np.arange(81).reshape(9, 9)
    a, b, c, d = (v.ravel() for v in (i[:-1, :-1], i[1:, :-1], i[:-1, 1:], i[1:, 1:]))
    cells = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    before = measure(points, cells, "triangle", 0.4)
    flipped = make_delaunay(points, cells)
    interior = measure(points, flipped, "triangle", 0.4)
    assert before.min_cotangent < -0.1
    assert interior.area == pytest.approx(before.area, rel=1e-14)
    moved, cleared = clear_boundary(points, flipped)
    after = measure(moved, cleared, "triangle", 0.4)
    assert after.min_cotangent >= -1e-10
    assert after.area == pytest.approx(0.4, rel=1e-14)


basix_ufl = pytest.importorskip("basix.ufl")
dolfinx = pytest.importorskip("dolfinx")
ufl = pytest.importorskip("ufl")


def to_dolfinx(mesh: SectionMesh) -> Any:
    """Return a DOLFINx mesh on one rank, for any order of its arguments."""
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
def test_dolfinx_has_the_same_mesh(parameters: dict[str, Any], cell: str, order: int) -> None:
    source = build(**parameters, cell=cell, order=order, symmetry="half")
    mesh = to_dolfinx(source)
    x = ufl.SpatialCoordinate(mesh)
    normal = ufl.FacetNormal(mesh)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4})
    ds = ufl.Measure("ds", mesh, metadata={"quadrature_degree": 6})
    area = source.quality().area
    assert integral(1.0 * dx) == pytest.approx(area, rel=1e-12)
    # Gauss' theorem checks the curvature of the sides; the moment checks the positions of nodes.
    assert integral(0.5 * ufl.dot(x, normal) * ds) == pytest.approx(area, rel=1e-10)
    assert integral(x[1] * dx) == pytest.approx(0.0, abs=1e-12 * area)

    topology = mesh.topology
    topology.create_connectivity(1, 2)
    topology.create_connectivity(1, 0)
    exterior = dolfinx.mesh.exterior_facet_indices(topology)
    assert len(exterior) == len(source.facets)
    nodes = dolfinx.mesh.entities_to_geometry(mesh, 1, exterior)[:, :2]
    original = np.asarray(mesh.geometry.input_global_indices)[nodes]
    found = {tuple(sorted(pair)) for pair in original.tolist()}
    assert found == {tuple(sorted(pair)) for pair in source.facets.tolist()}
