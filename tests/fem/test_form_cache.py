"""A form whose compilation a kill has cut off is compiled again; one at work is waited for."""

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
    """Of a rectangle, by a form in this cache, as a process finds it that has used none before."""
    form_cache._whole.clear()
    form_cache._looked_through.clear()
    cells = mesh.create_rectangle(comm, [(0.0, 0.0), (SIZE, 1.0)], (2, 2))
    one = fem.Constant(cells, 1.0) * ufl.dx(domain=cells)
    options = {"timeout": form_cache.WAIT}
    form = form_cache.compiled(
        comm, cache, lambda folder: fem.form(one, jit_options=options | {"cache_dir": folder})
    )
    return comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)


def cut_off(cache: Path) -> None:
    """Leave what a process does that is killed while it compiles the forms of this cache."""
    sources = list(cache.glob("*.c"))
    assert sources
    for source in sources:
        source.with_suffix(".c.cached").unlink()
        for module in cache.glob(f"{source.stem}*.so"):
            module.unlink()


def test_cut_off_on_one_rank(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    cut_off(tmp_path)
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert list(tmp_path.glob("*.c.cached"))


@pytest.mark.mpi
def test_cut_off_on_several_ranks(shared_folder: Path) -> None:
    comm = MPI.COMM_WORLD
    assert area(comm, shared_folder) == pytest.approx(SIZE)
    comm.Barrier()
    if comm.rank == 0:
        cut_off(shared_folder)
    comm.Barrier()
    assert area(comm, shared_folder) == pytest.approx(SIZE)


def test_another_at_work_is_waited_for(tmp_path: Path) -> None:
    """As long as it has the lock: what it has begun is not taken from it."""
    (tmp_path / "begun.c").touch()
    with open(tmp_path / form_cache.LOCK, "ab") as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        cleaning = threading.Thread(target=form_cache._clean, args=(tmp_path,))
        cleaning.start()
        cleaning.join(0.2)
        assert cleaning.is_alive() and (tmp_path / "begun.c").exists()
    cleaning.join(5.0)
    assert not cleaning.is_alive() and not (tmp_path / "begun.c").exists()


def damaged(cache: Path, size: int) -> None:
    """Cut off what was compiled, as a disk does that is full."""
    modules = list(cache.glob("*.so"))
    assert modules
    for module in modules:
        whole = module.read_bytes()
        assert len(whole) > size
        module.unlink()  # it is in use by this process
        module.write_bytes(whole[:size])


@pytest.mark.parametrize("size", [1000])
def test_a_damaged_form_is_compiled_anew(tmp_path: Path, size: int) -> None:
    """By a process of its own: a damaged one, loaded, would end it by a signal."""
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    damaged(tmp_path, size)
    run = subprocess.run(
        [sys.executable, "-c", AREA, str(tmp_path)], check=True, capture_output=True, text=True
    )
    assert float(run.stdout) == pytest.approx(SIZE)
    assert all(len(module.read_bytes()) > 8192 for module in tmp_path.glob("*.so"))


def test_a_form_that_is_gone_is_compiled_anew(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    for module in tmp_path.glob("*.so"):
        module.unlink()
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert list(tmp_path.glob("*.so"))


def test_a_whole_form_is_not_compiled_again(tmp_path: Path) -> None:
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.so")}
    assert area(MPI.COMM_SELF, tmp_path) == pytest.approx(SIZE)
    assert before and before == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.so")}


@pytest.mark.parametrize("kind", ["a file", "no folder can be made"])
def test_a_cache_that_cannot_be_written(
    tmp_path: Path, told: pytest.LogCaptureFixture, kind: str
) -> None:
    """Root may write everywhere but into a file and into /proc."""
    place = tmp_path / "file" if kind == "a file" else Path("/proc/castfem")
    if kind == "a file":
        place.touch()
    form_cache._temporary.cache_clear()
    for _ in range(2):
        assert area(MPI.COMM_SELF, place / "forms" / "form_1") == pytest.approx(SIZE)
    (line,) = told.messages
    assert line.startswith("the cache of compiled forms cannot be written (")
    assert line.endswith("; set XDG_CACHE_HOME to a writable folder")


def test_a_cache_that_may_only_be_read(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """What it holds is used; what it lacks is compiled elsewhere."""
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
def test_a_home_that_is_not_open_to_the_user(tmp_path: Path, variable: str) -> None:
    (tmp_path / "file").touch()  # root may enter any folder
    environment = {k: v for k, v in os.environ.items() if k != "XDG_CONFIG_HOME"}
    told = f"{AREA}import os\nprint(os.environ.get('XDG_CONFIG_HOME'))"
    found = subprocess.run(
        [sys.executable, "-c", told, str(tmp_path / "cache")],
        env={**environment, variable: str(tmp_path / "file")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    after = str(tmp_path / "file") if variable == "XDG_CONFIG_HOME" else "None"  # as it was
    assert (found.returncode, found.stdout.split()) == (0, [f"{SIZE}", after]), found.stderr


def test_no_place_at_all_is_told_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(**_: object) -> str:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    form_cache._temporary.cache_clear()
    monkeypatch.setattr(tempfile, "mkdtemp", none)
    (tmp_path / "file").touch()
    with pytest.raises(
        RunFailure, match=r"and there is no temporary folder .*; set XDG_CACHE_HOME"
    ):
        area(MPI.COMM_SELF, tmp_path / "file" / "forms")


def test_what_else_fails_is_told(tmp_path: Path) -> None:
    def make(folder: Path) -> None:
        raise RuntimeError("no such element")

    with pytest.raises(RuntimeError, match="no such element"):
        form_cache.compiled(MPI.COMM_SELF, tmp_path, make)


def test_that_there_is_no_compiler_is_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", f"{tmp_path}/gcc -O1")
    with pytest.raises(RunFailure, match=r"there is no C compiler .*gcc\), which .*apt install"):
        area(MPI.COMM_SELF, tmp_path)
    monkeypatch.delenv("CC")
    assert area(MPI.COMM_SELF, tmp_path / "again") == pytest.approx(SIZE)


def test_forms_are_spread_over_folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each look-up lists a folder: none grows with all that was ever compiled."""
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
