"""Change of an optimum if its margins are those of another level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, solve, study

from castfem.base.types import Array
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Evaluation, Optimum, RunRequest, Study
from castfem.studies.optimisation.check_level import Check, CheckedOptimum
from castfem.studies.optimisation.fidelity import NumericalError
from castfem.studies.optimisation.local_model import (
    MODEL,
    Binding,
    Quadratic,
    around,
    intervals,
    nearest,
)

CENTRE, STEP = np.array([0.5, 0.4]), np.array([0.05, 0.1])


def quadratic(*margins: tuple[float, float, float]) -> Quadratic:
    """Return a cost, and margins a + b dx + c dy, in steps from the optimum."""
    grid = np.linspace(-MODEL.reach, MODEL.reach, 5)
    steps = np.array([[a, b] for a in grid for b in grid])
    values = [
        np.sum(steps, axis=1),
        *(a + b * steps[:, 0] + c * steps[:, 1] for a, b, c in margins),
    ]
    return Quadratic.fit(CENTRE, STEP, CENTRE + steps * STEP, np.column_stack(values))


def in_steps(place: Array) -> Array:
    return np.asarray((place - CENTRE) / STEP)


@pytest.mark.parametrize(
    ("centre", "shares"),
    [
        (0.5, [0.3, 0.4, 0.6, 0.7]),
        (0.95, [0.75, 0.85, 1.0]),  # the end of the range replaces 1.05
        (0.85, [0.65, 0.75, 0.95, 1.0]),
        (0.997, [0.797, 0.897]),  # it is next to the optimum
        (0.897, [0.697, 0.797, 0.997]),
        (0.0, [0.1, 0.2]),
        (0.06, [0.0, 0.16, 0.26]),
    ],
)
def test_places_near_an_optimum_include_range_ends(centre: float, shares: list[float]) -> None:
    found = around(np.array([0.5, centre]), np.array([0.6, 0.1]))
    assert [at[1] for at in found if at[0] == 0.5] == pytest.approx(shares)
    assert [at[0] for at in found if at[0] != 0.5] == [0.0, 1.0]


def test_nearest_place_that_meets_a_moved_bound():
    """Along its slope, in steps: 3 dx + 4 dy = 1 is nearest at (3, 4) / 25."""
    model = quadratic((0.0, 3.0, 4.0))
    found = nearest(model, np.array([-1.0]), [True])
    assert in_steps(found) == pytest.approx([0.12, 0.16], abs=1e-5)
    back = nearest(model, np.array([1.0]), [True])
    assert in_steps(back) == pytest.approx([-0.12, -0.16], abs=1e-5)


def test_inactive_bounds_are_only_kept():
    """A bound with a margin has no effect; a missed one is met; of two that intersect, both."""
    model = quadratic((0.0, 1.0, 0.0), (0.5, 0.0, 1.0))
    free = nearest(model, np.array([-1.0, 0.0]), [True, False])
    assert in_steps(free) == pytest.approx([1.0, 0.0], abs=1e-5)
    missed = nearest(model, np.array([-1.0, -1.5]), [True, False])
    assert in_steps(missed) == pytest.approx([1.0, 1.0], abs=1e-5)


def test_optimum_with_its_margins_stays():
    model = quadratic((0.0, 1.0, 0.0), (0.5, 0.0, 1.0))
    assert nearest(model, np.zeros(2), [True, False]) == pytest.approx(CENTRE, abs=1e-7)
    assert nearest(model, np.array([1.0, 1.0]), [False, False]) == pytest.approx(CENTRE, abs=1e-7)
    assert nearest(quadratic(), np.zeros(0), []) == pytest.approx(CENTRE)


def test_unreachable_bound_is_missed_least():
    found = nearest(quadratic((0.0, 1.0, 0.0)), np.array([-100.0]), [True])
    assert in_steps(found)[0] == pytest.approx(MODEL.reach, abs=0.01)


def kinked(wanted: RunRequest) -> dict[str, float]:
    """Return a flat valley of stress, with curved heat; with fine cells some heat is missing.

    Far from the optimum along the valley quadratics are useless: heat breaks down there.
    """
    speed, superheat = wanted.values
    off = {"coarse": 0.0, "default": 0.05, "fine": 0.08}[wanted.fidelity]
    lost = 5.0 * max(abs(speed - 3.4) - 0.6, 0.0) ** 2
    heat = np.tanh((superheat - 20.0) / 4.0) - off * (1.0 + 0.1 * (superheat - 22.2)) - lost
    return {STRESS: superheat + 0.02 * abs(speed - 3.4), HEAT: 1e6 * heat}


def searched(given=kinked) -> Optimum:  # type: ignore[no-untyped-def]
    constrained = {"fidelity": "coarse", "constraints": ["heat_removed >= 0.5 MJ/m"]}
    return solve(study(SPEED, SUPERHEAT, **constrained), given)


def test_check_level_meets_the_bound_by_its_own_run():
    found = searched()
    speed, superheat = (v.checked for v in found.values)
    assert speed is not None
    assert superheat is not None
    given = kinked(RunRequest((speed, superheat), "fine"))
    assert found.by_check.objective == pytest.approx(given[STRESS])
    assert found.by_check.left == pytest.approx((given[HEAT] - 0.5e6,), abs=1e-3)
    missed = found.constraints[0].checked
    assert missed < -0.05e6
    assert abs(found.by_check.left[0]) < 0.1 * abs(missed)
    assert speed == pytest.approx(found.values[0].value, abs=0.1)  # no change along the valley
    assert all(v.low <= v.checked <= v.high for v in found.values if v.checked is not None)
    assert any(line.startswith("by fine, ") for line in report(found) if isinstance(line, str))
    assert found.to_json()["by_check"]["left"] == pytest.approx([1e-6 * found.by_check.left[0]])


def test_failing_check_keeps_the_successful_runs():
    best = searched().values[1].value

    def given(wanted: RunRequest) -> dict[str, float] | Evaluation:
        if wanted.fidelity == "fine" and wanted.values[1] > best + 0.05:
            return Evaluation({}, 0.5, "breakout")
        return kinked(wanted)

    found = searched(given)
    assert [v.checked for v in found.values] == [v.value for v in found.values]
    assert found.by_check.left == pytest.approx((found.constraints[0].checked,))


@pytest.mark.parametrize("end", [26.0, 35.0, 50.0])
def test_missed_check_continues_with_its_own_runs(end: float) -> None:
    """With fine cells the heat grows a fifth as fast: far beyond the validity of the quadratics."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        slow = 0.2 if wanted.fidelity == "fine" else 1.0
        heat = 0.5 + 0.05 * slow * (superheat - 20.0) - (0.1 if slow < 1.0 else 0.0)
        return {STRESS: superheat + 0.02 * (speed - 3.4) ** 2, HEAT: 1e6 * heat}

    request = {"fidelity": "coarse", "constraints": ["heat_removed >= 0.5 MJ/m"]}
    warm = SUPERHEAT | {"range": ["10 K", f"{end} K"]}
    found = solve(study(SPEED, warm, **request), given)
    assert found.by_check is not None and found.values[1].value == pytest.approx(20.0, abs=0.5)
    value, (left,) = found.values[1], found.by_check.left
    reached = value.checked
    assert reached is not None and value.high >= reached
    if end < 30.0:  # never met: up to the end of the range, and open beyond
        assert left < 0.0 and reached == pytest.approx(end) and value.open_high
        return
    assert left > -1e4 and 29.0 <= reached <= 34.0  # 30 K meet it


