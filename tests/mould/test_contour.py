"""Closed contours: the ray lands on the wall, moves with the point, and never falls through."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from castfem.physics.mould import Contour, Sides, Straight, circle, rectangle

A, B, R = 0.0625, 0.05, 0.005
FRACTION = st.floats(0.0, 1.0)
BULGES = st.sampled_from([0.0, 0.0004, -0.0004])


def walls(bulge: float, radius: float) -> tuple[Sides, Contour]:
    sides = Sides((A + bulge, B - bulge), (A, B), radius)
    return sides, rectangle(sides)


def depth(sides: Sides, points):
    """How far outside (positive) points lie, by the equation of the piece they belong to."""
    (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
    x, y = np.abs(points).T
    round_corner = np.hypot(x - (p - r), y - (q - r)) - r
    right = x - (a + (p - a) * (y / (q - r)) ** 2)
    top = y - (b + (q - b) * (x / (p - r)) ** 2)
    found = np.where(y <= q - r, right, np.where(x <= p - r, top, round_corner))
    inner = (x <= p - r) & (y <= q - r)
    return np.where(inner, np.maximum(right, top), found)


def ray(angle):
    return np.array([[math.cos(angle), math.sin(angle)]])


@given(
    x=FRACTION,
    y=FRACTION,
    angle=st.floats(-math.pi, math.pi),
    radius=st.sampled_from([0.0, 0.0005, R, 0.02]),
    bulge=BULGES,
)
def test_from_inside_every_ray_lands_on_the_wall(x, y, angle, radius, bulge):
    sides, wall = walls(bulge, radius)
    point, m = np.array([[(2 * x - 1) * 0.9 * A, (2 * y - 1) * 0.9 * B]]), ray(angle)
    assume(depth(sides, point)[0] < -1e-3)
    found = wall.gap_function(point, m)
    assert np.isfinite(found.gap).all() and found.gap[0] >= 0.0
    assert abs(depth(sides, point + found.gap[:, None] * m)[0]) < 1e-12
    # An arc's normal is a difference of places over its radius, and rounds as both.
    rounding = 8 * np.finfo(float).eps * max(1.0, A / radius if radius else 1.0)
    assert np.hypot(*found.normal[0]) == pytest.approx(1.0, abs=rounding)
    assert (found.normal @ m.T).item() > 0.0


@given(
    s=FRACTION,
    tilt=st.floats(-0.6, 0.6),
    move=st.floats(-0.0008, 0.0008),
    radius=st.sampled_from([0.0005, R]),
    bulge=BULGES,
)
def test_moving_along_the_ray_takes_the_way_off_the_gap(s, tilt, move, radius, bulge):
    _, wall = walls(bulge, radius)
    here = circle(0.04).gap_function(np.zeros((1, 2)), ray(2.0 * math.pi * s))
    m = ray(2.0 * math.pi * s + tilt)
    start = here.gap[:, None] * ray(2.0 * math.pi * s)
    first = wall.gap_function(start, m)
    close = start + (first.gap - 0.001)[:, None] * m
    for point, gap in ((close, 0.001), (close + move * m, 0.001 - move)):
        assert wall.gap_function(point, m).gap[0] == pytest.approx(gap, abs=1e-14)


@given(
    s=st.floats(0.0, 2.0 * math.pi),
    tilt=st.floats(-0.5, 0.5),
    heading=st.floats(0.0, 2.0 * math.pi),
    bulge=BULGES,
)
def test_change_of_the_gap_is_that_of_the_tangent_plane(s, tilt, heading, bulge):
    sides, wall = walls(bulge, R)
    m, u, h = ray(s + tilt), ray(heading)[0], 1e-7
    point = 0.03 * ray(s)
    found = wall.gap_function(point, m)
    corner = np.array([[sides.ends[0] - R, sides.ends[1]], [sides.ends[0], sides.ends[1] - R]])
    landed = np.abs(point + found.gap[:, None] * m)
    assume(np.hypot(*(landed - corner).T).min() > 1e-5)  # at a joint the normal may jump
    slope = (
        wall.gap_function(point + h * u, m).gap[0] - wall.gap_function(point - h * u, m).gap[0]
    ) / (2 * h)
    expected = -(found.normal[0] @ u) / (found.normal[0] @ m[0])
    assert slope == pytest.approx(expected, abs=2e-6)


def test_quarter_turns_and_mirror_images_see_the_same():
    """The whole, half and quarter section share one wall."""
    _, wall = walls(0.0004, R)
    angles = np.linspace(0.01, 0.5 * math.pi - 0.01, 40)
    m = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    gap = wall.gap_function(0.03 * m, m).gap
    for flip in ([-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]):
        other = wall.gap_function(0.03 * m * flip, m * flip).gap
        assert other == pytest.approx(gap, rel=1e-14)


def test_sharp_corner_is_met_along_its_diagonal_and_beside():
    _, wall = walls(0.0, 0.0)
    m = np.array([[A, B]]) / math.hypot(A, B)
    assert wall.gap_function(np.zeros((1, 2)), m).gap[0] == pytest.approx(
        math.hypot(A, B), rel=1e-14
    )
    points = np.array([[A - 0.001, B - 1e-12], [A - 0.001, B], [A - 0.001, B + 2e-5]])
    east = np.tile([1.0, 0.0], (3, 1))
    assert wall.gap_function(points, east).gap == pytest.approx(0.001, rel=1e-12)


@pytest.mark.parametrize("radius", [0.0, R])
def test_face_is_known_beyond_the_corner(radius):
    """A point that the closing wall has left beyond the other face still knows its own."""
    _, wall = walls(0.0, radius)
    outside = np.array([[A + 0.0002, B + 0.0003], [A + 0.0002, -B - 0.0003]])
    gap = wall.gap_function(outside, np.tile([1.0, 0.0], (2, 1))).gap
    assert gap == pytest.approx(-0.0002, rel=1e-9)


def test_nearest_of_several_walls_counts():
    """Two walls one behind the other: from between them, the nearer in either direction."""
    wall = Contour([Straight((1.0, -1.0), (1.0, 1.0)), Straight((2.0, -1.0), (2.0, 1.0))])
    points = np.array([[0.0, 0.0], [1.2, 0.0], [1.8, 0.0], [2.5, 0.0]])
    gap = wall.gap_function(points, np.tile([1.0, 0.0], (4, 1))).gap
    assert gap == pytest.approx([1.0, -0.2, 0.2, -0.5], rel=1e-12)


@given(
    x=st.floats(allow_nan=True, allow_infinity=True),
    y=st.floats(allow_nan=True, allow_infinity=True),
    angle=st.floats(-4.0, 4.0),
    bulge=BULGES,
)
def test_no_result_is_ever_not_a_number(x, y, angle, bulge):
    _, wall = walls(bulge, R)
    found = wall.gap_function(np.array([[x, y]]), ray(angle))
    assert not np.isnan(found.gap).any()
    assert np.isfinite(found.normal).all()


def test_no_points_at_all():
    """A rank without surface asks, too."""
    found = walls(0.0004, R)[1].gap_function(np.zeros((0, 2)), np.zeros((0, 2)))
    assert found.gap.shape == (0,) and found.normal.shape == (0, 2)


def test_circle_seen_from_off_its_centre():
    """Gap of an eccentric strand in a round mould, against the cosine rule."""
    wall, offset = circle(0.1), np.array([0.003, -0.002])
    angles = np.linspace(0.0, 2.0 * math.pi, 97)
    m = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    along = m @ offset
    expected = -along + np.sqrt(along**2 - offset @ offset + 0.01) - 0.09
    assert wall.gap_function(offset + 0.09 * m, m).gap == pytest.approx(expected, rel=1e-12)
