"""A wider range is spoken of only where it may meet what is missed."""

from __future__ import annotations

from typing import Any

import pytest
from known_results import HEAT, SPEED, STRESS, solve
from small_case import small

from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Optimum, RunRequest, Study

SUPERHEAT = {"key": "casting.superheat", "range": ["10 K", "50 K"]}
HINT = "a wider one may meet them"


def asked(*constraints: str, **start: str) -> Study:
    variables = [{**SPEED, "start": "3 m/min"}, {**SUPERHEAT, "start": start["superheat"]}]
    table: dict[str, Any] = {"minimise": STRESS, "constraints": constraints, "variable": variables}
    return Study(small({"casting.length": "6 mm", "optimise": table}))


def first_line(found: Optimum) -> str:
    assert found.status == "impossible"
    return str(next(iter(report(found))))


@pytest.mark.parametrize("superheat", ["10 K", "50 K"])
def test_a_variable_that_changes_nothing_of_what_is_missed(superheat: str):
    """The objective draws it to an end: the heat knows of the speed alone."""
    sign = 1.0 if superheat == "10 K" else -1.0

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, at = wanted.values
        return {STRESS: 100.0 + sign * at, HEAT: 1e6 * (5.0 - (speed - 4.2) ** 2)}

    found = solve(asked("heat_removed >= 9 MJ/m", superheat=superheat), given)
    assert found.values[1].at_end in ("lowest", "highest")
    assert HINT not in first_line(found)


def test_only_the_variable_that_helps_is_named():
    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        return {STRESS: 10.0 + superheat, HEAT: 1e6 * speed}

    found = solve(asked("heat_removed >= 9 MJ/m", superheat="10 K"), given)
    assert found.values[0].at_end == "highest" and found.values[1].at_end == "lowest"
    line = first_line(found)
    assert line.endswith(f"with casting.speed at the highest of its range: {HINT}")
    assert "superheat" not in line


def test_what_is_least_at_an_end_and_no_longer_falls():
    """Flat from 4 m/min on: the last of the way to the end gains nothing."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, _ = wanted.values
        return {STRESS: 100.0 - speed, HEAT: 1e6 * min(speed, 4.0)}

    found = solve(asked("heat_removed >= 9 MJ/m", superheat="30 K"), given)
    assert HINT not in first_line(found)


def test_a_second_constraint_that_is_missed_as_well():
    """More speed helps one; the other is missed whatever the speed, or by more with each step."""
    for more in (0.0, 1.0):

        def given(wanted: RunRequest, more: float = more) -> dict[str, float]:
            speed, _ = wanted.values
            return {STRESS: 1e6 * (100.0 + more * speed), HEAT: 1e6 * speed}

        both = ("heat_removed >= 9 MJ/m", "von_mises_max <= 10 MPa")
        found = solve(asked(*both, superheat="30 K"), given)
        assert HINT not in first_line(found)
