"""Locks on files, where the file system has any."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import FileLock


def taken(lock: FileLock) -> bool:
    """Whether the lock was taken; False where the file system has none, as on some network mounts.

    There processes cannot be kept apart, and what they write has to do.

    Raises:
        filelock.Timeout: Another process has it.
    """
    try:
        lock.acquire()
    except NotImplementedError:  # filelock 3 where flock() answers ENOSYS; 4 goes by a file instead
        return False
    return True
