"""Runs of a sweep on groups of ranks: each group takes the next run that nobody has taken.

Which is the next one is counted in one place that all groups reach without its owner's help.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.errors import InputError
from castfem.sweep.work import Job, Outcome, work

if TYPE_CHECKING:
    from mpi4py import MPI


def check(ranks: int, size: int) -> None:
    """Refuse groups that the ranks cannot form.

    Args:
        ranks: Of a group.
        size: All ranks.

    Raises:
        InputError: They cannot; it says how many it takes.
    """
    if ranks < 1:
        raise InputError(f"--ranks {ranks}: a run needs at least one")
    if size % ranks:
        raise InputError(
            f"--ranks {ranks}: {size} rank{'s' if size > 1 else ''} cannot be parted so; start it "
            f"with mpirun -n {2 * ranks} for two runs at once"
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
    jobs = comm.bcast(tuple(jobs))
    group = comm.Split(comm.rank // ranks, comm.rank)
    try:
        for number in _taken(comm, group, len(jobs)):
            job = jobs[number]
            if group.rank == 0:
                begun(job)
            outcome = work(job, comm=group)
            if group.rank == 0:
                ended(job, outcome)
        comm.Barrier()
    finally:
        group.Free()


def _taken(comm: MPI.Intracomm, group: MPI.Comm, count: int) -> Iterator[int]:
    """Yield the numbers of the jobs that this group takes, the same on its ranks (collective)."""
    from mpi4py import MPI

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
