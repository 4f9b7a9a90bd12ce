"""Makes several runs at once: in processes, on ranks, groups of ranks, or by an executor.

An executor is any object with `submit(function, *arguments)`, which returns an object with `done`,
`result` and `cancel`: those of `concurrent.futures`, `mpi4py.futures`, executorlib and submitit.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from castfem.base.atomic_files import Closing
from castfem.base.errors import InputError
from castfem.studies.sweep.work import Job, Outcome, ProcessEnded, Processes, work

if TYPE_CHECKING:
    from mpi4py import MPI


def check_groups(ranks: int, size: int, name: str = "--ranks ") -> None:
    """Refuse groups that the ranks cannot form."""
    if ranks < 1:
        raise InputError(f"{name}{ranks}: a run needs at least one")
    if size % ranks:
        raise InputError(
            f"{name}{ranks}: {size} rank{'s' if size > 1 else ''} cannot be divided so; start it "
            f"with mpirun -n {ranks} for one run at a time, mpirun -n {2 * ranks} for two"
        )


class Groups(Closing):
    """Groups of ranks that make several runs. All methods are collective.

    Each group takes the next run that no other has taken. The counter is on rank 0, and all groups
    access it without help of its owner: an executor of mpi4py would need a rank that only
    distributes the runs.

    Args:
        comm: All ranks.
        ranks: Ranks of a group; a divisor of all.
    """

    def __init__(self, comm: MPI.Intracomm, ranks: int) -> None:
        self._comm = comm.Dup()  # separates its messages
        self._group = comm.Split(comm.rank // ranks, comm.rank)
        self._open = True

    def run(
        self,
        jobs: Sequence[Job] = (),
        begun: Callable[[Job], None] | None = None,
        ended: Callable[[Job, Outcome], None] | None = None,
    ) -> None:
        """Make runs; rank 0 is informed of those of other groups between its own and at the end.

        Exceptions of `begun` or `ended` are raised after the last run, so that no rank is left
        waiting.

        Args:
            jobs: The runs, in this order; those of rank 0 count.
            begun: Called on rank 0 for each job; for another group when it has ended.
            ended: Called on rank 0 when the outcome of a job is known.
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
        """Dissolve the groups."""
        if self._open:
            self._group.Free()
            self._comm.Free()
        self._open = False

    def _taken(self, count: int) -> Iterator[int]:
        """Yield the indices of the jobs that this group takes, equal on its ranks."""
        from mpi4py import MPI

        comm, group = self._comm, self._group
        counter = np.zeros(1 if comm.rank == 0 else 0, np.int64)  # the next index, on rank 0
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


LOG_NAME = "sweep.log"
"""File in a folder of runs for the output of libraries in processes."""
_TICK = 0.25  # s between two checks of the progress


class Pending(Protocol):
    """A call that was submitted."""

    def done(self) -> bool:
        """Whether it has ended."""

    def result(self) -> Any:
        """Its value; raises what the call, or the loss of its process, has raised."""

    def cancel(self) -> Any:
        """Cancel it, if it has not begun."""


