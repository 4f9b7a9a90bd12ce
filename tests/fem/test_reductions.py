"""Extremes over ranks: a rank may hold none, and a NaN is lost on no rank."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.fem import reductions


@pytest.mark.mpi
def test_extremes() -> None:
    comm = MPI.COMM_WORLD
    last = comm.size - 1
    one, none = np.array([float(comm.rank)]), np.zeros(0)
    lone = one if comm.rank == last else none
    for values, most, least in ((one, last, 0.0), (lone, last, last), (none, -np.inf, np.inf)):
        assert reductions.largest(comm, values) == most
        assert reductions.smallest(comm, values) == least
    for rank in range(comm.size):
        spoilt = np.array([np.nan if comm.rank == rank else 1.0])
        assert np.isnan(reductions.largest(comm, spoilt))
        assert np.isnan(reductions.smallest(comm, spoilt))
        first, second = reductions.largest_of(comm, [spoilt[0], comm.rank])
        assert np.isnan(first) and second == last
