"""Where an optimum goes when its margins are those of another level."""

from __future__ import annotations

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS, solve
from small_case import small

from castfem.base.types import Array
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Evaluation, Optimum, RunRequest, Study
from castfem.studies.optimisation.local_model import MODEL, Quadratic, around, nearest

CENTRE, STEP = np.array([0.5, 0.4]), np.array([0.05, 0.1])
SUPERHEAT = {"key": "casting.superheat", "range": ["10 K", "50 K"]}


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
    asked = {
        "minimise": STRESS, "variable": [SPEED, SUPERHEAT], "fidelity": "coarse",
        "constraints": ["heat_removed >= 0.5 MJ/m"],
    }  # fmt: skip
    return solve(Study(small({"casting.length": "6 mm", "optimise": asked})), given)


def test_the_level_of_the_check_meets_the_bound_by_its_own_run():
    found = searched()
    assert found.by_check is not None
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
    assert found.by_check is not None
    assert found.by_check.left == pytest.approx((found.constraints[0].checked,))


@pytest.mark.parametrize("end", [26.0, 35.0, 50.0])
def test_a_check_that_is_missed_still_goes_on_by_its_own_runs(end: float) -> None:
    """By fine cells the heat grows a fifth as fast: far beyond where the quadratics hold."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        slow = 0.2 if wanted.fidelity == "fine" else 1.0
        heat = 0.5 + 0.05 * slow * (superheat - 20.0) - (0.1 if slow < 1.0 else 0.0)
        return {STRESS: superheat + 0.02 * (speed - 3.4) ** 2, HEAT: 1e6 * heat}

    asked = {
        "minimise": STRESS, "variable": [SPEED, SUPERHEAT | {"range": ["10 K", f"{end} K"]}],
        "fidelity": "coarse", "constraints": ["heat_removed >= 0.5 MJ/m"],
    }  # fmt: skip
    found = solve(Study(small({"casting.length": "6 mm", "optimise": asked})), given)
    assert found.by_check is not None and found.values[1].value == pytest.approx(20.0, abs=0.5)
    value, (left,) = found.values[1], found.by_check.left
    reached = value.checked
    assert reached is not None and value.high >= reached
    if end < 30.0:  # never met: as far as the range goes, and open beyond
        assert left < 0.0 and reached == pytest.approx(end) and value.open_high
        return
    assert left > -1e4 and 29.0 <= reached <= 34.0  # 30 K meet it
