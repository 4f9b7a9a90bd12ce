"""Stops a run on a signal, between two steps, since within PETSc an exception would be lost.

The signals are Ctrl-C, SIGTERM (sent by batch systems before they kill), SIGHUP, and SIGUSR1, which
mpirun passes on to its ranks without killing them.
"""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType
from typing import Any, Self

from mpi4py import MPI

from castfem.base import log, process
from castfem.base.atomic_files import Closing

USR1 = signal.SIGUSR1
ONE = 1.0  # s: `timeout`, for example, signals the program and then its group


class Stopped(KeyboardInterrupt):
    """A run was stopped after a saved step, the same on all ranks; it may be resumed."""


class Interrupt(Closing):
    """Context in which the first stop signal is only recorded; a later one acts at once.

    SIGUSR1 never acts at once: a batch system that signals a whole job reaches a rank twice,
    directly and through mpirun, and Python runs the handler of the second only when the rank no
    longer waits within MPI for the others, which can be seconds later.

    Signals that have another handler are left alone, and so are all off the main thread, where
    Python delivers none.

    Args:
        comm: Ranks of the run: a signal to any of them stops all.

    Attributes:
        wanted: Number of the signal that asked this rank to stop, 0 for none.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.wanted = 0
        self._comm, self._since = comm, 0.0
        self._previous: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Stop here if a signal has requested it (collective)."""
        comm = self._comm
        number = self.wanted if comm.size == 1 else comm.allreduce(self.wanted, op=MPI.MAX)
        if number:
            stop = Stopped(process.STOPS[signal.Signals(number)])
            stop.add_note("The last step is kept; resume=True continues from it.")
            raise stop

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in process.STOPS:
                if process.is_ours(number):
                    self._previous[number] = signal.signal(number, self._note)
        return self

    def close(self) -> None:
        """Restore the previous handlers; that of SIGUSR1 only if it has not stopped this run."""
        while self._previous:
            number, previous = self._previous.popitem()
            signal.signal(number, process.told if number == self.wanted == USR1 else previous)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.wanted:
            if number != USR1 and time.monotonic() - self._since >= ONE:
                self.close()
                signal.raise_signal(number)
            return
        self.wanted, self._since = number, time.monotonic()
        log.logger.warning("stopping after this step; a second signal stops at once")
