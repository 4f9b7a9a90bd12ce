"""Exact outlines."""

from __future__ import annotations

import math

import numpy as np
import pytest

from castfem.meshes import build
from castfem.meshes.outline import Piece, chain, quarter


def _rounded(a: float, b: float, r: float) -> tuple[Piece, ...]:
    return (
        Piece("narrow_face", (a, 0.0), (a, b - r), mirrors="x"),
        Piece("corner", (a, b - r), (a - r, b), (a - r, b - r), "xy"),
        Piece("wide_face", (a - r, b), (0.0, b), mirrors="y"),
    )


def test_area_of_a_rounded_rectangle_and_of_a_disc() -> None:
    a, b, r = 0.3, 0.2, 0.05
    expected = a * b - r**2 * (1.0 - math.pi / 4.0)
    assert quarter(_rounded(a, b, r)).area() == pytest.approx(expected, rel=1e-15)
    assert quarter(_rounded(b, b, b)).area() == pytest.approx(math.pi * b**2 / 4.0, rel=1e-15)


def test_concave_arc_takes_its_segment_away() -> None:
    arc = Piece("fillet", (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    outline = chain(
        [Piece("symmetry_y", (0.0, 0.0), (1.0, 0.0)), arc, Piece("s", (0.0, 1.0), (0.0, 0.0))]
    )
    assert arc.turn == pytest.approx(-math.pi / 2.0)
    assert outline.area() == pytest.approx(1.0 - math.pi / 4.0, rel=1e-14)


def test_distance_and_projection() -> None:
    arc = Piece("corner", (1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    points = np.array([[0.5, 0.5], [2.0, 0.0], [0.0, -1.0]])
    expected = [1.0 - math.sqrt(0.5), 1.0, math.sqrt(2.0)]
    np.testing.assert_allclose(arc.distance(points), expected, rtol=1e-14)
    np.testing.assert_allclose(np.hypot(*arc.onto(points).T), 1.0, rtol=1e-15)
    line = Piece("wide_face", (1.0, 1.0), (0.0, 1.0))
    np.testing.assert_allclose(line.distance(np.array([[0.5, 0.0], [2.0, 1.0]])), [1.0, 1.0])


def test_open_outline_is_refused() -> None:
    with pytest.raises(ValueError, match="open between a and b"):
        chain([Piece("a", (0.0, 0.0), (1.0, 0.0)), Piece("b", (1.0, 1.0), (0.0, 0.0))])


def test_facet_off_the_outline_is_refused() -> None:
    outline = quarter(_rounded(0.3, 0.2, 0.05))
    points = np.array([[0.0, 0.2], [0.1, 0.2], [0.1, 0.1]])
    assert outline.pieces[outline.classify(points, np.array([[1, 0]]))[0]].group == "wide_face"
    with pytest.raises(ValueError, match="lies on no piece"):
        outline.classify(points, np.array([[1, 2]]))


@pytest.mark.parametrize("order", [1, 2])
def test_points_inside_and_outside(order: int) -> None:
    """A disc of 50 mm, a quarter of it, and the cut-off of a round corner."""
    sizes = {"surface_size": 3e-3, "core_size": 10e-3, "order": order}
    disc = build("round", diameter=0.1, symmetry="quarter", **sizes)
    turns = np.linspace(0.0, 0.5 * np.pi, 13)
    for radius, inside in ((0.0495, True), (0.0510, False), (0.0, True)):
        places = radius * np.column_stack([np.cos(turns), np.sin(turns)])
        assert [disc.holds(*place) for place in places] == [inside] * len(turns)
    assert not disc.holds(-1e-3, 1e-2) and not disc.holds(1e-2, -1e-3)
    size = {"width": 0.1, "height": 0.08, "corner_radius": 5e-3}
    whole = build("rectangle", **size, symmetry="whole", **sizes)
    cut = 5e-3 * (1.0 - 0.5**0.5)  # of the corner, along both faces
    for sx in (-1.0, 1.0):
        assert whole.holds(sx * (0.05 - cut - 2e-4), 0.04 - cut - 2e-4)
        assert not whole.holds(sx * (0.05 - cut + 2e-4), 0.04 - cut + 2e-4)
        assert whole.holds(sx * 0.05, 0.0) and not whole.holds(sx * 0.0505, 0.0)
