"""The cache of forms: interrupted compilations, locks, damaged files, unwritable folders."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh

from castfem.base.errors import RunFailure
from castfem.fem import compat, form_cache

SIZE = 2.5
AREA = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from mpi4py import MPI
from test_form_cache import area
print(area(MPI.COMM_SELF, Path(sys.argv[1])))
"""


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(form_cache, "WAIT", 1)


def area(comm: MPI.Comm, cache: Path) -> float:
    """Integrate the area of a rectangle by a form in this cache, as in a new process."""
    form_cache._whole.clear()
    form_cache._looked_through.clear()
    cells = mesh.create_rectangle(comm, [(0.0, 0.0), (SIZE, 1.0)], (2, 2))
    one = fem.Constant(cells, 1.0) * ufl.dx(domain=cells)
    options = {"timeout": form_cache.WAIT}
    form = form_cache.compiled(
        comm, cache, lambda folder: fem.form(one, jit_options=options | {"cache_dir": folder})
    )
    return comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)


def interrupt(cache: Path) -> None:
    """Leave the cache as a process does that is killed while it compiles its forms."""
    sources = list(cache.glob("*.c"))
    assert sources
    for source in sources:
        source.with_suffix(".c.cached").unlink()
        for module in cache.glob(f"{source.stem}*.so"):
            module.unlink()


def test_interrupted_compilation_is_repeated_on_one_rank(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    interrupt(tmp_path)
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert list(tmp_path.glob("*.c.cached"))


@pytest.mark.mpi
def test_interrupted_compilation_is_repeated_on_several_ranks(shared_folder: Path) -> None:
    comm = MPI.COMM_WORLD
    assert area(comm, shared_folder) == pytest.approx(SIZE)
    comm.Barrier()
    if comm.rank == 0:
        interrupt(shared_folder)
    comm.Barrier()
    assert area(comm, shared_folder) == pytest.approx(SIZE)


def test_compilation_of_another_process_is_awaited(tmp_path: Path) -> None:
    """Its files are not removed while it has the lock."""
    (tmp_path / "begun.c").touch()
    with open(tmp_path / form_cache.LOCK, "ab") as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        cleaning = threading.Thread(target=form_cache._clean, args=(tmp_path,))
        cleaning.start()
        cleaning.join(0.2)
        assert cleaning.is_alive() and (tmp_path / "begun.c").exists()
    cleaning.join(5.0)
    assert not cleaning.is_alive() and not (tmp_path / "begun.c").exists()


def truncate(cache: Path, size: int) -> None:
    """Truncate the compiled modules, as on a full disk."""
    modules = list(cache.glob("*.so"))
    assert modules
    for module in modules:
        content = module.read_bytes()
        assert len(content) > size
        module.unlink()  # it is in use by this process
        module.write_bytes(content[:size])


@pytest.mark.parametrize("size", [1000])
def test_damaged_form_is_compiled_again(tmp_path: Path, size: int) -> None:
    """In a separate process, which a damaged module would end by a signal if it were loaded."""
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    truncate(tmp_path, size)
    run = subprocess.run(
        [sys.executable, "-c", AREA, str(tmp_path)], check=True, capture_output=True, text=True
    )
    assert float(run.stdout) == pytest.approx(SIZE)
    assert all(len(module.read_bytes()) > 8192 for module in tmp_path.glob("*.so"))


def test_deleted_form_is_compiled_again(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    for module in tmp_path.glob("*.so"):
        module.unlink()
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert list(tmp_path.glob("*.so"))


def test_valid_form_is_not_compiled_again(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.so")}
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert before and before == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.so")}


@pytest.mark.parametrize("kind", ["a file", "no folder can be made"])
def test_unwritable_cache_is_reported_and_replaced(
    tmp_path: Path, told: pytest.LogCaptureFixture, kind: str
) -> None:
    """Root can write everywhere except into a file and into /proc."""
    place = tmp_path / "file" if kind == "a file" else Path("/proc/castfem")
    if kind == "a file":
        place.touch()
    form_cache._temporary.cache_clear()
    for _ in range(2):
        assert area(MPI.COMM_SELF, place / "forms" / "form_1") == pytest.approx(SIZE)
    (line,) = told.messages
    assert line.startswith("the cache of compiled forms cannot be written (")
    assert line.endswith("; set XDG_CACHE_HOME to a writable folder")


def test_read_only_cache_is_used(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """Its forms are used; missing forms are compiled in another folder."""
    form_cache._temporary.cache_clear()

    def make(folder: Path) -> Path:
        if folder == tmp_path:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "x.c")
        return folder

    assert form_cache.compiled(MPI.COMM_SELF, tmp_path, lambda folder: folder) == tmp_path
    assert not told.messages
    found = form_cache.compiled(MPI.COMM_SELF, tmp_path, make)
    assert found != tmp_path and found.is_dir() and len(told.messages) == 1


@pytest.mark.parametrize("variable", ["HOME", "XDG_CONFIG_HOME"])
def test_inaccessible_home_is_allowed(tmp_path: Path, variable: str) -> None:
    (tmp_path / "file").touch()  # a file, as root can enter any folder
    environment = {k: v for k, v in os.environ.items() if k != "XDG_CONFIG_HOME"}
    script = f"{AREA}import os\nprint(os.environ.get('XDG_CONFIG_HOME'))"
    found = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "cache")],
        env={**environment, variable: str(tmp_path / "file")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    after = str(tmp_path / "file") if variable == "XDG_CONFIG_HOME" else "None"  # unchanged
    assert (found.returncode, found.stdout.split()) == (0, [f"{SIZE}", after]), found.stderr


def test_missing_temporary_folder_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(**_: object) -> str:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    form_cache._temporary.cache_clear()
    monkeypatch.setattr(tempfile, "mkdtemp", none)
    (tmp_path / "file").touch()
    with pytest.raises(
        RunFailure, match=r"and there is no temporary folder .*; set XDG_CACHE_HOME"
    ):
        area(MPI.COMM_SELF, tmp_path / "file" / "forms")


def test_other_errors_are_raised(tmp_path: Path) -> None:
    def make(folder: Path) -> None:
        raise RuntimeError("no such element")

    with pytest.raises(RuntimeError, match="no such element"):
        form_cache.compiled(MPI.COMM_SELF, tmp_path, make)


def test_missing_compiler_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", f"{tmp_path}/gcc -O1")
    with pytest.raises(RunFailure, match=r"there is no C compiler .*gcc\), which .*apt install"):
        area(MPI.COMM_SELF, tmp_path)
    monkeypatch.delenv("CC")
    assert area(MPI.COMM_SELF, tmp_path / "again") == pytest.approx(SIZE)


def test_forms_are_spread_over_folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A look-up lists its folder, so no folder may collect all compiled forms."""
    listed: list[Path] = []
    monkeypatch.setattr(compat, "jit_options", lambda: {"cache_dir": tmp_path})

    def noted(comm: MPI.Comm, cache: Path, make: Any) -> None:
        listed.append(cache)

    monkeypatch.setattr(form_cache, "compiled", noted)
    cells = mesh.create_rectangle(MPI.COMM_SELF, [(0.0, 0.0), (SIZE, 1.0)], (2, 2))
    x = ufl.SpatialCoordinate(cells)
    for power in range(40):
        compat.compile_form(x[0] ** power * ufl.dx(domain=cells))
    compat.Tabulation(cells, x, np.zeros((3, 2)))
    assert {path.parent for path in listed} == {tmp_path}
    assert listed[-1].name == "at_3" and len(set(listed)) > 8
