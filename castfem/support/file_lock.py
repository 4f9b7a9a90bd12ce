"""Locks on files, where the file system has any."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import FileLock

NO_LOCKS = NotImplementedError
"""What filelock 3 raises where flock() answers ENOSYS; later versions go by whether a file exists.

It is filelock's own choice of a type: nothing here is left to be implemented.
"""


def taken(lock: FileLock) -> bool:
    """Whether the lock was taken; False where the file system has none, as on some network mounts.

    There processes cannot be kept apart, and what they write has to do.

    Raises:
        filelock.Timeout: Another process has it.
    """
    try:
        lock.acquire()
    except NO_LOCKS:
        return False
    return True
