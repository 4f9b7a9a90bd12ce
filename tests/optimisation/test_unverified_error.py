"""An interval is open where a check of its error was not done, and says why."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, Given, bowl, solve, study

from castfem.post.compare.optimum_tables import interval, report
from castfem.studies.optimisation import Evaluation, Optimum, RunRequest
from castfem.studies.optimisation.numerical_error import Tilt

SUPERHEAT = {"key": "casting.superheat", "range": ["10 K", "50 K"]}
FAILS = Evaluation({}, 0.5, "breakout")


def failing(*levels: str, given: Given = bowl) -> Given:
    return lambda wanted: FAILS if wanted.fidelity in levels else given(wanted)


def lines(found: Optimum) -> str:
    return "\n".join(str(line) for line in report(found) if isinstance(line, str))


@pytest.mark.parametrize(
    ("fidelity", "levels", "why"),
    [
        ("coarse", ("default", "fine"), "not known: the best run fails by default and fine"),
        ("default", ("fine", "coarse"), "not known: the best run fails by coarse and fine"),
        ("default", ("fine",), "by coarse cells alone: the best run fails by fine"),
        ("fine", ("default", "coarse"), "not known: the best run fails by coarse and default"),
    ],
)
@pytest.mark.parametrize("constraints", [[], ["heat_removed >= 2 MJ/m"]])
def test_levels_that_fail(
    fidelity: str, levels: tuple[str, ...], why: str, constraints: list[str]
) -> None:
    asked = study(fidelity=fidelity, constraints=constraints)
    found = solve(asked, failing(*levels))
    (value,) = found.values
    assert value.open_low and value.open_high
    assert "or less to" in interval(value) and interval(value).endswith("or more")
    assert f"the interval is open, for the numerical error is {why}" in lines(found)
    content = json.loads(json.dumps(found.to_json()))
    assert any(why in reason for reason in content["unknown"])
    for kept in found.constraints:
        assert np.isnan(kept.error) == ("not known" in why)


def test_levels_that_all_come_through_leave_it_closed():
    (value,) = solve(study(fidelity="coarse"), bowl).values
    assert not value.open_low and not value.open_high
    found = solve(study(fidelity="coarse", constraints=["heat_removed >= 2 MJ/m"]), bowl)
    assert found.unverified == () and "is open" not in lines(found)


def test_a_finest_level_that_fails_is_named_where_the_next_one_checks():
    found = solve(study(fidelity="coarse"), failing("fine"))
    assert found.checked == "default" and found.unverified == ()
    assert "checked by default (the best run fails by fine)" in lines(found)


def test_the_end_of_a_range_stays_closed():
    """At 2 m/min the range ends: the optimum is not less, whatever the numerical error."""

    def given(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: 10.0 + wanted.values[0]}

    (value,) = solve(study(fidelity="coarse"), failing("default", "fine", given=given)).values
    assert value.at_end == "lowest" and value.low == 2.0
    assert not value.open_low and value.open_high


def test_a_tilt_that_is_not_known():
    """Runs by the next level fail along one variable: that one is open, the other is not."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed, superheat = wanted.values
        if wanted.fidelity == "default" and abs(superheat - 30.0) > 0.9:
            return FAILS
        return {STRESS: 10.0 + (speed - 3.3) ** 2 + 0.01 * (superheat - 30.0) ** 2}

    found = solve(study(SPEED, SUPERHEAT, fidelity="coarse"), given)
    speed, superheat = found.values
    assert (speed.open_low, speed.open_high) == (False, False)
    assert superheat.open_low and superheat.open_high
    assert "changes along casting.superheat is not known: runs by default fail" in lines(found)
    found = solve(study(fidelity="coarse"), failing("default"))  # no run of that level at all
    assert found.checked == "fine" and found.values[0].open_low and found.values[0].open_high


def test_slopes_without_runs():
    centre = np.array([0.5, 0.5])
    places = centre + np.array([[0.0, 0.0], [-0.1, 0.0], [0.1, 0.0], [0.0, -0.1], [0.0, 0.1]])
    tilt = Tilt.fit(centre, places, np.array([1.0, 0.8, 1.2, np.nan, np.nan]))
    assert tilt.unknown.tolist() == [False, True]
    assert tilt.slope == pytest.approx([2.0, 0.0])


def heated(wanted: RunRequest) -> dict[str, float]:
    """Fine cells ask for a little more speed."""
    heat = wanted.values[0] - (0.3 if wanted.fidelity == "fine" else 0.0)
    return {STRESS: 1e6 * wanted.values[0], HEAT: 1e6 * heat}


def test_a_check_that_fails_on_its_way():
    """The interval is open on the side to which it went, and there alone."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        if wanted.fidelity == "fine" and wanted.values[0] > 3.05:
            return FAILS
        return heated(wanted)

    asked = {"fidelity": "coarse", "constraints": ["heat_removed >= 3 MJ/m"]}
    whole, cut = solve(study(**asked), heated), solve(study(**asked), given)
    assert whole.values[0].checked == pytest.approx(3.3, abs=0.01)
    assert not whole.unverified and not whole.values[0].open_high
    (value,) = cut.values
    assert value.checked == pytest.approx(3.0, abs=0.01)
    assert (value.open_low, value.open_high) == (False, True)
    assert "the optimum by fine was not reached: a run towards it fails" in lines(cut)


def test_noise_that_was_not_measured():
    """Runs between those of the start fail."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        return FAILS if 3.5 < wanted.values[0] < 3.5999 else bowl(wanted)

    found = solve(study({**SPEED, "start": "3.6 m/min"}, fidelity="coarse"), given)
    (value,) = found.values
    assert value.open_low and value.open_high
    assert "noise was not measured: runs about the start, or about the best one, fail" in lines(
        found
    )
    assert found.objective is not None and not found.objective.measured
    assert found.to_json()["objective"]["noise"] is None


def test_a_spread_that_failed():
    inputs = [{"key": "casting.superheat", "range": ["10 K", "50 K"]}]

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        return FAILS if wanted.inputs else bowl(wanted)

    found = solve(study(fidelity="coarse", input=inputs), given)
    assert found.spread is None
    assert found.values[0].open_low and found.values[0].open_high
    assert "it lacks the spread by the inputs: too few of those runs came through" in lines(found)


def test_a_search_that_was_cut_short():
    found = solve(study(most_runs=8, fidelity="coarse"), bowl)
    (value,) = found.values
    assert found.exhausted and value.open_low and value.open_high
    why = "the search has had its runs before it was done: raise optimise.most_runs"
    assert lines(found).count(why) == 1 and found.unverified == (why,)
