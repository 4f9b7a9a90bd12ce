"""Runs of a record in parallel: on processes of this machine, or on the ranks of a launcher."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import CastfemError, InputError
from castfem.cli import parallel
from castfem.studies.sweep.record import Record, check_folder
from castfem.studies.sweep.work import Job, Outcome
from castfem.studies.sweep.workers import LOG_NAME, Workers, serve

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.model import Case
    from castfem.studies.optimisation.evaluator import Evaluator

Work = Callable[["MPI.Intracomm | None"], int]
"""Makes runs on rank 0, by `Workers` on the ranks, and returns the exit status."""


def on_root(prepare: Callable[[bool], Work]) -> int:
    """Prepare and carry out runs on rank 0; the other ranks work (collective).

    Args:
        prepare: Looks at all that the user gave, called with whether there are several ranks;
            returns what does it.

    Returns:
        The exit status, on all ranks.

    Raises:
        InputError: As `prepare`, on all ranks.
        CastfemError: As the work, on rank 0; the others return its status.
    """
    comm = parallel.communicator()
    work: Work | None = None
    problems: tuple[str, ...] = ()
    if parallel.rank_of(comm) == 0:
        try:
            work = prepare(comm is not None)
        except InputError as error:
            problems = error.problems
    problems = parallel.agree(comm, problems)
    if problems:
        raise InputError(problems)
    if work is None:
        assert comm is not None
        serve(comm)
        return int(comm.bcast(0))
    try:
        status = work(comm)
    except CastfemError as error:
        if comm is not None:
            comm.bcast(error.exit_status)
        raise
    return status if comm is None else int(comm.bcast(status))


def run_all(
    jobs: Sequence[Job],
    finished: int,
    record: Record,
    comm: MPI.Intracomm | None,
    *,
    processes: int | None = None,
    quiet: bool = False,
    noted: Callable[[Job, Outcome], None] | None = None,
    ranks: int = 1,
) -> None:
    """Do jobs and note in the record how each has ended (on rank 0; the others in `on_root`).

    Args:
        jobs: What to run, in this order.
        finished: How many runs were finished before.
        record: Of all runs.
        comm: All ranks, None for processes of this machine.
        processes: How many of these at once; None for one a core.
        quiet: Show nothing but runs that fail.
        noted: Called when a run has ended and has been noted.
        ranks: Of each run, under a launcher.
    """
    from castfem.cli.run_progress import View

    view = View(len(jobs) + finished, finished, quiet)

    def ended(job: Job, outcome: Outcome) -> None:
        view.ended(job, outcome)
        record.note(job, outcome)
        if noted is not None:
            noted(job, outcome)

    count = min(processes or cores(), len(jobs))
    noise = record.folder / LOG_NAME
    try:
        with Workers(noise, processes=count, comm=comm, ranks=ranks) as workers:
            workers.run(jobs, view.begun, ended, view.tick)
    finally:
        view.stop()


def evaluator(case: Case, folder: Path, processes: int | None, ranks: int = 1) -> Evaluator:
    """Return what does runs for a search: ranks under a launcher, else processes."""
    from castfem.studies.optimisation.evaluator import Evaluator

    check_folder(folder)
    comm = parallel.communicator()
    at_once = cores() if processes is None else processes
    at_once = 0 if comm is not None else at_once
    return Evaluator(case, folder, processes=at_once, comm=comm, ranks=ranks)


def check_processes(processes: int | None, ranks: bool, of_each: int = 1) -> None:
    """Refuse a number of processes that cannot be, or of ranks."""
    if ranks and processes is not None:
        raise InputError("-j is for one machine; under mpirun the ranks do the work")
    if processes is not None and processes < 1:
        raise InputError(f"-j {processes}: at least one process is needed")
    if of_each != 1:
        from castfem.studies.sweep.groups import check

        check(of_each, parallel.rank_and_size()[1])


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
