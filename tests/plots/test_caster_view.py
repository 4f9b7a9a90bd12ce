"""The picture of the strand in its caster: what faces the eye, no peak lost, every roll drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from synthetic_maps import THICK, WIDE, rolls, write_maps

from castfem.physics.machine.side import Side
from castfem.post.plots.caster_view import draw_caster, mirrored, view_of
from castfem.post.plots.style import look
from castfem.runs.output.surface_maps import Heading, MapWriter, SurfaceMaps


@pytest.fixture
def maps(tmp_path: Path) -> SurfaceMaps:
    write_maps(tmp_path)
    return SurfaceMaps(tmp_path)


def test_half_a_slab_is_mirrored_to_a_whole_one(maps: SurfaceMaps) -> None:
    assert mirrored(maps.heading.line) == [(1.0, 1.0), (-1.0, 1.0)]


@pytest.mark.parametrize("every", [1, 7])
def test_no_peak_is_lost_between_rows(maps: SurfaceMaps, every: int) -> None:
    """The peak of the intrados is seen, with rows that leave it out, too; no extrados is."""
    rows = np.append(np.arange(0, len(maps.time) - 1, every), len(maps.time) - 1)
    view = view_of(maps, Side(rolls(), THICK, 3.0), rows)
    values = maps["I1"]
    assert view.on_pieces(values).max() == values.max()
    faces = maps.heading.line.face[view.vertices]
    hidden = (faces == maps.heading.line.faces.index("extrados")).all(axis=1)
    assert not hidden.any()
    assert view.half == pytest.approx(0.5 * WIDE)


def test_what_faces_the_eye_is_drawn(maps: SurfaceMaps) -> None:
    """Both halves of the intrados, one narrow face of the two."""
    rows = np.arange(0, len(maps.time), 4)
    view = view_of(maps, Side(rolls(), THICK, 3.0), rows)
    line = maps.heading.line
    for face, times in (("intrados", 2), ("narrow face", 1)):
        segments = np.flatnonzero(line.face == line.faces.index(face))
        # The corners count to the wide faces; a piece lies on a face if it has a vertex inside.
        drawn = np.isin(view.vertices, segments[line.corner[segments] > 0.0]).any(axis=1)
        inside = np.count_nonzero(line.corner[segments] > 0.0)
        pieces = inside + 1 if face == "narrow face" else inside
        assert np.count_nonzero(drawn) == times * pieces * (len(rows) - 1), face


def test_every_roll_is_drawn(maps: SurfaceMaps) -> None:
    with look():
        figure = draw_caster(maps)
    assert figure is not None
    panels = figure.axes[:2]
    for panel in panels:
        drawn = [one for one in panel.collections if isinstance(one, PolyCollection)]
        paths = [len(one.get_paths()) for one in drawn]
        assert 2 * len(rolls().pairs) in paths and paths.count(len(rolls().pairs)) == 2
    shades = [one for one in panels[1].collections if one.get_array() is not None]
    assert shades[0].get_array().max() == pytest.approx(30.0)
    assert shades[0].get_clim() == pytest.approx((0.0, 30.0))


def test_the_worst_place_is_named_where_it_may_be_out_of_sight(maps: SurfaceMaps) -> None:
    with look():
        figure = draw_caster(maps)
    assert figure is not None and "I1" in maps.names()
    row, vertex = np.unravel_index(int(maps["I1"].argmax()), maps["I1"].shape)
    (title,) = [axes.get_title() for axes in figure.axes if axes.get_title()]
    face = maps.heading.line.words(int(vertex))
    assert title.startswith(f"largest: {face}, ")
    number, unit = title.rsplit(", ", 1)[1].split()
    factor = {"m": 1.0, "mm": 1e-3}[unit]
    assert float(number) * factor == pytest.approx(maps.position[row], rel=1e-3)


def test_rolls_are_numbered_and_those_with_a_defect_are_red(maps: SurfaceMaps) -> None:
    """A lost pair is not drawn, its number is."""
    count, pairs = len(rolls().pairs), list(rolls().pairs)
    pairs[1], pairs[2] = replace(pairs[1], lost=True), replace(pairs[2], locked=True)
    with look():
        figure = draw_caster(maps, replace(rolls(), pairs=tuple(pairs)))
    assert figure is not None
    panel = figure.axes[0]
    red = {text.get_text() for text in panel.texts if text.get_color() == "#c1121f"}
    assert red == {"#2", "#3"} and "#1" not in red
    drawn = [one for one in panel.collections if isinstance(one, PolyCollection)]
    paths = [len(one.get_paths()) for one in drawn]
    assert paths.count(count - 1) == 2 and 2 in paths  # bodies of each face; the two red ends


def test_a_strand_without_rolls_has_no_picture(tmp_path: Path, maps: SurfaceMaps) -> None:
    there = maps.heading
    with MapWriter(tmp_path, Heading(there.line, there.maps, there.band)) as writer:
        for i in range(3):
            writer.append(float(i), float(i), np.zeros((len(there.maps), len(there.line.nodes))))
    assert draw_caster(SurfaceMaps(tmp_path)) is None
