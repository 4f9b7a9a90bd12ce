"""Ranks without a cell, and with cells but none at the surface: all collective operations."""

from __future__ import annotations

import json
from pathlib import Path

from mpi4py import MPI

import pytest
from ranks import needs_mpirun, python_on
from runs.billet_runs import CASES
from test_run_on_ranks import COARSE, assert_same

from castfem.model import load_case
from castfem.runs import loop
from castfem.runs.output.history import read_history
from castfem.studies.sensitivity.run import sensitivity

pytestmark = [pytest.mark.slow, needs_mpirun]

PARTED = """
import sys
import numpy as np
from castfem.fem import section
def parted(points, cells, rim, ranks):
    found, low, high = np.zeros(len(cells), np.int32), points.min(axis=0), points.max(axis=0)
    outer = (np.minimum(points - low, high - points).min(axis=1) < 1e-9)[cells].any(axis=1)
    found[~(outer | rim)] = 2  # rank 2 has no facet, rank 1 no cell
    return found
section.straight_cuts = parted
from castfem.cli import main
main(sys.argv[1:])
"""
SHORT = (*COARSE, "coupling.interval=0.25 s", "casting.length=60 mm", "output.every=0.25 s")
_NOTHING = 1e-10  # in SI
RUBBED = ("mould.friction.law=coulomb", "mould.friction.coefficient=0.2")
ONE = (
    "section.corner_radius=0 mm", "mesh.surface_size=62.5 mm", "mesh.corner_size=62.5 mm",
    "mesh.face_size=62.5 mm", "mesh.core_size=62.5 mm", "output.figures=false",
    "coupling.interval=0.1 s", "casting.length=18 mm",
)  # fmt: skip


def _words(case: str, changes: tuple[str, ...]) -> list[str]:
    return [f"billet125/{case}", *(word for change in changes for word in ("--set", change))]


def _same(one: Path, many: Path) -> None:
    """Check that two runs agree; columns of rounding only, as gaps of 1e-12 m, remain so."""
    ours, theirs = (read_history(folder / "history.csv") for folder in (one, many))
    assert ours["contact_pressure_max"].iloc[-1] > 0.0 and ours["heat_removed"].iloc[-1] > 0.0
    sizes = [table.abs().max() for table in (ours, theirs)]
    nothing = [name for name in ours if all(size[name] < _NOTHING for size in sizes)]
    assert_same(ours.drop(columns=nothing), theirs.drop(columns=nothing))


def test_ranks_without_a_cell_or_a_facet_agree(tmp_path: Path) -> None:
    """Contact, friction, fed liquid, checkpoints, probes of a line and a surface."""
    changes = (*SHORT, *RUBBED)
    loop.run(load_case(CASES / "taper_1.toml", changes), tmp_path / "one", comm=MPI.COMM_SELF)
    words = ("run", *_words("taper_1", changes), "-q", "-o", str(tmp_path / "three"))
    done = python_on(3, "-c", PARTED, *words)
    assert done.returncode == 0, done.stderr
    _same(tmp_path / "one", tmp_path / "three")


def test_derivatives_on_ranks_without_a_cell(tmp_path: Path) -> None:
    """Their checkpoint is gathered from all ranks, also from empty ones."""
    of, to = ("heat_removed", "von_mises_max"), ("casting.speed", "casting.superheat")
    changes = (*SHORT, "casting.length=24 mm")
    case = load_case(CASES / "taper_1.toml", changes)
    one = sensitivity(case, of, to, folder=tmp_path / "one", comm=MPI.COMM_SELF)
    words = ("sensitivity", *_words("taper_1", changes), "--of", ",".join(of), "--to", ",".join(to))
    target = str(tmp_path / "three")
    done = python_on(3, "-c", PARTED, *words, "--no-figures", "-q", "-o", target, timeout=200.0)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "three" / "sensitivity.json").read_text())["derivatives"]
    theirs = {(d["quantity"], d["parameter"]): d["value"] for d in found}
    ours = {(d["quantity"], d["parameter"]): d["value"] for d in one.to_json()["derivatives"]}
    assert theirs == pytest.approx(ours, rel=1e-6)


def test_more_ranks_than_cells(tmp_path: Path) -> None:
    loop.run(load_case(CASES / "taper_1.toml", ONE), tmp_path / "1", comm=MPI.COMM_SELF)
    words = ("run", *_words("taper_1", ONE), "-q", "-o", str(tmp_path / "3"))
    done = python_on(3, "-m", "castfem.cli", *words)
    assert done.returncode == 0, done.stderr
    _same(tmp_path / "1", tmp_path / "3")
