"""Extremes over ranks: a rank may hold none, and a NaN is lost on no rank."""

from __future__ import annotations

import pytest
from ranks import needs_mpirun, python_on

SCRIPT = """
from mpi4py import MPI
import numpy as np
from castfem.fem import reductions
comm = MPI.COMM_WORLD
one, none = np.array([float(comm.rank)]), np.zeros(0)
lone = one if comm.rank == comm.size - 1 else none
found = [reductions.largest(comm, one), reductions.smallest(comm, one)]
found += [reductions.largest(comm, lone), reductions.smallest(comm, lone)]
found += [reductions.largest(comm, none), reductions.smallest(comm, none)]
for rank in range(comm.size):
    spoilt = np.array([np.nan if comm.rank == rank else 1.0])
    found += [reductions.largest(comm, spoilt), reductions.smallest(comm, spoilt)]
    found += reductions.largest_of(comm, [spoilt[0], comm.rank]).tolist()
texts = comm.gather(" ".join(f"{value:g}" for value in found))
if comm.rank == 0:
    assert len(set(texts)) == 1, texts
    print("found", texts[0])
"""


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=needs_mpirun)])
def test_extremes(ranks: int) -> None:
    done = python_on(ranks, "-c", SCRIPT, timeout=60.0)
    assert done.returncode == 0, done.stderr
    last = ranks - 1
    plain = f"found {last} 0 {last} {last} -inf inf"
    assert done.stdout.strip() == plain + f" nan nan nan {last}" * ranks
