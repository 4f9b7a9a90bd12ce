"""The search among failing runs: inside the ranges, near its start, all of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, Given, bowl, covered, solve, study
from synthetic_run import write_run

from castfem.api import Result
from castfem.base.atomic_files import write_json
from castfem.model.load import load
from castfem.post.compare.optimum_tables import interval, report
from castfem.runs.output.folder import SUMMARY_NAME
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.studies.optimisation import Evaluation, Optimum, RunRequest, Study


def test_runs_that_fail_inside_the_range():
    """They reach 1 - (speed - 3) / 2 of their length: the best is where they begin to fail."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed = wanted.values[0]
        if speed > 3.0:
            return Evaluation({}, 1.0 - (speed - 3.0) / 2.0, "breakout")
        return bowl(wanted)

    found = solve(study(), given)
    assert found.status == "found"
    assert found.values[0].value == pytest.approx(3.0, abs=0.05)
    assert found.values[0].value <= 3.0
    assert found.values[0].at_end == "runs fail"
    assert found.values[0].high < 3.2
    assert found.runs["failed"] > 0


def test_start_among_failures():
    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed = wanted.values[0]
        if speed < 4.0:
            return Evaluation({}, speed / 4.5, "breakout")
        return {STRESS: 10.0 + (speed - 4.5) ** 2}

    found = solve(study({**SPEED, "start": "2.5 m/min"}), given)
    assert found.status == "found"
    assert found.values[0].value == pytest.approx(4.5, abs=0.05)


TAPER = {"key": "mould.taper", "range": ["-10 %/m", "10 %/m"]}


