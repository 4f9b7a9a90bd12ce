"""Runs on groups of ranks: each group takes the next run that nobody has taken.

Which is the next one is counted in one place that all groups reach without its owner's help.
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
    """Refuse groups that the ranks cannot form.

    Args:
        ranks: Of a group.
        size: All ranks.
        name: What the user has given the number by.

    Raises:
        InputError: They cannot; it says how many it takes.
    """
    if ranks < 1:
        raise InputError(f"{name}{ranks}: a run needs at least one")
    if size % ranks:
        raise InputError(
            f"{name}{ranks}: {size} rank{'s' if size > 1 else ''} cannot be divided so; start it "
            f"with mpirun -n {ranks} for one run at a time, mpirun -n {2 * ranks} for two"
        )


def run_in_groups(
    comm: MPI.Intracomm,
    ranks: int,
    jobs: Sequence[Job],
    begun: Callable[[Job], None],
    ended: Callable[[Job, Outcome], None],
) -> None:
    """Do all jobs (collective).

    Args:
        comm: All ranks.
        ranks: Of a group; they divide all.
        jobs: What to run, in this order; those of rank 0 count.
        begun: Called on the first rank of a group when it has begun with a job.
        ended: Called there when it has ended.
    """
    with Groups(comm, ranks) as groups:
        groups.run(jobs, begun, ended)


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
        jobs: Sequence[Job],
        begun: Callable[[Job], None],
        ended: Callable[[Job, Outcome], None],
    ) -> None:
        """Do all jobs; whoever leads a group tells of those of its own. See `run_in_groups`."""
        from castfem.fem.root import raise_together

        jobs = self._comm.bcast(tuple(jobs))
        told = _Told(jobs, begun, ended) if self._group.rank == 0 else None
        for number in self._taken(len(jobs)):
            if told is not None:
                told.begin(number)
            outcome = work(jobs[number], comm=self._group)
            if told is not None:
                told.end(number, outcome)
        raise_together(self._comm, None if told is None else told.error)

    def run_for_first(
        self,
        jobs: Sequence[Job] = (),
        begun: Callable[[Job], None] | None = None,
        ended: Callable[[Job, Outcome], None] | None = None,
    ) -> None:
        """Do all jobs; rank 0 is told of each, between two runs of its own and at the end.

        What it raises when it is told is raised after the last run: nobody is left waiting.

        Args:
            jobs: What to run, in this order; those of rank 0 count.
            begun: Called on rank 0 for each job, of another group when it has ended.
            ended: Called there when it is known how a job has ended.
        """
        comm = self._comm
        jobs = comm.bcast(tuple(jobs))
        told = _Told(jobs, begun, ended) if comm.rank == 0 else None
        sent = []
        for number in self._taken(len(jobs)):
            if told is not None:
                told.begin(number)
            outcome = work(jobs[number], comm=self._group)
            if told is not None:
                told.end(number, outcome)
                while comm.iprobe():
                    told.end(*comm.recv())
            elif self._group.rank == 0:
                sent.append(comm.isend((number, outcome), 0))
        while told is not None and told.missing:
            told.end(*comm.recv())
        for request in sent:
            request.wait()
        comm.Barrier()
        if told is not None and told.error is not None:
            raise told.error

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


class _Told:
    """Whoever is told of jobs: an error of its own keeps no other rank from its work.

    Attributes:
        missing: Numbers of the jobs of whose end nothing was told.
        error: What telling has raised; nothing is told after that.
    """

    def __init__(
        self,
        jobs: Sequence[Job],
        begun: Callable[[Job], None] | None,
        ended: Callable[[Job, Outcome], None] | None,
    ) -> None:
        self._jobs, self._begun, self._ended = jobs, begun, ended
        self._waiting = set(range(len(jobs)))
        self.missing = set(range(len(jobs)))
        self.error: Exception | None = None

    def begin(self, number: int) -> None:
        """Tell that a job has begun."""
        self._waiting.discard(number)
        if self._begun is not None:
            self._tell(self._begun, self._jobs[number])

    def end(self, number: int, outcome: Outcome) -> None:
        """Tell how a job has ended; that it had begun, too, where that is not known yet."""
        if number in self._waiting:
            self.begin(number)
        self.missing.discard(number)
        if self._ended is not None:
            self._tell(self._ended, self._jobs[number], outcome)

    def _tell(self, word: Callable[..., None], *what: object) -> None:
        try:
            if self.error is None:
                word(*what)
        except Exception as error:
            self.error = error
