"""Runs of a sweep in processes of this machine, one thread each.

A process does one run after the other, so that DOLFINx is imported once in each. One that dies, of
whatever, costs its run alone: a new one takes its place.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from pathlib import Path

from castfem.base import process
from castfem.base.atomic_files import Closing
from castfem.studies.sweep.work import Job, Outcome, Stop, work

_TICK = 0.25  # s between two looks at the progress
_AGAIN = 2  # how often a run is taken up whose process was killed
_PATIENCE = 5.0  # s for a process to end its run in order
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def run_locally(
    jobs: Sequence[Job],
    processes: int,
    noise: Path,
    begun: Callable[[Job], None],
    ended: Callable[[Job, Outcome], None],
    tick: Callable[[], None],
) -> None:
    """Do all jobs; return when the last has ended. An exception, Ctrl-C too, stops all of them.

    Args:
        jobs: What to run, in this order.
        processes: How many at once.
        noise: File for what libraries print in the processes.
        begun: Called when a job is given to a process.
        ended: Called when it has ended.
        tick: Called a few times a second.
    """
    with Team(processes, noise) as team:
        team.run(jobs, begun, ended, tick)


class Team(Closing):
    """Processes that stay for further jobs: what they have imported and compiled serves all.

    Args:
        processes: How many at once, at most; each is started when there is a job for it.
        noise: File for what libraries print in the processes.
    """

    def __init__(self, processes: int, noise: Path) -> None:
        self._processes, self._noise = processes, noise
        self._team: list[_Worker] = []

    def run(
        self,
        jobs: Sequence[Job],
        begun: Callable[[Job], None],
        ended: Callable[[Job, Outcome], None],
        tick: Callable[[], None],
    ) -> None:
        """Do all jobs; return when the last has ended. See `run_locally`.

        A job whose process is killed goes on from its checkpoint in another one, twice at most.
        """
        waiting, team = list(reversed(jobs)), self._team
        killed: Counter[str] = Counter()
        with _one_thread_each():
            while waiting or any(worker.job for worker in team):
                idle = sum(worker.job is None for worker in team)
                while len(waiting) > idle and len(team) < self._processes:
                    team.append(_Worker(self._noise))
                    idle += 1
                for worker in team:
                    if worker.job is None and waiting:
                        if not killed[waiting[-1].name]:
                            begun(waiting[-1])
                        worker.give(waiting.pop())
                wait([w.connection for w in team if w.job], timeout=_TICK)
                for worker in list(team):
                    job, outcome = worker.job, worker.outcome()
                    if job is not None and outcome is not None:
                        killed[job.name] += worker.lost
                        if worker.lost and killed[job.name] <= _AGAIN:
                            waiting.append(replace(job, resume=True))
                        else:
                            ended(job, outcome)
                    if worker.lost:
                        team.remove(worker)
                tick()

    def close(self) -> None:
        """End the processes; a run that is at work notes that it was stopped."""
        _dismiss(self._team)
        self._team = []


class _Worker:
    """A process and the job it has."""

    def __init__(self, noise: Path) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would share what MPI has set up
        self.connection, other = context.Pipe()
        self.job: Job | None = None
        self.lost = False
        self._since = 0.0
        self.process = context.Process(target=_serve, args=(other, noise), daemon=True)
        self.process.start()
        other.close()

    def give(self, job: Job) -> None:
        """Hand over a job; that the process is gone shows when its outcome is asked for."""
        self.job, self._since = job, time.perf_counter()
        try:
            self.connection.send(job)
        except OSError:
            self.lost = True

    def outcome(self) -> Outcome | None:
        """Return how the job has ended, None while it has not."""
        if self.job is None:
            return None
        found: Outcome | None = None
        try:
            if self.connection.poll():
                found = self.connection.recv()
        except (EOFError, OSError):
            self.lost = True
        if self.lost:
            self.process.join(_PATIENCE)
            seconds = time.perf_counter() - self._since
            found = Outcome(_death(self.process.exitcode), seconds, "process")
        if found is not None:
            self.job = None
        return found


def _death(code: int | None) -> str:
    """Say how a process came to its end."""
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        hint = " (out of memory?)" if name == "SIGKILL" else ""
        return f"its process was ended by {name}{hint}"
    return f"its process ended with status {code}"


def _dismiss(team: Sequence[_Worker]) -> None:
    """End the processes: those with a job note in its folder that it was stopped."""
    for worker in team:
        if worker.job is not None:
            worker.process.terminate()
        worker.connection.close()
    end = time.monotonic() + _PATIENCE
    for worker in team:
        worker.process.join(max(0.0, end - time.monotonic()))
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that are started here compute with one thread, and PETSc leave signals be."""
    before = dict(os.environ)
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    options = before.get("PETSC_OPTIONS", "")
    if "no_signal_handler" not in options:
        os.environ["PETSC_OPTIONS"] = f"{options} -no_signal_handler".strip()
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _serve(connection: Connection, noise: Path) -> None:
    """Do the jobs that come, until the other end is closed (in the process)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all; the parent decides
    stop = Stop()
    process.keep_hangup()
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as below nohup
            signal.signal(number, lambda *_: setattr(stop, "wanted", True))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with open(noise, "ab", buffering=0) as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    try:
        while True:
            connection.send(work(connection.recv(), stop))
            if not gc.get_freeze_count():
                gc.freeze()  # what is imported stays: each run's end need not look through it
    except (EOFError, OSError):
        pass  # the parent needs no more runs, or is gone
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGTERM)


def _end_with_parent() -> None:
    """Stop this process when its parent is gone, killed perhaps: after its step, or without."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)
        os.kill(os.getpid(), signal.SIGKILL)
