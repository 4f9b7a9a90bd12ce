"""Compiled code is kept on disk and renewed; a lock keeps two processes apart, if supported."""

from __future__ import annotations

import ast
import errno
import fcntl
import importlib
import json
import os
import subprocess
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
        "@outermost\ndef outer(x):\n    return FACTOR * inner(x) + 5.0\n"
    ),
}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a package with an outermost function compiled with two others and a constant."""
    folder = tmp_path / "toy"
    folder.mkdir()
    for name, text in {"__init__.py": "", **FILES}.items():
        (folder / name).write_text(text)
        os.utime(folder / name, (1e9, 1e9))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("castfem.base.compiled.cache_folder", lambda: folder)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it would be stale by its time
    return folder


def reimported() -> Any:
    """Return the outermost function as a new process would import it."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return importlib.import_module("toy.outer").outer


def answer(found: bool) -> float:
    """Return its value at 3, and check whether it was found on disk."""
    outer = reimported()
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
def test_change_of_any_file_is_noticed(
    toy: Path, file: str, before: str, after: str, expected: float
) -> None:
    """Also a change that keeps length and time of the file, as between two installed versions."""
    assert answer(found=False) == 13.0
    assert answer(found=True) == 13.0
    text = (toy / file).read_text()
    assert text.count(before) == 1
    (toy / file).write_text(text.replace(before, after))
    os.utime(toy / file, (1e9, 1e9))
    assert answer(found=False) == expected
    assert answer(found=True) == expected


