"""The spread of an optimum by its inputs: known variances, places by hand, failures, mistakes."""

from __future__ import annotations

import itertools
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import known_results
import numpy as np
import pytest
from known_results import HEAT, STRESS, Given, solve

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.load import load
from castfem.physics.constitutive.parameters import given_set
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Evaluation, RunRequest, Study, polynomial_fit
from castfem.studies.optimisation.polynomial_fit import coefficients, fit, least, samples
from castfem.studies.optimisation.problem import DesignProblem

H = {"key": "cooling.mould.surface.0.coefficient", "relative": ["-10 %", "10 %"]}
SUPERHEAT = {"key": "casting.superheat", "range": ["20 K", "40 K"]}


def study(**table: Any) -> Study:
    return known_results.study(**{"input": [H, SUPERHEAT], **table})


def drawn(wanted: RunRequest) -> tuple[float, float, float]:
    """Return the speed, and both inputs from -1 to 1."""
    h, superheat = wanted.inputs or (1.0, 30.0)
    return wanted.values[0], (h - 1.0) / 0.1, (superheat - 30.0) / 10.0


def shifted(wanted: RunRequest) -> dict[str, float]:
    """Return stress, least at 3.3 + 0.06 a + 0.03 b, where it is 10 + 0.5 a, without b."""
    speed, a, b = drawn(wanted)
    least = 3.3 + 0.06 * a + 0.03 * b
    return {STRESS: 10.0 + 0.5 * a + 2.0 * (speed - least) ** 2}


def test_optimum_for_other_inputs():
    found = solve(study(), shifted)
    json.dumps(found.to_json(), allow_nan=False)
    (value,) = found.values
    assert value.value == pytest.approx(3.3, abs=0.01)
    # Quantiles of 0.06 a + 0.03 b for uniform a and b: 5 % at -(0.09 - sqrt(8 x 0.06 x 0.03 / 20)).
    ends = 0.09 - np.sqrt(8.0 * 0.06 * 0.03 * 0.05)
    assert value.drawn == pytest.approx((3.3 - ends, 3.3 + ends), abs=0.006)
    assert value.low < value.drawn[0] < value.drawn[1] < value.high
    objective, place = found.spread.rows
    # Variances 0.06^2 / 3 and 0.03^2 / 3 of the place: 80 and 20 %.
    assert place.first == pytest.approx((0.8, 0.2), abs=0.06)
    assert place.total == pytest.approx((0.8, 0.2), abs=0.06)
    assert objective.first == pytest.approx((1.0, 0.0), abs=0.02)
    assert objective.change == pytest.approx((-0.45e-6, 0.45e-6), abs=0.02e-6)
    assert objective.error == pytest.approx(0.0, abs=1e-12)
    assert found.spread.failed == 0
    text = " ".join(line for line in report(found) if isinstance(line, str))
    assert "spread by the inputs, 16 runs" in text


