"""The line of the strand: closed forms of its inclination, its height and its curvature."""

from __future__ import annotations

import math

import numpy as np
import pytest

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
