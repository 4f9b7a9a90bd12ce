"""What is compiled is kept on disk and renewed; a lock keeps two apart, where there are locks."""

from __future__ import annotations

import errno
import fcntl
import importlib
import os
import sys
import threading
from pathlib import Path
from typing import Any

import h5py
import pytest
from filelock import FileLock, Timeout

from castfem.base.atomic_files import folder_refused, saving, taken
from castfem.base.compiled import outermost
from castfem.base.errors import RunFailure
from castfem.runs.output.field_files import open_hdf5
from castfem.runs.output.folder import OutputFolder
from castfem.studies.sweep.record import Entry, Record

FILES = {
    "constants.py": "FACTOR = 2.0\n",
    "inner.py": (
        "from castfem.base.compiled import compiled\n\n"
        "@compiled\ndef deepest(x):\n    return x + 1.0\n\n"
        "@compiled\ndef inner(x):\n    return deepest(x)\n"
    ),
    "outer.py": (
        "from castfem.base.compiled import outermost\n"
        "from toy.constants import FACTOR\nfrom toy.inner import inner\n\n"
        "@outermost\ndef outer(x, sources=None):\n    return FACTOR * inner(x) + 5.0\n"
    ),
}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with an outermost function that is compiled with two others and a constant."""
    folder = tmp_path / "toy"
    folder.mkdir()
    for name, text in {"__init__.py": "", **FILES}.items():
        (folder / name).write_text(text)
        os.utime(folder / name, (1e9, 1e9))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # which would be found stale by the time
    return folder


def anew() -> Any:
    """The outermost function as a new process would import it."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return importlib.import_module("toy.outer").outer


def answer(found: bool) -> float:
    """Its value at 3, having seen whether it was found on disk."""
    outer = anew()
    value = float(outer(3.0))
    assert sum(outer.stats.cache_hits.values()) == found
    assert sum(outer.stats.cache_misses.values()) == (not found)
    return value


@pytest.mark.parametrize(
    ("file", "before", "after", "expected"),
    [
        ("inner.py", "+ 1.0", "+ 2.0", 15.0),
        ("constants.py", "2.0", "3.0", 17.0),
    ],
)
def test_a_change_of_any_file_is_seen(
    toy: Path, file: str, before: str, after: str, expected: float
) -> None:
    """Even where it leaves the file's length and time, as of two versions installed."""
    assert answer(found=False) == 13.0
    assert answer(found=True) == 13.0
    text = (toy / file).read_text()
    assert text.count(before) == 1
    (toy / file).write_text(text.replace(before, after))
    os.utime(toy / file, (1e9, 1e9))
    assert answer(found=False) == expected
    assert answer(found=True) == expected


def test_no_place_to_keep_it(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then it is compiled in every process."""

    def refused(path: str, exist_ok: bool = False) -> None:
        raise PermissionError(path)

    monkeypatch.setattr(os, "makedirs", refused)
    for _ in range(2):
        assert answer(found=False) == 13.0
    assert not list(toy.rglob("*.nbi"))


@pytest.mark.parametrize(("kind", "kept"), [("*.nbc", 0.5), ("*.nbi", 0.99)])
def test_a_damaged_file_is_compiled_anew(toy: Path, kind: str, kept: float) -> None:
    """And replaced: the next process finds it whole."""
    assert answer(found=False) == 13.0
    (path,) = toy.rglob(kind)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    assert answer(found=False) == 13.0
    assert answer(found=True) == 13.0


def test_a_full_disk_keeps_nothing(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    outer = anew()
    monkeypatch.setattr("os.replace", full)
    assert float(outer(3.0)) == 13.0
    monkeypatch.undo()


def test_each_is_called_directly(toy: Path) -> None:
    """Without a line of Python between, of which numba needs many to look a function up anew."""

    @outermost
    def other(x, sources=None):  # type: ignore[no-untyped-def]
        return x + 2.0

    functions = anew(), other
    assert [function(1.0) for function in functions] == [9.0, 3.0]
    assert len({function.py_func.__defaults__ for function in functions}) == 2
    calls: list[str] = []
    sys.setprofile(lambda frame, event, _: calls.append(event) if event == "call" else None)
    try:
        for function in functions:
            function(1.0)
    finally:
        sys.setprofile(None)
    assert not calls


def test_without_the_argument() -> None:
    def plain(x: float) -> float:
        return x

    with pytest.raises(TypeError, match="plain needs sources=None as its last argument"):
        outermost(plain)


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