# Binding constraints of a jagged objective, and the level of the check from there


BINDING_CENTRE, BINDING_STEP, SCATTER = np.array([0.5]), np.array([0.02]), np.array([0.01, 0.01])


def dent(*margins: float) -> Quadratic:
    """Return a cost, least at the centre; margins are 0 there and rise by so much a step."""
    steps = np.linspace(-2.5, 2.5, 6)[:, None]
    values = np.column_stack([steps**2, *(m * steps[:, 0] for m in margins)])
    return Quadratic.fit(
        BINDING_CENTRE, BINDING_STEP, BINDING_CENTRE + steps * BINDING_STEP, values
    )


def held(seen: Array, *left: float, error: float = 0.0) -> Binding:
    here = np.array([0.0, *left])
    scatter = np.full(len(here), 0.01)
    return Binding.of(dent(*(1.0 for _ in left)), scatter, here, seen, np.full(len(left), error))


def test_better_run_that_misses_one_constraint():
    """By the quadratics nothing would be gained; a distant run shows a large gain."""
    assert held(np.array([[-1.0, -5.0]]), 0.0) == Binding((True,), (True,))
    assert held(np.array([[-0.02, -5.0]]), 0.0).held == (False,)  # only scatter
    assert held(np.array([[1.0, -5.0]]), 0.0).held == (False,)
    assert held(np.array([[np.nan, np.nan]]), 0.0).held == (False,)
    assert held(np.array([[-1.0, 2.0, -5.0]]), 0.0, 0.0).held == (False, True)


