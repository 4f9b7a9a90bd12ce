"""Runs on groups of ranks: each group takes the next run that nobody has taken.

The number of the next run is on rank 0, and all groups reach it without its owner's help: an
executor of mpi4py would need a rank that gives out the runs and makes none itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import Closing
from castfem.base.errors import InputError
from castfem.studies.sweep.work import Job, Outcome, work

if TYPE_CHECKING:
    from mpi4py import MPI


def check(ranks: int, size: int, name: str = "--ranks ") -> None:
    """Refuse groups that the ranks cannot form."""
    if ranks < 1:
        raise InputError(f"{name}{ranks}: a run needs at least one")
    if size % ranks:
        raise InputError(
            f"{name}{ranks}: {size} rank{'s' if size > 1 else ''} cannot be divided so; start it "
            f"with mpirun -n {ranks} for one run at a time, mpirun -n {2 * ranks} for two"
        )


class Groups(Closing):
    """Groups of ranks that stay for further jobs. All that it does is collective.

    Args:
        comm: All ranks.
        ranks: Of a group; they divide all.
    """

    def __init__(self, comm: MPI.Intracomm, ranks: int) -> None:
        self._comm = comm.Dup()  # its messages are no others'
        self._group = comm.Split(comm.rank // ranks, comm.rank)
        self._open = True

    def run(
        self,
        jobs: Sequence[Job] = (),
        begun: Callable[[Job], None] | None = None,
        ended: Callable[[Job, Outcome], None] | None = None,
    ) -> None:
        """Make runs; rank 0 hears of those of other groups between its own and at the end.

        What `begun` or `ended` raises is raised after the last run: nobody is left waiting.

        Args:
            jobs: What to run, in this order; those of rank 0 count.
            begun: Called on rank 0 for each job, of another group when it has ended.
            ended: Called there when it is known how a job has ended.
        """
        comm, first = self._comm, self._comm.rank == 0
        jobs = comm.bcast(tuple(jobs))
        waiting, missing = set(range(len(jobs))), set(range(len(jobs)))
        error: Exception | None = None
        sent = []

        def note(number: int, outcome: Outcome | None) -> None:
            nonlocal error
            if outcome is not None:
                missing.discard(number)
            try:
                if error is None and number in waiting and begun is not None:
                    begun(jobs[number])
                waiting.discard(number)
                if error is None and outcome is not None and ended is not None:
                    ended(jobs[number], outcome)
            except Exception as raised:
                error = raised

        for number in self._taken(len(jobs)):
            if first:
                note(number, None)
            outcome = work(jobs[number], comm=self._group)
            if first:
                note(number, outcome)
                while comm.iprobe():
                    note(*comm.recv())
            elif self._group.rank == 0:
                sent.append(comm.isend((number, outcome), 0))
        while first and missing:
            note(*comm.recv())
        for request in sent:
            request.wait()
        comm.Barrier()
        if error is not None:
            raise error

    def close(self) -> None:
        """Give the groups up."""
        if self._open:
            self._group.Free()
            self._comm.Free()
        self._open = False

    def _taken(self, count: int) -> Iterator[int]:
        """Yield the numbers of the jobs that this group takes, the same on its ranks."""
        from mpi4py import MPI

        comm, group = self._comm, self._group
        counter = np.zeros(1 if comm.rank == 0 else 0, np.int64)  # the next number, on rank 0
        window = MPI.Win.Create(counter, counter.itemsize, comm=comm)
        try:
            one, number = np.ones(1, np.int64), np.zeros(1, np.int64)
            while True:
                if group.rank == 0:
                    window.Lock(0)
                    window.Fetch_and_op(one, number, 0, 0, MPI.SUM)
                    window.Unlock(0)
                group.Bcast(number)
                if number[0] >= count:
                    return
                yield int(number[0])
        finally:
            window.Free()
