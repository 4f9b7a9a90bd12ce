"""One run at a time in a process: solver, log and HDF5 are the same for all of its threads."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from castfem.base.errors import InputError

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
