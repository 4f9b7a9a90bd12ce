"""One run of a sweep, in any process; and an executor of processes on this machine.

A process makes one call after the other, so that DOLFINx is imported once in each. If one dies
`concurrent.futures.ProcessPoolExecutor` ends all others and accepts no further calls; here only
that call fails, and the next one is made by a new process.
"""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from castfem.base import process
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
    """Derivatives that a run is to compute."""

    of: tuple[str, ...]  #: names of results
    to: tuple[str, ...]  #: parameters, as for `castfem sensitivity`


@dataclass(frozen=True, slots=True)
class Job:
    """A run to be made."""

    name: str  #: name of the run
    folder: Path  #: output folder
    case: Case
    resume: bool = False  #: continue from the checkpoint, if there is one
    after: Callable[[Path], object] | None = None
    """Called with the folder of the finished run, such as `draw_figures`; a function of a module,
    since it is passed to other processes by name. None for nothing."""
    derivatives: Derivatives | None = None
    """Derivatives to compute, if the case has them; None for none. Such a run starts again instead
    of being resumed."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a run."""

    message: str = ""  #: why it failed, one line; "" if it did not
    seconds: float = 0.0  #: its duration
    obstacle: Obstacle = ""
    """An obstacle unrelated to the case: another run in its folder, a file that cannot be written,
    the end of its process; "" for none."""

    @property
    def failed(self) -> bool:
        """Whether it failed."""
        return bool(self.message)


class Stop(Progress):
    """Stops a run after a step when its process shall end, since PETSc would lose an exception."""

    wanted: ClassVar[bool] = False  #: whether this process shall end

    def __init__(self) -> None:
        super().__init__(verbosity=-1, terminal=False)

    def update(
        self, position: float, time_s: float, newton: int, step: float, note: str = ""
    ) -> None:
        """Log the progress of a step, and stop after it if wanted.

        Raises:
            KeyboardInterrupt: The process shall end.
        """
        super().update(position, time_s, newton, step, note)
        if self.wanted:
            raise KeyboardInterrupt("stopped with the command that had started it")


def work(job: Job, comm: MPI.Comm | None = None) -> Outcome:
    """Run a case; any error becomes the message of the outcome.

    A run in another thread of this process is waited for.

    Args:
        job: The run.
        comm: Ranks of the run (collective); None for this process alone.
    """
    with one_at_a_time(wait=True):
        return _alone(job, comm)


def _alone(job: Job, comm: MPI.Comm | None) -> Outcome:
    from mpi4py import MPI

    from castfem.base import log

    if comm is None and MPI.COMM_WORLD.size > 1 and "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        petsc4py.init(comm=MPI.COMM_SELF)  # other ranks of an executor need not take part
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
        gc.collect()  # meshes and their communicators are in reference cycles
    return Outcome("", time.perf_counter() - begun)


_PATIENCE = 5.0  # s for a process to end its run in order
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_starting = threading.Lock()


class ProcessEnded(RuntimeError):
    """A process has ended before its call."""


class Processes(Executor):
    """Makes calls in processes of this machine.

    Args:
        count: Largest number of processes; each is started when needed.
        noise: File for the output of libraries in the processes.
    """

    def __init__(self, count: int, noise: Path) -> None:
        self._threads = ThreadPoolExecutor(count)
        self._noise, self._closing = noise, False
        self._idle: list[_Process] = []
        self._busy: list[_Process] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **keywords: Any) -> Future[Any]:
        """Make a call; the result raises `ProcessEnded` if the process dies."""
        return self._threads.submit(self._call, partial(function, *args, **keywords))

    def _call(self, call: Callable[[], object]) -> object:
        try:
            process = self._idle.pop()
        except IndexError:
            process = _Process(self._noise)
        self._busy.append(process)
        try:
            if self._closing:  # while it was being started
                process.process.terminate()
            value, error = process.call(call)
            self._idle.append(process)
        finally:
            self._busy.remove(process)
        if error is not None:
            raise error
        return value

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their calls, or at once: a run records that it was stopped."""
        self._closing = cancel_futures
        self._threads.shutdown(wait=not cancel_futures, cancel_futures=cancel_futures)
        busy, idle = list(self._busy), list(self._idle)
        for one in busy:
            one.process.terminate()
        for one in idle:
            one.connection.close()
        end = time.monotonic() + _PATIENCE
        for one in (*idle, *busy):
            one.process.join(max(0.0, end - time.monotonic()))
            if one.process.is_alive():
                one.process.kill()
                one.process.join()
        self._threads.shutdown()


class _Process:
    """A process that makes calls."""

    def __init__(self, noise: Path) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would share MPI's resources
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, noise), daemon=True)
        try:
            with _starting, _one_thread_each():
                self.process.start()
        except BrokenPipeError:
            raise ProcessEnded("its process ended during its start") from None
        finally:
            other.close()

    def call(self, call: Callable[[], object]) -> tuple[object, Exception | None]:
        """Make a call in the process; return its value and its exception, if any."""
        try:
            self.connection.send(call)
            value, error = self.connection.recv()
        except (EOFError, OSError):
            self.process.join(_PATIENCE)
            raise ProcessEnded(_death(self.process.exitcode)) from None
        return value, error


def _death(code: int | None) -> str:
    """Describe how a process ended."""
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        hint = " (out of memory?)" if name == "SIGKILL" else ""
        return f"its process was ended by {name}{hint}"
    return f"its process ended with status {code}"


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Restrict processes started here to one thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(connection: Connection, noise: Path) -> None:
    """Make the incoming calls until the other end is closed (in the process)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent decides
    process.keep_hangup()
    for number in process.STOPS.keys() - {signal.SIGINT}:
        if signal.getsignal(number) is not signal.SIG_IGN:  # such as under nohup
            signal.signal(number, lambda *_: setattr(Stop, "wanted", True))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with open(noise, "ab", buffering=0) as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    try:
        while True:
            call = connection.recv()
            found: tuple[object, Exception | None]
            try:
                found = call(), None
            except Exception as error:
                found = None, error
            connection.send(found)
            if not gc.get_freeze_count():
                gc.freeze()  # modules stay: no search for garbage in them at the end of each run
    except (EOFError, OSError):
        pass  # the parent needs no more runs, or has ended
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGTERM)


def _end_with_parent() -> None:
    """Stop this process when its parent has ended: after its step, or at once."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)
        os.kill(os.getpid(), signal.SIGKILL)
