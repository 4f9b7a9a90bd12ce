"""Locks on files, where the file system has any."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import FileLock


def taken(lock: FileLock) -> bool:
    """Whether the lock was taken; False where the file system has none, as on some network mounts.

    There processes cannot be kept apart, and what they write has to do. flock() answers ENOSYS
    there, for which filelock 3 has an error of its own; all other errors pass. filelock 4 goes by a
    file of its own instead, and raises nothing.

    Raises:
        filelock.Timeout: Another process has it.
    """
    try:
        lock.acquire()
    except NotImplementedError:
        # Reason: a file system without locks is no fault of the run, which must write its results
        # there, too. filelock raises this for ENOSYS alone, so no other error is hidden by it; who
        # calls is told by False that nothing keeps other processes out.
        return False
    return True
