"""Intersections of rays with segments and closed contours, by closed forms, and never NaN."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from castfem.physics.mould import (
    Circular,
    Contour,
    Parabolic,
    PlaneWall,
    Sides,
    Straight,
    circle,
    rectangle,
)

A, B, R = 0.0625, 0.05, 0.005
FRACTION = st.floats(0.0, 1.0)
BULGES = st.sampled_from([0.0, 0.0004, -0.0004])


def walls(bulge: float, radius: float) -> tuple[Sides, Contour]:
    sides = Sides((A + bulge, B - bulge), (A, B), radius)
    return sides, rectangle(sides)


def depth(sides: Sides, points):
    """Return the distance of points from the wall by the equation of their piece; outside: > 0."""
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
def test_every_ray_from_inside_hits_the_wall(x, y, angle, radius, bulge):
    sides, wall = walls(bulge, radius)
    point, m = np.array([[(2 * x - 1) * 0.9 * A, (2 * y - 1) * 0.9 * B]]), ray(angle)
    assume(depth(sides, point)[0] < -1e-3)
    found = wall.gap_function(point, m)
    assert np.isfinite(found.gap).all() and found.gap[0] >= 0.0
    assert abs(depth(sides, point + found.gap[:, None] * m)[0]) < 1e-12
    # The normal of an arc is a difference of positions over the radius, with their rounding.
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
def test_motion_along_the_ray_reduces_the_gap_equally(s, tilt, move, radius, bulge):
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


def test_mirrored_rays_have_the_same_gap():
    """Full, half and quarter sections have the same wall."""
    _, wall = walls(0.0004, R)
    angles = np.linspace(0.01, 0.5 * math.pi - 0.01, 40)
    m = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    gap = wall.gap_function(0.03 * m, m).gap
    for flip in ([-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]):
        mirrored = wall.gap_function(0.03 * m * flip, m * flip).gap
        assert mirrored == pytest.approx(gap, rel=1e-14)


def test_sharp_corner_is_hit_on_and_off_its_diagonal():
    _, wall = walls(0.0, 0.0)
    m = np.array([[A, B]]) / math.hypot(A, B)
    assert wall.gap_function(np.zeros((1, 2)), m).gap[0] == pytest.approx(
        math.hypot(A, B), rel=1e-14
    )
    points = np.array([[A - 0.001, B - 1e-12], [A - 0.001, B], [A - 0.001, B + 2e-5]])
    east = np.tile([1.0, 0.0], (3, 1))
    assert wall.gap_function(points, east).gap == pytest.approx(0.001, rel=1e-12)


@pytest.mark.parametrize("radius", [0.0, R])
def test_gap_to_a_face_continues_beyond_the_corner(radius):
    """A point that has penetrated both faces keeps the gap to its own face."""
    _, wall = walls(0.0, radius)
    outside = np.array([[A + 0.0002, B + 0.0003], [A + 0.0002, -B - 0.0003]])
    gap = wall.gap_function(outside, np.tile([1.0, 0.0], (2, 1))).gap
    assert gap == pytest.approx(-0.0002, rel=1e-9)


def test_nearest_of_several_walls_counts():
    """With two parallel walls the nearest counts, ahead or behind."""
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
def test_no_result_is_nan(x, y, angle, bulge):
    _, wall = walls(bulge, R)
    found = wall.gap_function(np.array([[x, y]]), ray(angle))
    assert not np.isnan(found.gap).any()
    assert np.isfinite(found.normal).all()


def test_empty_set_of_points_is_allowed():
    """As on a rank without surface."""
    found = walls(0.0004, R)[1].gap_function(np.zeros((0, 2)), np.zeros((0, 2)))
    assert found.gap.shape == (0,) and found.normal.shape == (0, 2)


def test_gap_of_an_eccentric_strand_obeys_the_cosine_rule():
    wall, offset = circle(0.1), np.array([0.003, -0.002])
    angles = np.linspace(0.0, 2.0 * math.pi, 97)
    m = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    along = m @ offset
    expected = -along + np.sqrt(along**2 - offset @ offset + 0.01) - 0.09
    assert wall.gap_function(offset + 0.09 * m, m).gap == pytest.approx(expected, rel=1e-12)


UP = (0.0, 1.0)


def reach(segment, point, normal):
    normal = np.array([normal], dtype=float) / np.hypot(*normal)
    found = Contour([segment]).gap_function(np.array([point], dtype=float), normal)
    return float(found.gap[0]), found.normal[0]


def right_wall(x=1.0):
    return Straight((x, -1.0), (x, 1.0))


def test_gap_to_a_straight_wall_is_exact():
    gap, normal = reach(right_wall(), (0.25, 0.1), (1.0, 0.0))
    assert gap == 0.75
    assert normal == pytest.approx([1.0, 0.0], abs=1e-15)
    gap, _ = reach(right_wall(), (0.25, -0.5), (1.0, 1.0))
    assert gap == pytest.approx(0.75 * math.sqrt(2.0), rel=1e-14)


def test_gap_behind_a_straight_wall_is_negative():
    gap, normal = reach(right_wall(), (1.125, 0.1), (1.0, 0.0))
    assert gap == -0.125
    assert normal == pytest.approx([1.0, 0.0], abs=1e-15)


@pytest.mark.parametrize(
    ("point", "normal"),
    [
        ((0.0, 0.0), (0.0, 1.0)),  # parallel to the wall
        ((0.0, 0.0), (-1.0, 0.0)),  # hits the wall from behind
        ((0.0, 0.9), (1.0, 1.0)),  # passes beyond its end
        ((math.nan, 0.0), (1.0, 0.0)),
        ((math.inf, 0.0), (1.0, 0.0)),
    ],
)
def test_missed_straight_wall_has_an_infinite_gap(point, normal):
    gap, found = reach(right_wall(), point, normal)
    assert gap == math.inf
    assert found == pytest.approx(np.array(normal) / np.hypot(*normal), rel=1e-14)


@pytest.mark.parametrize("depth", [0.3, 1e-9, 0.0, -1e-9, -0.2])
def test_gap_of_concentric_arcs_is_the_difference_of_radii(depth):
    for radius, angle in product((0.005, 1.0, 1e4), (0.0, 0.3, 0.7)):
        half = radius / math.sqrt(2.0)
        arc = Circular((half, -half), (half, half), (0.0, 0.0))
        ray = math.cos(angle), math.sin(angle)
        inner = radius * (1.0 - depth)
        gap, normal = reach(arc, (inner * ray[0], inner * ray[1]), ray)
        assert gap == pytest.approx(radius * depth, rel=1e-12, abs=4e-16 * radius), (radius, angle)
        assert normal == pytest.approx(ray, abs=1e-12), (radius, angle)


def test_gap_to_an_arc_of_another_radius_is_exact():
    """A strand corner of radius q about c in a wall corner of radius r about C, along m."""
    r, q, m = 0.005, 0.003, np.array([0.6, 0.8])
    wall = Circular((0.0625, 0.0575), (0.0575, 0.0625), (0.0575, 0.0575))
    c, centre = np.array([0.0590, 0.0588]), np.array([0.0575, 0.0575])
    offset = c + q * m - centre
    expected = -offset @ m + math.sqrt((offset @ m) ** 2 - offset @ offset + r * r)
    gap, normal = reach(wall, c + q * m, m)
    assert gap == pytest.approx(expected, rel=1e-12)
    assert normal == pytest.approx((offset + expected * m) / r, abs=1e-12)


def test_convex_arc_is_hit_on_its_near_side():
    """The wall bulges into the cavity, so the ray enters the circle at the wall."""
    fillet = Circular((1.0, 1.0), (-1.0, 1.0), (0.0, 2.0))
    radius = math.sqrt(2.0)
    gap, normal = reach(fillet, (0.25, 0.0), UP)
    assert gap == pytest.approx(2.0 - math.sqrt(radius**2 - 0.25**2), rel=1e-14)
    assert normal == pytest.approx([-0.25 / radius, math.sqrt(1 - 0.25**2 / 2)], rel=1e-14)


@pytest.mark.parametrize("x", [1.0, 1.0 - 1e-9, 1.0 + 1e-9, 1.2])
def test_ray_tangent_to_an_arc_or_past_it_has_no_hit(x):
    half = Circular((1.0, -0.5), (1.0, 0.5), (0.0, 0.0)).radius
    arc = Circular((half, 0.0), (0.0, half), (0.0, 0.0))
    gap, _ = reach(arc, (half * x, 0.1), UP)
    assert gap == math.inf


PARABOLA = Parabolic((1.0, 0.0), (0.0, 0.5), (-1.0, 0.0))  # y = (1 - x^2) / 2


@pytest.mark.parametrize("x", [-1.0, -0.4, 0.0, 1e-9, 0.9, 1.0])
def test_gap_along_the_axis_of_a_parabola_is_exact(x):
    gap, normal = reach(PARABOLA, (x, -0.3), UP)
    assert gap == pytest.approx(0.5 * (1 - x * x) + 0.3, rel=1e-13)
    assert normal == pytest.approx(np.array([x, 1.0]) / math.hypot(x, 1.0), abs=1e-12)


def test_oblique_gap_to_a_parabola_is_exact():
    """From the origin along (1, 1): x = (1 - x^2) / 2, so x = sqrt(2) - 1."""
    gap, _ = reach(PARABOLA, (0.0, 0.0), (1.0, 1.0))
    assert gap == pytest.approx(math.sqrt(2.0) * (math.sqrt(2.0) - 1.0), rel=1e-14)


def test_gap_behind_a_parabola_is_negative():
    gap, _ = reach(PARABOLA, (0.5, 0.4), UP)
    assert gap == pytest.approx(0.375 - 0.4, rel=1e-13)


@pytest.mark.parametrize("bulge", [0.0, 1e-17, 1e-9])
@pytest.mark.parametrize("ray", [(0.0, 1.0), (0.4, 1.0), (-1.0, 0.3)])
def test_flat_parabola_is_a_straight_line(bulge, ray):
    nearly = Parabolic((1.0, 0.5), (0.0, 0.5 + bulge), (-1.0, 0.5))
    line = Straight((1.0, 0.5), (-1.0, 0.5))
    for x in (-0.3, 0.0, 0.6):
        found, expected = reach(nearly, (x, 0.45), ray), reach(line, (x, 0.45), ray)
        assert found[0] == pytest.approx(expected[0], abs=4.0 * bulge + 1e-14)
        assert found[1] == pytest.approx(expected[1], abs=4.0 * bulge + 1e-14)


def test_asymmetric_parabola_passes_through_its_points():
    skew = Parabolic((1.0, 0.0), (0.2, 0.6), (-1.0, 0.2))
    for point in skew.points(9):
        gap, _ = reach(skew, point - np.array([0.0, 0.25]), UP)
        assert gap == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize(
    ("point", "ray"),
    [
        ((0.0, 0.5), (1.0, 0.0)),  # tangent at the top
        ((0.0, 0.6), (1.0, 0.0)),  # no root
        ((2.0, 0.0), (0.0, 1.0)),  # root beyond the end
        ((0.0, 0.0), (0.0, -1.0)),  # opposite direction
        ((0.0, math.nan), (0.0, 1.0)),
    ],
)
def test_missed_parabola_has_an_infinite_gap(point, ray):
    gap, normal = reach(PARABOLA, point, ray)
    assert gap == math.inf
    assert np.isfinite(normal).all()


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Straight((1.0, 1.0), (1.0, 1.0)), "two points"),
        (lambda: Circular((1.0, 0.0), (0.0, 2.0), (0.0, 0.0)), "at 1 and 2 m"),
        (lambda: Parabolic((1.0, 0.0), (0.9, 0.0), (-1.0, 0.0)), "turns back"),
        (lambda: Contour([]), "at least one segment"),
        (lambda: PlaneWall((0.0, 0.0), (0.0, 0.0)), "direction"),
    ],
)
def test_invalid_segments_are_rejected(build, words):
    with pytest.raises(ValueError, match=words):
        build()


def test_gap_to_a_closing_plane_wall_is_exact():
    slope = np.array([3.0, 4.0]) / 5.0
    wall = PlaneWall((0.6, 0.8), (3.0, 4.0), closing=0.1)
    points = np.array([[0.0, 0.0], [0.9, 1.2], [5.0, -3.0]])
    found = wall.gap_function(points, np.tile(slope, (3, 1)), 2.0)
    assert found.gap == pytest.approx([0.8, -0.7, 0.8 - points[2] @ slope], rel=1e-13)
    found = wall.gap_function(points[:1], np.array([[1.0, 0.0]]), 0.0)
    assert found.gap[0] == pytest.approx(1.0 / 0.6, rel=1e-14)
    assert wall.gap_function(points[:1], -slope[None], 0.0).gap[0] == math.inf


def arc(radius, *angles, centre=(0.0, 0.0)):
    """Return an arc of a radius about a centre from one angle to another."""
    ends = [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in angles]
    return Circular(*ends, centre)


@pytest.mark.parametrize(
    ("segment", "sign"),
    [
        (right_wall(), 0),
        (arc(1.5, -0.5, 0.5), 1),
        (arc(1.5, math.pi + 0.5, math.pi - 0.5, centre=(2.5, 0.0)), -1),
        (Parabolic((1.0, -0.5), (1.1, 0.1), (0.9, 0.6)), 1),
        (Parabolic((1.0, -0.5), (0.9, 0.1), (1.0, 0.6)), -1),
    ],
)
def test_curvature_is_the_change_of_the_normal(segment, sign):
    contour, step = Contour([segment]), 1e-5
    points = np.column_stack([np.full(6, 0.6), np.linspace(-0.2, 0.3, 6)])
    right = np.broadcast_to([1.0, 0.0], points.shape)
    found = [
        contour.gap_function(points + np.array([0.0, move]), right) for move in (-step, 0.0, step)
    ]
    tangent = np.column_stack([-found[1].normal[:, 1], found[1].normal[:, 0]])
    way = (found[2].gap - found[0].gap)[:, None] * right + np.array([0.0, 2.0 * step])
    turn = np.einsum("ni,ni->n", found[2].normal - found[0].normal, tangent)
    assert found[1].curvature == pytest.approx(turn / np.einsum("ni,ni->n", way, tangent), abs=1e-8)
    assert (np.sign(found[1].curvature) == sign).all()
