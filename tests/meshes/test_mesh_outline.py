"""Exact outlines, bulged outlines of rectangles, and grading along a line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.meshes import build, build_section, parameters_of
from castfem.meshes.assemble import assemble
from castfem.meshes.bulge import normals_round, ways_round
from castfem.meshes.grading import LARGEST_GROWTH, SizeLaw, size_law, two_sided
from castfem.meshes.outline import Piece, chain, quarter
from castfem.meshes.rectangle import rectangle

from .sections import BEAM, BILLET, ROUNDED, STRIP


def _rounded(a: float, b: float, r: float) -> tuple[Piece, ...]:
    return (
        Piece("narrow_face", (a, 0.0), (a, b - r), mirrors="x"),
        Piece("corner", (a, b - r), (a - r, b), (a - r, b - r), "xy"),
        Piece("wide_face", (a - r, b), (0.0, b), mirrors="y"),
    )


def test_areas_of_rounded_rectangle_and_disc_are_exact() -> None:
    a, b, r = 0.3, 0.2, 0.05
    expected = a * b - r**2 * (1.0 - math.pi / 4.0)
    assert quarter(_rounded(a, b, r)).area() == pytest.approx(expected, rel=1e-15)
    assert quarter(_rounded(b, b, b)).area() == pytest.approx(math.pi * b**2 / 4.0, rel=1e-15)


def test_concave_arc_reduces_the_area() -> None:
    arc = Piece("fillet", (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    outline = chain(
        [Piece("symmetry_y", (0.0, 0.0), (1.0, 0.0)), arc, Piece("s", (0.0, 1.0), (0.0, 0.0))]
    )
    assert arc.turn == pytest.approx(-math.pi / 2.0)
    assert outline.area() == pytest.approx(1.0 - math.pi / 4.0, rel=1e-14)


def test_distance_and_projection_are_exact() -> None:
    arc = Piece("corner", (1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    points = np.array([[0.5, 0.5], [2.0, 0.0], [0.0, -1.0]])
    expected = [1.0 - math.sqrt(0.5), 1.0, math.sqrt(2.0)]
    np.testing.assert_allclose(arc.distance(points), expected, rtol=1e-14)
    np.testing.assert_allclose(np.hypot(*arc.onto(points).T), 1.0, rtol=1e-15)
    line = Piece("wide_face", (1.0, 1.0), (0.0, 1.0))
    np.testing.assert_allclose(line.distance(np.array([[0.5, 0.0], [2.0, 1.0]])), [1.0, 1.0])


def test_open_outline_is_rejected() -> None:
    with pytest.raises(ValueError, match="open between a and b"):
        chain([Piece("a", (0.0, 0.0), (1.0, 0.0)), Piece("b", (1.0, 1.0), (0.0, 0.0))])


def test_facet_off_the_outline_is_rejected() -> None:
    outline = quarter(_rounded(0.3, 0.2, 0.05))
    points = np.array([[0.0, 0.2], [0.1, 0.2], [0.1, 0.1]])
    assert outline.pieces[outline.classify(points, np.array([[1, 0]]))[0]].group == "wide_face"
    with pytest.raises(ValueError, match="lies on no piece"):
        outline.classify(points, np.array([[1, 2]]))


@pytest.mark.parametrize("order", [1, 2])
def test_points_inside_and_outside_are_distinguished(order: int) -> None:
    """A quarter disc of 50 mm radius, and a rectangle with rounded corners."""
    sizes = {"surface_size": 3e-3, "core_size": 10e-3, "order": order}
    disc = build("round", diameter=0.1, symmetry="quarter", **sizes)
    turns = np.linspace(0.0, 0.5 * np.pi, 13)
    for radius, inside in ((0.0495, True), (0.0510, False), (0.0, True)):
        places = radius * np.column_stack([np.cos(turns), np.sin(turns)])
        assert [disc.holds(*place) for place in places] == [inside] * len(turns)
    assert not disc.holds(-1e-3, 1e-2) and not disc.holds(1e-2, -1e-3)
    size = {"width": 0.1, "height": 0.08, "corner_radius": 5e-3}
    full = build("rectangle", **size, symmetry="whole", **sizes)
    cut = 5e-3 * (1.0 - 0.5**0.5)  # of the corner, along both faces
    for sx in (-1.0, 1.0):
        assert full.holds(sx * (0.05 - cut - 2e-4), 0.04 - cut - 2e-4)
        assert not full.holds(sx * (0.05 - cut + 2e-4), 0.04 - cut + 2e-4)
        assert full.holds(sx * 0.05, 0.0) and not full.holds(sx * 0.0505, 0.0)


A, B, R = 0.0625, 0.05, 0.005
SIZES = {"surface_size": 0.002, "core_size": 0.01}
SECTION = {"width": 2 * A, "height": 2 * B, "corner_radius": R}
ARC = 0.5 * np.pi * R
TABLE = ([0.0, 0.045, 0.045 + ARC, 0.045 + ARC + 0.0575], [1e-4, -2e-4, -2e-4, 3e-4])


def offsets(points):
    """Return the offsets of surface points from the rectangle, and their arc lengths."""
    q = np.abs(points)
    ways = ways_round(q, A, B, R)
    normal = normals_round(ways, B, R)
    centre = np.array([A - R, B - R])
    base = centre + R * normal
    right, upper = ways <= B - R, ways >= B - R + ARC
    base[right] = np.stack([np.full(right.sum(), A), q[right, 1]], 1)
    base[upper] = np.stack([q[upper, 0], np.full(upper.sum(), B)], 1)
    return ((q - base) * normal).sum(axis=1), ways


@pytest.mark.parametrize("symmetry", ["quarter", "half", "whole"])
@pytest.mark.parametrize(("cell", "order"), [("quadrilateral", 2), ("triangle", 1)])
def test_outline_has_the_offsets(symmetry, cell, order):
    parts = {"cell": cell, "order": order, "symmetry": symmetry}
    plain = build("rectangle", **SECTION, **SIZES, **parts)
    mesh = build("rectangle", **SECTION, **SIZES, **parts, bulge=TABLE)
    surface = np.unique(
        mesh.facets[[mesh.groups[g] in mesh.outer_groups for g in mesh.facet_group]]
    )
    found, ways = offsets(mesh.points[surface])
    assert found == pytest.approx(np.interp(ways, *TABLE), abs=1e-9)
    assert np.array_equal(plain.cells, mesh.cells)
    moved = mesh.points - plain.points
    assert np.abs(moved).max() <= 3.01e-4
    for axis in (0, 1):
        on_axis = np.abs(plain.points[:, axis]) < 1e-12
        assert np.all(moved[on_axis, axis] == 0.0)
    quality = mesh.quality()
    assert quality.min_jacobian_ratio > 0.5 * plain.quality().min_jacobian_ratio
    assert abs(quality.area_error) == pytest.approx(abs(plain.quality().area_error), abs=1e-9)


def test_uniform_bulge_is_the_larger_rectangle():
    mesh = build("rectangle", **SECTION, **SIZES, order=2, bulge=([0.0], [1e-3]))
    area = 4 * (A + 1e-3) * (B + 1e-3) - (4 - np.pi) * (R + 1e-3) ** 2
    assert 4.0 * mesh.exact_area == pytest.approx(area, rel=1e-6)
    assert mesh.probes["mid_face"][0] == pytest.approx([0.0, B + 1e-3])
    assert mesh.probes["narrow_face"][0] == pytest.approx([A + 1e-3, 0.0])
    corner = np.array([A, B]) - R + (R + 1e-3) * np.sqrt(0.5)
    assert mesh.probes["corner"][0] == pytest.approx(corner, abs=2e-5)


def test_sharp_corner_bulges_and_arc_lengths_are_exact():
    mesh = build("rectangle", width=0.1, height=0.1, **SIZES, bulge=([0.0], [5e-4]))
    assert np.abs(mesh.points).max(axis=0) == pytest.approx([0.0505, 0.0505], abs=1e-9)
    points = np.array([[A, 0.0], [A, B - R], [A - R, B], [0.0, B], [-A, -0.01]])
    expected = [0.0, B - R, B - R + ARC, B - R + ARC + A - R, 0.01]
    assert ways_round(points, A, B, R) == pytest.approx(expected)


def test_too_large_bulge_is_rejected():
    with pytest.raises(ValueError, match=r"bulge is 20 mm somewhere; allowed: at most 10 mm"):
        build("rectangle", **SECTION, **SIZES, bulge=([0.0], [0.02]))


LENGTH = 0.0625


def test_sizes_form_a_geometric_progression() -> None:
    law = size_law(0.5e-3, 5e-3, 0.0, LENGTH)
    sizes = np.diff(law.nodes(LENGTH))
    ratio = sizes[1:] / sizes[:-1]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert ratio[0] == pytest.approx(math.exp(4.5 / 62.5), rel=5e-3)
    assert 0.45e-3 < sizes[0] <= 0.5e-3
    assert sizes.sum() == pytest.approx(LENGTH, rel=1e-14)


def test_integer_number_of_cells_starts_with_the_fine_size() -> None:
    law = SizeLaw(0.001, 1.0, 0.0, math.log(1.2))
    length = 0.001 * (1.2**9 - 1.0) / 0.2
    assert law.count(length) == pytest.approx(9.0, abs=1e-12)
    np.testing.assert_allclose(np.diff(law.nodes(length)), 0.001 * 1.2 ** np.arange(9), rtol=1e-10)


def test_growth_is_limited() -> None:
    law = size_law(0.1e-3, 50e-3, 0.0, 0.01)
    sizes = np.diff(law.nodes(LENGTH))
    assert (sizes[1:] / sizes[:-1]).max() <= LARGEST_GROWTH + 1e-9


def test_fine_size_is_kept_over_its_depth() -> None:
    law = size_law(0.5e-3, 5e-3, 0.01, LENGTH)
    nodes = law.nodes(LENGTH)
    sizes = np.diff(nodes)
    kept = nodes[1:] <= 0.01
    assert kept.sum() >= 19
    np.testing.assert_allclose(sizes[kept], sizes[0], rtol=1e-12)
    assert sizes[0] <= 0.5e-3
    assert np.all(np.diff(sizes) >= -1e-15)


def test_halving_every_size_halves_every_cell() -> None:
    coarse = size_law(1e-3, 8e-3, 0.0, LENGTH)
    fine = size_law(0.5e-3, 4e-3, 0.0, LENGTH)
    assert fine.count(LENGTH) == pytest.approx(2.0 * coarse.count(LENGTH), rel=0.06)
    n = 20
    halves = fine.nodes(LENGTH, 2 * n)
    # The continuous laws are similar, so every second node of the fine grid is a coarse one.
    np.testing.assert_allclose(halves[::2], coarse.nodes(LENGTH, n), atol=0.02 * LENGTH)


def test_lead_increases_from_a_narrow_feature() -> None:
    law = SizeLaw(0.5e-3, 5e-3, 0.0, 0.07, lead=0.05e-3)
    sizes = np.diff(law.nodes(LENGTH))
    assert 0.045e-3 < sizes[0] <= 0.05e-3
    assert (sizes[1:] / sizes[:-1]).max() <= LARGEST_GROWTH + 1e-6
    plain = SizeLaw(0.5e-3, 5e-3, 0.0, 0.07)
    assert 0 < law.count(LENGTH) - plain.count(LENGTH) < 9


@pytest.mark.parametrize("cells", [1, 2, 5, 20, 60, 125, 400])
@pytest.mark.parametrize("keep", [0.0, 0.004])
def test_fitted_law_has_the_count_it_was_fitted_to(cells: int, keep: float) -> None:
    law = SizeLaw(0.5e-3, 5e-3, keep, 0.07)
    fitted = law.fitted(LENGTH, cells)
    nodes = fitted.nodes(LENGTH, cells)
    assert len(nodes) == cells + 1
    assert np.all(np.diff(nodes) > 0.0)
    if 20 <= cells <= 125:
        assert fitted.count(LENGTH) == pytest.approx(cells, abs=1e-6)
        assert nodes[1] == pytest.approx(0.5e-3, rel=0.05)


def test_two_sided_grading_has_both_sizes() -> None:
    first, last = SizeLaw(1e-3, 1e-2, 0.0, 0.1), SizeLaw(2e-3, 1e-2, 0.0, 0.1)
    sizes = np.diff(two_sided(0.2, first, last))
    assert 0.9e-3 < sizes[0] <= 1.001e-3
    assert 1.8e-3 < sizes[-1] <= 2.002e-3
    assert sizes.max() <= 1.001e-2
    fixed_count = np.diff(two_sided(0.2, first, last, 50))
    assert len(fixed_count) == 50
    assert fixed_count[0] == pytest.approx(1e-3, rel=0.1)


@settings(max_examples=30, deadline=None)
@given(
    fine=st.floats(1e-4, 5e-3),
    ratio=st.floats(1.0, 100.0),
    keep=st.floats(0.0, 0.03),
    length=st.floats(0.01, 1.0),
    lead=st.floats(0.0, 1.0),
)
def test_nodes_increase_and_respect_the_size_law(
    fine: float, ratio: float, keep: float, length: float, lead: float
) -> None:
    law = size_law(fine, fine * ratio, keep, keep + 0.05)
    law = SizeLaw(law.fine, law.coarse, law.keep, law.slope, lead * fine if lead > 0.01 else 0.0)
    nodes = law.nodes(length)
    sizes = np.diff(nodes)
    assert nodes[0] == 0.0 and nodes[-1] == length
    assert np.all(sizes > 0.0)
    assert np.all(sizes <= law.size(nodes[1:]) * (1.0 + 1e-6))
    assert len(sizes) == law.cells(length)


# Invalid parameters are rejected with the name of the parameter and a fix.


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (BILLET | {"width": 0.0}, "width = 0 mm is impossible: it must be more than 0"),
        (BILLET | {"width": "125 mm"}, "width must be a length in metres, not '125 mm'"),
        (BILLET | {"corner_radius": 0.07}, r"corner_radius = 70 mm is larger than half the smal"),
        (BILLET | {"corner_radius": 1e-6}, "too small to mesh: choose at least 0.01 mm, or 0"),
        (BILLET | {"surface_size": 0.1}, r"surface_size = 100 mm is larger than half the thick"),
        (BILLET | {"core_depth": 0.2}, "core_depth = 200 mm is larger than half the section"),
        (BILLET | {"cell": "hexagon"}, "cell = 'hexagon' is unknown: choose one of quadri"),
        (BILLET | {"order": 3}, "order = 3 is not available: choose 1 or 2"),
        (
            BILLET
            | {"surface_size": 1e-5, "face_size": 2e-5, "core_size": 2e-5, "corner_size": 1e-5},
            "cells, more than 2e.06: raise surface_size",
        ),
        (ROUNDED | {"corner_size": 1e-8, "cell": "triangle"}, "more than 2e"),
        (BEAM | {"web_thickness": 0.5}, "web_thickness = 250 mm|web_thickness = 500 mm"),
        (BEAM | {"fillet_radius": 0.18}, "fillet_radius .* off the flank"),
        (STRIP | {"surface_size": 1e-8, "core_size": 1e-8}, "more than 2e"),
    ],
)
def test_invalid_parameters_are_rejected(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        build(**parameters)


def test_unknown_and_missing_parameters_are_all_named() -> None:
    with pytest.raises(ValueError) as error:
        build("rectangle", widht=0.1, height=0.1, core_size=0.01, colour="red")
    text = str(error.value)
    assert "widht is not a parameter" in text and "did you mean width?" in text
    assert "colour is not a parameter" in text
    assert "needs width, surface_size" in text
    with pytest.raises(ValueError, match="shape = 'star' is unknown: choose one of rectangle"):
        build("star")
    with pytest.raises(ValueError, match="corner_size is not a parameter of shape = 'strip'"):
        build(**STRIP, corner_size=0.001)


def test_parameters_of_a_shape_are_listed() -> None:
    needed, optional = parameters_of("rectangle")
    assert set(needed) == {"width", "height", "surface_size", "core_size"}
    assert {"corner_radius", "symmetry", "cell", "order", "face_size", "core_depth"} <= set(
        optional
    )
    assert parameters_of("strip")[0] == ("length", "width", "surface_size")


def test_section_is_built_from_a_mapping_or_a_dataclass() -> None:
    @dataclass
    class Section:
        shape: str = "strip"
        length: float = 0.1
        width: float = 0.01
        surface_size: float = 0.01
        core_depth: float | None = None

    from_class = build_section(Section())
    from_mapping = build_section(
        {"shape": "strip", "length": 0.1, "width": 0.01, "surface_size": 0.01}
    )
    np.testing.assert_array_equal(from_class.points, from_mapping.points)
    with pytest.raises(ValueError, match="shape is missing"):
        build_section({"length": 0.1})
    with pytest.raises(ValueError, match="a mapping or a dataclass, not int"):
        build_section(3)


SQUARE = chain(
    [
        Piece("symmetry_y", (0.0, 0.0), (1.0, 0.0)),
        Piece("narrow_face", (1.0, 0.0), (1.0, 1.0), mirrors="x"),
        Piece("wide_face", (1.0, 1.0), (0.0, 1.0), mirrors="y"),
        Piece("symmetry_x", (0.0, 1.0), (0.0, 0.0)),
    ]
)
GRID = np.array([(x, y) for y in (0.0, 0.5, 1.0) for x in (0.0, 0.5, 1.0)])
CELLS = np.array([(0, 1, 3, 4), (1, 2, 4, 5), (3, 4, 6, 7), (4, 5, 7, 8)])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({4: (1.2, 0.5)}, "cells are inverted, the first at"),
        ({4: (0.999, 0.999)}, "cells are (inverted|degenerate)"),
        ({1: (0.5, 0.1)}, "lies on no piece of the outline"),
        ({4: (0.5, 0.0)}, "two vertices in one place"),
    ],
)
def test_invalid_meshes_are_rejected(change: dict[int, tuple[float, float]], message: str) -> None:
    good = assemble(GRID, CELLS, "quadrilateral", 1, SQUARE, {}, "quarter")
    assert good.quality().area == 1.0
    points = GRID.copy()
    for node, place in change.items():
        points[node] = place
    with pytest.raises(ValueError, match=message):
        assemble(points, CELLS, "quadrilateral", 1, SQUARE, {}, "quarter")


def test_holes_overlaps_and_loose_vertices_are_rejected() -> None:
    loose = np.concatenate([GRID, [(0.25, 0.25)]])
    with pytest.raises(ValueError, match="belong to no cell"):
        assemble(loose, CELLS, "quadrilateral", 1, SQUARE, {}, "quarter")
    with pytest.raises(ValueError, match=r"lies on no piece|cells overlap or are missing"):
        assemble(GRID[:8], CELLS[:3], "quadrilateral", 1, SQUARE, {}, "quarter")
    with pytest.raises(ValueError, match="more than two cells share a side"):
        twice = np.concatenate([CELLS, CELLS[:1]])
        assemble(GRID, twice, "quadrilateral", 1, SQUARE, {}, "quarter")


def test_unknown_size_is_a_type_error_of_the_function() -> None:
    with pytest.raises(TypeError, match="colour"):
        rectangle(width=0.1, height=0.1, surface_size=0.01, core_size=0.01, colour=3.0)
