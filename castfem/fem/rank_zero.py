"""Work done by one rank for others: if it fails, every rank fails, and none is left waiting."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TypeVar

from mpi4py import MPI

from castfem.base.atomic_files import Closing
from castfem.base.errors import CastfemError

T = TypeVar("T")

PATIENCE = 5.0  # s for the other ranks to arrive at the same failure


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


def shared_out(comm: MPI.Comm, works: Sequence[Callable[[], T]]) -> list[T]:
    """Do each piece of work on one rank; all results on every rank (collective).

    Raises:
        Exception: On every rank, what the first failed piece raised.
    """
    if comm.size == 1:
        return [work() for work in works]
    own: dict[int, T | Exception] = {}
    for i in range(comm.rank, len(works), comm.size):
        try:
            own[i] = works[i]()
        except Exception as raised:
            own[i] = raised
    done = {i: result for part in comm.allgather(own) for i, result in part.items()}
    results: list[T] = []
    for i in range(len(works)):
        result = done[i]
        if isinstance(result, Exception):
            raise result
        results.append(result)
    return results


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise the error of the lowest rank that has one on every rank (collective).

    Raises:
        Exception: The lowest rank's error.
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


def all_arrive(comm: MPI.Comm, patience: float | None = None) -> bool:
    """Whether all ranks arrive here within so many seconds, by default `PATIENCE`."""
    request = comm.Ibarrier()
    end = time.monotonic() + (PATIENCE if patience is None else patience)
    while not request.Test():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


class Together(Closing):
    """Context for work of all ranks: an error on a single rank ends all of them.

    Otherwise the others would wait for that rank forever in their next collective call, and it for
    them when freeing shared objects. A rank that leaves the block by an error therefore first waits
    a little for the others: if they also leave, all continue to clean up; if not, it reports the
    error and aborts.

    Args:
        comm: All ranks (collective); a separate communicator is used for messages.
        agreed: Errors that ranks raise together, if they raise them.
        last_words: Called with the error on rank 0 before it aborts; only rank 0 has the files.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        agreed: tuple[type[BaseException], ...] = (),
        last_words: Callable[[BaseException], None] | None = None,
    ) -> None:
        self._last_words = last_words
        self._world, self._kinds = comm, agreed
        self._comm = comm.Dup() if comm.size > 1 else None
        self._met: bool | None = None if comm.size > 1 else True

    def meet(self, error: BaseException) -> bool:
        """Return whether all ranks have an error of the agreed kinds, so they may work together.

        Does not return if other ranks have no error. (Collective; a single rank may always call
        it.)
        """
        if self._comm is not None and self._met is None:
            if not all_arrive(self._comm):
                if self._world.rank == 0 and self._last_words is not None:
                    with suppress(Exception):
                        self._last_words(error)
                self._world.Abort(_report_alone(error, self._world.rank))
            own = isinstance(error, self._kinds)
            self._met = bool(self._comm.allreduce(own, op=MPI.LAND))
        return bool(self._met)

    def leave(self, error: BaseException) -> None:
        """Wait for the others, or abort."""
        self.meet(error)

    def close(self) -> None:
        """Free the communicator (collective)."""
        if self._comm is not None:
            self._comm.Free()
        self._comm = None


def _report_alone(error: BaseException, rank: int) -> int:
    """Report an error that only this rank has, and return the exit status of all.

    With the traceback of an unexpected error, since no caller will see it.
    """
    status = CastfemError.exit_status
    if isinstance(error, CastfemError):
        said, status = str(error), error.exit_status
    elif isinstance(error, KeyboardInterrupt):
        said, status = "interrupted", 130
    else:
        traceback.print_exception(error)
        said = f"unexpected {type(error).__name__}: {error}"
    print(f"castfem: on rank {rank}: {said}", file=sys.stderr, flush=True)
    return status
