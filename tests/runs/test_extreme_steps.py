"""A freezing billet with its mechanics in steps far too long, and with a solver that gives up."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from billet_runs import run
from small_case import small

from castfem.base.errors import RunFailure
from castfem.model import Case, load_case
from castfem.physics.mechanics.state import MechanicalResult
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_history

CASES = Path(__file__).parents[2] / "cases"
COARSE = (
    "mechanics.law=norton_hoff_kozlowski",
    "mesh.surface_size=2 mm",
    "mesh.corner_size=2 mm",
    "mesh.face_size=6 mm",
    "mesh.core_size=12 mm",
    "output.fields=[]",
)


def billet(*overrides: str, name: str = "idealised") -> Case:
    return load_case(CASES / "billet125" / f"{name}.toml", (*COARSE, *overrides))


def test_intervals_a_hundred_times_longer(tmp_path: Path) -> None:
    """Two windows of 5 s through the mould: in balance, and about the stress of 0.4 s.

    Heat keeps its own steps; the bulge of the first soft shell is what long steps miss.  The shell
    is measured in the slice as it is, so what its strains are off, a thousandth, is in it.
    """
    long = run(billet("coupling.interval=5 s"), tmp_path / "long")
    fine = run(billet("coupling.interval=0.4 s"), tmp_path / "fine")
    assert long.status == "finished" and long.steps["coupling windows"] == 2
    for name, close in (
        ("shell_mid_face", 2e-3),
        ("heat_removed", 1e-3),
        ("von_mises_corner", 0.2),
        ("axial_strain", 0.25),
    ):
        ours, theirs = (s.quantities[name].value for s in (long, fine))
        assert ours == pytest.approx(theirs, rel=close), name
    for balance in ("axial force", "forces in the plane"):
        assert abs(long.balances[balance]["error"].value) < 1e-6
    table = read_history(tmp_path / "long" / "history.csv")
    assert all(whole(row) for _, row in table.iterrows())


def test_a_table_that_misses_the_end_by_rounding(tmp_path: Path) -> None:
    """As inches do that were written as millimetres: no step goes from its last row to the end."""
    heat = []
    for last in (300.0, 299.9999999988, 300.0000000012):
        table = {"position": [0, last], "position_unit": "mm", "value": [2e3, 1e3]}
        law = {"law": "contact", "wall": "160 degC"}
        law["coefficient"] = table | {"unit": "W/(m^2 K)"}  # type: ignore[assignment]
        stepping = {"adaptive": {"tolerance": "1 K"}}
        changes = {"casting.length": "300 mm", "thermal.time": stepping, "cooling.0.surface": [law]}
        found = run(small(changes), tmp_path / str(last))
        assert found.status == "finished"
        steps = np.diff(read_history(tmp_path / str(last) / "history.csv")["time"])
        assert steps.min() > 1e-5  # the smallest of a case
        heat.append(found.quantities["heat_removed"].value)
    assert heat[1:] == pytest.approx(2 * heat[:1], rel=1e-9)


def whole(row: pandas.Series) -> bool:
    """Whether a row of a history has a number for everything that exists.

    Without a shell there is no cell in which the solidus lies, and with one there is.
    """
    cells = [name for name in row.index if name.startswith("solidus_cell_")]
    there = {name: row[name.replace("solidus_cell_", "shell_")] > 0.0 for name in cells}
    assert cells and all(np.isfinite(row[name]) == is_ for name, is_ in there.items())
    return bool(np.isfinite(row.drop(cells).to_numpy()).all())


def failed(folder: Path, said: str) -> float:
    """Time that a failed run has reached, s: that of its record, its last row, all of it good."""
    record = json.loads((folder / "run.json").read_text())
    assert record["status"] == "failed" and record["reason"] == said
    table = read_history(folder / "history.csv")
    last = table.iloc[-1]
    assert record["reached"]["time"] == pytest.approx(last["time"], rel=1e-11)
    assert whole(last) and abs(last["force_error"]) < 1e-6
    return float(last["time"])


def test_a_solver_that_gives_up_says_so(tmp_path: Path) -> None:
    """One Newton iteration is not enough: cut back to the smallest step, then the reason."""
    short = ("casting.length=120 mm", "coupling.interval=0.5 s")
    with pytest.raises(RunFailure) as caught:
        run(billet(*short, "mechanics.solver.snes_max_it=1"), tmp_path)
    said = str(caught.value)
    for part in ("mechanics", "smallest step", "DIVERGED_MAX_IT", "forces", "x tolerance"):
        assert part in said
    assert failed(tmp_path, said) < 2.0


def test_a_failed_run_goes_on_from_its_last_good_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing converges beyond 1 s, until it does: resumed, it is the run that never failed.

    The failed attempts have found states, of contact and friction too: none is in the checkpoint.
    """
    case = billet(
        "casting.length=105 mm", "coupling.interval=0.25 s", "mould.friction.law=coulomb",
        "mould.friction.coefficient=0.2", "mechanics.liquid=fed", "mechanics.ferrostatic=full",
        name="taper_0",
    )  # fmt: skip
    whole = run(case, tmp_path / "whole")
    step = MechanicalStepper.step

    def stuck(self: MechanicalStepper, old: Any, time: float, *rest: Any) -> MechanicalResult:
        result = step(self, old, time, *rest)
        if time < 1.0 + 1e-9:
            return result
        return replace(result, converged=False, state=old, reason="stuck", balance=None)

    with monkeypatch.context() as patch:
        patch.setattr(MechanicalStepper, "step", stuck)
        with pytest.raises(RunFailure, match="stuck") as caught:
            run(case, tmp_path / "cut")
    assert failed(tmp_path / "cut", str(caught.value)) == pytest.approx(1.0, rel=1e-11)
    resumed = run(case, tmp_path / "cut", resume=True)
    assert resumed.status == "finished" and resumed.steps == whole.steps
    assert whole.quantities["gap_max"].value > 1e-6
    for name, quantity in whole.quantities.items():
        ours = resumed.quantities[name].value
        assert ours == pytest.approx(quantity.value, rel=1e-9, abs=1e-15), name
    (_, one), (_, other) = (
        load_checkpoint(tmp_path / name / "checkpoint.h5") for name in ("whole", "cut")
    )
    assert one.keys() == other.keys() and one["contact_friction"].any()
    for name, values in one.items():
        size = np.abs(values[np.isfinite(values)]).max(initial=1e-300)
        assert np.allclose(other[name], values, rtol=0.0, atol=1e-9 * size), name
