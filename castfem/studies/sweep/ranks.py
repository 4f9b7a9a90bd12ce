"""Runs of a sweep on the ranks of an MPI launcher: rank 0 hands them out, each of the others works.

Every run is on one rank. A rank that dies takes all others with it: that is how launchers are; the
sweep goes on where it was when it is started again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TYPE_CHECKING

from castfem.studies.sweep.work import Job, Outcome, work

if TYPE_CHECKING:
    from mpi4py import MPI

_TICK = 0.25  # s between two looks at the progress


def run_on_ranks(
    comm: MPI.Intracomm,
    jobs: Sequence[Job],
    begun: Callable[[Job], None],
    ended: Callable[[Job, Outcome], None],
    tick: Callable[[], None],
) -> None:
    """Do all jobs (collective); on ranks other than 0 the arguments after `comm` do not matter.

    Args:
        comm: All ranks, at least two.
        jobs: What to run, in this order.
        begun: Called when a rank has begun with a job.
        ended: Called when it has ended.
        tick: Called a few times a second.
    """
    from mpi4py.futures import MPICommExecutor

    import castfem.runs.loop  # noqa: F401  PETSc is initialised by all ranks together or never

    with MPICommExecutor(comm, root=0) as pool:
        executor: Executor | None = pool  # type: ignore[assignment]  # its stubs are wrong
        if executor is None:
            return
        waiting = {executor.submit(work, job): job for job in jobs}
        started: set[Future[Outcome]] = set()
        try:
            while waiting:
                done, _ = wait(waiting, timeout=_TICK, return_when=FIRST_COMPLETED)
                for future, job in waiting.items():
                    if future not in started and (future.running() or future in done):
                        started.add(future)
                        begun(job)
                for future in done:
                    error = future.exception()
                    outcome = future.result() if error is None else Outcome(f"unexpected {error!r}")
                    ended(waiting.pop(future), outcome)
                tick()
        finally:
            for future in waiting:  # an error of ours: those that have not begun need not
                future.cancel()
