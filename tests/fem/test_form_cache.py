"""A form whose compilation a kill has cut off is compiled again; one at work is waited for."""

from __future__ import annotations

import fcntl
import threading
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh

from castfem.fem import dolfinx_compat, form_cache

SIZE = 2.5


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(form_cache, "WAIT", 1)


def area(comm: MPI.Comm, cache: Path) -> float:
    """Of a rectangle, by a form in this cache."""
    cells = mesh.create_rectangle(comm, [(0.0, 0.0), (SIZE, 1.0)], (2, 2))
    one = fem.Constant(cells, 1.0) * ufl.dx(domain=cells)
    options = {"cache_dir": cache, "timeout": form_cache.WAIT}
    form = form_cache.compiled(comm, cache, lambda: fem.form(one, jit_options=options))
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


def test_what_else_fails_is_told(tmp_path: Path) -> None:
    def make() -> None:
        raise RuntimeError("no such element")

    with pytest.raises(RuntimeError, match="no such element"):
        form_cache.compiled(MPI.COMM_SELF, tmp_path, make)


def test_forms_are_spread_over_folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each look-up lists a folder: none grows with all that was ever compiled."""
    listed: list[Path] = []
    monkeypatch.setattr(dolfinx_compat, "jit_options", lambda: {"cache_dir": tmp_path})

    def noted(comm: MPI.Comm, cache: Path, make: Any) -> None:
        listed.append(cache)

    monkeypatch.setattr(form_cache, "compiled", noted)
    cells = mesh.create_rectangle(MPI.COMM_SELF, [(0.0, 0.0), (SIZE, 1.0)], (2, 2))
    x = ufl.SpatialCoordinate(cells)
    for power in range(40):
        dolfinx_compat.compile_form(x[0] ** power * ufl.dx(domain=cells))
    dolfinx_compat.Tabulation(cells, x, np.zeros((3, 2)))
    assert {path.parent for path in listed} == {tmp_path}
    assert listed[-1].name == "at_3" and len(set(listed)) > 8
