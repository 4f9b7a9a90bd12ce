"""Where an optimum goes when its margins are those of another level."""

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
    """A cost, and margins a + b dx + c dy in steps from the optimum."""
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
        (0.95, [0.75, 0.85, 1.0]),  # the end of the range stands in for 1.05
        (0.85, [0.65, 0.75, 0.95, 1.0]),
        (0.997, [0.797, 0.897]),  # it is next to the optimum
        (0.897, [0.697, 0.797, 0.997]),
        (0.0, [0.1, 0.2]),
        (0.06, [0.0, 0.16, 0.26]),
    ],
)
def test_places_about_an_optimum_reach_the_ends_of_the_ranges(
    centre: float, shares: list[float]
) -> None:
    found = around(np.array([0.5, centre]), np.array([0.6, 0.1]))
    assert [at[1] for at in found if at[0] == 0.5] == pytest.approx(shares)
    assert [at[0] for at in found if at[0] != 0.5] == [0.0, 1.0]


def test_nearest_place_that_meets_a_moved_bound():
    """Along its slope, by steps: 3 dx + 4 dy = 1 is nearest at (3, 4) / 25."""
    model = quadratic((0.0, 3.0, 4.0))
    found = nearest(model, np.array([-1.0]), [True])
    assert in_steps(found) == pytest.approx([0.12, 0.16], abs=1e-5)
    back = nearest(model, np.array([1.0]), [True])
    assert in_steps(back) == pytest.approx([-0.12, -0.16], abs=1e-5)


def test_bounds_that_do_not_bind_are_only_kept():
    """One with something left stays out of it; missed, it is met; the two that meet, both."""
    model = quadratic((0.0, 1.0, 0.0), (0.5, 0.0, 1.0))
    free = nearest(model, np.array([-1.0, 0.0]), [True, False])
    assert in_steps(free) == pytest.approx([1.0, 0.0], abs=1e-5)
    missed = nearest(model, np.array([-1.0, -1.5]), [True, False])
    assert in_steps(missed) == pytest.approx([1.0, 1.0], abs=1e-5)


def test_an_optimum_that_keeps_its_margins_stays():
    model = quadratic((0.0, 1.0, 0.0), (0.5, 0.0, 1.0))
    assert nearest(model, np.zeros(2), [True, False]) == pytest.approx(CENTRE, abs=1e-7)
    assert nearest(model, np.array([1.0, 1.0]), [False, False]) == pytest.approx(CENTRE, abs=1e-7)
    assert nearest(quadratic(), np.zeros(0), []) == pytest.approx(CENTRE)


def test_a_bound_out_of_reach_is_missed_least():
    found = nearest(quadratic((0.0, 1.0, 0.0)), np.array([-100.0]), [True])
    assert in_steps(found)[0] == pytest.approx(MODEL.reach, abs=0.01)


def kinked(wanted: RunRequest) -> dict[str, float]:
    """A flat valley of stress, with heat that bends; by fine cells some heat is missing.

    Far from the optimum along the valley quadratics are of no use: heat breaks down there.
    """
    speed, superheat = wanted.values
    off = {"coarse": 0.0, "default": 0.05, "fine": 0.08}[wanted.fidelity]
    lost = 5.0 * max(abs(speed - 3.4) - 0.6, 0.0) ** 2
    heat = np.tanh((superheat - 20.0) / 4.0) - off * (1.0 + 0.1 * (superheat - 22.2)) - lost
    return {STRESS: superheat + 0.02 * abs(speed - 3.4), HEAT: 1e6 * heat}


def searched(given=kinked) -> Optimum:  # type: ignore[no-untyped-def]
    asked = {"fidelity": "coarse", "constraints": ["heat_removed >= 0.5 MJ/m"]}
    return solve(study(SPEED, SUPERHEAT, **asked), given)


def test_the_level_of_the_check_meets_the_bound_by_its_own_run():
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
    assert speed == pytest.approx(found.values[0].value, abs=0.1)  # along the valley nothing asks
    assert all(v.low <= v.checked <= v.high for v in found.values if v.checked is not None)
    assert any(line.startswith("by fine, ") for line in report(found) if isinstance(line, str))
    assert found.to_json()["by_check"]["left"] == pytest.approx([1e-6 * found.by_check.left[0]])


