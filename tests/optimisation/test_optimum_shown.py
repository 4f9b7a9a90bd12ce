"""Output of an optimum: differences are visible, small values are not 0; its figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from known_results import SPEED, STRESS, solve
from rich.console import Console
from small_case import small

from castfem.base.shown_units import ShownUnits, shown_in
from castfem.base.table import say
from castfem.post.compare.digits import result
from castfem.post.compare.optimum_tables import report
from castfem.post.plots.studies import mould_figure
from castfem.post.plots.style import save
from castfem.studies.optimisation import Optimum, RunRequest, Study


@pytest.mark.parametrize(
    ("value", "unit", "apart", "printed"),
    [
        (0.0042, "mm", 0.0, "0.0042"),  # not 0.00
        (5.0, "MPa", 0.0, "5"),
        (3.1e-6, "mm", 0.0, "3.1e-06"),
        (0.0, "mm", 0.0, "0.00"),
        (4.861, "mm", 0.0013, "4.8610"),
        (1503.57, "degC", 0.0, "1503.6"),
        (1503.57, "degC", 0.012, "1503.570"),
        (1503.57, "degC", 1e-6, "1503.570"),  # no more digits than a result has
        (16802.0, "kW", 0.0, "16802"),
        (math.nan, "mm", 0.1, "-"),
    ],
)
def test_results_have_the_digits_of_their_differences(
    value: float, unit: str, apart: float, printed: str
) -> None:
    assert result(value, unit, apart) == printed


def lines(found: Optimum) -> str:
    console = Console(width=200, record=True, markup=False, file=open("/dev/null", "w"))  # noqa: SIM115
    for one in report(found):
        say(console, one)
    return console.export_text()


def test_tables_of_an_answer():
    """A gap of some micrometres, a stress that the check changes by a thousandth."""

    def given(wanted: RunRequest) -> Mapping[str, float]:
        speed = wanted.values[0]
        moved = 700.0 if wanted.fidelity == "fine" else 0.0
        stress = 1e6 * (8.9 + 0.1 * speed) + moved
        return {STRESS: stress, "mould_gap_max": 1e-6 * (4.2 - speed)}

    constraints = ["mould_gap_max <= 0.0012 mm"]
    request = {"minimise": STRESS, "variable": [SPEED], "constraints": constraints}
    table = {"casting.length": "6 mm", "optimise": {**request, "fidelity": "coarse"}}
    printed = lines(solve(Study(small(table)), given))
    assert "0.0012" in printed.split("mould_gap_max <= 0.0012 mm [mm]")[1].splitlines()[0]
    assert "9.2" in printed.split("von_mises_max [MPa]")[1].split()
    assert "by fine, casting.speed = 3 m/min: von_mises_max 9.20070 MPa" in printed


def test_column_of_the_check_has_its_constraints():
    """At the fine level the objective is best at another speed, which is not in that column."""

    def given(wanted: RunRequest) -> Mapping[str, float]:
        speed = wanted.values[0]
        best = 3.8 if wanted.fidelity == "fine" else 3.6
        return {STRESS: 1e6 * (8.0 + (speed - best) ** 2), "mould_gap_max": 1e-6 * speed}

    request = {"minimise": STRESS, "variable": [SPEED], "constraints": ["mould_gap_max <= 1 mm"]}
    table = {"casting.length": "6 mm", "optimise": {**request, "fidelity": "coarse"}}
    printed = lines(solve(Study(small(table)), given))
    heads, _, row = printed.splitlines()[1:4]
    assert "constraints by fine" in heads and "best by fine" not in heads
    value, constrained, *_ = row.split("]")[1].split()
    assert float(value) == pytest.approx(3.6, abs=0.05) and constrained == value


HEAD = ["distance [mm]", "width [mm]", "diagonal [mm]"]
ROWS = [[0.0, 125.0, 172.6], [300.0, 124.8, 172.3], [600.0, 124.6, 172.0]]


def run(folder: Path, **columns: Any) -> Path:
    z = np.array([0.0, 0.3, 0.6, 0.9])
    table = pd.DataFrame({"time [s]": z / 0.06, "position [m]": z, **columns})
    table.to_csv(folder / "history.csv", index=False)
    return folder


def test_mould_and_its_run_are_drawn(tmp_path):
    """Down to the end of the mould, with panels for the columns of the run."""
    gaps = {"gap_mid_face [mm]": [0.0, 0.01, 0.02, 9.0], "gap_corner [mm]": [0.0, 0.02, 0.1, 9.0]}
    folder = run(tmp_path, **gaps, **{"von_mises_max [MPa]": [0.0, 3.0, 7.0, 99.0]})
    sizes, gap, stress = mould_figure(HEAD, ROWS, folder).axes
    assert [line.get_label() for line in sizes.get_lines()] == ["width", "diagonal"]
    assert sizes.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.3, 0.6])
    assert gap.get_lines()[1].get_xdata() == pytest.approx([0.0, 300.0, 600.0])
    assert gap.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.02, 0.1])
    assert stress.get_lines()[0].get_ydata() == pytest.approx([0.0, 3.0, 7.0])
    assert stress.get_xlim() == (0.0, 600.0)
    with shown_in(ShownUnits("si")):
        sizes, gap, stress = mould_figure(HEAD, ROWS, folder).axes
    assert (stress.get_ylabel(), stress.get_xlabel()) == (
        "von Mises [Pa]",
        "below the meniscus [m]",
    )
    assert sizes.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.3e-3, 0.6e-3])
    assert gap.get_lines()[1].get_xdata() == pytest.approx([0.0, 0.3, 0.6])
    assert stress.get_lines()[0].get_ydata() == pytest.approx([0.0, 3e6, 7e6])
    assert len(mould_figure(HEAD, ROWS, run(tmp_path)).axes) == 1
    save(mould_figure(HEAD, ROWS, folder), tmp_path / "mould.png")
    assert (tmp_path / "mould.png").read_bytes().startswith(b"\x89PNG")
