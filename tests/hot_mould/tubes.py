"""Small tubes for the tests."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np

from castfem.base.tables import Constant
from castfem.meshes.tube import TubeMesh, tube
from castfem.physics.mould.cavity import Sides
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.tube import Tube
from castfem.physics.mould.perimeter import Places

ROUND = Sides((0.06, 0.06), (0.06, 0.06), 0.06)
SQUARE = Sides((0.0625, 0.0625), (0.0625, 0.0625), 0.005)
COLD = 300.0


def plain_copper() -> Copper:
    """Return copper with properties independent of temperature."""
    return Copper(Constant(380.0), Constant(17e-6), Constant(117e9), Constant(0.34), COLD)


def tube_mesh(
    sides: Sides,
    cells: tuple[int, int, int],
    thickness: float = 0.02,
    length: float = 0.03,
    order: int = 2,
    taper: float = 0.0,
) -> TubeMesh:
    """Mesh a tube; `cells` across the wall, on the corner (half a face has half), along it."""
    across, corner, along = cells
    places = Places.spread(sides, max(corner // 2, 1), corner, order)
    points, normals = places.on(sides)
    z = np.linspace(0.0, length, order * along + 1)
    inner = points[None] * (1.0 - taper * z[:, None, None])
    return tube(inner, np.repeat(normals[None], len(z), 0), z, thickness, across, order)


def round_tube(cells: int, comm: MPI.Comm = MPI.COMM_SELF) -> Tube:
    return Tube(comm, tube_mesh(ROUND, (cells, 3 * cells, 1)))


def square_tube(
    cells: tuple[int, int, int] = (1, 2, 2), comm: MPI.Comm = MPI.COMM_SELF, taper: float = 0.02
) -> Tube:
    """Build a tapered square tube of cells with straight edges and unknowns of second order."""
    mesh = tube_mesh(SQUARE, cells, 0.01, 0.2, order=1, taper=taper)
    return Tube(comm, mesh)
