"""Searches that begin with runs all over the ranges, by Optuna (the extra castfem[optimise])."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, Given, solve
from small_case import small

from castfem.base.errors import InputError
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Evaluation, RunRequest, Study
from castfem.studies.optimisation.global_search import local_optima

SUPERHEAT = {"key": "casting.superheat", "range": ["10 K", "50 K"]}
installed = pytest.mark.skipif(
    importlib.util.find_spec("optuna") is None, reason="no Optuna: tools/env.sh optimise"
)


def study(*variables: dict[str, Any], method: str = "optuna", **table: Any) -> Study:
    asked = {"minimise": STRESS, "variable": list(variables), "method": method, **table}
    return Study(small({"casting.length": "6 mm", "optimise": asked}))


def two_valleys(wanted: RunRequest) -> dict[str, float]:
    """The better one, 9 at 4.4 m/min, lies behind a hill, seen from 2.2 m/min, where it is 10."""
    speed = wanted.values[0]
    return {STRESS: min(10.0 + 4.0 * (speed - 2.4) ** 2, 9.0 + 20.0 * (speed - 4.4) ** 2)}


@installed
def test_the_better_of_two_valleys():
    start = {**SPEED, "start": "2.2 m/min"}
    stuck = solve(study(start, method="cobyqa"), two_valleys)
    assert stuck.values[0].value == pytest.approx(2.4, abs=0.02)
    found = solve(study(start), two_valleys)
    assert found.values[0].value == pytest.approx(4.4, abs=0.01)
    assert found.runs["search"] <= 65
    assert not found.exhausted


def wedges(wanted: RunRequest) -> dict[str, float]:
    """Two of one depth, of other slopes: no search hits both tips alike."""
    speed = wanted.values[0]
    return {STRESS: min(10.0 + 4.0 * abs(speed - 2.4), 10.0 + 9.0 * abs(speed - 4.37))}


def bowls(wanted: RunRequest) -> dict[str, float]:
    speed = wanted.values[0]
    return {STRESS: min(10.0 + 4.0 * (speed - 2.5) ** 2, 10.0 + 20.0 * (speed - 4.3) ** 2)}


def scattered(wanted: RunRequest) -> dict[str, float]:
    noise = np.random.default_rng(round(1e4 * wanted.values[0])).normal()
    return {STRESS: bowls(wanted)[STRESS] + 0.02 * noise}


@installed
@pytest.mark.parametrize(
    ("given", "near"), [(bowls, (2.5, 4.3)), (scattered, (2.5, 4.3)), (wedges, (2.4, 4.37))]
)
def test_two_valleys_of_one_depth_are_told(given: Given, near: tuple[float, float]) -> None:
    """One is the answer, the other is named, once, in the first line and by its values."""
    found = solve(study({**SPEED, "start": "2.2 m/min"}), given)
    (other,) = found.other_optima
    places = sorted([found.values[0].value, *other])
    assert places == pytest.approx(near, abs=0.2 if given is scattered else 0.01)
    lines = [line for line in report(found) if isinstance(line, str)]
    assert lines[0].endswith("no constraint binds; another place is as good")
    assert any(line.endswith(f"is casting.speed = {other[0]:g} m/min") for line in lines)


@installed
def test_a_valley_that_is_not_as_deep_or_misses_a_constraint_is_not_told():
    """One is worse by a tenth, in the other the heat is missing."""
    found = solve(study({**SPEED, "start": "2.2 m/min"}), two_valleys)
    assert not found.other_optima
    assert "another place" not in str(next(iter(report(found))))

    def given(wanted: RunRequest) -> dict[str, float]:
        return {**bowls(wanted), HEAT: 1e6 * wanted.values[0]}

    asked = {"constraints": ["heat_removed >= 3 MJ/m"]}
    found = solve(study({**SPEED, "start": "2.2 m/min"}, **asked), given)
    assert found.values[0].value == pytest.approx(4.3, abs=0.01) and not found.other_optima


@installed
def test_a_small_room_among_failures():
    """Runs come through in a corner of both ranges alone, and heat is to be had in a part of it."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed, superheat = wanted.values
        if speed > 3.5 or superheat > 35.0:
            return Evaluation({}, 0.5, "breakout")
        return {STRESS: 10.0 - speed + 0.1 * superheat, HEAT: 1e6 * (superheat - 10.0) / 5.0}

    table = {"constraints": ["heat_removed >= 2 MJ/m"]}
    start = {**SPEED, "start": "5 m/min"}, {**SUPERHEAT, "start": "50 K"}
    found = solve(study(*start, **table), given)
    assert found.status == "found"
    assert [v.value for v in found.values] == pytest.approx([3.5, 20.0], abs=0.1)


@installed
def test_asked_run_by_run():
    """Told a run at a time by objects that know nothing of one another, it goes the same way."""
    at_once = solve(study(SPEED, most_runs=24), two_valleys)
    told_so_far: dict[RunRequest, Mapping[str, float]] = {}
    for _ in range(60):
        one = study(SPEED, most_runs=24)
        for run, values in told_so_far.items():
            one.tell(run, values)
        wanted = one.ask()
        if not wanted:
            break
        told_so_far[wanted[-1]] = two_valleys(wanted[-1])
    assert one.result() == at_once


def test_best_places_of_valleys():
    places = np.array([[0.1], [0.15], [0.5], [0.55], [0.9]])
    values = np.array([[3.0], [1.0], [0.5], [0.2], [0.4]])
    assert [place[0] for place in local_optima(places, values)] == [0.55, 0.9]
    missed = np.column_stack([values, [1.0, 1.0, 1.0, -1.0, -2.0]])  # what misses less goes first
    assert [place[0] for place in local_optima(places, missed)] == [0.5, 0.15]


def test_it_is_missed_before_a_run(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"Optuna is not installed; pip install \"castfem\[opti"):
        study(SPEED)


def test_a_valley_that_is_flat_is_one_valley() -> None:
    """Runs beyond the quadratics that are as good are of it: the interval reaches to them."""

    def quartic(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: 10.0 + 1e-3 * (wanted.values[0] - 3.5) ** 4}

    for given in (quartic, lambda wanted: {STRESS: 10.0}):
        found = solve(study({**SPEED, "start": "2.2 m/min"}, method="cobyqa"), given)
        assert not found.other_optima
        assert "another place" not in str(next(iter(report(found))))
    assert found.values[0].low <= 2.2  # of the last, which is flat
