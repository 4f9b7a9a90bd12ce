"""Pictures of the slices of a run, stacked along the strand."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from strained_run import write_strained
from synthetic_run import HALF, LIQUIDUS, SOLIDUS, rectangle

from castfem.post.plots.deformation import draw_shape, draw_von_mises
from castfem.post.plots.section import Steel
from castfem.post.plots.strand import Stack, View, draw_stack
from castfem.post.plots.style import look, save
from castfem.runs.output.fields import Fields
from castfem.runs.output.xdmf import FieldWriter

STEEL = Steel(SOLIDUS, LIQUIDUS)


@pytest.mark.parametrize(("part", "views"), [("quarter", 2), ("half", 2), ("whole", 1)])
def test_stack_shows_surface_and_core(tmp_path, part, views):
    write_strained(tmp_path, part=part, cell="triangle", order=2)
    with Fields(tmp_path) as fields:
        figure = draw_stack(fields, STEEL)
        titles = [axes.get_title() for axes in figure.axes[: 2 * views]]
        assert titles == ["from outside", "from the core"][:views] * 2
        bars = [a.get_xlabel() for a in figure.axes[2 * views :]]
        assert bars == ["temperature [°C]", "von Mises stress, solid [MPa]"]
        labels = [text.get_text() for text in figure.legends[0].get_texts()]
        assert f"displacement × {2 if part == 'quarter' else 5}" in labels
        ticks = [text.get_text() for text in figure.axes[0].texts]
        assert ticks[:3] == ["0", "100", "200"]


def test_pictures_of_the_stack_have_one_scale(strained_run):
    with Fields(strained_run) as fields:
        figure = draw_stack(fields, STEEL)
        pictures = figure.axes[:4]
        figure.canvas.draw()
        scales = [axes.get_window_extent().width / np.ptp(axes.get_xlim()) for axes in pictures]
        assert scales == pytest.approx([scales[0]] * 4)
        tops = [axes.get_window_extent().height / np.ptp(axes.get_ylim()) for axes in pictures]
        assert tops == pytest.approx(scales)


def test_colours_of_the_stack_are_continuous(strained_run, tmp_path):
    """A palette would give bands: each pixel along a scale has its own colour."""
    with Fields(strained_run) as fields, look():
        figure = draw_stack(fields, STEEL)
        scale = next(axes for axes in figure.axes if "temperature" in axes.get_xlabel())
        (x0, x1), (y0, y1) = scale.get_position().intervalx, scale.get_position().intervaly
        image = np.asarray(Image.open(save(figure, tmp_path / "stack.png", shaded=True)))
    height, width, depth = image.shape
    line = image[round(height * (1.0 - 0.5 * (y0 + y1))), round(width * x0) : round(width * x1)]
    assert depth == 3 and len(np.unique(line, axis=0)) > 200


def test_rows_of_the_stack_are_linear_between_slices(strained_run):
    with Fields(strained_run) as fields:
        stack = Stack.of(fields, STEEL)
        assert stack.factor == 2.0
        nodes = [
            int(np.abs(stack.plane - 1e3 * np.array(p)).sum(axis=1).argmin())
            for p in ((HALF, 0.0), (0.0, HALF))
        ]
        for z, row in ((0.12, None), (0.3, None), (0.6, -1)):
            row = int(np.abs(stack.position - z).argmin()) if row is None else row
            right, top = stack.points[row][nodes]
            share = stack.position[row] / 0.6
            assert right[:2] == pytest.approx([62.5 + 2 * 0.3 * share, 0.0], abs=1e-4)
            assert top[:2] == pytest.approx([0.0, 62.5 - 2 * 0.6 * share], abs=1e-4)
        assert stack.points[0, 0, 2] == 0.0
        assert stack.points[-1, 0, 2] == stack.end[0, 2] < 0.0
        assert stack.strongest == pytest.approx(2e6)


def test_only_visible_walls_are_drawn(strained_run):
    with Fields(strained_run) as fields:
        stack = Stack.of(fields, STEEL)
        outside, inside = View.of(stack, 50.0), View.of(stack, 230.0)
        assert np.isclose(stack.plane[outside.pieces].max(axis=2), 1e3 * HALF).all()
        assert np.isclose(stack.plane[inside.pieces].min(axis=2), 0.0).all()
        for view in (outside, inside):
            x, y = view.walls.x[view.walls.triangles], view.walls.y[view.walls.triangles]
            twice = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (
                y[:, 1] - y[:, 0]
            )
            assert (np.sign(twice) == np.sign(twice[0])).all()  # no wall is seen from its back


def test_strip_and_slice_at_rest_have_no_stack(tmp_path):
    points, cells = rectangle(40, 1, 0.06, 1e-3, "quadrilateral", 1)
    fall = {"strip": 0.06, "still": 0.0}
    for name, speed in fall.items():
        (tmp_path / name).mkdir()
        width = 1.0 if name == "strip" else 60.0
        with FieldWriter(tmp_path / name, points * [1, width], cells, "quadrilateral", 1) as writer:
            for time in (0.0, 1.0, 2.0):
                values = np.linspace(1600.0, 1800.0, len(points))
                u = np.full((len(points), 2), 1e-4)
                fields = {"temperature": values, "von_mises": 1e4 * values, "displacement": u}
                writer.write(time, speed * time, fields)
        with Fields(tmp_path / name) as fields:
            assert draw_stack(fields, STEEL) is None
            assert draw_von_mises(fields, STEEL) is not None
            assert (draw_shape(fields, STEEL) is None) == (name == "strip")
