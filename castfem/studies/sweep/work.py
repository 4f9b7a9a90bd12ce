"""One run of a sweep, in whichever process it happens."""

from __future__ import annotations

import gc
import logging
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from castfem.base.errors import CannotWrite, CastfemError, FolderInUse
from castfem.base.progress import Progress
from castfem.model import Case
from castfem.runs.output.run_record import RUN_NAME

if TYPE_CHECKING:
    from mpi4py import MPI


Obstacle = Literal["", "in use", "file", "process"]


@dataclass(frozen=True, slots=True)
class Derivatives:
    """Which derivatives a run is to carry along.

    Attributes:
        of: Names of results.
        to: Parameters, as `castfem sensitivity` takes them.
    """

    of: tuple[str, ...]
    to: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Job:
    """What is to be run.

    Attributes:
        name: Of the run.
        folder: Where it writes.
        case: The case.
        resume: Go on from the checkpoint, if there is one.
        after: Called with the folder of the finished run, such as `draw_figures`; a function of a
            module, since it goes to other processes by name. None for nothing.
        derivatives: To be carried along, where the case has them; None for none. Such a run is
            begun anew, not resumed.
    """

    name: str
    folder: Path
    case: Case
    resume: bool = False
    after: Callable[[Path], object] | None = None
    derivatives: Derivatives | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run has ended.

    Attributes:
        message: Why it failed, one line; empty if it did not.
        seconds: How long it took.
        obstacle: What hindered it that is none of the case's: another run in its folder, a file
            that cannot be written, the end of its process; empty for nothing.
    """

    message: str = ""
    seconds: float = 0.0
    obstacle: Obstacle = ""

    @property
    def failed(self) -> bool:
        """Whether it failed."""
        return bool(self.message)


class Stop(Progress):
    """A wish to stop that a run heeds after its step: an exception would be lost within PETSc."""

    def __init__(self) -> None:
        super().__init__(verbosity=-1, terminal=False)
        self.wanted = False

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


def work(job: Job, stop: Stop | None = None, comm: MPI.Comm | None = None) -> Outcome:
    """Run a case; whatever goes wrong becomes the outcome's message.

    Args:
        job: The run.
        stop: Asked after each step.
        comm: Ranks to run it on (collective); this process alone if None.
    """
    from mpi4py import MPI

    from castfem.base import log
    from castfem.runs import loop

    log.close()
    log.logger.addHandler(logging.NullHandler())  # not even warnings between the bars: see run.log
    log.logger.propagate = False
    log.logger.setLevel(logging.INFO)
    begun, progress = time.perf_counter(), stop or Stop()
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
