"""Makes the runs of a record in parallel, in processes or on ranks, and shows their progress."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import CastfemError, InputError
from castfem.cli import parallel
from castfem.runs.output.history import HISTORY_NAME, last_row
from castfem.studies.sweep.record import Record, check_folder
from castfem.studies.sweep.work import Job, Outcome
from castfem.studies.sweep.workers import LOG_NAME, Workers, check_groups, serve

if TYPE_CHECKING:
    from mpi4py import MPI

    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    from castfem.model import Case
    from castfem.studies.optimisation.evaluator import Evaluator


class View:
    """Shows the progress of several runs.

    Args:
        count: Number of runs in all.
        done: Number of runs finished before.
        quiet: Show nothing but failing runs.
        terminal: Whether to draw bars; by default if stderr is a terminal.
    """

    def __init__(
        self, count: int, done: int, quiet: bool = False, terminal: bool | None = None
    ) -> None:
        self._count, self._done, self._failed, self._quiet = count, done, 0, quiet
        self._since = time.time()
        self._tasks: dict[str, tuple[Job, TaskID]] = {}
        self._bars: Bars | None = None
        bars = sys.stderr.isatty() if terminal is None else terminal
        if bars and not quiet:
            self._bars = _bars()
            self._all = self._bars.add_task("all runs", total=count, completed=done, text="")
            self._bars.start()

    def begun(self, job: Job) -> None:
        """Show that a run has begun."""
        if self._bars is not None:
            task = self._bars.add_task(job.name, total=job.case.casting.length, text="")
            self._tasks[job.name] = (job, task)

    def ended(self, job: Job, outcome: Outcome) -> None:
        """Show how a run has ended."""
        self._done += 1
        self._failed += outcome.failed
        how = f"failed: {outcome.message}" if outcome.failed else "finished"
        line = f"{job.name}: {how} in {outcome.seconds:.1f} s ({self._done} of {self._count})"
        if self._bars is None:
            if not self._quiet or outcome.failed:
                print(line, file=sys.stderr, flush=True)
            return
        _, task = self._tasks.pop(job.name)
        self._bars.remove_task(task)
        if outcome.failed:
            self._bars.console.print(line, style="red", markup=False, highlight=False)
        text = f"{self._failed} failed" if self._failed else ""
        self._bars.update(self._all, completed=self._done, text=text)

    def tick(self) -> None:
        """Update the progress of the runs."""
        if self._bars is None:
            return
        part = 0.0
        for job, task in self._tasks.values():
            length = job.case.casting.length
            position = min(reached(job.folder, self._since), length)
            part += position / length
            self._bars.update(task, completed=position, text=f"{position:.3f} of {length:.3f} m")
        self._bars.update(self._all, completed=self._done + part)
        self._bars.refresh()

    def stop(self) -> None:
        """End the view; may be called twice."""
        if self._bars is not None:
            self._bars.stop()


def reached(folder: Path, since: float = 0.0) -> float:
    """Position that the run in a folder has reached, m; a history older than `since` is ignored."""
    path = folder / HISTORY_NAME
    try:
        found = None if path.stat().st_mtime < since else last_row(path)
    except (OSError, InputError):
        return 0.0  # not begun
    return 0.0 if found is None else found[0].get("position", 0.0)


def _bars() -> Bars:
    """Return a bar for each run, with its name and the remaining time."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    return Bars(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
        console=Console(stderr=True),
        auto_refresh=False,
    )


Work = Callable[["MPI.Intracomm | None"], int]
"""Makes runs on rank 0, or by `Workers` on the ranks; returns the exit status."""


def on_root(prepare: Callable[[bool], Work]) -> int:
    """Prepare and start runs on rank 0; the other ranks make them (collective).

    Args:
        prepare: Checks the input; called with whether there are several ranks; returns the work.

    Returns:
        The exit status, on all ranks.

    Raises:
        InputError: From `prepare`, on all ranks.
        CastfemError: From the work, on rank 0; the others return its status.
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
    """Make runs and record how each has ended (on rank 0; the others in `on_root`).

    Args:
        jobs: The runs, in this order.
        finished: Number of runs finished before.
        record: Record of all runs.
        comm: All ranks; None for processes of this machine.
        processes: Number of simultaneous processes; None for one per core.
        quiet: Show nothing but failing runs.
        noted: Called when a run has ended and been recorded.
        ranks: Ranks of each run, under a launcher.
    """
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
    """Return an evaluator for a search: with ranks under a launcher, otherwise with processes."""
    from castfem.studies.optimisation.evaluator import Evaluator

    check_folder(folder)
    comm = parallel.communicator()
    at_once = cores() if processes is None else processes
    at_once = 0 if comm is not None else at_once
    return Evaluator(case, folder, processes=at_once, comm=comm, ranks=ranks)


def check_processes(processes: int | None, ranks: bool, of_each: int = 1) -> None:
    """Refuse an impossible number of processes or ranks."""
    if ranks and processes is not None:
        raise InputError("-j is for one machine; under mpirun the ranks do the work")
    if processes is not None and processes < 1:
        raise InputError(f"-j {processes}: at least one process is needed")
    if of_each != 1:
        check_groups(of_each, parallel.rank_and_size()[1])


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
