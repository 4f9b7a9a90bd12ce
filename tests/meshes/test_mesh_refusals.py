"""What cannot be meshed is refused with the name of the parameter and the mend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from castfem.meshes import build, build_section, parameters_of
from castfem.meshes.assemble import assemble
from castfem.meshes.outline import Piece, chain
from castfem.meshes.rectangle import rectangle

from .sections import BEAM, BILLET, ROUNDED, STRIP


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
def test_impossible_parameters(parameters: dict[str, Any], message: str) -> None:
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


def test_parameters_of_each_shape() -> None:
    needed, optional = parameters_of("rectangle")
    assert set(needed) == {"width", "height", "surface_size", "core_size"}
    assert {"corner_radius", "symmetry", "cell", "order", "face_size", "core_depth"} <= set(
        optional
    )
    assert parameters_of("strip")[0] == ("length", "width", "surface_size")


def test_section_from_a_mapping_or_a_dataclass() -> None:
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
def test_bad_meshes_are_refused(change: dict[int, tuple[float, float]], message: str) -> None:
    good = assemble(GRID, CELLS, "quadrilateral", 1, SQUARE, {}, "quarter")
    assert good.quality().area == 1.0
    points = GRID.copy()
    for node, place in change.items():
        points[node] = place
    with pytest.raises(ValueError, match=message):
        assemble(points, CELLS, "quadrilateral", 1, SQUARE, {}, "quarter")


def test_holes_overlaps_and_loose_vertices_are_refused() -> None:
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
