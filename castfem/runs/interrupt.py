"""A wish to stop a run: obeyed between two steps, for within PETSc an exception would be lost.

The signals are Ctrl-C, SIGTERM, which batch systems send before they kill, SIGHUP, and SIGUSR1,
which mpirun passes on to its ranks without killing them.
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
ONE = 1.0  # s: `timeout`, for one, sends its signal to the program and then to its group


class Stopped(KeyboardInterrupt):
    """A run was stopped after a step that is kept, the same one on all ranks; it may be resumed."""


class Interrupt(Closing):
    """While it is entered, the first signal to stop is only noted; a later one acts at once.

    SIGUSR1 never does: a batch system that signals a whole job reaches a rank twice, itself and
    through mpirun, and Python runs the handler of the second only when the rank no longer waits
    within MPI for the others, which can be seconds later.

    It leaves signals alone that somebody else handles, and off the main thread, where Python
    delivers none.

    Args:
        comm: Ranks that run together: a signal to any of them stops all.

    Attributes:
        wanted: Number of the signal by which this rank was asked to stop, 0 for none.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.wanted = 0
        self._comm, self._since = comm, 0.0
        self._previous: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Stop here if that is wanted (collective)."""
        comm = self._comm
        number = self.wanted if comm.size == 1 else comm.allreduce(self.wanted, op=MPI.MAX)
        if number:
            stop = Stopped(process.STOPS[signal.Signals(number)])
            stop.add_note("The last step is kept; resume=True goes on from it.")
            raise stop

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in process.STOPS:
                if process.is_ours(number):
                    self._previous[number] = signal.signal(number, self._note)
        return self

    def close(self) -> None:
        """Let the signals do what they did before, SIGUSR1 if it has not stopped this."""
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
