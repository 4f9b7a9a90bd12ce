"""A tube on several ranks is the tube on one."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.distortion import Distortion
from castfem.physics.mould.hot.tube import Tube
from hot_mould.tubes import SQUARE, tube_mesh


def solved(comm: MPI.Comm, method: str, support: str) -> list[Array] | None:
    """Heat, stress, temperature and displacement of a tube; on the first rank."""
    mesh = tube_mesh(SQUARE, (1, 2, 6), 0.01, 0.3) if comm.rank == 0 else None
    tube = Tube(comm, mesh)
    nodes = comm.bcast(None if mesh is None else mesh.points)
    flux = 2e6 * np.exp(-5.0 * nodes[:, 2])
    heated = Conduction(tube, Copper(), method).solve(FaceLoad(flux, 3e4, 313.0))
    found = Distortion(tube, Copper(), support, method).solve(heated.temperature)
    kelvin = tube.gather(heated.temperature.x.array[: tube.owned])
    moved = tube.gather(found.displacement.x.array[: 3 * tube.owned].reshape(-1, 3))
    if comm.rank > 0:
        return None
    heat = np.array([heated.supplied, heated.removed, heated.hottest])
    stress = np.array([found.largest_stress, *found.largest_at])
    return [heat, stress, kelvin, *moved.T]


@pytest.mark.mpi
@pytest.mark.parametrize(("method", "support"), [("direct", "hung"), ("multigrid", "free")])
def test_many_ranks_are_one(method: str, support: str) -> None:
    one, many = (solved(comm, method, support) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert one is not None and (many is None) == (MPI.COMM_WORLD.rank > 0)
    for first, second in zip(one, many or one, strict=True):
        assert np.isfinite(first).all()
        assert np.abs(first - second).max() <= 1e-7 * np.abs(first).max()
