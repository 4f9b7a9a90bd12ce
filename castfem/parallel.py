"""Work that one rank does for all: what fails on it fails on every rank, with the same error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

T = TypeVar("T")


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T | None:
    """Do `work` on rank 0 alone; its result there, None elsewhere (collective).

    Raises:
        Exception: On every rank, what `work` raised on rank 0.
    """
    result: T | None = None
    error: Exception | None = None
    if comm.rank == 0:
        try:
            result = work()
        except Exception as raised:
            error = raised
    raise_together(comm, error)
    return result


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise on every rank the error of the lowest rank that has one (collective).

    Raises:
        Exception: That error.
    """
    if comm.size == 1:
        if error is not None:
            raise error
        return
    first = comm.allreduce(comm.rank if error is not None else comm.size, op=MPI.MIN)
    if first < comm.size:
        shared = comm.bcast(error, root=first)
        if error is not None and comm.rank == first:
            raise error
        raise shared
