"""A lock keeps two apart; a file system without locks stops neither a run nor a sweep."""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from pathlib import Path

import h5py
import pytest
from filelock import FileLock, Timeout

from castfem.base.atomic_files import folder_refused, saving, taken
from castfem.base.errors import RunFailure
from castfem.runs.output.field_files import open_hdf5
from castfem.runs.output.folder import OutputFolder
from castfem.studies.sweep.record import Entry, Record


@pytest.fixture(params=[errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, 524])
def without_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes flock() that of a file system without locks, as some network mounts are."""

    def refuse(descriptor: object, operation: int) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr(fcntl, "flock", refuse)


def test_one_at_a_time(tmp_path: Path) -> None:
    first, second = (FileLock(tmp_path / "lock", timeout=0) for _ in range(2))
    assert taken(first)
    with pytest.raises(Timeout):
        taken(second)
    first.release()
    assert taken(second)


@pytest.mark.usefixtures("without_locks")
def test_a_file_system_without_locks(tmp_path: Path) -> None:
    """What filelock makes of it, an exception or a lock by the file's existence, stops nobody."""
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


def test_who_waits_has_it_as_soon_as_it_is_free(tmp_path: Path) -> None:
    first = FileLock(tmp_path / "lock", timeout=0, thread_local=False)
    second = FileLock(tmp_path / "lock")
    assert taken(first)
    free = threading.Timer(0.2, first.release)
    free.start()
    assert taken(second)
    assert not free.is_alive() and not first.is_locked


def test_a_refusal_of_another_kind_is_no_lack_of_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(descriptor: object, operation: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", interrupted)
    with pytest.raises(OSError, match="lock") as refused:  # Timeout is one
        taken(FileLock(tmp_path / "lock", timeout=0))
    assert isinstance(refused.value, Timeout) or refused.value.filename == str(tmp_path / "lock")


def test_fields_are_read_without_a_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 has locks of its own, and gives up for others than ENOSYS; h5py is told not to ask."""
    asked = []

    def opened(path: Path, mode: str, **options: object) -> None:
        asked.append((mode, options))

    monkeypatch.setattr(h5py, "File", opened)
    open_hdf5(tmp_path / "fields.h5")
    assert asked == [("r", {"locking": False})]


# What is said of a folder that cannot be written


def test_the_reason_stands_there_once() -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    said = "out: cannot be written (No space left on device); choose another with -o"
    assert folder_refused(Path("out"), full) == said
    with pytest.raises(RunFailure) as caught, saving(Path("out/sweep.json")):
        raise full
    assert folder_refused(Path("out"), caught.value) == said
