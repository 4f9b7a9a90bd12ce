"""Figures of a strained strand, over its section and along it.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools

import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from strained_run import moved_points, write_strained
from synthetic_run import COLUMNS, HALF, LIQUIDUS, SOLIDUS, rectangle, temperature

from castfem.model import load_case
from castfem.model.shipped_cases import find
from castfem.post.compare.figures import _derive
from castfem.post.compare.runs import read_runs
from castfem.post.compare.sections import Section, draw_sections
from castfem.post.plots.along_strand import (
    draw_axial,
    draw_contact,
    draw_size,
    draw_steps,
    draw_stress,
)
from castfem.post.plots.deformation import SOFT, draw_shape, draw_von_mises, stress_levels
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.section import Steel
from castfem.post.plots.shape import Outline, WallLine, displacement, magnification, von_mises
from castfem.post.plots.strand import draw_stack
from castfem.post.plots.style import Abscissa, head, look, new_figure, render
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import FIGURES, MECHANICS_FIGURES, OutputFolder
from castfem.runs.output.layout import components
from castfem.runs.output.xdmf import FieldWriter
from castfem.runs.results.labels import probes_with

STEEL = Steel(SOLIDUS, LIQUIDUS)


@pytest.fixture
def abscissa(table):
    """Return the positions of the strained run."""
    return Abscissa(table["time"].to_numpy(), table["position"].to_numpy())


def test_all_figures_are_drawn_and_removed_by_a_new_run(tmp_path):
    run = write_strained(tmp_path)
    drawn = draw_figures(run)
    assert {path.stem for path in drawn} == {*FIGURES, *MECHANICS_FIGURES}
    for path in drawn:
        image = matplotlib.image.imread(path)
        assert min(image.shape[:2]) > 400
        assert image[..., :3].std() > 0.02
        # the stack has all colours of two scales, without bands
        newer = matplotlib.__version_info__ >= (3, 11)  # its files are 3 % larger
        largest = 600_000 if path.stem == "stack" else 210_000 if newer else 200_000
        assert path.stat().st_size < largest
    OutputFolder(run).begin("x = 1\n")
    assert not (run / "figures").exists()


@pytest.mark.parametrize(
    ("cell", "order"),
    [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1), ("triangle", 2)],
)
@pytest.mark.parametrize(("part", "planes", "faces"), [("quarter", 2, 2), ("half", 1, 3)])
def test_outline_is_surface_and_symmetry_planes(tmp_path, cell, order, part, planes, faces):
    write_strained(tmp_path, cell=cell, order=order, part=part)
    with Fields(tmp_path) as fields:
        outline = Outline.of(fields)
        lengths = [
            np.linalg.norm(fields.points[p[:, 1]] - fields.points[p[:, 0]], axis=1).sum()
            for p in (outline.surface, *outline.cuts.values())
        ]
        assert lengths == pytest.approx([faces * HALF, *planes * [HALF]])
        for axis, pieces in outline.cuts.items():
            assert np.abs(fields.points[pieces][..., axis]).max() < 1e-12
        nodes, normals = outline.outward(fields.points)
        right = np.isclose(fields.points[nodes, 0], HALF)
        inner = np.abs(fields.points[nodes, 1] - fields.points[:, 1].min() - HALF / 2) < 0.4 * HALF
        assert np.allclose(normals[right & inner], [1.0, 0.0])
        assert (right & inner).any()


@pytest.mark.parametrize(
    ("largest", "factor"),
    [(2.4e-4, 10.0), (6e-4, 5.0), (1.5e-3, 2.0), (0.1, 1.0), (0.0, 1.0), (4e-6, 500.0)],
)
def test_displacements_are_magnified_by_a_round_factor(largest, factor):
    moved = np.array([[0.0, 0.0], [0.0, -largest]])
    assert magnification(moved, np.array([[0.0, 0.0, 0.0], [0.0625, 0.0625, 0.0]])) == factor


def test_von_mises_stress_is_read_or_taken_from_the_tensor(tmp_path, strained_run):
    write_strained(tmp_path, tensor=True)
    with Fields(tmp_path) as tensor, Fields(strained_run) as scalar:
        assert np.allclose(von_mises(tensor), 2e6)
        assert np.allclose(von_mises(scalar), 2e6)
        assert components(np.ones((3, 4)), 3, "stress").shape == (3, 9)
    points, cells = rectangle(2, 2, HALF, HALF, "quadrilateral", 1)
    shear = np.tile([0.0, 0.0, 0.0, 1e6], (len(points), 1))
    with FieldWriter(tmp_path, points, cells, "quadrilateral", 1) as writer:
        writer.write(0.0, 0.0, {"stress": shear, "temperature": np.full(len(points), 1800.0)})
    with Fields(tmp_path) as fields:
        assert np.allclose(von_mises(fields), np.sqrt(3.0) * 1e6)
        assert draw_von_mises(fields, Steel(1700.0, 1750.0)) is None  # nothing is solid
        assert draw_von_mises(fields, None) is None
        assert draw_stack(fields, None) is None  # one slice only
        assert draw_shape(fields, None) is None
        assert not displacement(fields).any()


@pytest.mark.parametrize("largest", [10.3, 0.0421, 1.0, 250.0])
def test_scale_of_stress_is_round_and_contains_the_largest(largest):
    levels = stress_levels(largest)
    assert levels[0] == 0.0
    assert levels[-2] < largest <= levels[-1] * (1 + 1e-9)
    assert 4 < len(levels) <= 14


@pytest.mark.parametrize("part", ["quarter", "half", "whole"])
def test_section_figures_show_the_modelled_part_with_its_factor(tmp_path, part):
    write_strained(tmp_path, part=part)
    with Fields(tmp_path) as fields:
        for figure in (draw_von_mises(fields, STEEL), draw_shape(fields, STEEL)):
            labels = {text.get_text() for text in figure.legends[0].get_texts()}
            factor = 2 if part == "quarter" else 5
            assert {"at the meniscus", f"displacement × {factor}", "solidus"} <= labels
            assert ("symmetry" in labels) == (part != "whole")
            low, high = figure.axes[0].get_xlim()
            assert low < fields.points[:, 0].min() * 1e3 < high - 50.0
        texts = [text.get_text() for text in figure.axes[0].texts]
        named = {"quarter": ["+0.30 mm", "−0.60 mm"], "half": ["+0.30 mm", "−0.30 mm"]}
        assert sorted(texts) == named.get(part, ["+0.15 mm", "−0.30 mm"])


def test_soft_steel_is_grey_and_does_not_change_the_scale(tmp_path):
    run = write_strained(tmp_path)
    with FieldWriter.resume(run, 9.0) as writer, Fields(run) as fields:
        kelvin = temperature(fields.points[:, :2], 10.0)
        stress = np.where(kelvin > SOLIDUS, 9e9, 1e6 * (2.0 + fields.points[:, 0] / HALF))
        moved = moved_points(fields.points[:, :2], 10.0)
        now = {"temperature": kelvin, "von_mises": stress, "displacement": moved}
        writer.write(10.0, 0.6, now)
    with Fields(run) as fields:
        figure = draw_von_mises(fields, STEEL)
        bar = next(a for a in figure.axes[0].child_axes if "MPa" in a.get_ylabel())
        assert bar.get_ylim() == pytest.approx((0.0, 3.0))
        assert np.allclose(colour_at(figure, 10.0, 10.0), to_rgb(SOFT[1]), atol=0.01)


def colour_at(figure, x: float, y: float) -> np.ndarray:
    """Return the colour at a place [mm] of the section."""
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[..., :3] / 255.0
    column, line = figure.axes[0].transData.transform((x, y))
    return image[len(image) - int(line), int(column)]


def test_displacement_that_rounds_to_zero_has_no_sign(tmp_path):
    run = write_strained(tmp_path)
    with FieldWriter.resume(run, 9.0) as writer, Fields(run) as fields:
        kelvin = temperature(fields.points[:, :2], 10.0)
        moved = 1e-3 * moved_points(fields.points[:, :2], 10.0)
        writer.write(10.0, 0.6, {"temperature": kelvin, "von_mises": kelvin, "displacement": moved})
    with Fields(run) as fields:
        figure = draw_shape(fields, STEEL)
        assert {text.get_text() for text in figure.axes[0].texts} == {"0.00 mm"}


def test_largest_stress_is_at_the_end_of_the_scale(strained_run):
    with Fields(strained_run) as fields:  # 2 MPa everywhere, the scale ends there
        figure = draw_von_mises(fields, STEEL)
        assert figure is not None
        red, green, blue = colour_at(figure, 62.0, 10.0)
        assert min(red, green) > 0.85
        assert blue < 0.3


def test_history_figures_have_their_labels(table, abscissa):
    figure = draw_stress(table, abscissa, None)
    labels = [line.get_label() for line in figure.axes[0].lines]
    assert labels == ["surface, mid-face", "surface, corner", "largest in the section"]
    figure = draw_size(table, abscissa, None)
    assert len(figure.axes) == 1  # the displacement adds nothing
    lines = figure.axes[0].lines
    assert lines[0].get_label() == "mid-face, from 125.00 mm"
    assert lines[1].get_label() == "diagonal, from 172.60 mm"
    assert lines[1].get_ydata()[-1] == pytest.approx(-0.48)
    figure = draw_axial(table, abscissa, None)
    assert len(figure.axes) == 1
    assert figure.axes[0].lines[0].get_ydata()[-1] == pytest.approx(-0.3)
    assert figure.axes[0].get_legend().get_texts()[0].get_text() == "free slice, no axial force"


def test_newtons_on_a_free_strand_are_not_drawn(table, abscissa):
    for newtons, panels in ((3.0, 1), (300.0, 2)):
        table["axial_force"] = 1e-3 * newtons
        assert len(draw_axial(table, abscissa, None).axes) == panels


def test_displacements_and_forces_are_drawn_if_informative(table, abscissa):
    units = table.attrs["units"]
    half = table.drop(columns=["size_mid_face"])
    half["axial_force"] = 12.0
    half.attrs["units"] = units
    labels = [axes.get_ylabel() for axes in draw_size(half, abscissa, None).axes]
    assert labels == ["change of size [mm]", "outward displacement [mm]"]
    labels = [axes.get_ylabel() for axes in draw_axial(half, abscissa, None).axes]
    assert labels == ["axial strain [%]", "axial force,\nmodelled part [kN]"]


def test_contact_and_steps_are_drawn_from_their_columns(table, abscissa):
    labels = [axes.get_ylabel() for axes in draw_contact(table, abscissa, None).axes]
    share = "share of the surface\nin contact [%]"
    assert labels == ["gap [mm]", "contact pressure [MPa]", share]  # no friction anywhere
    assert probes_with(table, "gap") == {"mid_face": "gap_mid_face", "corner": "gap_corner"}
    figure = draw_steps(table, abscissa, None)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels[1:] == [
        "Newton\niterations [-]",
        "relative error [-]",
        "largest\npenetration [µm]",
    ]
    assert [t.get_text() for t in figure.axes[1].get_legend().get_texts()] == [
        "temperature",
        "mechanics",
    ]
    thermal = table[[name for name, _ in COLUMNS]]
    thermal.attrs["units"] = table.attrs["units"]
    for draw in (draw_contact, draw_stress, draw_size, draw_axial):
        assert draw(thermal, abscissa, None) is None


def test_long_title_continues_in_further_lines(tmp_path):
    with look():
        figure = new_figure(5.0, 3.0)
        figure.subplots()
        head(figure, "; ".join(f"casting.speed = {i} m/min" for i in range(10)), 9.0)
        render(figure)
        box = figure._suptitle.get_window_extent()
    assert figure.get_suptitle().count("\n") > 1
    assert box.x0 > 0.0 and box.x1 < figure.bbox.x1


def test_no_gap_is_drawn_below_the_mould(table, abscissa):
    """A history has a largest gap of 0 there; a curve down to it would mean that it closes."""
    below = table["position"].to_numpy() > 0.5
    table.loc[below, ["gap_mid_face", "gap_corner"]] = np.nan
    table.loc[below, "gap_max"] = 0.0
    drawn = draw_contact(table, abscissa, STEEL).axes[0].get_lines()
    (largest,) = [line for line in drawn if line.get_label() == "largest anywhere"]
    assert (np.isnan(largest.get_ydata()) == below).all()
    _derive(table, None)
    assert (table["gap_max"].isna() == below).all()


def test_long_numbers_keep_their_label_in_the_figure(table, abscissa):
    units = table.attrs["units"]
    for name in ("von_mises_mid_face", "von_mises_corner", "von_mises_max"):
        table[name] *= 1e7
    table.attrs["units"] = units
    with look():
        figure = draw_stress(table, abscissa, None)
        figure.axes[0].ticklabel_format(axis="y", style="plain")
        before = figure.subplotpars.left
        image = render(figure)
    assert figure.subplotpars.left > before
    assert figure.axes[0].yaxis.label.get_window_extent().x0 > 0.0
    assert np.asarray(image)[:, 0].min() == 255  # nothing is drawn at the edge


def test_sections_of_several_runs_have_one_scale(tmp_path):
    folders = [tmp_path / "taper_1", tmp_path / "taper_2"]
    for folder, last in zip(folders, (10.0, 5.0), strict=True):
        folder.mkdir()
        write_strained(folder, last=last)
    found = draw_sections(read_runs(folders), lambda label: label.replace("_", " "))
    assert list(found) == ["temperature", "states", "von_mises", "shape"]
    figure = found["von_mises"]
    assert [axes.get_title() for axes in figure.axes[:2]] == ["taper 1", "taper 2"]
    assert figure.axes[2].get_ylim() == pytest.approx((0.0, 2.0))  # of the stronger
    assert np.allclose(colour_at(figure, 10.0, 10.0), to_rgb(SOFT[1]), atol=0.01)
    titles = [axes.get_title() for axes in found["states"].axes]
    shares = [float(title.split(": ")[1].removesuffix(" % solid")) for title in titles]
    assert shares[0] > shares[1] > 0.0
    assert len(found["temperature"].axes) == 3
    (tmp_path / "taper_2" / "fields.h5").unlink()
    assert draw_sections(read_runs(folders), str) == {}


def in_mould(folder, last: float = 10.0):
    """Write a strained run whose case has a mould of -3 %/m, wide open at its end at 0.6 m."""
    folder.mkdir()
    write_strained(folder, last=last)
    (folder / "case.toml").write_text(load_case(find("billet125/taper_minus_3")).resolved_toml())
    return folder


def test_wall_is_drawn_round_the_modelled_part(tmp_path):
    with Fields(in_mould(tmp_path / "open")) as fields:
        wall = WallLine.of(fields, -1)
        known = np.isfinite(wall.start).all(axis=1)
        assert wall.start[known].min() >= -1e-9
        assert wall.start[known].max() == pytest.approx(HALF)
        outwards = HALF * (1 / (1 - 0.03 * 0.6) - 1)  # (300): the taper is that of the outlet
        assert wall.moved[known].max(axis=0) == pytest.approx([outwards] * 2)
        assert WallLine.of(fields, 0).moved[known].max() == 0.0
        figure = draw_shape(fields, STEEL)
        assert "mould" in {text.get_text() for text in figure.legends[0].get_texts()}
        assert figure.axes[0].get_xlim()[1] > 1e3 * (HALF + 2 * outwards)
        fields.positions[-1] = 0.7
        assert WallLine.of(fields, -1) is None  # the slice has left the mould


def test_shapes_of_several_runs_have_one_magnification(tmp_path):
    folders = [in_mould(tmp_path / "open"), in_mould(tmp_path / "early", last=5.0)]
    (folders[1] / "case.toml").unlink()
    found = draw_sections(read_runs(folders), str)["shape"]
    assert found.get_suptitle() == "Shape where the runs end, displacement and taper × 20"
    labels = [text.get_text() for text in found.legends[0].get_texts()]
    assert {"mould", "at the meniscus", "displacement × 20"} <= set(labels)
    assert len({axes.get_xlim() for axes in found.axes[:2]}) == 1
    found.canvas.draw()
    entries = found.legends[0].get_window_extent()
    assert 0.0 < entries.x0 < entries.x1 < found.bbox.x1
    assert entries.y1 < found.axes[0].get_tightbbox().y0
    for section, last in zip(map(Section.of, read_runs(folders)), (10.0, 5.0), strict=True):
        drawn = section.distorted(20.0)
        assert drawn.x.max() == pytest.approx(62.5 + 20 * 0.3 * last / 10, rel=1e-6)
        assert drawn.y.max() == pytest.approx(62.5 - 20 * 0.6 * last / 10, rel=1e-6)


@pytest.mark.parametrize(("part", "closed"), [("quarter", False), ("half", False), ("whole", True)])
def test_surface_is_a_single_line(tmp_path, part, closed):
    write_strained(tmp_path, part=part)
    with Fields(tmp_path) as fields:
        outline = Outline.of(fields)
        (chain,) = outline.chains()
        assert len(chain) == len(outline.surface) + 1
        assert (chain[0] == chain[-1]) == closed
        steps = {tuple(step) for step in outline.surface}
        assert set(itertools.pairwise(chain.tolist())) == steps
