"""What is said to differ is seen to differ, and what is small is not printed as nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest
from known_results import SPEED, STRESS, solve
from rich.console import Console
from small_case import small

from castfem.base.table import say
from castfem.post.compare.digits import column, ends, result, significant, variable
from castfem.post.compare.optimum_tables import interval, report
from castfem.studies.optimisation import Optimum, RunRequest, Study
from castfem.studies.optimisation.optimum import Value


@pytest.mark.parametrize(
    ("value", "unit", "apart", "printed"),
    [
        (0.0042, "mm", 0.0, "0.0042"),  # not 0.00
        (0.014, "mm", 0.0, "0.014"),
        (5.0, "MPa", 0.0, "5"),
        (0.42, "mm", 0.0, "0.42"),
        (4.86, "mm", 0.0, "4.86"),
        (3.1e-6, "mm", 0.0, "3.1e-06"),
        (0.0, "mm", 0.0, "0.00"),
        (4.861, "mm", 0.0013, "4.8610"),
        (1503.57, "degC", 0.0, "1503.6"),
        (1503.57, "degC", 0.012, "1503.570"),
        (1503.57, "degC", 1e-6, "1503.570"),  # no more digits than a result has
        (8.9612, "MPa", 0.0, "8.961"),
        (8.9612, "MPa", 0.0004, "8.96120"),
        (16802.0, "kW", 0.0, "16802"),
        (-0.0042, "mm", 0.0, "-0.0042"),
        (math.nan, "mm", 0.1, "-"),
    ],
)
def test_results(value: float, unit: str, apart: float, printed: str) -> None:
    assert result(value, unit, apart) == printed


@pytest.mark.parametrize(
    ("value", "digits", "printed"),
    [
        (0.0321, 2, "0.032"),
        (4.0, 3, "4"),
        (123.4, 2, "123"),  # not 1.2e+02
        (1204.0, 3, "1204"),
        (1.2e-7, 2, "1.2e-07"),
        (0.0, 2, "0"),
        (math.nan, 2, "?"),
        (-0.590, 3, "-0.59"),
    ],
)
def test_differences(value: float, digits: int, printed: str) -> None:
    assert significant(value, digits) == printed
    if value > 0.0:
        assert significant(value, digits, "+") == f"+{printed}"


def test_neighbours_of_a_column():
    assert column([0.59012, 0.59016, 0.7], "MPa") == ["0.590120", "0.590160", "0.7"]
    assert column([1500.01, 1500.03], "degC") == ["1500.010", "1500.030"]
    assert column([0.004, 0.006, 1.2], "mm") == ["0.0040", "0.0060", "1.20"]
    assert column([3.0], "mm") == ["3.00"] and column([1.0, 1.0], "mm") == ["1.00", "1.00"]


def test_ends_of_an_interval():
    assert ends(0.57414, 0.80112) == ("0.5741", "0.8011")
    assert ends(1003.21, 1003.64) == ("1003.21", "1003.64")
    assert ends(2.0, 2.0) == ("2", "2")
    assert variable(1003.41) == "1003.41"
    value = Value("k", "K", 1003.41, 1003.21, 1003.64, False, True, None, (900.0, 1100.0))
    assert interval(value) == "1003.21 to 1003.64 or more"


def lines(found: Optimum) -> str:
    console = Console(width=200, record=True, markup=False, file=open("/dev/null", "w"))  # noqa: SIM115
    for one in report(found):
        say(console, one)
    return console.export_text()


def test_the_tables_of_an_answer():
    """A gap of some micrometres, a stress that the check moves by a thousandth."""

    def given(wanted: RunRequest) -> Mapping[str, float]:
        speed = wanted.values[0]
        moved = 700.0 if wanted.fidelity == "fine" else 0.0
        stress = 1e6 * (8.9 + 0.1 * speed) + moved
        return {STRESS: stress, "mould_gap_max": 1e-6 * (4.2 - speed)}

    constraints = ["mould_gap_max <= 0.0012 mm"]
    asked = {"minimise": STRESS, "variable": [SPEED], "constraints": constraints}
    table = {"casting.length": "6 mm", "optimise": {**asked, "fidelity": "coarse"}}
    printed = lines(solve(Study(small(table)), given))
    assert "0.0012" in printed.split("mould_gap_max <= 0.0012 mm [mm]")[1].splitlines()[0]
    assert "9.2" in printed.split("von_mises_max [MPa]")[1].split()
    assert "by fine, casting.speed = 3 m/min: von_mises_max 9.20070 MPa" in printed


def test_the_column_of_the_check_is_that_of_its_constraints():
    """The objective of the fine level is best at another speed, which that column does not have."""

    def given(wanted: RunRequest) -> Mapping[str, float]:
        speed = wanted.values[0]
        best = 3.8 if wanted.fidelity == "fine" else 3.6
        return {STRESS: 1e6 * (8.0 + (speed - best) ** 2), "mould_gap_max": 1e-6 * speed}

    asked = {"minimise": STRESS, "variable": [SPEED], "constraints": ["mould_gap_max <= 1 mm"]}
    table = {"casting.length": "6 mm", "optimise": {**asked, "fidelity": "coarse"}}
    printed = lines(solve(Study(small(table)), given))
    heads, _, row = printed.splitlines()[1:4]
    assert "constraints by fine" in heads and "best by fine" not in heads
    value, constrained, *_ = row.split("]")[1].split()
    assert float(value) == pytest.approx(3.6, abs=0.05) and constrained == value