def tapered(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
    """Return results like those of the 125 mm billet: 9.2 MJ/m from +0.59 %/m, stress rising."""
    taper = wanted.values[0]
    if taper < -3.0:
        return Evaluation({}, 1.0 + (taper + 3.0) / 8.0, "breakout")
    if taper > 7.0:
        return Evaluation({}, 0.9 - (taper - 7.0) / 10.0, "the mechanics do not converge")
    heat = np.interp(taper, [-3.0, -1.0, 0.0, 0.59, 0.8, 10.0], [7.9, 8.3, 8.7, 9.2, 9.29, 9.3])
    stress = np.interp(taper, [-3.0, 0.0, 0.4, 0.59, 1.0, 10.0], [4.2, 4.1, 4.0, 8.9, 14.5, 40.0])
    return {STRESS: float(stress), HEAT: 1e6 * float(heat)}


def any_taper(bound: str, start: str) -> Optimum:
    variable = {**TAPER, "start": start}
    request = {"minimise": STRESS, "constraints": [f"heat_removed >= {bound}"]}
    case = load("billet125/taper_1").with_({"optimise": {**request, "variable": [variable]}})
    return solve(Study(case), tapered)


@pytest.mark.parametrize("start", ["-9.9 %/m", "0 %/m", "9.5 %/m"])
def test_tapers_of_ten_percent(start: str):
    """Runs that fail at both ends, also near the start, neither stop nor mislead it."""
    found = any_taper("9.2 MJ/m", start)
    assert found.status == "found"
    assert found.values[0].value == pytest.approx(0.59, abs=0.05)
    assert covered(found, 0.59)
    assert found.runs["search"] <= 30


def test_failed_runs_are_reported_with_the_result():
    """Also which of the runs are counted by optimise.most_runs."""
    found = any_taper("9.2 MJ/m", "-9.9 %/m")
    runs, messages = found.runs, [block for block in report(found) if isinstance(block, str)]
    assert 0 < runs["failed"] < runs["search"] and runs["looked_at"] <= runs["search"]
    assert f"{runs['failed']} of the {runs['search']} runs by default failed" in messages[0]
    assert any(
        f"{runs['looked_at']} of the search (limit: optimise.most_runs)" in x for x in messages
    )


def test_unreachable_constraint_from_a_start_among_failures():
    """Runs that miss a bound are nearer than runs that fail."""
    found = any_taper("9.9 MJ/m", "-8 %/m")
    assert found.status == "impossible"
    assert found.worst.left == pytest.approx(-0.603e6, rel=2e-3)
    assert found.values[0].at_end == "runs fail"


def test_start_where_positions_are_misleading():
    """Runs between 2.5 and 3.5 m/min succeed; from the start the way there is downhill."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        speed = wanted.values[0]
        if not 2.5 < speed < 3.5:
            return Evaluation({}, 0.9 - 0.1 * min(abs(speed - 4.9), 4.0), "breakout")
        return bowl(wanted)

    found = solve(study({**SPEED, "start": "4.8 m/min"}), given)
    assert found.status == "found"
    assert found.values[0].value == pytest.approx(3.3, abs=0.02)


def test_failed_run_is_given_by_its_folder(tmp_path: Path):
    """Its position and reason count; the contents of its summary are not used."""
    one = study(constraints=["heat_removed >= 2 MJ/m"])
    (wanted, *_) = one.ask()
    folder = write_run(tmp_path / "run")
    record, summary = RunRecord.load(folder), Summary.load(folder)
    assert summary is not None
    replace(record, status="failed", reason="a breakout", reached={"position": 3e-3}).write(folder)
    write_json(folder / SUMMARY_NAME, replace(summary, status="failed").to_json())
    one.tell(wanted, Result(folder))
    given = one._runs.results[wanted]
    assert given.failed and given.message == "a breakout"
    assert given.share == pytest.approx(0.5) and not given.quantities


def test_all_runs_fail():
    found = solve(study(), lambda w: Evaluation({}, 0.1 * w.values[0], "breakout"))
    assert found.status == "failed"
    assert found.values[0].value == pytest.approx(5.0, abs=0.1)
    assert "no run has finished" in str(next(iter(report(found))))


# An interval is open if a check of its error was not done, and has the reason


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
def test_failing_levels_open_the_interval(
    fidelity: str, levels: tuple[str, ...], why: str, constraints: list[str]
) -> None:
    one = study(fidelity=fidelity, constraints=constraints)
    found = solve(one, failing(*levels))
    (value,) = found.values
    assert value.open_low and value.open_high
    assert "or less to" in interval(value) and interval(value).endswith("or more")
    assert f"the interval is open, for the numerical error is {why}" in lines(found)
    content = json.loads(json.dumps(found.to_json()))
    assert any(why in reason for reason in content["unknown"])
    for kept in found.constraints:
        assert np.isnan(kept.error) == ("not known" in why)


def test_successful_levels_close_the_interval():
    (value,) = solve(study(fidelity="coarse"), bowl).values
    assert not value.open_low and not value.open_high
    found = solve(study(fidelity="coarse", constraints=["heat_removed >= 2 MJ/m"]), bowl)
    assert found.unverified == () and "is open" not in lines(found)


def test_failing_finest_level_is_named():
    found = solve(study(fidelity="coarse"), failing("fine"))
    assert found.checked == "default" and found.unverified == ()
    assert "checked by default (the best run fails by fine)" in lines(found)


def test_end_of_a_range_stays_closed():
    """The range ends at 2 m/min: the optimum is not less, with any numerical error."""

    def given(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: 10.0 + wanted.values[0]}

    (value,) = solve(study(fidelity="coarse"), failing("default", "fine", given=given)).values
    assert value.at_end == "lowest" and value.low == 2.0
    assert not value.open_low and value.open_high


def test_unknown_tilt_opens_the_interval():
    """Runs by the next level fail along one variable: only that one is open."""

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


def heated(wanted: RunRequest) -> dict[str, float]:
    """Return results in which fine cells need slightly more speed."""
    heat = wanted.values[0] - (0.3 if wanted.fidelity == "fine" else 0.0)
    return {STRESS: 1e6 * wanted.values[0], HEAT: 1e6 * heat}


def test_failing_check_opens_one_side():
    """The interval is open only on the side to which the check moved."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        if wanted.fidelity == "fine" and wanted.values[0] > 3.05:
            return FAILS
        return heated(wanted)

    request = {"fidelity": "coarse", "constraints": ["heat_removed >= 3 MJ/m"]}
    complete, cut = solve(study(**request), heated), solve(study(**request), given)
    assert complete.values[0].checked == pytest.approx(3.3, abs=0.01)
    assert not complete.unverified and not complete.values[0].open_high
    (value,) = cut.values
    assert value.checked == pytest.approx(3.0, abs=0.01)
    assert (value.open_low, value.open_high) == (False, True)
    assert "the optimum by fine was not reached: a run towards it fails" in lines(cut)


def test_unmeasured_noise_opens_the_interval():
    """Runs near the start fail."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        return FAILS if 3.5 < wanted.values[0] < 3.5999 else bowl(wanted)

    found = solve(study({**SPEED, "start": "3.6 m/min"}, fidelity="coarse"), given)
    (value,) = found.values
    assert value.open_low and value.open_high
    assert "noise was not measured: runs around the start or the best one fail" in lines(found)
    assert found.objective is not None and not found.objective.measured
    assert found.to_json()["objective"]["noise"] is None


def test_failed_spread_opens_the_interval():
    inputs = [{"key": "casting.superheat", "range": ["10 K", "50 K"]}]

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        return FAILS if wanted.inputs else bowl(wanted)

    found = solve(study(fidelity="coarse", input=inputs), given)
    assert found.spread is None
    assert found.values[0].open_low and found.values[0].open_high
    assert "the spread by the inputs is missing: too few of those runs succeeded" in lines(found)


def test_exhausted_search_opens_the_interval():
    found = solve(study(most_runs=8, fidelity="coarse"), bowl)
    (value,) = found.values
    assert found.runs["looked_at"] <= 8 < found.runs["all"]
    assert found.exhausted and value.open_low and value.open_high
    why = "the search ran out of runs: raise optimise.most_runs"
    assert lines(found).count(why) == 1 and found.unverified == (why,)