def test_a_check_that_fails_on_the_way_leaves_what_came_through():
    best = searched().values[1].value

    def given(wanted: RunRequest) -> dict[str, float] | Evaluation:
        if wanted.fidelity == "fine" and wanted.values[1] > best + 0.05:
            return Evaluation({}, 0.5, "breakout")
        return kinked(wanted)

    found = searched(given)
    assert [v.checked for v in found.values] == [v.value for v in found.values]
    assert found.by_check.left == pytest.approx((found.constraints[0].checked,))


@pytest.mark.parametrize("end", [26.0, 35.0, 50.0])
def test_a_check_that_is_missed_still_goes_on_by_its_own_runs(end: float) -> None:
    """By fine cells the heat grows a fifth as fast: far beyond where the quadratics hold."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        slow = 0.2 if wanted.fidelity == "fine" else 1.0
        heat = 0.5 + 0.05 * slow * (superheat - 20.0) - (0.1 if slow < 1.0 else 0.0)
        return {STRESS: superheat + 0.02 * (speed - 3.4) ** 2, HEAT: 1e6 * heat}

    asked = {"fidelity": "coarse", "constraints": ["heat_removed >= 0.5 MJ/m"]}
    warm = SUPERHEAT | {"range": ["10 K", f"{end} K"]}
    found = solve(study(SPEED, warm, **asked), given)
    assert found.by_check is not None and found.values[1].value == pytest.approx(20.0, abs=0.5)
    value, (left,) = found.values[1], found.by_check.left
    reached = value.checked
    assert reached is not None and value.high >= reached
    if end < 30.0:  # never met: as far as the range goes, and open beyond
        assert left < 0.0 and reached == pytest.approx(end) and value.open_high
        return
    assert left > -1e4 and 29.0 <= reached <= 34.0  # 30 K meet it


# What binds where the objective is jagged, and how the level of the check goes on from there


BINDING_CENTRE, BINDING_STEP, SCATTER = np.array([0.5]), np.array([0.02]), np.array([0.01, 0.01])


def dent(*margins: float) -> Quadratic:
    """A cost with its least at the centre; margins that rise by so much a step, 0 there."""
    steps = np.linspace(-2.5, 2.5, 6)[:, None]
    values = np.column_stack([steps**2, *(m * steps[:, 0] for m in margins)])
    return Quadratic.fit(
        BINDING_CENTRE, BINDING_STEP, BINDING_CENTRE + steps * BINDING_STEP, values
    )


def held(seen: Array, *left: float, error: float = 0.0) -> Binding:
    here = np.array([0.0, *left])
    scatter = np.full(len(here), 0.01)
    return Binding.of(dent(*(1.0 for _ in left)), scatter, here, seen, np.full(len(left), error))


def test_a_better_run_that_misses_one_constraint_alone():
    """By the quadratics nothing would be gained; a run from afar says that much would."""
    assert held(np.array([[-1.0, -5.0]]), 0.0) == Binding((True,), (True,))
    assert held(np.array([[-0.02, -5.0]]), 0.0).held == (False,)  # that is scatter
    assert held(np.array([[1.0, -5.0]]), 0.0).held == (False,)
    assert held(np.array([[np.nan, np.nan]]), 0.0).held == (False,)
    assert held(np.array([[-1.0, 2.0, -5.0]]), 0.0, 0.0).held == (False, True)


def test_a_bound_that_lies_beyond_its_error_binds_from_afar():
    """It keeps from what is better, but the optimum is not at it."""
    seen = np.array([[-1.0, -5.0]])
    assert held(seen, 0.4) == Binding((True,), (False,))
    assert held(seen, 0.4, error=0.5) == Binding((True,), (True,))


def test_better_runs_that_miss_several_at_once():
    """The one whose bound is near; where a run tells that one alone keeps from it, that one."""
    seen = np.array([[-1.0, -5.0, -5.0]])
    assert held(seen, 0.0, 2.0).held == (True, False)
    assert held(seen, 2.0, 2.0).held == (True, True)
    assert held(np.vstack([seen, [-0.5, 3.0, -1.0]]), 0.0, 2.0).held == (False, True)


def jagged(wanted: RunRequest) -> dict[str, float]:
    """Stress grows with the speed, and goes up and down; fine cells give 0.5 MJ/m of heat more.

    2 MJ/m are met from 4.2 m/min on by coarse cells, where stress has a dent, from 3.7 by fine.
    """
    speed = wanted.values[0]
    stress = 10.0 + 3.0 * (speed - 2.0) - 0.6 * np.cos(2.0 * np.pi * (speed - 4.205) / 0.3)
    off = {"coarse": 0.0, "default": 0.25, "fine": 0.5}[wanted.fidelity]
    return {STRESS: stress, HEAT: 1e6 * (speed - 2.2 + off)}


def steep(wanted: RunRequest) -> dict[str, float]:
    """The same with neither dents nor what cells do."""
    speed = wanted.values[0]
    return {STRESS: 10.0 + 3.0 * (speed - 2.0), HEAT: 1e6 * (speed - 2.2)}


def asked() -> Study:
    table = {"fidelity": "coarse", "constraints": ["heat_removed >= 2 MJ/m"]}
    return study({**SPEED, "start": "2.5 m/min"}, **table)


@pytest.fixture(scope="module")
def found() -> Optimum:
    return solve(asked(), jagged)


def test_a_jagged_objective_is_held_by_its_constraint(found: Optimum):
    assert found.values[0].value == pytest.approx(4.2, abs=0.03)
    assert found.constraints[0].binding
    assert str(next(iter(report(found)))).endswith("found; held by heat_removed >= 2 MJ/m")
    (afar,) = (replace(kept, near=False) for kept in found.constraints)
    elsewhere = replace(found, constraints=(afar,))
    assert str(next(iter(report(elsewhere)))).endswith("2 MJ/m (which bars better places)")


def test_the_level_of_the_check_goes_on_to_where_its_constraint_is_met(found: Optimum):
    """Its bound lies 0.5 m/min off, beyond where the quadratics of a dent hold."""
    (value,) = found.values
    assert value.checked is not None and found.by_check is not None
    assert 3.68 <= value.checked <= 3.95 and found.by_check.left[0] >= -0.02e6
    there = jagged(RunRequest((value.checked,), "fine"))
    assert found.by_check.objective == pytest.approx(there[STRESS])
    assert there[STRESS] < jagged(RunRequest((value.value,), "fine"))[STRESS] - 0.5
    assert value.low <= value.checked


def test_the_interval_holds_better_runs_that_miss_by_less_than_the_error(found: Optimum):
    """The error of the heat is some 0.6 MJ/m: the optimum may lie at 3.6 m/min."""
    assert found.values[0].low <= 3.7


def test_a_far_run_is_held_against_the_best_run_not_against_its_quadratics():
    """Those lie above the tip of a kink, where a run that is as good as its tip is no better."""
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
    """Runs of one variable that give what a function of their place does."""

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
        """The best by the level of the check, from 0.5; heat rises by 1 over the range."""
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


def test_of_the_runs_of_the_check_that_meet_all_the_best_counts():
    """By fine cells the stress is least half way to the bound: there it stays."""
    runs = Along(lambda x: [abs(x - 0.25), x - 0.1])
    there = runs.checked()
    assert not there.missed
    assert min(runs.seen) == pytest.approx(0.1, abs=0.02)
    assert there.vector[0] == min(abs(x - 0.25) for x in runs.seen)


@pytest.mark.parametrize("most", [0.4, -0.005, -0.3])
def test_a_constraint_that_is_missed_at_the_last_is_flagged(most: float):
    """Heat that ends at its most: the flag is there where that misses by more than scatter."""
    there = Along(lambda x: [x, min(0.5 * x - 0.3, most)]).checked()
    assert there.missed == (most < -0.1)
    assert there.vector[1] == pytest.approx(min(0.0, most), abs=0.015)


@pytest.mark.parametrize("ends", [(False, False), (False, True)])
def test_a_value_whose_check_misses_a_constraint_may_lie_beyond(
    monkeypatch: pytest.MonkeyPatch, ends: tuple[bool, bool]
) -> None:
    """The flag alone opens the interval: of two answers alike but for it, on its side alone."""
    optimum = Check.optimum

    def flagged(check: Check, best: RunRequest) -> CheckedOptimum:
        there = optimum(check, best)
        assert there is not None
        return replace(there, request=RunRequest((4.9,), "fine"), missed=ends[1])

    monkeypatch.setattr(Check, "optimum", flagged)
    (value,) = solve(asked(), steep).values
    assert (value.open_low, value.open_high) == ends
    assert value.high == 4.9