def test_bound_moved_by_inputs():
    """Heat 2 (speed - 3) + a/10 must be 1: 3.5 - a/20 m/min; 95 % of draws are safe at 3.545."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, a, b = drawn(wanted)
        heat = 2.0 * (speed - 3.0) + 0.1 * a + 0.02 * a * b
        return {STRESS: 10.0 + speed**2, HEAT: 1e6 * heat}

    found = solve(study(constraints=["heat_removed >= 1 MJ/m"]), given)
    (value,) = found.values
    assert value.value == pytest.approx(3.5, abs=0.01)
    assert value.drawn == pytest.approx((3.455, 3.545), abs=0.01)
    assert value.safe == pytest.approx(3.545, abs=0.012)
    _, heat, _ = found.spread.rows
    assert heat.met == pytest.approx(0.5, abs=0.1)
    # Parts of a and the product a b: variances 0.1^2/3 and 0.02^2/9.
    ratio = 0.02**2 / 9.0 / (0.1**2 / 3.0)
    assert heat.first[1] == pytest.approx(0.0, abs=0.01)
    assert heat.total[1] == pytest.approx(ratio / (1.0 + ratio), abs=0.01)
    text = " ".join(line for line in report(found) if isinstance(line, str))
    assert "best of what meets all constraints in 95 % of the draws: casting.speed" in text


def test_single_input_is_the_cause_of_all():
    """One variable, one input, no constraint: scipy returns numbers instead of arrays."""

    def given(wanted: RunRequest) -> dict[str, float]:
        a = ((wanted.inputs or (1.0,))[0] - 1.0) / 0.1
        return {STRESS: 10.0 + 0.5 * a + 2.0 * (wanted.values[0] - 3.3 - 0.06 * a) ** 2}

    found = solve(study(input=[H]), given)
    objective, place = found.spread.rows
    for row in (objective, place):
        assert row.first == pytest.approx((1.0,), abs=0.03)
        assert row.total == pytest.approx((1.0,), abs=0.03)


def test_error_of_the_quadratics_is_reported():
    def given(wanted: RunRequest) -> dict[str, float]:
        _, a, b = drawn(wanted)
        return {STRESS: shifted(wanted)[STRESS] + 0.1 * np.sin(9.0 * a) * np.cos(7.0 * b)}

    found = solve(study(samples=64), given)
    assert 0.03 < 1e6 * (found.spread.rows[0].error or 0.0) < 0.2


def test_failed_draws_are_left_out():
    """Some are left out; with too many there is no spread, but still an answer."""

    def given(threshold: float) -> Given:
        def one(wanted: RunRequest) -> Mapping[str, float] | Evaluation:
            if drawn(wanted)[1] > threshold and wanted.inputs:
                return Evaluation({}, 0.5, "breakout")
            return shifted(wanted)

        return one

    some = solve(study(samples=32), given(0.7))
    assert 0 < some.spread.failed < 8
    assert some.values[0].drawn == pytest.approx((3.243, 3.357), abs=0.02)
    none = solve(study(), given(-0.9))
    assert none.spread is None
    assert none.values[0].value == pytest.approx(3.3, abs=0.01)


def test_relative_inputs_are_multiplied():
    """A number, a table, a property of the steel, a parameter of the law, each in its own file."""
    table = {"time": [0, 1], "time_unit": "s", "value": [1600, 1200], "unit": "W/(m^2 K)"}
    case = load("billet125/taper_1").with_({"cooling.mould.surface.0.coefficient": table})
    keys = ["cooling.mould.surface.0.coefficient", "casting.superheat", "steel.conductivity",
            "mechanics.law.strength", "mechanics.elasticity.young"]  # fmt: skip
    request = {
        "minimise": STRESS,
        "variable": [{"key": "mould.taper", "range": ["0 %/m", "1 %/m"]}],
        "input": [{"key": key, "relative": ["-10 %", "20 %"]} for key in keys],
    }
    question = DesignProblem(case.with_({"optimise": request}))
    wanted = RunRequest((0.5,), "coarse", inputs=(1.2,) * len(keys))
    changed = case.with_(question.changes(wanted))
    document = changed.document()
    assert changed.cooling[0].surface[0].coefficient(0.5) == pytest.approx(1.2 * 1400.0)
    assert changed.casting.superheat == pytest.approx(48.0)
    assert document["steel"]["overrides"]["conductivity"]["value"] == "36 W/(m K)"
    law = tomllib.loads(Path(document["mechanics"]["law"]).read_text())
    assert law["strength"]["value"][0] == pytest.approx(1.2 * 108.62)
    assert law["p3"]["value"][0] == 0.1215
    young = tomllib.loads(Path(document["mechanics"]["elasticity"]).read_text())["young"]
    plain = given_set("elastic_steel")["young"]
    assert young["value"] == pytest.approx([1.2 * v for v in plain["value"]])


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ({"key": "casting.speed"}, "optimise.input.0: one of range and relative is needed"),
        ({**H, "range": ["1 W/(m^2 K)", "2 W/(m^2 K)"]}, "optimise.input.0: one of range and rel"),
        ({**H, "relative": ["10 %", "-10 %"]}, "optimise.input.0.relative: is empty"),
        ({**H, "relative": ["-10 K", "10 K"]}, "optimise.input.0.relative: "),
        ({**SUPERHEAT, "key": "casting.superhat"}, "optimise.input.0: casting.superhat"),
        ({**H, "key": "steel.conductivty"}, "optimise.input.0: steel.conductivty: there is no"),
        ({**H, "key": "steel.solidus"}, "optimise.input.0: steel.solidus: a temperature is not"),
        ({**H, "key": "casting.speedy"}, "optimise.input.0: "),
    ],
)
def test_invalid_inputs_are_refused(entry: dict[str, Any], line: str):
    with pytest.raises(InputError) as error:
        study(input=[entry])
    assert any(line in problem for problem in error.value.problems), error.value.problems


# Polynomials through runs and their derivatives: exact ones, omitted runs, unknown derivatives


def cubic(x: Array) -> tuple[Array, Array]:
    """Return two results of a variable and two inputs at places (r, 3), and slopes (r, 2, 3)."""
    a, b, c = x.T
    values = np.column_stack([1.0 + 2.0 * a - b * c + a**3, 3.0 * c - a * b])
    one = np.column_stack([2.0 + 3.0 * a**2, -c, -b])
    other = np.column_stack([-b, -a, np.full_like(a, 3.0)])
    return values, np.stack([one, other], axis=1)


def bent(x: Array) -> tuple[Array, Array]:
    """Return a result that is no quadratic, and its derivatives."""
    a, b, c = x.T
    slopes = np.column_stack([4.0 * np.cos(4.0 * a) * b, np.sin(4.0 * a), 2.0 * c])
    return (np.sin(4.0 * a) * b + c**2)[:, None], slopes[:, None]


def drawn_places(count: int) -> Array:
    return 2.0 * np.random.default_rng(3).random((count, 3)) - 1.0


@pytest.mark.parametrize("carrying", [True, False])
def test_polynomials_are_recovered(carrying: bool) -> None:
    """By the least number of runs, with any of them omitted."""
    places = drawn_places(least(1, 2, derivatives=carrying))
    values, slopes = cubic(places)
    laid, missed = fit(places, values, 1, slopes if carrying else None)
    there = drawn_places(40)
    assert laid(there) == pytest.approx(cubic(there)[0], abs=1e-8)
    assert missed == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("carrying", [True, False])
def test_cross_validation_error_is_that_of_refits(carrying: bool) -> None:
    places = drawn_places(18)
    values, slopes = bent(places)
    left = []
    for i in range(len(places)):
        rest = np.arange(len(places)) != i
        laid, _ = fit(places[rest], values[rest], 1, slopes[rest] if carrying else None)
        left.append(laid(places[i : i + 1])[0, 0] - values[i, 0])
    _, missed = fit(places, values, 1, slopes if carrying else None)
    assert missed[0] == pytest.approx(np.sqrt(np.mean(np.square(left))), rel=1e-9)
    assert missed[0] > 0.1


def test_unknown_derivative_is_no_equation() -> None:
    places = drawn_places(9)
    values, slopes = cubic(places)
    slopes[2, 0, 1] = slopes[5, 1, :] = np.nan
    laid, missed = fit(places, values, 1, slopes)
    there = drawn_places(40)
    assert laid(there) == pytest.approx(cubic(there)[0], abs=1e-8)
    assert missed == pytest.approx(0.0, abs=1e-8)


def test_number_of_runs() -> None:
    """As measured in docs/mould_design.md for a taper and four inputs."""
    assert (coefficients(1, 4), samples(1, 4), samples(1, 4, derivatives=True)) == (22, 32, 16)
    for variables, inputs in itertools.product(range(1, 5), range(1, 7)):
        for carrying in (True, False):
            few = least(variables, inputs, derivatives=carrying)
            assert samples(variables, inputs, derivatives=carrying) >= few


@pytest.mark.parametrize("variables", [1, 2, 4])
@pytest.mark.parametrize("inputs", [1, 3])
def test_least_number_of_runs_is_sufficient(variables: int, inputs: int) -> None:
    """Any polynomial of the kind is recovered, also with one run less, with and without slopes."""
    every = variables + inputs
    random = np.random.default_rng(1)
    weights = random.random(coefficients(variables, inputs))

    def given(x: Array) -> tuple[Array, Array]:
        step = 1e-5 * np.eye(every)
        columns = polynomial_fit.columns
        by = [columns(x + h, variables) - columns(x - h, variables) for h in step]
        slopes = np.stack([b @ weights / 2e-5 for b in by], axis=1)
        return (columns(x, variables) @ weights)[:, None], slopes[:, None, :]

    for carrying in (True, False):
        places = 2.0 * random.random((least(variables, inputs, derivatives=carrying), every)) - 1.0
        values, slopes = given(places)
        laid, missed = fit(places, values, variables, slopes if carrying else None)
        there = 2.0 * random.random((20, every)) - 1.0
        assert laid(there) == pytest.approx(given(there)[0], abs=1e-5)
        assert missed == pytest.approx(0.0, abs=1e-3)