def test_bound_beyond_its_error_binds_from_a_distance():
    """It excludes better places, but the optimum is not at it."""
    seen = np.array([[-1.0, -5.0]])
    assert held(seen, 0.4) == Binding((True,), (False,))
    assert held(seen, 0.4, error=0.5) == Binding((True,), (True,))


def test_better_runs_that_miss_several_constraints():
    """The near bound binds; if a run shows that only one excludes it, that one."""
    seen = np.array([[-1.0, -5.0, -5.0]])
    assert held(seen, 0.0, 2.0).held == (True, False)
    assert held(seen, 2.0, 2.0).held == (True, True)
    assert held(np.vstack([seen, [-0.5, 3.0, -1.0]]), 0.0, 2.0).held == (False, True)


def jagged(wanted: RunRequest) -> dict[str, float]:
    """Return stress that grows with the speed, with dents; fine cells give 0.5 MJ/m more heat.

    Coarse cells meet 2 MJ/m from 4.2 m/min, at a dent of stress, fine cells from 3.7.
    """
    speed = wanted.values[0]
    stress = 10.0 + 3.0 * (speed - 2.0) - 0.6 * np.cos(2.0 * np.pi * (speed - 4.205) / 0.3)
    off = {"coarse": 0.0, "default": 0.25, "fine": 0.5}[wanted.fidelity]
    return {STRESS: stress, HEAT: 1e6 * (speed - 2.2 + off)}


def steep(wanted: RunRequest) -> dict[str, float]:
    """Return the same without dents and effects of cells."""
    speed = wanted.values[0]
    return {STRESS: 10.0 + 3.0 * (speed - 2.0), HEAT: 1e6 * (speed - 2.2)}


def constrained() -> Study:
    table = {"fidelity": "coarse", "constraints": ["heat_removed >= 2 MJ/m"]}
    return study({**SPEED, "start": "2.5 m/min"}, **table)


@pytest.fixture(scope="module")
def found() -> Optimum:
    return solve(constrained(), jagged)


def test_jagged_objective_is_held_by_its_constraint(found: Optimum):
    assert found.values[0].value == pytest.approx(4.2, abs=0.03)
    assert found.constraints[0].binding
    assert str(next(iter(report(found)))).endswith("found; held by heat_removed >= 2 MJ/m")
    (afar,) = (replace(kept, near=False) for kept in found.constraints)
    elsewhere = replace(found, constraints=(afar,))
    assert str(next(iter(report(elsewhere)))).endswith("2 MJ/m (which bars better places)")


def test_check_level_reaches_its_constraint(found: Optimum):
    """Its bound is 0.5 m/min away, beyond the validity of the quadratics of a dent."""
    (value,) = found.values
    assert value.checked is not None and found.by_check is not None
    assert 3.68 <= value.checked <= 3.95 and found.by_check.left[0] >= -0.02e6
    expected = jagged(RunRequest((value.checked,), "fine"))
    assert found.by_check.objective == pytest.approx(expected[STRESS])
    assert expected[STRESS] < jagged(RunRequest((value.value,), "fine"))[STRESS] - 0.5
    assert value.low <= value.checked


