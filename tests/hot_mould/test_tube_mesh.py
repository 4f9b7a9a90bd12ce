"""The mesh of a tube, and the places round its wall."""

from __future__ import annotations

from itertools import pairwise

import basix
import numpy as np
import pytest

from castfem.meshes.tube import brick_nodes, graded, tube
from castfem.physics.mould.cavity import (
    FreeCavity,
    RectangleCavity,
    RoundCavity,
    Sides,
    Tapers,
    same,
)
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.perimeter import Places, lengths, sides_of
from castfem.physics.mould.segments import Straight
from castfem.physics.mould.taper import Taper

from .tubes import ROUND, SQUARE, round_tube, tube_mesh

BULGED = Sides((0.0625, 0.05), (0.0622, 0.0496), 0.006)


@pytest.mark.parametrize("order", [1, 2])
def test_nodes_stand_in_the_order_of_the_element(order: int) -> None:
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.hexahedron, order, basix.LagrangeVariant.gll_warped
    )
    assert brick_nodes(order) == pytest.approx(order * element.points)


@pytest.mark.parametrize("sides", [SQUARE, ROUND, BULGED])
def test_places_lie_on_the_contour(sides: Sides) -> None:
    places = Places.spread(sides, 4, 3)
    points, normals = places.on(sides)
    assert np.hypot(*normals.T) == pytest.approx(1.0)
    if sides is ROUND:
        contour = RoundCavity(0.12).contour(same(Taper.single(0.0, 1.0)), 0.0, 1.0)
    else:
        (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
        cavity = RectangleCavity(2 * a, 2 * b, r)
        assert isinstance(cavity, RectangleCavity)
        from castfem.physics.mould.cavity import rectangle

        contour = rectangle(Sides((a, b), (p, q), r))
    assert isinstance(contour, Contour)
    found = contour.gap_function(0.99 * points, normals)
    inner = 0.01 * (points * normals).sum(axis=1)
    # The corner of a bulged face has a kink: its places look along the arc.
    assert np.abs(contour.gap_function(points - 1e-3 * normals, normals).gap - 1e-3).max() < 1e-9
    assert found.gap == pytest.approx(inner, rel=0.05)


@pytest.mark.parametrize("sides", [SQUARE, ROUND, BULGED])
def test_places_are_found_again_by_their_way(sides: Sides) -> None:
    places = Places.spread(sides, 4, 3)
    again = Places.at_ways(sides, places.ways(sides))
    assert again.on(sides)[0] == pytest.approx(places.on(sides)[0], abs=1e-12)
    assert np.all(np.diff(places.ways(sides)) > 0.0)
    assert places.ways(sides)[-1] == pytest.approx(sum(lengths(sides)))


def test_sizes_of_cavities() -> None:
    taper = same(Taper.single(0.01, 0.6))
    assert sides_of(RoundCavity(0.2), taper, 0.0) == Sides((0.1, 0.1), (0.1, 0.1), 0.1)
    assert sides_of(RectangleCavity(0.2, 0.1, 0.01), taper, 0.0).middle == (0.1, 0.05)
    free = FreeCavity((Straight((0.1, 0.0), (0.0, 0.1)),), 0.2, 0.2)
    with pytest.raises(ValueError, match="not a beam blank"):
        sides_of(free, Tapers(taper.width, taper.height), 0.0)


def test_volume_and_faces_of_a_tube() -> None:
    from mpi4py import MPI

    import dolfinx.fem as fem

    tube = round_tube(2)
    areas = {
        name: fem.assemble_scalar(fem.form(1.0 * tube.surface(name)))
        for name in ("inner", "outer", "top", "bottom", "symmetry_x", "symmetry_y")
    }
    ring = 0.25 * np.pi * (0.08**2 - 0.06**2)
    wanted = {
        "inner": 0.5 * np.pi * 0.06 * 0.03,
        "outer": 0.5 * np.pi * 0.08 * 0.03,
        "top": ring,
        "bottom": ring,
        "symmetry_x": 0.02 * 0.03,
        "symmetry_y": 0.02 * 0.03,
    }
    assert areas == pytest.approx(wanted, rel=1e-4)
    assert tube.comm == MPI.COMM_SELF
    sums = fem.assemble_scalar(fem.form(tube.function(1.0) * tube.dx))
    assert sums == pytest.approx(ring * 0.03, rel=1e-4)


def test_nodal_values_come_and_go() -> None:
    tube = round_tube(1)
    mesh = tube_mesh(ROUND, (1, 3, 1))
    put = tube.function(mesh.points[:, 0])
    assert put.x.array == pytest.approx(tube.scalars.tabulate_dof_coordinates()[:, 0], abs=1e-15)
    back = tube.gather(put.x.array[: tube.owned])
    assert back is not None and back == pytest.approx(mesh.points[:, 0])
    assert mesh.points[mesh.inner()[0, 0]] == pytest.approx([0.06, 0.0, 0.0])
    assert mesh.points[mesh.outer()[-1, -1]] == pytest.approx([0.0, 0.08, 0.03], abs=1e-15)


def test_layers_are_fine_at_the_meniscus() -> None:
    z = graded(-0.1, 0.6, 0.004, 0.02, order=1)
    assert z[0] == pytest.approx(-0.1) and z[-1] == pytest.approx(0.6)
    assert 0.0 in z
    steps = np.diff(z)
    assert steps.max() <= 0.0201 and 0.0025 < steps[np.searchsorted(z, 0.0)] <= 0.0041
    assert all(max(a, b) <= 1.35 * min(a, b) for a, b in pairwise(steps))
    assert len(graded(0.0, 0.6, 0.004, 0.02)) % 2 == 1


def test_mesh_that_cannot_be_made_of_whole_cells() -> None:
    points, normals = Places.spread(ROUND, 1, 2).on(ROUND)
    with pytest.raises(ValueError, match="nodes round and along"):
        tube(np.repeat(points[None], 2, 0), np.repeat(normals[None], 2, 0), np.zeros(2), 0.01, 1)
