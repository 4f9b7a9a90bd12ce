"""Searches that begin with runs all over the ranges, with Optuna (the extra castfem[optimise])."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import known_results
import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, Given, solve
from small_case import small

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Evaluation, Optimum, RunRequest, Study
from castfem.studies.optimisation.argument_checks import quantities_of
from castfem.studies.sensitivity.result import Slope

installed = pytest.mark.skipif(
    importlib.util.find_spec("optuna") is None, reason="no Optuna: tools/env.sh optimise"
)


def study(*variables: dict[str, Any], method: str = "optuna", **table: Any) -> Study:
    return known_results.study(*variables, method=method, **table)


def two_valleys(wanted: RunRequest) -> dict[str, float]:
    """Return the lesser of two valleys: 10 at 2.4 m/min, and behind a hill 9 at 4.4 m/min."""
    speed = wanted.values[0]
    return {STRESS: min(10.0 + 4.0 * (speed - 2.4) ** 2, 9.0 + 20.0 * (speed - 4.4) ** 2)}


@installed
def test_better_of_two_valleys_is_found():
    start = {**SPEED, "start": "2.2 m/min"}
    stuck = solve(study(start, method="cobyqa"), two_valleys)
    assert stuck.values[0].value == pytest.approx(2.4, abs=0.02)
    found = solve(study(start), two_valleys)
    assert found.values[0].value == pytest.approx(4.4, abs=0.01)
    assert found.runs["search"] <= 65
    assert not found.exhausted


def wedges(wanted: RunRequest) -> dict[str, float]:
    """Return two valleys of one depth with different slopes: no search hits both equally."""
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
def test_two_valleys_of_one_depth_are_reported(given: Given, near: tuple[float, float]) -> None:
    """One is the answer, the other is named once, in the first line and with its values."""
    found = solve(study({**SPEED, "start": "2.2 m/min"}), given)
    (other,) = found.other_optima
    places = sorted([found.values[0].value, *other])
    assert places == pytest.approx(near, abs=0.2 if given is scattered else 0.01)
    lines = [line for line in report(found) if isinstance(line, str)]
    assert lines[0].endswith("no constraint binds; another point is as good")
    assert any(line.endswith(f"is casting.speed = {other[0]:g} m/min") for line in lines)


@installed
def test_worse_or_infeasible_valley_is_not_reported():
    """One is worse by a tenth, the other lacks heat."""
    found = solve(study({**SPEED, "start": "2.2 m/min"}), two_valleys)
    assert not found.other_optima
    assert "another point" not in str(next(iter(report(found))))

    def given(wanted: RunRequest) -> dict[str, float]:
        return {**bowls(wanted), HEAT: 1e6 * wanted.values[0]}

    table = {"constraints": ["heat_removed >= 3 MJ/m"]}
    found = solve(study({**SPEED, "start": "2.2 m/min"}, **table), given)
    assert found.values[0].value == pytest.approx(4.3, abs=0.01) and not found.other_optima


@installed
def test_small_feasible_region_among_failures_is_found():
    """Runs succeed only in a corner of both ranges, and only a part of it has the heat."""

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
def test_requests_run_by_run_give_the_same_answer():
    """Results are given one at a time to objects without a common state."""
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


def test_missing_optuna_is_reported_before_a_run(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"Optuna is not installed; pip install \"castfem\[opti"):
        study(SPEED)


def test_flat_valley_is_one_valley() -> None:
    """Equally good runs beyond the quadratics belong to it: the interval includes them."""

    def quartic(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: 10.0 + 1e-3 * (wanted.values[0] - 3.5) ** 4}

    for given in (quartic, lambda wanted: {STRESS: 10.0}):
        found = solve(study({**SPEED, "start": "2.2 m/min"}, method="cobyqa"), given)
        assert not found.other_optima
        assert "another point" not in str(next(iter(report(found))))
    assert found.values[0].low <= 2.2  # of the last, which is flat


# The search by derivatives: known optima, kinks, failed runs, runs without derivatives, refusals


COST = "surface_temperature_mid_face"  # K, used as stress: the case has no mechanics
BY_SUPERHEAT = {"key": "casting.superheat", "range": ["20 K", "40 K"]}
H = {
    "key": "cooling.mould.surface.0.coefficient",
    "range": ["1500 W/(m^2 K)", "1700 W/(m^2 K)"],
    "start": "1600 W/(m^2 K)",
}
VARIABLES = (SPEED, BY_SUPERHEAT, H)
RANGES = np.array([3.0, 20.0, 200.0])
Results = Callable[[Array], tuple[tuple[float, float], Array]]
"""Stress and heat at shares of the ranges, and their derivatives by the shares (2, n)."""


def smooth(u: Array) -> tuple[tuple[float, float], Array]:
    """Return stress, least at 0.7, 0.3, 0.6 in a valley across the axes, and growing heat."""
    off = u - np.array([0.7, 0.3, 0.6])
    bend = np.array([[3.0, 2.0, 0.5], [2.0, 3.0, 0.0], [0.5, 0.0, 1.0]])
    stress = 1e3 * (1.0 + 0.5 * off @ bend @ off)
    return (stress, 1e6 * float(np.sum(u))), np.array([1e3 * bend @ off, 1e6 * np.ones(3)])


def kinked(u: Array) -> tuple[tuple[float, float], Array]:
    """Return the larger of two slopes that intersect along a line across the axes."""
    one, other = 2.0 * u[0] + u[1] - 1.4, 1.3 - u[0] - 1.5 * u[1]
    first = one > other
    slope = np.array([2.0, 1.0, 0.0]) if first else np.array([-1.0, -1.5, 0.0])
    bowl = 0.3 * (u[2] - 0.4) ** 2
    by = slope + np.array([0.0, 0.0, 0.6 * (u[2] - 0.4)])
    stress = 1e3 * (3.0 + (one if first else other) + bowl)
    return (stress, 1e6), np.array([1e3 * by, np.zeros(3)])


class StudyWithResults:
    """A study by derivatives that gets known results; its requests are kept."""

    def __init__(self, folder: Path | None, results: Results, **table: Any) -> None:
        request = {"minimise": COST, "variable": list(VARIABLES), "method": "slsqp", **table}
        case = small({"casting.length": "6 mm", "optimise": request})
        self.study, self._results = Study(case, folder), results
        self.runs: set[RunRequest] = set()

    def answer(self, derivatives: bool = True, fails: float = 2.0) -> Optimum:
        """Return the answer; runs whose first share is above a value fail."""
        while wanted := self.study.ask():
            for one in wanted:
                self.runs.add(one)
                self.study.tell(one, self._given(one, derivatives, fails))
        return self.study.result()

    def _given(self, wanted: RunRequest, derivatives: bool, fails: float) -> Evaluation:
        u = self.study.problem.shares(wanted)
        if u[0] > fails:
            return Evaluation({}, 0.9 - 0.5 * (u[0] - fails), "breakout")
        (stress, heat), slopes = self._results(u)
        results = quantities_of(self.study.problem, wanted, {COST: stress, HEAT: heat})
        if not (derivatives and wanted.derivatives):
            return Evaluation(results)
        units = ("m/min", "K", "W/(m^2 K)")
        found = {}
        for name, row in zip((COST, HEAT), slopes, strict=True):
            each = zip(VARIABLES, row / RANGES, wanted.values, units, strict=True)
            found[name] = {v["key"]: Slope(by, at, unit) for v, by, at, unit in each}
        return Evaluation(results, slopes=found)


def shares(known: StudyWithResults, found: Optimum) -> Array:
    return known.study.problem.shares(RunRequest(tuple(v.value for v in found.values), "default"))


def test_minimum_of_a_bowl_is_found(tmp_path: Path) -> None:
    known = StudyWithResults(tmp_path / "runs", smooth)
    found = known.answer()
    assert shares(known, found) == pytest.approx([0.7, 0.3, 0.6], abs=0.01)
    plain = StudyWithResults(tmp_path / "others", smooth, method="cobyqa")
    assert shares(plain, plain.answer()) == pytest.approx([0.7, 0.3, 0.6], abs=0.03)
    assert len(known.runs) < len(plain.runs)
    assert any(run.derivatives for run in known.runs)
    assert not any(run.derivatives for run in plain.runs)


def test_constraint_holds(tmp_path: Path) -> None:
    """With heat of 2 MJ/m: bend @ off = lambda (1, 1, 1), and the shares add up to 2."""
    known = StudyWithResults(tmp_path / "runs", smooth, constraints=["heat_removed >= 2 MJ/m"])
    found = known.answer()
    bend = np.array([[3.0, 2.0, 0.5], [2.0, 3.0, 0.0], [0.5, 0.0, 1.0]])
    along = np.linalg.solve(bend, np.ones(3))
    best = np.array([0.7, 0.3, 0.6]) + 0.4 * along / np.sum(along)
    assert shares(known, found) == pytest.approx(best, abs=0.02)
    assert [one.binding for one in found.constraints] == [True]


def test_kink_does_not_stop_the_search(tmp_path: Path) -> None:
    """Both slopes are equal along a line; COBYQA finds the least on it from there."""
    known = StudyWithResults(tmp_path / "runs", kinked)
    found = known.answer()
    u = shares(known, found)
    best, _ = min(
        (kinked(np.array([x, np.clip((2.7 - 3.0 * x) / 2.5, 0.0, 1.0), 0.4])) for x in
         np.linspace(0.0, 1.0, 2001)),
        key=lambda one: one[0][0],
    )  # fmt: skip
    (here, _), _ = kinked(u)
    assert here < best[0] + 20.0


def test_failing_runs_limit_the_search(tmp_path: Path) -> None:
    known = StudyWithResults(tmp_path / "runs", smooth, constraints=["heat_removed >= 2 MJ/m"])
    found = known.answer(fails=0.72)
    u = shares(known, found)
    assert u[0] <= 0.72
    assert np.sum(u) >= 2.0 - 1e-3
    (stress, _), _ = smooth(u)
    free = np.array([0.72 - 0.7, *np.zeros(2)])
    bend = np.array([[3.0, 0.0], [0.0, 1.0]])
    pull = np.array([2.0, 0.5]) * free[0]
    along = np.linalg.solve(bend, np.ones(2))
    rest = np.linalg.solve(bend, -pull)
    off = rest + (0.38 - np.sum(rest)) / np.sum(along) * along
    (least, _), _ = smooth(np.array([0.72, 0.3 + off[0], 0.6 + off[1]]))
    assert stress < least + 10.0


def test_runs_without_derivatives_use_cobyqa(tmp_path: Path) -> None:
    """COBYQA takes over, with its own result."""
    known = StudyWithResults(tmp_path / "runs", smooth)
    plain = StudyWithResults(tmp_path / "others", smooth, method="cobyqa")
    found, other = known.answer(derivatives=False), plain.answer()
    assert shares(known, found) == pytest.approx(shares(plain, other), abs=1e-3)


def test_invalid_requests_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"optimise.method: slsqp needs the derivatives that"):
        StudyWithResults(None, smooth)
    size = {"key": "mesh.surface_size", "range": ["4 mm", "5 mm"]}
    request = {"minimise": HEAT, "method": "slsqp", "variable": [size]}
    case = small({"casting.length": "6 mm", "optimise": request})
    with pytest.raises(InputError) as error:
        Study(case, tmp_path / "runs")
    (problem,) = error.value.problems
    assert "slsqp needs derivatives: --to mesh.surface_size: a run has no derivative" in problem
    assert problem.endswith('or take method = "cobyqa"')
