"""What rolls bear and how far the shell bulges, by roll; the largest change between two runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.model.shipped_cases import CASE_NAME, load
from castfem.post.compare.runs import Run
from castfem.post.compare.table import remarks
from castfem.post.report.remarks import remarks_of
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.summary import Summary
from castfem.runs.results.derived import derived
from castfem.runs.results.roll_load import RollLoads


def write(folder: Path, force: dict[int, float], bulge: dict[int, float]) -> Path:
    """A run of the slab with a force [kN/m] and a bulge [mm] for each pitch; 100 and 0.1 else."""
    case = load("slab1200/slab")
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    folder.mkdir()
    (folder / CASE_NAME).write_text(case.resolved_toml())
    rows = ["time [s],position [m],roll_force [kN/m],bulge_pitch [mm]"]
    for number, pair in enumerate(rolls.pairs, start=1):
        before = rolls.pairs[number - 2].position if number > 1 else 0.5
        for place in (0.5 * (before + pair.position), pair.position):  # of the pitch above it
            above = number - 1
            rows.append(f"{50 * place:.9g},{place:.9g},{force.get(above, 100.0)},"
                        f"{bulge.get(above, 0.1)}")  # fmt: skip
    (folder / HISTORY_NAME).write_text("\n".join(rows) + "\n")
    return folder


def test_the_largest_and_where(tmp_path: Path) -> None:
    folder = write(tmp_path / "run", {69: 273.0}, {33: 1.7})
    loads = RollLoads.of(folder)
    assert loads is not None
    assert loads.largest("roll_force") == (69, 273.0)
    assert loads.largest("bulge_pitch") == (33, 1.7)
    (bulge,) = [one for one in remarks_of(folder, None) if "bulge" in one.what]
    assert (bulge.value, bulge.unit) == (1.7, "mm") and "(roll 33), arc" in bulge.where
    found = derived(folder, Summary("slab", "finished", {}))
    assert found["bulge_largest"].value == pytest.approx(1.7e-3)
    assert found["roll_force_largest"].value == pytest.approx(273e3)


def test_the_roll_beside_the_one_that_is_off_is_named(tmp_path: Path) -> None:
    """Though the largest force of both runs is at roll 69, and the same."""
    one = write(tmp_path / "order", {69: 273.0, 33: 177.0}, {33: 0.3})
    other = write(tmp_path / "off", {69: 273.0, 33: 251.0}, {33: 0.8})
    runs = [Run(path, path.name, Summary("slab", "finished", {})) for path in (one, other)]
    told = [line for line in remarks(runs, runs[0], []) if line.startswith("from order to off")]
    assert len(told) == 2
    assert "force on roll 33, a metre of width: 177 kN/m -> 251 kN/m, at" in told[0]
    assert "bulge below roll 33: 0.3 mm -> 0.8 mm, at" in told[1]
    assert not [line for line in remarks(runs[:1] * 2, runs[0], []) if line.startswith("from ")]


def test_a_run_without_rolls_has_none(tmp_path: Path) -> None:
    (tmp_path / CASE_NAME).write_text(load("billet125/taper_1").resolved_toml())
    assert RollLoads.of(tmp_path) is None
