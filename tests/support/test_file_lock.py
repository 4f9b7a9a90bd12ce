"""A lock keeps two apart; a file system without locks stops neither a run nor a sweep."""

from __future__ import annotations

from pathlib import Path

import pytest
from filelock import FileLock, Timeout

from castfem.output.folder import OutputFolder
from castfem.support.file_lock import taken
from castfem.sweep.record import Entry, Record


def without_locks(self: FileLock) -> None:
    """As filelock's own `_acquire` ends where flock() answers ENOSYS."""
    # Its type is what is tested: `taken` must know it from any other failure.
    raise NotImplementedError("FileSystem does not appear to support flock")


def test_one_at_a_time(tmp_path: Path) -> None:
    first, second = (FileLock(tmp_path / "lock", timeout=0) for _ in range(2))
    assert taken(first)
    with pytest.raises(Timeout):
        taken(second)
    first.release()
    assert taken(second)


def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FileLock, "_acquire", without_locks)
    assert not taken(FileLock(tmp_path / "lock"))
    assert not OutputFolder(tmp_path).is_running()
    record = Record(tmp_path / "sweep")
    with record.shared():
        record.entries["one"] = Entry(label="kept")
    assert Record(tmp_path / "sweep").entries["one"].label == "kept"