def test_interval_contains_better_runs_within_the_error(found: Optimum):
    """The error of the heat is about 0.6 MJ/m: the optimum may be at 3.6 m/min."""
    assert found.values[0].low <= 3.7


def test_far_run_is_compared_with_the_best_run():
    """The quadratics are above the tip of a kink, where an equally good run is no better."""
    steps = np.linspace(-2.0, 2.0, 5)[:, None]
    shares = np.vstack([BINDING_CENTRE + steps * BINDING_STEP, [[0.9]]])
    seen = np.vstack([np.abs(steps), [[0.001]]])
    model = Quadratic.fit(BINDING_CENTRE, BINDING_STEP, shares, seen)
    known = NumericalError.of("coarse", {"coarse": np.zeros(1), "default": np.zeros(1)})
    assert model(BINDING_CENTRE[None])[0, 0] > 0.1
    (there,) = intervals(replace(model, misfit=np.zeros(1)), np.zeros(1), known, shares, seen)
    assert there.high < 0.6
    seen[-1] = -5.0
    (there,) = intervals(replace(model, misfit=np.zeros(1)), np.zeros(1), known, shares, seen)
    assert there.high == pytest.approx(0.9)


class Along:
    """Runs of one variable with results by a function of their place."""

    def __init__(self, given: Callable[[float], list[float]]) -> None:
        self.problem, self.given, self.seen = self, given, list[float]()

    def shares(self, wanted: RunRequest) -> Array:
        return np.array(wanted.values)

    def request(self, shares: Array, fidelity: str = "coarse") -> RunRequest:
        return RunRequest((float(shares[0]),), fidelity)

    def fetch(self, wanted: list[RunRequest]) -> None:
        self.seen += [one.values[0] for one in wanted]

    def vector_or_nan(self, wanted: RunRequest) -> Array:
        return np.array(self.given(wanted.values[0]))

    def checked(self) -> CheckedOptimum:
        """Return the best by the level of the check, from 0.5; heat rises by 1 over the range."""
        steps = np.linspace(-2.5, 2.5, 6)[:, None]
        values = np.column_stack([steps, 0.02 * steps])
        model, best = (
            Quadratic.fit(
                BINDING_CENTRE, BINDING_STEP, BINDING_CENTRE + steps * BINDING_STEP, values
            ),
            self.request(BINDING_CENTRE),
        )
        check = Check("fine", self, model, [True], 0.002, SCATTER)  # type: ignore[arg-type]
        there = check.optimum(best)
        assert there is not None
        return there


def test_best_feasible_run_of_the_check_counts():
    """With fine cells the stress is least half-way to the bound: the optimum stays there."""
    runs = Along(lambda x: [abs(x - 0.25), x - 0.1])
    there = runs.checked()
    assert not there.missed
    assert min(runs.seen) == pytest.approx(0.1, abs=0.02)
    assert there.vector[0] == min(abs(x - 0.25) for x in runs.seen)


@pytest.mark.parametrize("most", [0.4, -0.005, -0.3])
def test_missed_constraint_is_flagged(most: float):
    """Heat has a maximum: it is flagged if that misses by more than the scatter."""
    there = Along(lambda x: [x, min(0.5 * x - 0.3, most)]).checked()
    assert there.missed == (most < -0.1)
    assert there.vector[1] == pytest.approx(min(0.0, most), abs=0.015)


@pytest.mark.parametrize("ends", [(False, False), (False, True)])
def test_value_with_a_missed_check_may_be_beyond(
    monkeypatch: pytest.MonkeyPatch, ends: tuple[bool, bool]
) -> None:
    """Only the flag opens the interval: of two answers equal but for it, only on its side."""
    optimum = Check.optimum

    def flagged(check: Check, best: RunRequest) -> CheckedOptimum:
        there = optimum(check, best)
        assert there is not None
        return replace(there, request=RunRequest((4.9,), "fine"), missed=ends[1])

    monkeypatch.setattr(Check, "optimum", flagged)
    (value,) = solve(constrained(), steep).values
    assert (value.open_low, value.open_high) == ends
    assert value.high == 4.9
