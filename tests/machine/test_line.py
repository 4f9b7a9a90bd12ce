"""The strand line in closed form; position and time at changing speeds."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from castfem.physics.machine import Changing, Machine, Steady
from castfem.physics.machine.line import Bent

INF = math.inf


def arc(radius: float, face: str = "centreline", thickness: float = 0.22) -> Bent:
    """Return the line of a curved mould, bent from the meniscus on."""
    return Bent([1.0, 5.0], [radius] * 2, [thickness] * 2, face)  # type: ignore[arg-type]


def test_height_in_an_arc_is_exact() -> None:
    """The height is R sin(s/R), above the first roll, between rolls and far below the last."""
    line = arc(8.0)
    for s in (0.0, 0.3, 1.0, 3.7, 5.0, 9.0, 4.0 * math.pi):
        assert line.inclination(s) == pytest.approx(s / 8.0, rel=1e-14)
        assert line.height(s) == pytest.approx(8.0 * math.sin(s / 8.0), rel=1e-13, abs=1e-15)
        assert line.curvature(s) == 0.125


def test_vertical_head_is_too_large_in_a_bent_machine() -> None:
    """By 44 % at the end of an 8 m arc below 2.3 m of straight strand, and 60 % at 16.5 m."""
    hair, end = 1e-9, 2.3 + 4.0 * math.pi
    line = Bent([2.3, 2.3 + hair, end, end + hair], [INF, 8.0, 8.0, INF], [0.22] * 4, "centreline")
    assert math.degrees(line.inclination(end + 5.0)) == pytest.approx(90.0, abs=1e-6)
    assert line.height(end) == pytest.approx(10.3, rel=1e-8)
    assert line.height(16.5) == pytest.approx(10.3, rel=1e-8)
    assert round(100.0 * (end / line.height(end) - 1.0)) == 44
    assert round(100.0 * (16.5 / line.height(16.5) - 1.0)) == 60
    assert line.height(2.0) == pytest.approx(2.0, rel=1e-15)


def test_curvature_is_linear_between_rolls() -> None:
    line = Bent([1.0, 2.0, 4.0], [INF, 10.0, 5.0], [0.2] * 3)
    expected = {0.0: 0.0, 1.0: 0.0, 1.5: 0.05, 2.0: 0.1, 3.0: 0.15, 4.0: 0.2, 99.0: 0.2}
    for position, value in expected.items():
        assert line.curvature(position) == pytest.approx(value, abs=1e-15)
    assert line.knots == (1.0, 2.0, 4.0)
    # The slope does not change at 3 m.
    assert Bent([1.0, 2.0, 3.0, 4.0], [INF, 10.0, 5.0, 10.0 / 3.0], [0.2] * 4).knots == (1.0, 4.0)


def test_inclination_and_height_are_the_integrals() -> None:
    """Compared with fine sums on a machine with all kinds of sections."""
    rolls = ([0.9, 2.3, 4.1, 14.0, 15.0, 16.6], [INF, INF, 8.0, 8.0, 11.0, INF])
    line = Bent(*rolls, [0.22] * 6, "centreline")
    for end in (0.5, 3.0, 4.1, 9.3, 15.2, 16.6, 25.0):
        s = np.linspace(0.0, end, 200_001)
        middle, step = 0.5 * (s[1:] + s[:-1]), np.diff(s)
        chi = np.interp(middle, rolls[0], 1.0 / np.array(rolls[1]))
        angle = np.concatenate([[0.0], np.cumsum(chi * step)])
        assert line.inclination(end) == pytest.approx(angle[-1], rel=1e-8, abs=1e-12)
        fallen = float(np.sum(np.cos(0.5 * (angle[1:] + angle[:-1])) * step))
        assert line.height(end) == pytest.approx(fallen, rel=1e-9)


@pytest.mark.parametrize(("face", "offset"), [("extrados", -0.11), ("intrados", 0.11)])
def test_height_is_that_of_the_centreline(face: str, offset: float) -> None:
    """For concentric arcs, and radius and positions of either face."""
    line = arc(8.0, face)
    for s in (0.4, 3.0, 9.0):
        assert line.height(s) == pytest.approx((8.0 + offset) * math.sin(s / 8.0), rel=1e-13)


def test_curvature_depends_on_the_face_of_the_radius() -> None:
    """A centreline radius used as that of the extrados is 1.4 % off, one of the intrados 2.8 %."""
    found = {face: arc(8.0, face).curvature(3.0, "extrados") for face in FACE_AT}
    assert found["extrados"] == 0.125
    for face, at in FACE_AT.items():
        assert found[face] == pytest.approx(1.0 / (8.0 + at * 0.22), rel=1e-14)
        assert arc(8.0).curvature(3.0, face) == pytest.approx(1.0 / (8.11 - at * 0.22), rel=1e-14)  # type: ignore[arg-type]
    assert round(100.0 * (0.125 / found["centreline"] - 1.0), 1) == 1.4
    assert round(100.0 * (0.125 / found["intrados"] - 1.0), 1) == 2.8


FACE_AT = {"extrados": 0.0, "centreline": 0.5, "intrados": 1.0}


def test_head_is_constant_during_a_stop() -> None:
    machine = Machine(
        Changing([0.0, 200.0, 220.0, 280.0, 300.0], [0.02, 0.02, 0, 0, 0.02]), arc(8.0)
    )
    head = machine.head(7000.0)
    assert head(200.0) == pytest.approx(7000.0 * 9.81 * 8.0 * math.sin(0.5), rel=1e-13)
    assert head(230.0) == head(270.0)
    assert head(310.0) > head(280.0)
    steady = Machine(Steady(0.02), arc(8.0))
    assert steady.head(7000.0)(200.0) == head(200.0)
    assert machine.inclination(4.0) == pytest.approx(0.5)
    assert machine.curvature(4.0) == 0.125


@pytest.mark.parametrize(
    ("positions", "radii", "message"),
    [
        ([1.0, 1.0], [5.0, 5.0], "must increase"),
        ([1.0, 2.0], [5.0, 0.0], "must not be zero"),
        ([-1.0, 2.0], [5.0, 5.0], "from the meniscus"),
    ],
)
def test_invalid_lines_are_rejected(
    positions: list[float], radii: list[float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Bent(positions, radii, [0.2] * len(positions))


# From 1.2 m/min to a stop in 10 s, stopped for 60 s, to 0.9 m/min in 20 s.
STOP = Changing([0.0, 30.0, 40.0, 100.0, 120.0], [0.02, 0.02, 0.0, 0.0, 0.015])
SPEED = st.just(0.0) | st.floats(1e-4, 0.2)
KNOTS = (0.0, 0.6, 0.7, 0.7, 0.85)


def test_position_at_constant_speed_is_exact_to_the_bit() -> None:
    """Also the time at a position."""
    travel = Steady(0.06)
    for time in (0.0, 0.1, 3.7, 1e4 / 3.0):
        assert travel.position(time) == 0.06 * time
        assert travel.time_at(time) == time / 0.06
    assert (travel.speed(5.0), travel.mean_speed(5.0), travel.kinks) == (0.06, 0.06, ())


def test_position_is_the_integral_of_the_speed() -> None:
    for time, position in zip((0.0, 30.0, 40.0, 100.0, 120.0), KNOTS, strict=True):
        assert STOP.position(time) == pytest.approx(position, rel=1e-15, abs=1e-18)
    assert STOP.position(35.0) == pytest.approx(0.6 + 0.02 * 5.0 - 0.001 * 25.0, rel=1e-15)
    assert STOP.position(70.0) == STOP.position(40.0)  # stopped
    assert STOP.position(200.0) == pytest.approx(0.85 + 80.0 * 0.015, rel=1e-15)
    assert STOP.mean_speed(120.0) == pytest.approx(0.85 / 120.0, rel=1e-15)
    assert STOP.mean_speed(0.0) == STOP.speed(0.0) == 0.02
    assert STOP.kinks == (30.0, 40.0, 100.0, 120.0)


def test_position_of_a_stop_is_reached_when_it_begins() -> None:
    """Neither earlier by rounding in the flat parabola, nor at the restart."""
    assert STOP.time_at(STOP.position(70.0)) == 40.0
    assert STOP.time_at(0.7 * (1.0 + 1e-15)) == 40.0
    assert STOP.time_at(0.7 * (1.0 - 1e-15)) == 40.0
    assert 39.0 < STOP.time_at(0.6999) < 40.0
    assert 100.0 < STOP.time_at(0.7001) < 110.0


def test_first_speed_is_used_before_the_table() -> None:
    travel = Changing([10.0, 20.0], [0.01, 0.03])
    assert travel.position(10.0) == pytest.approx(0.1, rel=1e-15)
    assert travel.speed(0.0) == 0.01
    assert travel.kinks == (10.0, 20.0)
    # With rows before the meniscus the interpolated speed counts.
    assert Changing([-10.0, 10.0], [0.0, 0.02]).position(10.0) == pytest.approx(0.15, rel=1e-15)


def test_strand_stopped_for_good_moves_no_further() -> None:
    travel = Changing([0.0, 10.0], [0.02, 0.0])
    assert travel.time_at(0.1) == 10.0
    assert travel.time_at(0.1001) == math.inf
    waits = Changing([0.0, 5.0, 6.0], [0.0, 0.0, 0.02])
    assert waits.time_at(0.0) == 0.0
    assert waits.time_at(1e-9) > 5.0


@given(
    st.lists(st.tuples(st.floats(0.01, 100.0), SPEED), min_size=2, max_size=8), st.floats(0.0, 1.0)
)
def test_time_at_is_the_inverse_of_position(rows: list[tuple[float, float]], share: float) -> None:
    times = list(itertools.accumulate(step for step, _ in rows))
    travel = Changing(times, [speed for _, speed in rows])
    time = share * times[-1]
    position = travel.position(time)
    reached = travel.time_at(position)
    assert reached <= time + 1e-5 * times[-1]  # earlier if the strand is stopped at this position
    assert travel.position(reached) == pytest.approx(position, rel=1e-11, abs=1e-300)
    fine = np.array(sorted({0.0, time, *(t for t in times if t < time)}))  # linear in between
    speeds = np.array([travel.speed(t) for t in fine])
    integral = float(np.sum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(fine)))
    assert position == pytest.approx(integral, rel=1e-9, abs=1e-300)


@pytest.mark.parametrize(
    ("times", "speeds", "message"),
    [
        ([0.0, 1.0], [0.02, -0.01], "must not be negative"),
        ([0.0, 0.0], [0.02, 0.01], "must increase"),
        ([0.0, 1.0], [0.02], "as many speeds as times"),
        ([0.0, 1.0], [0.02, math.nan], "must not be negative"),
    ],
)
def test_invalid_speeds_are_rejected(times: list[float], speeds: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Changing(times, speeds)


def test_constant_speed_must_be_positive() -> None:
    for speed in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="positive"):
            Steady(speed)


def test_head_of_a_vertical_machine_follows_the_position() -> None:
    machine = Machine(STOP)
    head = machine.head(7000.0)
    for time in (0.0, 35.0, 70.0, 150.0):
        assert head(time) == pytest.approx(7000.0 * 9.81 * machine.position(time), rel=1e-15)
    assert Machine(Steady(0.06)).head(7000.0)(10.0) == pytest.approx(7000.0 * 9.81 * 0.6)
    assert machine.height(3.0) == 3.0
    assert machine.curvature(3.0) == machine.inclination(3.0) == 0.0


def test_speed_between_two_positions_is_the_mean() -> None:
    """If the strand stops for good between them, it is the mean until the stop."""
    assert Machine(Steady(0.02)).speed_between(0.9, 1.1) == 0.02
    stopping = Machine(Changing([10.0, 12.0, 72.0, 74.0], [0.02, 0.0, 0.0, 0.02]))
    # At 0.2 m after 10 s, stopped at 0.22 m from 12 to 72 s, at 0.24 m after 74 s.
    assert stopping.speed_between(0.2, 0.24) == pytest.approx(0.04 / 64.0, rel=1e-12)
    ended = Machine(Changing([10.0, 12.0], [0.02, 0.0]))
    assert ended.time_near(0.3) == 12.0 and ended.time_near(0.1) == pytest.approx(5.0)
    assert ended.speed_between(0.2, 0.3) == pytest.approx(0.01, rel=1e-12)


def test_windows_by_length_have_equal_lengths() -> None:
    """During a stop a window lasts ten times as long as at full speed."""
    assert Machine(Steady(0.06)).window(3.7, 0.006) == pytest.approx(0.1, rel=1e-12)
    machine = Machine(STOP)
    assert machine.window_time(0.01) == 0.5
    assert machine.window(10.0, 0.01) == pytest.approx(0.5, rel=1e-12)
    for time in (32.0, 34.0, 119.0, 150.0):  # on the ramps and beyond them
        window = machine.window(time, 0.01)
        length = machine.position(time + window) - machine.position(time)
        assert length == pytest.approx(0.01, rel=1e-12)
    assert machine.window(60.0, 0.01) == 5.0
    assert Machine(Changing([0.0, 10.0], [0.02, 0.0])).window(9.9, 0.01) == 5.0
