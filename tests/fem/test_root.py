"""Work that is shared out among the ranks comes back to all of them, and so does its failure."""

from __future__ import annotations

from collections.abc import Callable

from mpi4py import MPI

import pytest

from castfem.base.errors import RunFailure
from castfem.fem.root import shared_out

COMM = MPI.COMM_WORLD


def work(number: int) -> Callable[[], tuple[int, int]]:
    return lambda: (number, COMM.rank)


def fails(number: int) -> Callable[[], tuple[int, int]]:
    def _fail() -> tuple[int, int]:
        raise RunFailure(f"piece {number}")

    return _fail


@pytest.mark.mpi
def test_each_piece_is_done_once_and_known_to_all() -> None:
    pieces = [work(number) for number in range(5)]
    assert shared_out(COMM, pieces) == [(number, number % COMM.size) for number in range(5)]
    assert shared_out(MPI.COMM_SELF, pieces) == [(number, COMM.rank) for number in range(5)]
    assert shared_out(COMM, pieces[:1]) == [(0, 0)]


@pytest.mark.mpi
def test_the_first_piece_that_fails_fails_on_all_ranks() -> None:
    pieces = [work(0), work(1), fails(2), fails(3)]
    for comm in (COMM, MPI.COMM_SELF):
        with pytest.raises(RunFailure, match="piece 2"):
            shared_out(comm, pieces)
