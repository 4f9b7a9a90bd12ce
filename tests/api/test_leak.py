"""Forty runs in one process leave nothing behind."""

from __future__ import annotations

from mpi4py import MPI

import psutil
import pytest
from small_case import write_small

import castfem

WARM_UP, RUNS = 10, 30


def communicators() -> int:
    """How many communicators exist, by the handle Open MPI gives the next one: the lowest free."""
    own = MPI.COMM_WORLD.Dup()
    handle = own.py2f()
    own.Free()
    return handle


@pytest.mark.skipif("Open MPI" not in MPI.Get_library_version(), reason="handles mean nothing")
def test_forty_runs_leak_nothing(tmp_path):
    case = castfem.load(write_small(tmp_path)).with_(length="15 mm")
    process = psutil.Process()

    def state() -> tuple[int, int, int]:
        return communicators(), process.num_fds(), process.memory_info().rss

    for number in range(WARM_UP + RUNS):
        if number == WARM_UP:
            before = state()
        with castfem.run(case.with_(superheat=f"{20 + number} K")) as result:
            assert len(result.history) > 2
            result.fields()
    after = state()
    assert after[0] == before[0], "communicators"
    assert after[1] == before[1], "open files"
    # The heap may still settle by a page or two; a mesh that stayed would be 0.1 MB a run.
    assert after[2] - before[2] < 2e6, "memory"
