"""A tube on two ranks is the tube on one."""

from __future__ import annotations

import numpy as np
from ranks import needs_mpirun, python_on

SCRIPT = """
import sys
from mpi4py import MPI
import numpy as np
sys.path.insert(0, {tests!r})
from hot_mould.tubes import SQUARE, tube_mesh
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.distortion import Distortion
from castfem.physics.mould.hot.tube import Tube
comm = MPI.COMM_WORLD
mesh = tube_mesh(SQUARE, (1, 2, 6), 0.01, 0.3) if comm.rank == 0 else None
for method, support in (("direct", "hung"), ("multigrid", "free")):
    tube = Tube(comm, mesh)
    nodes = comm.bcast(None if mesh is None else mesh.points)
    flux = 2e6 * np.exp(-5.0 * nodes[:, 2])
    heated = Conduction(tube, Copper(), method).solve(FaceLoad(flux, 3e4, 313.0))
    found = Distortion(tube, Copper(), support, method).solve(heated.temperature)
    kelvin = tube.gather(heated.temperature.x.array[: tube.owned])
    moved = tube.gather(found.displacement.x.array[: 3 * tube.owned].reshape(-1, 3))
    if comm.rank == 0:
        print("heat", heated.supplied, heated.removed, heated.hottest)
        print("stress", found.largest_stress, *found.largest_at)
        for values in (kelvin, *moved.T):
            print("values", *values)
"""


@needs_mpirun
def test_two_ranks_are_one() -> None:
    from pathlib import Path

    script = SCRIPT.format(tests=str(Path(__file__).parents[1]))
    found = []
    for ranks in (1, 2):
        ended = python_on(ranks, "-c", script)
        assert ended.returncode == 0, ended.stderr
        found.append([line.split() for line in ended.stdout.splitlines() if line])
    assert [len(lines) for lines in found] == [12, 12]
    for one, two in zip(*found, strict=True):
        first, second = (np.array(words[1:], float) for words in (one, two))
        assert one[0] == two[0] and np.isfinite(first).all()
        assert np.abs(first - second).max() <= 1e-7 * np.abs(first).max(), one[0]
