"""One run of a sweep, in whichever process it happens."""

from __future__ import annotations

import gc
import logging
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from castfem.base.errors import CannotWrite, CastfemError, FolderInUse
from castfem.base.process import one_at_a_time
from castfem.base.progress import Progress
from castfem.model import Case
from castfem.runs.output.run_record import RUN_NAME

if TYPE_CHECKING:
    from mpi4py import MPI


Obstacle = Literal["", "in use", "file", "process"]


@dataclass(frozen=True, slots=True)
class Derivatives:
    """Which derivatives a run is to carry along."""

    of: tuple[str, ...]  #: names of results
    to: tuple[str, ...]  #: parameters, as `castfem sensitivity` takes them


@dataclass(frozen=True, slots=True)
class Job:
    """What is to be run."""

    name: str  #: of the run
    folder: Path  #: where it writes
    case: Case
    resume: bool = False  #: go on from the checkpoint, if there is one
    after: Callable[[Path], object] | None = None
    """Called with the folder of the finished run, such as `draw_figures`; a function of a
    module, since it goes to other processes by name. None for nothing."""
    derivatives: Derivatives | None = None
    """To be carried along, where the case has them; None for none. Such a run is begun anew,
    not resumed."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run has ended."""

    message: str = ""  #: why it failed, one line; empty if it did not
    seconds: float = 0.0  #: how long it took
    obstacle: Obstacle = ""
    """What hindered it that is none of the case's: another run in its folder, a file that
    cannot be written, the end of its process; empty for nothing."""

    @property
    def failed(self) -> bool:
        """Whether it failed."""
        return bool(self.message)


class Stop(Progress):
    """Stops a run after its step where its process shall end: PETSc would lose an exception."""

    wanted: ClassVar[bool] = False  #: whether this process shall end

    def __init__(self) -> None:
        super().__init__(verbosity=-1, terminal=False)

    def update(
        self, position: float, time_s: float, newton: int, step: float, note: str = ""
    ) -> None:
        """Note a step in the run's log, and stop after it if that is wanted.

        Raises:
            KeyboardInterrupt: It is.
        """
        super().update(position, time_s, newton, step, note)
        if self.wanted:
            raise KeyboardInterrupt("stopped with the command that had started it")


def work(job: Job, comm: MPI.Comm | None = None) -> Outcome:
    """Run a case; whatever goes wrong becomes the outcome's message.

    A run of another thread of this process is waited for.

    Args:
        job: The run.
        comm: Ranks to run it on (collective); this process alone if None.
    """
    with one_at_a_time(wait=True):
        return _alone(job, comm)


def _alone(job: Job, comm: MPI.Comm | None) -> Outcome:
    from mpi4py import MPI

    from castfem.base import log

    if comm is None and MPI.COMM_WORLD.size > 1 and "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        petsc4py.init(comm=MPI.COMM_SELF)  # other ranks of an executor need not come along
    from castfem.runs import loop

    log.close()
    log.logger.addHandler(logging.NullHandler())  # not even warnings between the bars: see run.log
    log.logger.propagate = False
    log.logger.setLevel(logging.INFO)
    begun, progress = time.perf_counter(), Stop()
    try:
        ranks = MPI.COMM_SELF if comm is None else comm
        reported = progress if ranks.rank == 0 else None
        beside = None
        if job.derivatives is not None:
            from castfem.studies.sensitivity.run import carrying

            beside = carrying(job.derivatives.of, job.derivatives.to, job.folder)
        begun_before = (job.folder / RUN_NAME).is_file()
        goes_on = job.resume and begun_before and beside is None
        loop.run(job.case, job.folder, comm=ranks, resume=goes_on, progress=reported, beside=beside)
        if job.after is not None and ranks.rank == 0:
            job.after(job.folder)
    except CastfemError as error:
        log.logger.error("%s", error)
        obstacle: Obstacle = ""
        if isinstance(error, FolderInUse | CannotWrite):
            obstacle = "in use" if isinstance(error, FolderInUse) else "file"
        return Outcome("; ".join(str(error).splitlines()), time.perf_counter() - begun, obstacle)
    except Exception as error:
        log.logger.error("%s", "".join(traceback.format_exception(error)))
        what = str(error).partition("\n")[0]
        text = f"unexpected {type(error).__name__}: {what} (traceback in run.log)"
        return Outcome(text, time.perf_counter() - begun)
    finally:
        progress.stop()
        log.close()
        gc.collect()  # meshes and their communicators stand in cycles
    return Outcome("", time.perf_counter() - begun)
