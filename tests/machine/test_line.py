"""The line of the strand in closed form; time into place and back, at speeds that change."""

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
    """Of a curved mould: bent from the meniscus on."""
    return Bent([1.0, 5.0], [radius] * 2, [thickness] * 2, face)  # type: ignore[arg-type]


def test_height_in_an_arc() -> None:
    """D = R sin(s/R), above the first roll, between the rolls and far below the last."""
    line = arc(8.0)
    for s in (0.0, 0.3, 1.0, 3.7, 5.0, 9.0, 4.0 * math.pi):
        assert line.inclination(s) == pytest.approx(s / 8.0, rel=1e-14)
        assert line.height(s) == pytest.approx(8.0 * math.sin(s / 8.0), rel=1e-13, abs=1e-15)
        assert line.curvature(s) == 0.125


def test_a_vertical_head_is_too_large_in_a_bent_machine() -> None:
    """By 44 % at the end of an 8 m arc below 2.3 m of straight strand, by 60 % at 16.5 m."""
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
    # No change of slope at 3 m.
    assert Bent([1.0, 2.0, 3.0, 4.0], [INF, 10.0, 5.0, 10.0 / 3.0], [0.2] * 4).knots == (1.0, 4.0)


def test_inclination_and_height_are_the_integrals() -> None:
    """Of the curvature and of its cosine, by brute force on a machine with everything."""
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
def test_the_liquid_is_as_high_as_the_middle_of_the_strand(face: str, offset: float) -> None:
    """Of concentric arcs, whichever face the radius and the positions are of."""
    line = arc(8.0, face)
    for s in (0.4, 3.0, 9.0):
        assert line.height(s) == pytest.approx((8.0 + offset) * math.sin(s / 8.0), rel=1e-13)


def test_the_face_of_a_radius_counts() -> None:
    """One of the centreline taken for that of the extrados is 1.4 % off, of the intrados 2.8 %."""
    given = {face: arc(8.0, face).curvature(3.0, "extrados") for face in FACE_AT}
    assert given["extrados"] == 0.125
    for face, at in FACE_AT.items():
        assert given[face] == pytest.approx(1.0 / (8.0 + at * 0.22), rel=1e-14)
        assert arc(8.0).curvature(3.0, face) == pytest.approx(1.0 / (8.11 - at * 0.22), rel=1e-14)  # type: ignore[arg-type]
    assert round(100.0 * (0.125 / given["centreline"] - 1.0), 1) == 1.4
    assert round(100.0 * (0.125 / given["intrados"] - 1.0), 1) == 2.8


FACE_AT = {"extrados": 0.0, "centreline": 0.5, "intrados": 1.0}


def test_a_bent_strand_that_stands_has_a_head_that_stands() -> None:
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
    ("positions", "radii", "said"),
    [
        ([1.0, 1.0], [5.0, 5.0], "must increase"),
        ([1.0, 2.0], [5.0, 0.0], "must not be zero"),
        ([-1.0, 2.0], [5.0, 5.0], "from the meniscus"),
    ],
)
def test_impossible_lines_are_refused(
    positions: list[float], radii: list[float], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        Bent(positions, radii, [0.2] * len(positions))


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
