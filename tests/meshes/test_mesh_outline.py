"""Exact outlines."""

from __future__ import annotations

import math

import numpy as np
import pytest

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
