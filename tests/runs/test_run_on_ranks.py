"""Runs with mechanics and a mould give the same on one rank and on several."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import dolfinx
import numpy as np
import pandas
import pytest
from ranks import needs_mpirun, python_on
from runs.billet_runs import cells

import castfem
from castfem.model import load_case
from castfem.runs import loop
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_history

pytestmark = pytest.mark.slow

CASES = Path(__file__).parents[2] / "cases" / "billet125"
COARSE = (*cells(2, 10, 14), "output.figures=false")
MOULDED = (
    *COARSE, "mould.friction.law=coulomb", "mould.friction.coefficient=0.2",
    "coupling.interval=0.4 s", "output.every=0.4 s", "mould.contact=nitsche",
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
    "mechanics.law=kozlowski_zhu_signed",
)  # fmt: skip
# Zero but for rounding, which differs on other ranks.
LEFT_OVER = {"energy_error", "axial_force", "force_error"}
# A small difference of displacements: on DOLFINx 0.11 other rounding changes it by 1.9e-8.
EXACT = {"penetration": 2e-8} if dolfinx.__version__ >= "0.11" else {}
ERRORS = {"error", "whole", "worst_step"}


def run(folder: Path, ranks: int, case: str, overrides: tuple[str, ...], *words: str) -> None:
    """Run a case as a user starts it; the reference on one rank runs in this process."""
    if ranks == 1:
        loop.run(load_case(CASES / f"{case}.toml", overrides), folder, comm=MPI.COMM_SELF)
        return
    sets = [word for override in overrides for word in ("--set", override)]
    words = ("-m", "castfem.cli", "run", f"billet125/{case}", "-q", *sets, *words)
    done = python_on(ranks, *words, "-o", str(folder))
    assert done.returncode == 0, done.stderr


def assert_same(one: pandas.DataFrame, other: pandas.DataFrame) -> None:
    """Check that two histories agree."""
    assert list(other) == list(one) and len(other) == len(one)
    for name in set(one) - LEFT_OVER:
        ours, theirs = other[name].to_numpy(), one[name].to_numpy()
        size = np.nanmax(np.abs(theirs), initial=1e-300)
        assert np.nanmax(np.abs(ours - theirs), initial=0.0) <= EXACT.get(name, 1e-8) * size, name


def numbers(folder: Path) -> dict[str, float]:
    """Return all numbers of a summary but errors, by name."""
    content: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    found = {name: entry["value"] for name, entry in content["quantities"].items()}
    for balance, terms in content["balances"].items():
        for name in terms.keys() - ERRORS:
            found[f"{balance}: {name}"] = terms[name]["value"]
    return found | content["steps"]


def assert_same_state(one: Path, other: Path) -> dict[str, np.ndarray]:
    """Check that two checkpoints agree; return the arrays."""
    (_, state), (_, ours) = (load_checkpoint(folder / "checkpoint.h5") for folder in (one, other))
    assert state.keys() == ours.keys()
    for name, values in state.items():
        known = np.isfinite(values)
        assert np.array_equal(known, np.isfinite(ours[name])), name
        size = np.abs(values[known]).max(initial=1e-300)
        assert np.abs(values - ours[name])[known].max(initial=0.0) <= 1e-7 * size, name
    return state


@needs_mpirun
def test_mould_with_friction_resumes_on_other_ranks(tmp_path: Path) -> None:
    """The run on one rank equals one begun on two and ended on three; the corner leaves the wall.

    The state of Nitsche's method at the wall and the strain tensor of the law are compared, too.
    """
    case, end = "taper_0", "casting.length=105 mm"
    run(tmp_path / "one", 1, case, (*MOULDED, end))
    run(tmp_path / "many", 2, case, (*MOULDED, "casting.length=96 mm"))
    run(tmp_path / "many", 3, case, (*MOULDED, end), "--resume")
    table = read_history(tmp_path / "one" / "history.csv")
    assert table["friction_force"].iloc[-1] < -1e-3 and table["gap_max"].iloc[-1] > 0.0
    assert_same(table, read_history(tmp_path / "many" / "history.csv"))
    one, many = numbers(tmp_path / "one"), numbers(tmp_path / "many")
    assert many == pytest.approx(one, rel=1e-7, abs=1e-12)
    state = assert_same_state(tmp_path / "one", tmp_path / "many")
    assert state["internal_deviator"].shape[2] == 3
    assert np.abs(state["internal_deviator"]).max() > 1e-5
    assert len(set(state["contact_status"].ravel())) > 1
    assert np.abs(state["contact_stress"]).max() > 1e3 and state["contact_internal"].any()


@pytest.mark.mpi
def test_closed_form_is_compared_on_ranks(shared_folder: Path) -> None:
    """Its errors are sums over the ranks, which the checkpoints need as well: they once waited."""
    short = ("casting.length=3 mm", "output.checkpoint_every=2", "output.figures=false")
    case = load_case(CASES.parent / "verification" / "neumann.toml", short)
    one, many = (
        loop.run(case, shared_folder / name, comm=comm).quantities["error_temperature"].value
        for name, comm in ((f"{MPI.COMM_WORLD.rank}", MPI.COMM_SELF), ("many", MPI.COMM_WORLD))
    )
    assert one > 0.0 and many == pytest.approx(one, rel=1e-6)


@pytest.mark.mpi
def test_scripted_run_without_a_folder_ends_on_all_ranks() -> None:
    """Only rank 0 makes the temporary folder; the others once waited for it to look into one."""
    short = ("casting.length=3 mm", "output.figures=false")
    with castfem.run(load_case(CASES.parent / "verification" / "neumann.toml", short)) as result:
        heats = MPI.COMM_WORLD.allgather(result.summary.quantities["heat_removed"].value)
    assert len(set(heats)) == 1 and heats[0] > 0.0
