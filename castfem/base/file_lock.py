"""Locks on files, where the file system has any."""

from __future__ import annotations

import errno
import fcntl
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import FileLock


_PAUSE = 0.05  # s between two tries
# What flock() answers where there are none; the last is ENOTSUPP, which has no name in Python.
_NONE = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, 524}


def taken(lock: FileLock) -> bool:
    """Whether the lock was taken; False where the file system has none, as on some network mounts.

    There processes cannot be kept apart, and what they write has to do: that is no fault of the
    run, which must write its results there, too.

    Args:
        lock: Of filelock; a `timeout` of 0 does not wait, any other waits as long as it takes.

    Raises:
        filelock.Timeout: Another process has it.
    """
    from filelock import Timeout

    while True:
        try:
            lock.acquire(timeout=0)
        except NotImplementedError:  # reason: filelock raises it for ENOSYS, no locks on this disk
            return False
        except Timeout:
            if not _has_locks(Path(lock.lock_file)):
                return False
            if lock.timeout == 0:
                raise
            time.sleep(_PAUSE)
        else:
            return True


def _has_locks(path: Path) -> bool:
    """Whether files may be locked there: filelock takes any other answer for a lock of others."""
    with open(path, "ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno not in _NONE
    return True
