"""A process of castfem: the signals that stop it, one run at a time in it, and what a run leaves.

A signal of the user, of a batch system or of a terminal that closes ends a command as Ctrl-C does:
in order, with a line, and with what is done on disk.
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
    signal.SIGTERM: "stopped by SIGTERM, as a batch system sends it before it kills",
    signal.SIGHUP: "stopped by SIGHUP, as a terminal or a connection sends it when it closes",
    signal.SIGUSR1: "stopped by SIGUSR1, which mpirun passes on to its ranks",
}
"""The signals, and what is noted of a run that one of them has stopped."""


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle one of the signals as Python handles Ctrl-C.

    Raises:
        KeyboardInterrupt: Always; it says why.
    """
    raise KeyboardInterrupt(STOPS[signal.Signals(number)])


def told(number: int, frame: FrameType | None) -> None:
    """Handle a signal that has been obeyed already: a batch system's may reach a rank twice."""


def stop_by_all() -> None:
    """Let each of the signals interrupt this process, except those that are handled already.

    `nohup`, for one, has SIGHUP ignored.
    """
    if threading.current_thread() is threading.main_thread():
        for number in STOPS:
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, interrupt)


def keep_hangup() -> None:
    """Keep UCX, a transport of MPI, from taking SIGHUP for a wish to debug: it ends nothing then.

    It looks at the environment when MPI is initialised.
    """
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")


def is_ours(number: signal.Signals) -> bool:
    """Whether a signal does what it did when Python started, or what castfem made it do."""
    usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    return signal.getsignal(number) in (usual, interrupt, told)


def reason_of(stop: KeyboardInterrupt) -> str:
    """Why a run was stopped, one line."""
    return str(stop) or STOPS[signal.SIGINT]


_running = threading.RLock()  # a run may have others within, in its own thread


@contextmanager
def one_at_a_time(*, wait: bool = False) -> Iterator[None]:
    """Keep other threads from running a case as long as the block lasts; `wait` for one that does.

    Raises:
        InputError: Another thread runs one, and it is not waited for.
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
    """Free what the block has made, though it stands in cycles, as meshes and communicators do.

    Python's collector does not look through what there was before, all that is imported: that would
    take as long as a short run.  Whoever has frozen it himself (`gc.freeze`) finds it frozen.
    (Collective: what it frees may be.)
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
