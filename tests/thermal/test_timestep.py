"""Step control: milestones to the digit, rejection, cut-back, limits."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.errors import RunFailure
from castfem.timestep import Adaptive, StepControl

BOUNDS = Adaptive(tolerance=1.0, first=1e-3, smallest=1e-5, largest=0.5)


def march(control: StepControl, error: float) -> list[float]:
    times = [0.0]
    while times[-1] < control.end:
        end = control.propose(times[-1])
        assert end > times[-1]
        control.learn(end - times[-1], error)
        times.append(end)
        assert len(times) < 100_000
    return times


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.01, 9.99), max_size=8), st.sampled_from([0.05, 0.3, 20.0]))
def test_milestones_are_hit_exactly(stops: list[float], step: float) -> None:
    for control in (
        StepControl(10.0, stops, fixed=step),
        StepControl(10.0, stops, adaptive=BOUNDS),
    ):
        times = march(control, 0.3)
        assert times[-1] == 10.0
        reached = sorted(set(times))
        for stop in stops:
            assert min(abs(t - stop) for t in reached) <= 1e-12 * 10.0


def test_adaptive_steps_grow_to_the_largest_and_leave_no_crumb() -> None:
    times = march(StepControl(100.0, adaptive=BOUNDS), 0.01)
    steps = [b - a for a, b in pairwise(times)]
    assert max(steps) == pytest.approx(0.5)
    assert min(steps[20:]) > 0.2


def test_large_error_is_rejected_and_cut() -> None:
    control = StepControl(10.0, adaptive=BOUNDS)
    assert not control.accepts(8.0)
    control.step = 0.4
    control.learn(0.4, 8.0)
    assert control.step == pytest.approx(0.4 * 0.9 / 2.0)


def test_below_the_smallest_step_the_run_fails_with_the_key_to_change() -> None:
    control = StepControl(10.0, adaptive=BOUNDS)
    with pytest.raises(RunFailure, match=r"thermal\.time\.adaptive\.smallest"):
        for _ in range(50):
            control.learn(control.step, 1e9)


def test_failed_solver_cuts_back_and_a_fixed_step_recovers() -> None:
    control = StepControl(10.0, fixed=0.1)
    control.failed(0.1, "DIVERGED_MAX_IT")
    assert control.step == pytest.approx(0.025)
    for _ in range(5):
        control.learn(control.step, 0.0)
    assert control.step == 0.1
    with pytest.raises(RunFailure, match="DIVERGED_MAX_IT"):
        for _ in range(50):
            control.failed(control.step, "DIVERGED_MAX_IT")


def test_restart_begins_small_again() -> None:
    control = StepControl(10.0, adaptive=BOUNDS)
    control.step = 0.4
    control.restart()
    assert control.step == BOUNDS.first
