"""One of two ranks has an error, or a NaN, that the other has not: no rank is left waiting."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from ranks import needs_mpirun, python_on
from runs.billet_runs import COARSE

from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.model.shipped_cases import find
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_history

PATCHED = """
import sys
from mpi4py import MPI
from castfem.fem import rank_zero
from castfem.physics.mechanics.material_points import Material
from castfem.physics.thermal.flux_laws import Contact
alone, stage, folder, words = MPI.COMM_WORLD.rank == 1, *sys.argv[1:3], sys.argv[3:]
if stage != "nan":
    rank_zero.PATIENCE = 0.5  # the other one never comes
flux, integrate = Contact.flux, Material.integrate
calls = []
def met(self, temperature, time):
    q, dq = flux(self, temperature, time)
    if alone and time > 0.45 and stage == "table":
        raise ValueError("1600 degC lies outside of the table")
    return (q * float("nan"), dq) if alone and time > 0.45 and stage == "nan" else (q, dq)
def strained(self, *given):
    calls.append(0)
    if alone and stage == "law" and len(calls) > 8:
        raise MemoryError("too much")
    return integrate(self, *given)
Contact.flux, Material.integrate = met, strained
"""
COMMAND = """
from castfem.cli import main
main(["run", words[0], "-q", "-o", folder, *(w for o in words[1:] for w in ("--set", o))])
"""
SCRIPT = """
import castfem
from castfem.model import load_case
from castfem.model.shipped_cases import find
castfem.run(load_case(find(words[0]), words[1:]), folder)
"""
SHORT = (*COARSE, "casting.length=60 mm", "output.checkpoint_every=1")


def failed(
    stage: str, case: str, folder: Path, how: str = COMMAND, *more: str
) -> subprocess.CompletedProcess[str]:
    """Run a case on two ranks, only the second of which fails."""
    words = (stage, str(folder), f"billet125/{case}", *SHORT, *more)
    return python_on(2, "-c", PATCHED + how, *words, timeout=120.0)


@needs_mpirun
def test_error_within_a_solver_ends_a_script(tmp_path: Path) -> None:
    done = failed("table", "thermal", tmp_path, SCRIPT, "thermal.time.step=0.1 s")
    assert done.returncode == 2, done.stderr
    message = "castfem: on rank 1: unexpected ValueError: 1600 degC lies outside of the table"
    assert done.stderr.count(message) == 1
    assert "in met" in done.stderr  # the traceback: it will not be seen elsewhere
    assert load_checkpoint(tmp_path / "checkpoint.h5")[0]["time"] == pytest.approx(0.4)


@needs_mpirun
def test_rank_of_the_files_records_its_abort(tmp_path: Path) -> None:
    """What MUMPS holds is freed by all ranks or by none.

    An error of only another rank cannot be recorded: `show` calls that killed or aborted.
    """
    words = ("law", str(tmp_path), "billet125/taper_1", *SHORT)
    done = python_on(2, "-c", PATCHED.replace("rank == 1", "rank == 0") + COMMAND, *words)
    assert done.returncode == 2, done.stderr
    record = json.loads((tmp_path / "run.json").read_text())
    assert (record["status"], record["reason"]) == ("failed", "unexpected MemoryError: too much")
    load_checkpoint(tmp_path / "checkpoint.h5")


@needs_mpirun
def test_nan_is_a_failure_of_all_ranks(tmp_path: Path) -> None:
    """All ranks cut the step back, and end in order with the last good state on disk."""
    done = failed("nan", "thermal", tmp_path, COMMAND, "thermal.time.step=0.1 s")
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("the solver fails at the smallest step") == 1
    assert "on rank" not in done.stderr.replace("process rank", "")
    record = json.loads((tmp_path / "run.json").read_text())
    assert "ranks: this is slower than one rank" in (tmp_path / "run.log").read_text()
    assert record["status"] == "failed" and "smallest step" in record["reason"]
    last = read_history(tmp_path / "history.csv")["time"].iloc[-1]
    assert (
        load_checkpoint(tmp_path / "checkpoint.h5")[0]["time"]
        == pytest.approx(last)
        == pytest.approx(0.45)
    )


@pytest.mark.mpi
def test_ranks_agree_on_evaluating_a_stage_again() -> None:
    """The decision is collective: a NaN in the unknowns of one rank is not equal to itself."""
    comm = MPI.COMM_WORLD
    simulation = build(load_case(find("billet125/thermal"), COARSE), comm)
    state = simulation.stepper.initial(simulation.start_temperature)
    guess = state.enthalpy.copy()
    if comm.rank == comm.size - 1:
        guess[:] = np.nan
    result = simulation.problem.solve_stage(state.enthalpy, guess, 0.1, 0.1).result
    assert not result.converged and result.reason.startswith("DIVERGED")
    assert len(set(comm.allgather(result.reason))) == 1
    simulation.destroy()
