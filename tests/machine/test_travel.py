"""Time into place and back: a casting speed that is constant, changes, stops."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from castfem.physics.machine import Changing, Machine, Steady

# 1.2 m/min down to a stop in 10 s, 60 s of it, up again to 0.9 m/min in 20 s.
STOP = Changing([0.0, 30.0, 40.0, 100.0, 120.0], [0.02, 0.02, 0.0, 0.0, 0.015])
SPEED = st.just(0.0) | st.floats(1e-4, 0.2)
KNOTS = (0.0, 0.6, 0.7, 0.7, 0.85)


def test_a_constant_speed_is_that_of_one_multiplication() -> None:
    """To the last bit, in both directions."""
    way = Steady(0.06)
    for time in (0.0, 0.1, 3.7, 1e4 / 3.0):
        assert way.position(time) == 0.06 * time
        assert way.time_at(time) == time / 0.06
    assert (way.speed(5.0), way.mean_speed(5.0), way.kinks) == (0.06, 0.06, ())


def test_the_position_is_the_integral_of_the_speed() -> None:
    for time, position in zip((0.0, 30.0, 40.0, 100.0, 120.0), KNOTS, strict=True):
        assert STOP.position(time) == pytest.approx(position, rel=1e-15, abs=1e-18)
    assert STOP.position(35.0) == pytest.approx(0.6 + 0.02 * 5.0 - 0.001 * 25.0, rel=1e-15)
    assert STOP.position(70.0) == STOP.position(40.0)  # it stands
    assert STOP.position(200.0) == pytest.approx(0.85 + 80.0 * 0.015, rel=1e-15)
    assert STOP.mean_speed(120.0) == pytest.approx(0.85 / 120.0, rel=1e-15)
    assert STOP.mean_speed(0.0) == STOP.speed(0.0) == 0.02
    assert STOP.kinks == (30.0, 40.0, 100.0, 120.0)


def test_a_place_where_the_strand_stands_is_met_when_it_stops() -> None:
    """Not a hair before, which the flat parabola would make of rounding, and not as it starts."""
    assert STOP.time_at(STOP.position(70.0)) == 40.0
    assert STOP.time_at(0.7 * (1.0 + 1e-15)) == 40.0
    assert STOP.time_at(0.7 * (1.0 - 1e-15)) == 40.0
    assert 39.0 < STOP.time_at(0.6999) < 40.0
    assert 100.0 < STOP.time_at(0.7001) < 110.0


def test_a_table_that_begins_late_holds_its_first_speed_before() -> None:
    way = Changing([10.0, 20.0], [0.01, 0.03])
    assert way.position(10.0) == pytest.approx(0.1, rel=1e-15)
    assert way.speed(0.0) == 0.01
    assert way.kinks == (10.0, 20.0)
    # Of rows before the meniscus the speed there is what counts.
    assert Changing([-10.0, 10.0], [0.0, 0.02]).position(10.0) == pytest.approx(0.15, rel=1e-15)


def test_a_strand_that_stands_for_good_comes_no_further() -> None:
    way = Changing([0.0, 10.0], [0.02, 0.0])
    assert way.time_at(0.1) == 10.0
    assert way.time_at(0.1001) == math.inf
    waits = Changing([0.0, 5.0, 6.0], [0.0, 0.0, 0.02])
    assert waits.time_at(0.0) == 0.0
    assert waits.time_at(1e-9) > 5.0


@given(
    st.lists(st.tuples(st.floats(0.01, 100.0), SPEED), min_size=2, max_size=8), st.floats(0.0, 1.0)
)
def test_time_at_is_the_inverse_of_position(rows: list[tuple[float, float]], share: float) -> None:
    times = list(itertools.accumulate(step for step, _ in rows))
    way = Changing(times, [speed for _, speed in rows])
    time = share * times[-1]
    position = way.position(time)
    met = way.time_at(position)
    assert met <= time + 1e-5 * times[-1]  # it may stand there
    assert way.position(met) == pytest.approx(position, rel=1e-11, abs=1e-300)
    fine = np.array(sorted({0.0, time, *(t for t in times if t < time)}))  # linear in between
    speeds = np.array([way.speed(t) for t in fine])
    integral = float(np.sum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(fine)))
    assert position == pytest.approx(integral, rel=1e-9, abs=1e-300)


@pytest.mark.parametrize(
    ("times", "speeds", "said"),
    [
        ([0.0, 1.0], [0.02, -0.01], "must not be negative"),
        ([0.0, 0.0], [0.02, 0.01], "must increase"),
        ([0.0, 1.0], [0.02], "as many speeds as times"),
        ([0.0, 1.0], [0.02, math.nan], "must not be negative"),
    ],
)
def test_impossible_speeds_are_refused(times: list[float], speeds: list[float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Changing(times, speeds)


def test_a_constant_speed_must_be_one() -> None:
    for speed in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="positive"):
            Steady(speed)


def test_the_head_of_a_vertical_machine_goes_with_the_position() -> None:
    machine = Machine(STOP)
    head = machine.head(7000.0)
    for time in (0.0, 35.0, 70.0, 150.0):
        assert head(time) == pytest.approx(7000.0 * 9.81 * machine.position(time), rel=1e-15)
    assert Machine(Steady(0.06)).head(7000.0)(10.0) == pytest.approx(7000.0 * 9.81 * 0.6)
    assert machine.height(3.0) == 3.0
    assert machine.curvature(3.0) == machine.inclination(3.0) == 0.0


def test_the_speed_between_two_places_is_the_mean_on_the_way() -> None:
    """Of a strand that stands for good between them, until it stands."""
    assert Machine(Steady(0.02)).speed_between(0.9, 1.1) == 0.02
    stopping = Machine(Changing([10.0, 12.0, 72.0, 74.0], [0.02, 0.0, 0.0, 0.02]))
    # 0.2 m is met at 10 s, it stands at 0.22 m from 12 to 72 s, and 0.24 m is met at 74 s.
    assert stopping.speed_between(0.2, 0.24) == pytest.approx(0.04 / 64.0, rel=1e-12)
    ended = Machine(Changing([10.0, 12.0], [0.02, 0.0]))
    assert ended.time_near(0.3) == 12.0 and ended.time_near(0.1) == pytest.approx(5.0)
    assert ended.speed_between(0.2, 0.3) == pytest.approx(0.01, rel=1e-12)


def test_windows_by_length() -> None:
    """Of equal lengths; where the strand stands, of ten times what they take at full speed."""
    assert Machine(Steady(0.06)).window(3.7, 0.006) == pytest.approx(0.1, rel=1e-12)
    machine = Machine(STOP)
    assert machine.window_time(0.01) == 0.5
    assert machine.window(10.0, 0.01) == pytest.approx(0.5, rel=1e-12)
    for time in (32.0, 34.0, 119.0, 150.0):  # on the ramps and beyond them
        window = machine.window(time, 0.01)
        gone = machine.position(time + window) - machine.position(time)
        assert gone == pytest.approx(0.01, rel=1e-12)
    assert machine.window(60.0, 0.01) == 5.0
    assert Machine(Changing([0.0, 10.0], [0.02, 0.0])).window(9.9, 0.01) == 5.0
