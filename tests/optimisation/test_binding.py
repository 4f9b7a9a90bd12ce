"""What binds where the objective is jagged, and how the level of the check goes on from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, solve
from small_case import small

from castfem.base.types import Array
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Optimum, RunRequest, Study
from castfem.studies.optimisation.check_level import Check, CheckedOptimum
from castfem.studies.optimisation.local_model import Binding, Quadratic, intervals
from castfem.studies.optimisation.numerical_error import NumericalError

CENTRE, STEP, SCATTER = np.array([0.5]), np.array([0.02]), np.array([0.01, 0.01])


def dent(*margins: float) -> Quadratic:
    """A cost with its least at the centre; margins that rise by so much a step, 0 there."""
    steps = np.linspace(-2.5, 2.5, 6)[:, None]
    values = np.column_stack([steps**2, *(m * steps[:, 0] for m in margins)])
    return Quadratic.fit(CENTRE, STEP, CENTRE + steps * STEP, values)


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
    table = {
        "minimise": STRESS, "variable": [{**SPEED, "start": "2.5 m/min"}], "fidelity": "coarse",
        "constraints": ["heat_removed >= 2 MJ/m"],
    }  # fmt: skip
    return Study(small({"casting.length": "6 mm", "optimise": table}))


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
    shares = np.vstack([CENTRE + steps * STEP, [[0.9]]])
    seen = np.vstack([np.abs(steps), [[0.001]]])
    model = Quadratic.fit(CENTRE, STEP, shares, seen)
    known = NumericalError.of("coarse", {"coarse": np.zeros(1), "default": np.zeros(1)})
    assert model(CENTRE[None])[0, 0] > 0.1
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
            Quadratic.fit(CENTRE, STEP, CENTRE + steps * STEP, values),
            self.request(CENTRE),
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