def test_without_a_folder_nothing_is_kept(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is then compiled in every process."""

    def refused(path: str, exist_ok: bool = False) -> None:
        raise PermissionError(path)

    monkeypatch.setattr(os, "makedirs", refused)
    for _ in range(2):
        assert answer(found=False) == 13.0
    assert not list(toy.rglob("*.nbi"))


@pytest.mark.parametrize(("kind", "kept"), [("*.nbc", 0.5), ("*.nbi", 0.99)])
def test_damaged_file_is_compiled_again(toy: Path, kind: str, kept: float) -> None:
    """It is replaced: the next process finds a complete one."""
    assert answer(found=False) == 13.0
    (path,) = toy.rglob(kind)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    assert answer(found=False) == 13.0
    assert answer(found=True) == 13.0


def test_code_for_other_types_is_not_used(toy: Path) -> None:
    """Two processes that compile at the same time may write into the same file."""
    outer = reimported()
    assert (outer(3.5), outer(3)) == (14.0, 13.0)
    first, second = sorted(toy.rglob("*.nbc"))
    first.write_bytes(second.read_bytes())
    assert reimported()(3.5) == 14.0
    assert answer(found=True) == 13.0


def test_full_disk_keeps_nothing(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    outer = reimported()
    monkeypatch.setattr("os.replace", full)
    assert float(outer(3.0)) == 13.0
    monkeypatch.undo()


def test_functions_are_called_directly(toy: Path) -> None:
    """Without a line of Python in between; numba needs many to look a function up again."""

    @outermost
    def other(x):  # type: ignore[no-untyped-def]
        return x + 2.0

    functions = reimported(), other
    assert [function(1.0) for function in functions] == [9.0, 3.0]
    assert len({function._cache.cache_path for function in functions}) == 2
    calls: list[str] = []
    sys.setprofile(lambda frame, event, _: calls.append(event) if event == "call" else None)
    try:
        for function in functions:
            function(1.0)
    finally:
        sys.setprofile(None)
    assert not calls


@pytest.fixture(params=[errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, 524])
def without_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let flock() fail as on a file system without locks, as some network mounts are."""

    def refuse(descriptor: object, operation: int) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr(fcntl, "flock", refuse)


def test_lock_admits_one_at_a_time(tmp_path: Path) -> None:
    first, second = (FileLock(tmp_path / "lock", timeout=0) for _ in range(2))
    assert taken(first)
    with pytest.raises(Timeout):
        taken(second)
    first.release()
    assert taken(second)


@pytest.mark.usefixtures("without_locks")
def test_file_system_without_locks_is_supported(tmp_path: Path) -> None:
    """With filelock's reaction, an exception or a lock by an existing file, nobody is blocked."""
    lock = FileLock(tmp_path / "lock")
    assert taken(lock) == lock.is_locked
    lock.release()
    for _ in range(2):  # the second run finds the files of the first
        folder = OutputFolder(tmp_path / "run")
        folder.begin('title = "a case"\n')
        folder.close()
        assert not OutputFolder(tmp_path / "run").is_running()
    record = Record(tmp_path / "sweep")
    with record.shared():
        record.entries["one"] = Entry(label="kept")
    assert Record(tmp_path / "sweep").entries["one"].label == "kept"


def test_waiting_process_gets_the_lock_when_released(tmp_path: Path) -> None:
    first = FileLock(tmp_path / "lock", timeout=0, thread_local=False)
    second = FileLock(tmp_path / "lock")
    assert taken(first)
    free = threading.Timer(0.2, first.release)
    free.start()
    assert taken(second)
    assert not free.is_alive() and not first.is_locked


def test_other_refusals_do_not_count_as_missing_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(descriptor: object, operation: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", interrupted)
    with pytest.raises(OSError, match="lock") as refused:  # Timeout is one
        taken(FileLock(tmp_path / "lock", timeout=0))
    assert isinstance(refused.value, Timeout) or refused.value.filename == str(tmp_path / "lock")


def test_fields_are_read_without_a_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 has own locks, and fails on errors other than ENOSYS; h5py is told to use none."""
    calls = []

    def opened(path: Path, mode: str, **options: object) -> None:
        calls.append((mode, options))

    monkeypatch.setattr(h5py, "File", opened)
    open_hdf5(tmp_path / "fields.h5")
    assert calls == [("r", {"locking": False})]


# Messages about a folder that cannot be written


def test_reason_is_reported_once() -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    message = "out: cannot be written (No space left on device); choose another with -o"
    assert folder_refused(Path("out"), full) == message
    with pytest.raises(RunFailure) as caught, saving(Path("out/sweep.json")):
        raise full
    assert folder_refused(Path("out"), caught.value) == message


# h5py and MPI are loaded before DOLFINx in any order of imports; without it, how to get it.


ROOT = Path(__file__).parents[2]
LATER = ("dolfinx", "petsc4py")
# A new process for each, forked from one that has loaded only modules without effect on the order.
FORKED = """
import json, os, sys
import castfem, castfem.model, numba, scipy.optimize, scipy.sparse.linalg, ufl
from importlib import import_module
assert not {"h5py", "mpi4py", "dolfinx", "petsc4py"} & sys.modules.keys()
for name in sys.argv[1:]:
    if os.fork() == 0:
        import_module(name)
        print(json.dumps([name, list(sys.modules)]), flush=True)
        os._exit(0)
    os.wait()
"""


def first_modules() -> list[str]:
    """Return, for each package that loads DOLFINx or petsc4py, a module that does so itself."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / "castfem").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in LATER:
                module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                found.setdefault(path.parent.name, module)
    return list(found.values())


def test_each_package_may_be_loaded_first() -> None:
    modules = ["castfem.fem.snes", *first_modules()]
    done = subprocess.run(
        [sys.executable, "-c", FORKED, *modules], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    loaded = dict(json.loads(line) for line in done.stdout.splitlines())
    assert set(loaded) == set(modules), done.stderr
    seen = 0
    for name, order in loaded.items():
        late = [order.index(one) for one in LATER if one in order]
        seen += bool(late)
        for earlier in ("h5py", "mpi4py.MPI") if late else ():
            assert order.index(earlier) < min(late), name
    assert seen > 5


def test_script_may_load_dolfinx_itself(tmp_path: Path) -> None:
    """If its HDF5 then prevents h5py, one line contains the fix."""
    (tmp_path / "dolfinx.py").touch()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}

    def output(h5py: str, script: str) -> str:
        (tmp_path / "h5py.py").write_text(h5py, encoding="utf-8")
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True
        )
        return done.stdout + done.stderr

    failed = output("raise ValueError('Not a datatype')", "import dolfinx, castfem")
    assert failed.splitlines()[-1].endswith("has loaded: import castfem before dolfinx")
    assert output("print('h5py')", "import dolfinx; print('dolfinx'); import castfem") == (
        "dolfinx\nh5py\n"
    )
    assert output("print('h5py')", "import castfem, dolfinx; print('dolfinx')") == "h5py\ndolfinx\n"


PIPE = """
import os
from petsc4py import PETSc
r, w = os.pipe()
os.close(r)
try:
    os.write(w, b"x")
except BrokenPipeError:
    print("raised", flush=True)
PETSc.Sys.getVersion()
"""


# The one of PyPI finds its MPI only through mpi4py.
@pytest.mark.parametrize("order", ["castfem, dolfinx", "mpi4py.MPI, dolfinx, castfem"])
def test_closed_pipe_raises_after_petsc_was_loaded(order: str) -> None:
    """PETSc's own signal handler would abort the script instead."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {order}{PIPE}"], capture_output=True, text=True
    )
    assert (done.stdout, done.returncode) == ("raised\n", 0), done.stderr


HIDDEN = """
import sys
import castfem

class Without:
    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, *rest):
        hidden = ("dolfinx", "mpi4py", "petsc4py", "ufl", "basix")
        return None if name in hidden else self.finder.find_spec(name, *rest)

sys.meta_path[1:] = [Without(finder) for finder in sys.meta_path[1:]]
"""


@pytest.mark.parametrize(
    "use",
    [
        "castfem.run('billet125/thermal')",
        "from castfem.cli import main; main(['mould', 'billet125/hot', '--hot'])",
    ],
)
def test_missing_dolfinx_is_reported_with_the_fix(use: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HIDDEN + use], cwd=tmp_path, capture_output=True, text=True
    )
    last = done.stderr.splitlines()[-1]
    for way in ('pip install "castfem[solver]"', "apt install", "conda install"):
        assert way in last
    if "cli" in use:
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
