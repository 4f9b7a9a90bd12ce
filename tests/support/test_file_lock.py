"""A lock keeps two apart; a file system without locks stops neither a run nor a sweep."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path

import pytest
from filelock import FileLock, Timeout

from castfem.output.folder import OutputFolder
from castfem.support.file_lock import taken
from castfem.sweep.record import Entry, Record


def without_locks(descriptor: int, operation: int) -> None:
    """flock() of a file system that has no locks, as some network mounts."""
    raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))


def test_one_at_a_time(tmp_path: Path) -> None:
    first, second = (FileLock(tmp_path / "lock", timeout=0) for _ in range(2))
    assert taken(first)
    with pytest.raises(Timeout):
        taken(second)
    first.release()
    assert taken(second)


def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What filelock makes of it, an exception or a lock by the file's existence, stops nobody."""
    monkeypatch.setattr(fcntl, "flock", without_locks)
    lock = FileLock(tmp_path / "lock")
    assert taken(lock) == lock.is_locked
    lock.release()
    for _ in range(2):  # the second run finds what the first has left
        folder = OutputFolder(tmp_path / "run")
        folder.begin('title = "a case"\n')
        folder.close()
        assert not OutputFolder(tmp_path / "run").is_running()
    record = Record(tmp_path / "sweep")
    with record.shared():
        record.entries["one"] = Entry(label="kept")
    assert Record(tmp_path / "sweep").entries["one"].label == "kept"
