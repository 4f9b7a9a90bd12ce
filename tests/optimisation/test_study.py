"""The search: optima of known results, and disturbances that cannot stop or mislead it."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, Given, bowl, covered, solve, study

from castfem.base.atomic_files import plain
from castfem.base.shown_quantity import Quantity
from castfem.post.compare.optimum_tables import report
from castfem.studies.accuracy.estimate import RULES
from castfem.studies.accuracy.sizes import LEVELS
from castfem.studies.optimisation import Evaluation, RunRequest
from castfem.studies.optimisation.fidelity import NumericalError, error, sides


@pytest.mark.parametrize(
    ("given", "close", "truth"),
    [
        (bowl, 0.01, 3.3),
        (lambda w: {STRESS: 10.0 + abs(w.values[0] - 3.3)}, 0.02, 3.3),  # a kink
        # The slope at the start is 0 by symmetry, although the result depends on the variable.
        (lambda w: {STRESS: 10.0 + 2.0 * (w.values[0] - 3.6) ** 2, HEAT: 1.0}, 0.01, 3.6),
    ],
    ids=["bowl", "kink", "start at the best"],
)
def test_least_value(given: Given, close: float, truth: float):
    found = solve(study(), given)
    assert found.status == "found" and found.without_effect == ()
    assert found.values[0].value == pytest.approx(truth, abs=close)
    assert covered(found, truth)
    assert not found.constraints
    json.dumps(found.to_json(), allow_nan=False)


def test_largest_value():
    table = {"minimise": [], "maximise": STRESS}
    found = solve(study(**table), lambda w: {STRESS: -bowl(w)[STRESS]})
    assert found.values[0].value == pytest.approx(3.3, abs=0.01)
    assert found.objective.value == pytest.approx(-10.0, abs=1e-3)
    assert all(step.objective < 0.0 for step in found.neighbours)


def test_constraint_binds():
    found = solve(study(constraints=["heat_removed >= 2 MJ/m"]), bowl)
    assert found.values[0].value == pytest.approx(4.2, abs=0.002)
    assert covered(found, 4.2)
    (kept,) = found.constraints
    assert kept.met
    assert kept.binding
    slack = solve(study(constraints=["heat_removed >= 0.5 MJ/m"]), bowl)
    assert not slack.constraints[0].binding
    assert covered(slack, 3.3)


def test_two_variables_with_a_trade_off():
    """A quadratic with a cross term under a linear bound: by hand the optimum is 3.9046, 29.54."""

    def given(wanted: RunRequest) -> dict[str, float]:
        a, b = wanted.values[0] - 3.0, wanted.values[1] - 30.0
        stress = 10.0 + 2.0 * a**2 + 0.01 * b**2 + 0.05 * a * b
        return {STRESS: stress, HEAT: 1e6 * (a + 0.01 * b + 1.1)}

    found = solve(study(SPEED, SUPERHEAT, constraints=["heat_removed >= 2 MJ/m"]), given)
    assert found.objective.value == pytest.approx(11.6179, abs=2e-3)
    assert covered(found, 3.9046, 29.536)
    assert found.constraints[0].binding


def converging(order: float) -> Given:
    """Return results whose heat converges: zero cell size loses 0.2 MJ/m, that of the case 0.1."""

    def given(wanted: RunRequest) -> dict[str, float]:
        off = 0.2e6 - 0.1e6 * LEVELS[wanted.fidelity].cells ** order
        return {**bowl(wanted), HEAT: bowl(wanted)[HEAT] - off}

    return given


@pytest.mark.parametrize("order", [0.9, 1.0, 2.0])
@pytest.mark.parametrize("fidelity", ["coarse", "default", "fine"])
def test_interval_contains_the_converged_optimum(fidelity: str, order: float):
    """The bound at zero cell size is met at 4.4 m/min; it is on one side, and not far beyond."""
    table = {"constraints": ["heat_removed >= 2 MJ/m"], "fidelity": fidelity}
    found = solve(study(**table), converging(order))
    (value,), (kept,) = found.values, found.constraints
    cells = LEVELS[fidelity].cells ** order
    assert value.value == pytest.approx(4.4 - 0.1 * cells, abs=0.01)
    stated = RULES.safety * 0.1 * cells
    if order >= 1.0:
        assert kept.result.numerical == pytest.approx(1e6 * stated, rel=1e-3)
    else:  # that of first order is stated, which is smaller
        stated = 1e-6 * kept.result.numerical
        assert 0.1 * cells < stated < RULES.safety * 0.1 * cells
    assert found.checked == ("default" if fidelity == "fine" else "fine")
    there = LEVELS[found.checked].cells ** order
    assert kept.checked == pytest.approx(kept.left + 0.1e6 * (there - cells))
    assert value.checked == pytest.approx(4.4 - 0.1 * there, abs=0.02)
    assert covered(found, 4.4)
    assert value.high == pytest.approx(value.value + stated, abs=0.02)
    assert value.low == pytest.approx(value.value, abs=0.02)


@pytest.mark.parametrize("order", [1.0, 2.0])
@pytest.mark.parametrize("fidelity", ["coarse", "default", "fine"])
def test_tilted_objective(fidelity: str, order: float):
    """Larger cells move the least stress itself, from 3.3 m/min to 3.35 with those of the case."""

    def given(wanted: RunRequest) -> dict[str, float]:
        off = 0.05 * LEVELS[wanted.fidelity].cells ** order
        return {STRESS: 10.0 + 2.0 * (wanted.values[0] - 3.3 - off) ** 2}

    found = solve(study(fidelity=fidelity), given)
    (value,) = found.values
    assert value.value == pytest.approx(3.3 + 0.05 * LEVELS[fidelity].cells ** order, abs=0.01)
    assert covered(found, 3.3)
    assert value.high - value.low < 12.0 * abs(value.value - 3.3)


@pytest.mark.parametrize(
    ("heat", "sides"),
    [
        ({"coarse": 3.0, "default": 1.0, "fine": 2.0}, (2.143, 2.143)),  # to and fro
        ({"coarse": 3.0, "default": 2.0, "fine": 0.2}, (6.0, 0.0)),  # one way, without an order
        ({"coarse": 3.0, "default": 2.0, "fine": np.nan}, (3.75, 3.75)),
        ({"coarse": 3.0}, (0.0, 0.0)),
    ],
)
def test_numerical_error_without_an_order(
    heat: Mapping[str, float], sides: tuple[float, float]
) -> None:
    """Assumed of first order, with a quarter more; on both sides unless all three go one way."""
    known = NumericalError.of("coarse", {word: np.array([1.0, v]) for word, v in heat.items()})
    assert (known.below[1], known.above[1]) == pytest.approx(sides, rel=1e-3)
    assert (known.checked == "") == (len(heat) == 1)


def test_levels_that_fail():
    """The finest one fails, the next one checks; if all fail nothing is known."""

    def given(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
        return Evaluation({}, 0.5, "breakout") if wanted.fidelity in failing else bowl(wanted)

    table = {"constraints": ["heat_removed >= 2 MJ/m"], "fidelity": "coarse"}
    failing = ["fine"]
    assert solve(study(**table), given).checked == "default"
    failing = ["fine", "default"]
    found = solve(study(**table), given)
    assert found.checked == ""
    assert found.values[0].checked is None
    assert covered(found, 4.2)


def test_flat_variable_does_not_blur_the_other():
    """Runs are farther apart along the variable with an open interval; heat is curved in the other.

    The bound is met at 20 + 4 artanh 0.5 = 22.197 K, by the finest level at 22.473 K.
    """

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        scatter = np.random.default_rng([round(1e4 * v) for v in wanted.values]).normal()
        stress = superheat + 1e-4 * (speed - 3.4) ** 2 + 1e-3 * scatter
        off = {"coarse": 0.0, "default": 0.03, "fine": 0.05}[wanted.fidelity]
        return {STRESS: stress, HEAT: 1e6 * (np.tanh((superheat - 20.0) / 4.0) - off)}

    table = {"constraints": ["heat_removed >= 0.5 MJ/m"], "fidelity": "coarse"}
    speed, superheat = solve(study(SPEED, SUPERHEAT, **table), given).values
    assert speed.high - speed.low > 0.5
    assert superheat.value == pytest.approx(22.197, abs=0.2)
    assert superheat.checked == pytest.approx(22.473, abs=0.15)
    assert 21.6 < superheat.low < 22.2 < 22.4 < superheat.high < 23.0


@pytest.mark.parametrize("size", [0.01, 0.3])
def test_noise_is_measured(size: float):
    """Scatter is measured, widens the interval, and stops the search."""

    def given(wanted: RunRequest) -> dict[str, float]:
        scatter = np.random.default_rng(round(1e4 * wanted.values[0])).normal()
        return {**bowl(wanted), STRESS: bowl(wanted)[STRESS] + size * scatter}

    found = solve(study(), given)
    assert found.objective.noise == pytest.approx(size, rel=0.7)
    assert covered(found, 3.3)
    assert found.step > solve(study(), bowl).step or size < 0.1
    assert found.runs["search"] < 40


def test_pure_noise():
    def given(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: np.random.default_rng(round(1e4 * wanted.values[0])).normal()}

    found = solve(study(), given)
    (value,) = found.values
    assert value.high - value.low > 0.3
    assert found.runs["search"] < 40
    assert any("flat" in str(line) for line in report(found) if isinstance(line, str))


def test_objective_of_steps():
    """Without a slope, or with a useless one: a place on the lowest step."""
    found = solve(study(), lambda w: {STRESS: 5.0 + 2.0 * np.floor(abs(w.values[0] - 3.3) / 0.25)})
    assert found.objective.value == pytest.approx(5.0)
    assert covered(found, 3.3)


def test_constraints_that_cannot_be_met():
    """Heat is largest at 4.2 m/min, 5 MJ/m, and 9 are required."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed = wanted.values[0]
        return {**bowl(wanted), HEAT: 1e6 * (5.0 - (speed - 4.2) ** 2)}

    table = ["heat_removed >= 9 MJ/m", "von_mises_max <= 1 GPa"]
    found = solve(study(constraints=table), given)
    assert found.status == "impossible"
    assert found.values[0].value == pytest.approx(4.2, abs=0.05)
    assert found.worst.text == table[0]
    assert found.worst.left == pytest.approx(-4e6, rel=1e-3)
    first = next(iter(report(found)))
    assert "cannot be met; nearest, heat_removed >= 9 MJ/m is missed by 4 MJ/m" in str(first)


