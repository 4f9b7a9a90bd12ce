"""Run after run in one process leaves nothing behind."""

from __future__ import annotations

import gc
from pathlib import Path

from mpi4py import MPI

import psutil
import pytest
from runs.billet_runs import billet
from small_case import write_small

import castfem
from castfem.model import Case

MOULDED = (
    "casting.length=30 mm", 'output.fields=["temperature", "stress"]',
    "mould.contact=nitsche", "mould.friction.law=coulomb", "mould.friction.coefficient=0.3",
)  # fmt: skip

pytestmark = pytest.mark.skipif(
    "Open MPI" not in MPI.Get_library_version(), reason="handles mean nothing"
)


def communicators() -> int:
    """How many communicators exist, by the handle Open MPI gives the next one: the lowest free."""
    own = MPI.COMM_WORLD.Dup()
    handle = own.py2f()
    own.Free()
    return handle


def left_behind(case: Case, changes: list[dict[str, str]], warm: int) -> tuple[int, ...]:
    """Communicators, open files and memory (bytes) that runs after the first `warm` leave."""
    process = psutil.Process()

    def state() -> tuple[int, int, int]:
        gc.collect()
        return communicators(), process.num_fds(), process.memory_info().rss

    before = state()
    for number, change in enumerate(changes):
        if number == warm:
            before = state()
        with castfem.run(case.with_(**change)) as result:
            assert len(result.history) > 2
            result.fields()
        del result
    return tuple(now - then for now, then in zip(state(), before, strict=True))


def test_runs_leak_nothing(tmp_path: Path) -> None:
    case = castfem.load(write_small(tmp_path)).with_(length="15 mm")
    changes = [{"superheat": f"{20 + number} K"} for number in range(16)]
    ranks, files, memory = left_behind(case, changes, warm=8)
    assert (ranks, files) == (0, 0)
    # The heap may still settle by a page or two; a mesh that stayed would be 0.1 MB a run.
    assert memory < 2e6


def test_tapers_leak_nothing() -> None:
    """With mechanics, contact and friction; what one window leaves is 0.3 MB."""
    changes = [{"taper": f"{0.5 + 0.1 * number:.1f} %/m"} for number in range(6)]
    ranks, files, memory = left_behind(billet("taper_1", *MOULDED), changes, warm=3)
    assert (ranks, files) == (0, 0)
    assert memory < 1.5e6