class CallExecutor(Protocol):
    """Makes calls in parallel."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Pending:
        """Make a call at some time."""


def nothing(*_: object) -> None:
    """Ignore a run."""


class Workers(Closing):
    """Makes runs, list after list, by the given means; otherwise in this process.

    Args:
        noise: File for the output of libraries in processes.
        processes: Largest number of processes, which are kept for further runs; 0 for none.
        comm: Ranks, the others within `serve`; a single one makes its runs itself.
        ranks: Ranks of each run; they divide those of `comm`.
        executor: Makes the runs instead; it is not closed.
    """

    def __init__(
        self,
        noise: Path,
        *,
        processes: int = 0,
        comm: MPI.Intracomm | None = None,
        ranks: int = 1,
        executor: CallExecutor | None = None,
    ) -> None:
        self._noise, self._processes, self._ranks = noise, processes, ranks
        self._comm = comm if comm is not None and comm.size > 1 else None
        self._executor = executor
        self._own: Processes | None = None
        self._groups: Groups | None = None

    def run(
        self,
        jobs: Sequence[Job],
        begun: Callable[[Job], None] = nothing,
        ended: Callable[[Job, Outcome], None] = nothing,
        tick: Callable[[], None] = nothing,
    ) -> None:
        """Make all runs; an exception, including Ctrl-C, cancels those that have not begun.

        Args:
            jobs: The runs, in this order.
            begun: Called when a run has begun.
            ended: Called when a run has ended.
            tick: Called a few times per second, but not while this process makes runs itself.
        """
        if not jobs:
            return
        if self._executor is not None:
            jobs = [replace(job, folder=job.folder.absolute()) for job in jobs]
            run_jobs(self._executor, jobs, begun, ended, tick)
        elif self._comm is not None:
            self._comm.bcast(self._ranks)
            if self._ranks == 1:
                _on_ranks(self._comm, jobs, begun, ended, tick)
                return
            if self._groups is None:
                self._groups = Groups(self._comm, self._ranks)
            self._groups.run(jobs, begun, ended)
        elif self._processes:
            if self._own is None:
                self._own = Processes(self._processes, self._noise)
            run_jobs(self._own, jobs, begun, ended, tick)
        else:
            for job in jobs:
                begun(job)
                ended(job, work(job))

    def close(self) -> None:
        """End the processes, and release the other ranks."""
        if self._own is not None:
            self._own.shutdown(cancel_futures=True)
        if self._comm is not None:
            self._comm.bcast(0)
        if self._groups is not None:
            self._groups.close()
        self._own = self._comm = self._groups = None


def serve(comm: MPI.Intracomm) -> None:
    """Make runs for the workers of rank 0 until they are closed (on other ranks)."""
    groups: Groups | None = None
    while ranks := comm.bcast(0):
        if ranks == 1:
            _on_ranks(comm, (), nothing, nothing, nothing)
            continue
        if groups is None:
            groups = Groups(comm, ranks)
        groups.run()
    if groups is not None:
        groups.close()


def _on_ranks(
    comm: MPI.Intracomm,
    jobs: Sequence[Job],
    begun: Callable[[Job], None],
    ended: Callable[[Job, Outcome], None],
    tick: Callable[[], None],
) -> None:
    """Make runs on one rank each (collective): rank 0 distributes them to the others.

    If one rank dies, the launcher ends all of them.
    """
    from mpi4py.futures import MPICommExecutor

    import castfem.runs.loop  # noqa: F401  PETSc is initialised by all ranks together or never

    with MPICommExecutor(comm, root=0) as pool:
        executor: CallExecutor | None = pool  # type: ignore[assignment]  # its stubs are wrong
        if executor is not None:
            run_jobs(executor, jobs, begun, ended, tick)


def run_jobs(
    executor: CallExecutor,
    jobs: Sequence[Job],
    begun: Callable[[Job], None],
    ended: Callable[[Job, Outcome], None],
    tick: Callable[[], None],
) -> None:
    """Make runs by an executor; return when the last has ended. See `Workers.run`.

    A run lost with its process is submitted again, to be resumed from its checkpoint, at most
    twice.
    """
    waiting = {executor.submit(work, job): job for job in jobs}
    started: set[str] = set()
    lost: Counter[str] = Counter()
    try:
        while waiting:
            _wait(waiting)
            for call, job in list(waiting.items()):
                done = call.done()
                if job.name not in started and (done or _running(call)):
                    started.add(job.name)
                    begun(job)
                if not done:
                    continue
                del waiting[call]
                try:
                    outcome = call.result()
                except Exception as error:
                    lost[job.name] += 1
                    again = _submitted_again(executor, job) if lost[job.name] <= 2 else None
                    if again is not None:
                        waiting[again] = job
                        continue
                    outcome = Outcome(_said(error), obstacle="process")
                ended(job, outcome)
            tick()
    finally:
        for call in waiting:  # a programming error: cancel those that have not begun
            call.cancel()


def _wait(calls: Collection[Pending]) -> None:
    """Wait until a call has ended, with a time limit."""
    futures = [call for call in calls if isinstance(call, Future)]
    if len(futures) == len(calls):
        wait(futures, timeout=_TICK, return_when=FIRST_COMPLETED)
    elif not any(call.done() for call in calls):
        time.sleep(_TICK)


def _running(call: Pending) -> bool:
    """Whether a call has begun; without this information calls count as begun when submitted."""
    return call.running() if isinstance(call, Future) else True


def _submitted_again(executor: CallExecutor, job: Job) -> Pending | None:
    try:
        return executor.submit(work, replace(job, resume=True))
    except Exception:
        return None  # the lost run has broken the executor


def _said(error: Exception) -> str:
    """Reason for the end of a lost run, one line."""
    text = str(error).strip().partition("\n")[0]
    return text if isinstance(error, ProcessEnded) else f"{type(error).__name__}: {text}"
