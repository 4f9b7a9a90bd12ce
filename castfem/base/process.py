"""A process of castfem: the signals that stop it, one run at a time in it, and what a run leaves.

A signal from the user, a batch system or a closing terminal ends a command like Ctrl-C: in order,
with a message, and with completed work on disk.
"""

from __future__ import annotations

import gc
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from castfem.base.errors import InputError

STOPS: dict[signal.Signals, str] = {
    signal.SIGINT: "stopped by the user",
    signal.SIGTERM: "stopped by SIGTERM, as sent by a batch system before it kills",
    signal.SIGHUP: "stopped by SIGHUP, as sent by a closing terminal or connection",
    signal.SIGUSR1: "stopped by SIGUSR1, which mpirun passes on to its ranks",
}
"""The signals, and the recorded reason of a run stopped by them."""


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle one of the signals as Python handles Ctrl-C.

    Raises:
        KeyboardInterrupt: Always, with the reason.
    """
    raise KeyboardInterrupt(STOPS[signal.Signals(number)])


def told(number: int, frame: FrameType | None) -> None:
    """Handle a repeated signal: a batch system's may reach a rank twice."""


def stop_by_all() -> None:
    """Let each of the signals interrupt this process, except signals with another handler.

    `nohup`, for example, ignores SIGHUP.
    """
    if threading.current_thread() is threading.main_thread():
        for number in STOPS:
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, interrupt)


def keep_hangup() -> None:
    """Keep UCX, a transport of MPI, from using SIGHUP for debugging, which would end nothing.

    UCX reads the environment when MPI is initialised.
    """
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")


def is_ours(number: signal.Signals) -> bool:
    """Whether a signal still has Python's initial handler, or castfem's."""
    usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    return signal.getsignal(number) in (usual, interrupt, told)


def reason_of(stop: KeyboardInterrupt) -> str:
    """Reason why a run was stopped, one line."""
    return str(stop) or STOPS[signal.SIGINT]


_running = threading.RLock()  # a run may start others in its own thread


@contextmanager
def one_at_a_time(*, wait: bool = False) -> Iterator[None]:
    """Prevent other threads from running a case within the block; `wait` for a running one.

    Raises:
        InputError: Another thread runs a case, and `wait` is false.
    """
    if not _running.acquire(blocking=wait):
        raise InputError(
            "another thread of this process runs a case; run one after the other, or in processes "
            "of their own (castfem sweep, multiprocessing)"
        )
    try:
        yield
    finally:
        _running.release()


@contextmanager
def collected() -> Iterator[None]:
    """Free objects made in the block that are in reference cycles, such as meshes, communicators.

    Python's collector does not search older objects such as imported modules, which would take as
    long as a short run. Objects frozen by the caller (`gc.freeze`) remain frozen.
    (Collective, as freeing some of the objects is.)
    """
    frozen = gc.get_freeze_count() > 0
    if not frozen:
        gc.freeze()
    try:
        yield
    finally:
        gc.collect()
        if not frozen:
            gc.unfreeze()
