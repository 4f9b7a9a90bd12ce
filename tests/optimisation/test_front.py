"""The front of two results: known ones, failures, noise, and invalid requests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import known_results
import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, Given, solve

from castfem.base.errors import InputError
from castfem.post.compare.optimum_tables import report, write_front
from castfem.post.plots.studies import front_figure
from castfem.post.plots.style import save
from castfem.studies.optimisation import Evaluation, RunRequest, Study
from castfem.studies.optimisation.optimum import Front


def study(*variables: dict[str, Any], **table: Any) -> Study:
    return known_results.study(*variables, **{"front": {"maximise": HEAT, "points": 7}, **table})


def front(one: Study, given: Given) -> Front:
    found = solve(one, given)
    assert found.front is not None
    json.dumps(found.to_json(), allow_nan=False)
    return found.front


def opposed(wanted: RunRequest) -> dict[str, float]:
    """Return least stress at 3 m/min and most heat at 4.5; all between is on the front."""
    speed = wanted.values[0]
    return {STRESS: 1e7 + 1e6 * (speed - 3.0) ** 2, HEAT: 9e6 - 1e6 * (speed - 4.5) ** 2}


def test_one_variable():
    found = front(study(), opposed)
    speeds = [point.values[0] for point in found.points]
    assert len(speeds) == 7
    assert speeds == sorted(speeds)
    assert (speeds[0], speeds[-1]) == pytest.approx((3.0, 4.5), abs=0.02)
    # A gap is halved in the second result, the larger one by the spans of both.
    assert np.max(np.diff(speeds)) < 0.5
    for point in found.points:
        assert point.first == pytest.approx(1e7 + 1e6 * (point.values[0] - 3.0) ** 2)
        assert point.second == pytest.approx(9e6 - 1e6 * (point.values[0] - 4.5) ** 2)
    a, b = found.points[2:4]
    assert found.price(b) == pytest.approx((b.first - a.first) / (b.second - a.second))
    assert found.points[0].price is None


def test_two_variables():
    """Stress about (3, 20), heat about (4.5, 40): the front is the straight line between."""

    def given(wanted: RunRequest) -> dict[str, float]:
        a, b = wanted.values[0], wanted.values[1] / 20.0
        return {
            STRESS: 1e7 + 1e6 * ((a - 3.0) ** 2 + 2.25 * (b - 1.0) ** 2),
            HEAT: 9e6 - 1e6 * ((a - 4.5) ** 2 + 2.25 * (b - 2.0) ** 2),
        }

    found = front(study(SPEED, SUPERHEAT), given)
    assert len(found.points) == 7
    for point in found.points:
        speed, superheat = point.values
        way = (speed - 3.0) / 1.5
        assert superheat == pytest.approx(20.0 + 20.0 * way, abs=1.5)
    assert not found.exhausted


def test_constraints_hold_on_the_front():
    found = front(study(constraints=["heat_removed >= 8 MJ/m"]), opposed)
    assert found.points[0].values[0] == pytest.approx(3.5, abs=0.01)
    assert all(point.second >= 8e6 - 1.0 for point in found.points)


def test_common_optimum_is_a_single_point():
    def given(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: opposed(wanted)[STRESS], HEAT: -opposed(wanted)[STRESS]}

    optimum = solve(study(), given)
    assert len(optimum.front.points) == 1
    assert any("are best together" in line for line in report(optimum) if isinstance(line, str))


def test_failing_runs_end_the_front():
    """Above 4 m/min the strand breaks out: the front ends there."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed = wanted.values[0]
        if speed > 4.0:
            return Evaluation({}, 1.0 - 0.2 * (speed - 4.0), "breakout")
        return opposed(wanted)

    found = front(study(), given)
    assert found.points[-1].values[0] == pytest.approx(4.0, abs=0.06)
    assert len(found.points) >= 5


def test_noise_is_no_front():
    """Heat that changes only by noise is no trade-off for stress."""

    def given(wanted: RunRequest) -> dict[str, float]:
        scatter = np.random.default_rng(round(1e4 * wanted.values[0])).normal()
        return {STRESS: opposed(wanted)[STRESS], HEAT: 9e6 + 1e3 * scatter}

    found = front(study(), given)
    for a, b in zip(found.points, found.points[1:], strict=False):
        assert b.second - a.second > found.second.noise


def test_requests_run_by_run_give_the_same_front():
    one, told_so_far = study(), {}
    at_once = solve(study(), opposed)
    while wanted := one.ask():
        for run in reversed(wanted):
            told_so_far[run] = opposed(run)
            one.tell(run, told_so_far[run])
    assert one.result() == at_once
    again = study()
    for run, values in told_so_far.items():
        again.tell(run, values)
    assert not again.ask()
    assert again.result() == at_once


def test_front_is_written_reported_and_drawn(tmp_path):
    optimum = solve(study(), opposed)
    assert optimum.front is not None
    lines = write_front(tmp_path, optimum.front).read_text().splitlines()
    assert lines[0] == (
        "casting.speed [m/min],von_mises_max [MPa],heat_removed [MJ/m],price [MPa per MJ/m],run"
    )
    assert len(lines) == 8
    assert float(lines[1].split(",")[0]) == pytest.approx(3.0, abs=0.02)
    save(front_figure(optimum.front), tmp_path / "front.png")
    assert (tmp_path / "front.png").read_bytes().startswith(b"\x89PNG")
    messages = [line for line in report(optimum) if isinstance(line, str)]
    assert any("the front of von_mises_max and heat_removed" in line for line in messages)


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"points": 5}, "optimise.front: one of minimise and maximise is needed"),
        ({"maximise": HEAT, "minimise": HEAT}, "optimise.front: one of minimise and maximise"),
        ({"maximise": STRESS}, 'optimise.front: ("von_mises_max") is weighed against itself'),
        ({"maximise": "heat"}, 'optimise.front.maximise: ("heat") is not a result of a run'),
        ({"maximise": HEAT, "points": 2}, "optimise.front.points"),
    ],
)
def test_invalid_requests_are_refused(table: dict[str, Any], line: str):
    with pytest.raises(InputError) as error:
        study(front=table)
    assert any(line in problem for problem in error.value.problems), error.value.problems