def test_range_that_ends_too_early_is_named():
    found = solve(study(constraints=["heat_removed >= 9 MJ/m"]), bowl)
    assert found.status == "impossible" and found.values[0].at_end == "highest"
    first = str(next(iter(report(found))))
    assert first.endswith(
        "with casting.speed at the highest of its range: a wider one may meet them"
    )


def test_two_equal_optima():
    """One is found; equally good runs elsewhere are reported if there were any."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed = wanted.values[0]
        scatter = np.random.default_rng(round(1e4 * speed)).normal()
        return {STRESS: 10.0 + ((speed - 3.2) ** 2 - 0.04) ** 2 + 1e-3 * scatter}

    found = solve(study({**SPEED, "start": "3.2 m/min"}), given)
    assert min(abs(found.values[0].value - x) for x in (3.0, 3.4)) < 0.1
    assert found.other_optima or (covered(found, 3.0) and covered(found, 3.4))


def test_noise_about_the_best_run():
    """If windows are cut for their error, neighbours of the best run may differ by that."""

    def given(cut: int) -> Given:
        def one(wanted: RunRequest) -> Evaluation:
            speed = wanted.values[0]
            steps = round(1e4 * speed) % 7 - 3 if abs(speed - 3.3) < 0.2 else 0
            stress = Quantity(bowl(wanted)[STRESS] + 0.01 * steps, "Pa", "stress")
            return Evaluation({STRESS: stress}, cut=cut)

        return one

    start = {**SPEED, "start": "4.5 m/min"}
    blind, seen = solve(study(start), given(0)), solve(study(start), given(2))
    assert blind.objective.noise < 1e-4
    assert 0.005 < seen.objective.noise < 0.05
    widths = [found.values[0].high - found.values[0].low for found in (blind, seen)]
    assert widths[1] > widths[0]


def test_search_by_temperature_only():
    """The error is the change to the finest level plus its own; the finest level also checks."""
    moved = {"thermal": 0.0, "coarse": 0.4, "default": 0.3, "fine": 0.25}

    def given(wanted: RunRequest) -> dict[str, float]:
        off = wanted.values[0] - 3.3 - moved[wanted.fidelity]
        return {STRESS: 10.0 + 2.0 * off**2 + moved[wanted.fidelity]}

    found = solve(study(fidelity="thermal"), given)
    (value,) = found.values
    assert found.checked == "fine"
    assert value.value == pytest.approx(3.3, abs=0.01)
    here = {word: 10.0 + 2.0 * by**2 + by for word, by in moved.items()}
    own = error({word: here[word] for word in LEVELS}, "fine")
    assert own > 0.0
    assert found.objective.numerical == pytest.approx(here["fine"] - 10.0 + own, rel=0.02)
    assert value.low <= 3.3 and (value.open_high or value.high >= 3.55)


def test_level_between_the_finest_and_its_error():
    """Below it reaches as far as the error of the finest level, above it has the full error."""
    values = {"coarse": 1.4, "default": 1.2, "fine": 1.1}
    own = error(values, "fine")
    assert sides({"thermal": 1.0, **values}, "thermal") == pytest.approx(
        (max(0.0, own - 0.1), own + 0.1)
    )
    assert sides({"thermal": 1.0, "coarse": 0.8}, "thermal") == pytest.approx((0.2, 0.0))
    assert sides({"thermal": 1.0, "coarse": np.nan}, "thermal") == (0.0, 0.0)
    assert np.isnan(error({"thermal": 1.0}, "thermal"))


@pytest.mark.parametrize("most", [7, 8, 12, 20])
@pytest.mark.parametrize("table", [{"minimise": HEAT}, {"minimise": [], "maximise": HEAT}])
def test_best_of_all_runs_is_the_answer(table: dict[str, object], most: int) -> None:
    """Few runs of a result that rises throughout: none of them is better than the answer."""
    seen: dict[float, float] = {}

    def given(wanted: RunRequest) -> dict[str, float]:
        heat = 1e6 * (1.0 + 0.1 * (wanted.values[0] - 10.0))
        if wanted.fidelity == "default":
            seen[wanted.values[0]] = heat
        return {HEAT: heat, STRESS: 1.0}

    found = solve(study(SUPERHEAT, most_runs=most, **table), given)
    best = (max if "maximise" in table else min)(seen, key=seen.__getitem__)
    assert found.values[0].value == best
    truth = 50.0 if "maximise" in table else 10.0
    assert (found.status == "found") == (best == truth)
    assert found.status in ("found", "not converged")
    assert covered(found, truth)
    assert ("not converged" in "".join(b for b in report(found) if isinstance(b, str))) == (
        found.status != "found"
    )
    json.dumps(plain(found.to_json()), allow_nan=False)


@pytest.mark.parametrize("most", [6, 8, 10, 14])
@pytest.mark.parametrize("start", ["30 K", "40 K", "52 K"])
def test_optimum_is_found_only_at_the_end_of_the_range(start: str, most: int) -> None:
    """A search that runs out of runs within a step of the end of the range is not done."""
    variable = {"key": "casting.superheat", "range": ["5 K", "60 K"], "start": start}
    problem = study(variable, minimise=[], maximise=HEAT, most_runs=most)
    found = solve(problem, lambda wanted: {HEAT: 4.8e6 + 1.7e3 * wanted.values[0], STRESS: 1.0})
    assert found.status in ("found", "not converged")
    assert (found.status == "found") <= (found.values[0].value == 60.0), found.values
    text = "".join(part for part in report(found) if isinstance(part, str))
    assert "the check of it failed" not in text


def test_independent_result_has_no_optimum() -> None:
    """Differences of 1e-12 K are rounding."""

    def given(wanted: RunRequest) -> dict[str, float]:
        return {STRESS: 1500.0 + 1e-12 * np.sin(1e3 * wanted.values[0]), HEAT: 1.0}

    found = solve(study(SUPERHEAT), given)
    assert found.status == "independent" and found.without_effect == ("casting.superheat",)
    (first, *_) = (block for block in report(found) if isinstance(block, str))
    assert "depends on none of casting.superheat; any value is as good" in first
    both = solve(study(SPEED, SUPERHEAT), lambda w: bowl(w))
    assert both.status == "found" and both.without_effect == ("casting.superheat",)
    assert any(
        "no result depends on casting.superheat" in b for b in report(both) if isinstance(b, str)
    )
