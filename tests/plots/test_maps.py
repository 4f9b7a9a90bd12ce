"""Figures of a strand in its machine: maps, the caster, effects of bending."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from matplotlib.collections import PolyCollection
from rolled_case import circuit, rolled, secondary
from synthetic_maps import LENGTH, THICK, WIDE, rolls, write_maps

from castfem.model.load import load
from castfem.physics.machine.side import Side
from castfem.post.plots import figures
from castfem.post.plots.along_strand import draw_bulging, draw_slice
from castfem.post.plots.caster_view import draw_caster, view_of
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.maps import band_norm, draw_maps, temperature_colours
from castfem.post.plots.secondary import faces_met
from castfem.post.plots.style import Abscissa, look, render
from castfem.runs.loop import run
from castfem.runs.output.folder import ALL_FIGURES, OutputFolder
from castfem.runs.output.surface_maps import Heading, MapWriter, SurfaceMaps


@pytest.mark.parametrize(
    ("celsius", "colour"), [(700.0, 2), (780.0, 2), (990.0, 1), (1200.0, 1), (1400.0, 1)]
)
def test_colours_are_blue_below_and_green_above_the_band(celsius: float, colour: int) -> None:
    rgb = temperature_colours()(band_norm(650.0, 1450.0, (800.0, 950.0))(celsius))[:3]
    assert int(np.argmax(rgb)) == colour


def test_band_outside_all_temperatures_keeps_its_third() -> None:
    norm = band_norm(500.0, 600.0, (800.0, 950.0))
    assert float(norm(800.0)) == pytest.approx(1.0 / 3.0)
    assert float(norm(950.0)) == pytest.approx(2.0 / 3.0)


def test_every_value_is_drawn_at_its_place(tmp_path: Path) -> None:
    """Down the strand to the right, from the extrados at the bottom to the intrados at the top."""
    line = write_maps(tmp_path)
    maps = SurfaceMaps(tmp_path)
    with look():
        figure = draw_maps(maps, Abscissa(maps.time, maps.position))
    temperature, band, first, second = (axes.collections[0] for axes in figure.axes[:4])
    assert np.ma.allclose(temperature.get_array(), maps["temperature"].T - 273.15)
    assert np.array_equal(band.get_array(), maps["in_band"].T)
    drawn = first.get_array().reshape(len(line.nodes), -1)
    assert np.ma.count(drawn) == 4 and drawn.max() == pytest.approx(30.0)
    assert second.get_array().max() == pytest.approx(20.0)  # in 1e-5 1/s
    lines = figure.axes[2].get_lines()
    (worst,) = [one for one in lines if one.get_marker() == "o"]
    assert worst.get_xydata()[0] == pytest.approx([2.125, 1e3 * (0.5 * WIDE + THICK)])
    assert figure.axes[0].get_xlim() == (0.0, LENGTH)
    names = [label.get_text().replace("\n", " ") for label in figure.axes[0].get_yticklabels()]
    assert names == ["extrados", "narrow face", "intrados"]
    assert {"bending", "straightening"} <= {text.get_text() for text in figure.axes[0].texts}


def test_figures_are_drawn_and_removed_by_a_new_run(tmp_path: Path) -> None:
    with OutputFolder(tmp_path) as folder:
        folder.begin("x = 1\n")
        write_maps(tmp_path)
        folder.finish()
    assert [path.name for path in draw_figures(tmp_path)] == ["maps.png", "caster.png"]
    assert {"maps", "caster"} <= set(ALL_FIGURES)
    with OutputFolder(tmp_path) as folder:
        folder.begin("x = 1\n")
        assert {path.name for path in tmp_path.iterdir()} <= {
            "case.toml", "run.json", ".castfem.lock",
        }  # fmt: skip


# The picture of the strand in its caster: visible faces, all peaks, every roll


@pytest.fixture
def maps(tmp_path: Path) -> SurfaceMaps:
    write_maps(tmp_path)
    return SurfaceMaps(tmp_path)


@pytest.mark.parametrize("every", [1, 7])
def test_no_peak_is_lost_between_rows(maps: SurfaceMaps, every: int) -> None:
    """The peak of the intrados is visible, also with rows that omit it; no extrados is."""
    rows = np.append(np.arange(0, len(maps.time) - 1, every), len(maps.time) - 1)
    view = view_of(maps, Side(rolls(), THICK, 3.0), rows)
    values = maps["I1"]
    assert view.on_pieces(values).max() == values.max()
    faces = maps.heading.line.face[view.vertices]
    hidden = (faces == maps.heading.line.faces.index("extrados")).all(axis=1)
    assert not hidden.any()
    assert view.half == pytest.approx(0.5 * WIDE)


def test_visible_faces_are_drawn(maps: SurfaceMaps) -> None:
    """Both halves of the intrados, one narrow face of the two."""
    rows = np.arange(0, len(maps.time), 4)
    view = view_of(maps, Side(rolls(), THICK, 3.0), rows)
    line = maps.heading.line
    for face, times in (("intrados", 2), ("narrow face", 1)):
        segments = np.flatnonzero(line.face == line.faces.index(face))
        # The corners belong to the wide faces; a piece is on a face if it has a vertex inside.
        drawn = np.isin(view.vertices, segments[line.corner[segments] > 0.0]).any(axis=1)
        inside = np.count_nonzero(line.corner[segments] > 0.0)
        pieces = inside + 1 if face == "narrow face" else inside
        assert np.count_nonzero(drawn) == times * pieces * (len(rows) - 1), face


def test_every_roll_is_drawn(maps: SurfaceMaps) -> None:
    with look():
        figure = draw_caster(maps)
    panels = figure.axes[:2]
    for panel in panels:
        drawn = [one for one in panel.collections if isinstance(one, PolyCollection)]
        paths = [len(one.get_paths()) for one in drawn]
        assert 2 * len(rolls().pairs) in paths and paths.count(len(rolls().pairs)) == 2
    shades = [one for one in panels[1].collections if one.get_array() is not None]
    assert shades[0].get_array().max() == pytest.approx(30.0)
    assert shades[0].get_clim() == pytest.approx((0.0, 30.0))


def test_largest_value_is_named_with_its_place(maps: SurfaceMaps) -> None:
    with look():
        figure = draw_caster(maps)
        assert figure is not None and "I1" in maps.names()
        render(figure)
    row, vertex = np.unravel_index(int(maps["I1"].argmax()), maps["I1"].shape)
    (named,) = [axes.title for axes in figure.axes if axes.get_title().strip()]
    assert 0.0 < named.get_window_extent().y0 < named.get_window_extent().y1 < figure.bbox.height
    title = named.get_text()
    face = maps.heading.line.words(int(vertex))
    assert title.startswith(f"largest: {face}, ")
    number, unit = title.rsplit(", ", 1)[1].split()
    factor = {"m": 1.0, "mm": 1e-3}[unit]
    assert float(number) * factor == pytest.approx(maps.position[row], rel=1e-3)


def test_rolls_are_numbered_and_defects_are_red(maps: SurfaceMaps) -> None:
    """A lost pair is not drawn, but its number is."""
    count, pairs = len(rolls().pairs), list(rolls().pairs)
    pairs[1], pairs[2] = replace(pairs[1], lost=True), replace(pairs[2], locked=True)
    with look():
        figure = draw_caster(maps, replace(rolls(), pairs=tuple(pairs)))
    panel = figure.axes[0]
    red = {text.get_text() for text in panel.texts if text.get_color() == "#c1121f"}
    assert red == {"#2", "#3"} and "#1" not in red
    drawn = [one for one in panel.collections if isinstance(one, PolyCollection)]
    paths = [len(one.get_paths()) for one in drawn]
    assert paths.count(count - 1) == 2 and 2 in paths  # bodies of each face; the two red ends


def test_strand_without_rolls_has_no_picture(tmp_path: Path, maps: SurfaceMaps) -> None:
    head = maps.heading
    with MapWriter(tmp_path, Heading(head.line, head.maps, head.band)) as writer:
        for i in range(3):
            writer.append(float(i), float(i), np.zeros((len(head.maps), len(head.line.nodes))))
    assert draw_caster(SurfaceMaps(tmp_path)) is None


# Figures of a strand in its rolls: thickness, neutral axis between its faces, stress, bulges


def history() -> pandas.DataFrame:
    """Return a strand bent from 1 to 2 m, its neutral axis 20 mm towards the intrados."""
    position = np.linspace(0.0, 4.0, 41)
    k = 0.1 * np.clip(position - 1.0, 0.0, 1.0)
    table = pandas.DataFrame({"time": 50.0 * position, "position": position})
    for place, y in (("intrados", 0.1), ("centre", 0.0), ("extrados", -0.1)):
        table[f"slice_thickness_{place}"] = (1.0 - k * y) / (1.0 - k * 0.02)
    table["neutral_axis"] = np.where((position > 1.0) & (position <= 2.0), 20.0, np.nan)
    table["size_mid_face_intrados"] = 200.0
    table["axial_stress_corner_intrados"] = -100.0 * k
    table.attrs["units"] = {"neutral_axis": "mm", "axial_stress_corner_intrados": "MPa"}
    return table


def test_slice_is_drawn_over_the_strand() -> None:
    table = history()
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    with look():
        figure = draw_slice(table, abscissa, None)
        assert draw_slice(table.drop(columns="slice_thickness_centre"), abscissa, None) is None
    thickness, axis, stress = figure.axes[:3]
    drawn = {line.get_label(): line.get_ydata() for line in thickness.get_lines()}
    for place in ("intrados", "centre", "extrados"):
        assert drawn[place] == pytest.approx(table[f"slice_thickness_{place}"])
    faces = [line.get_ydata()[0] for line in axis.get_lines()[1:]]
    assert faces == [100.0, -100.0]
    assert np.nanmax(axis.get_lines()[0].get_ydata()) == 20.0
    assert {text.get_text() for text in axis.texts} == {"intrados", "extrados"}
    assert axis.get_ylabel() == "neutral axis (y) [mm]"
    assert stress.get_ylabel() == "axial stress [MPa]"


def defects(folder: Path) -> tuple[tuple[float, str], ...]:
    with ExitStack() as files:
        return figures.RunData(folder, None, files).defects


def test_rolls_with_a_defect_are_marked(tmp_path: Path) -> None:
    """Those of the run's case, within the drawn length."""
    case = load("slab1200/locked_48_52")
    (tmp_path / "case.toml").write_text(case.resolved_toml(), encoding="utf-8")
    found = defects(tmp_path)
    assert [name for _, name in found] == ["#48 locked", "#52 locked"]
    assert case.machine is not None and (rolls := case.machine.pairs()) is not None
    assert [place for place, _ in found] == [rolls.pairs[i - 1].position for i in (48, 52)]
    (tmp_path / "case.toml").write_text(load("slab1200/slab").resolved_toml(), encoding="utf-8")
    assert defects(tmp_path) == () == defects(tmp_path / "nowhere")
    table = history()
    way = table["time"].to_numpy(), table["position"].to_numpy()
    with look():
        plain = draw_slice(table, Abscissa(*way), None)
        marked = draw_slice(table, Abscissa(*way, (), ((3.0, "#7 lost"), (9.0, "#8 off"))), None)
    for one, other in zip(plain.axes[:3], marked.axes[:3], strict=True):
        assert len(other.get_lines()) == len(one.get_lines()) + 1
        assert list(other.get_lines()[-1].get_xdata()) == [3.0, 3.0]
    assert [text.get_text() for text in marked.axes[2].texts] == ["#7 lost"]


def test_bulges_are_drawn_with_the_roll_forces() -> None:
    table = history()
    for name, most in (("intrados", 0.1), ("extrados", 0.08), ("pitch", 0.12)):
        table[f"bulge_{name}"] = most * np.sin(table["position"]) ** 2
    table["roll_force"] = 20.0 * table["position"]
    table.attrs["units"] |= {"bulge_pitch": "mm", "roll_force": "kN/m"}
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    with look():
        figure = draw_bulging(table, abscissa, None)
        assert draw_bulging(history(), abscissa, None) is None
    bulge, force = figure.axes[:2]
    drawn = {line.get_label(): line.get_ydata() for line in bulge.get_lines()}
    # A curve through few places of a pitch misses its largest bulge: the legend says so.
    assert drawn["intrados, once a window"] == pytest.approx(table["bulge_intrados"])
    assert drawn["largest of the pitch"] == pytest.approx(table["bulge_pitch"])
    assert force.get_lines()[0].get_ydata() == pytest.approx(table["roll_force"])
    assert (bulge.get_ylabel(), force.get_ylabel()) == ("bulge [mm]", "force on a roll [kN/m]")


def test_every_figure_is_removed_with_its_run() -> None:
    """A run that replaces another removes its known files by name."""
    assert set(figures.FIGURES) == set(ALL_FIGURES)
    assert all(figure.title for figure in figures.FIGURES.values())


def test_roll_to_roll_figure_needs_rolls(tmp_path: Path) -> None:
    short = rolled(casting__length="0.2 m")
    run(short, tmp_path / "short")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "short")]
    run(rolled(casting__length="0.5 m"), tmp_path / "run")
    drawn = {path.name: path for path in draw_figures(tmp_path / "run")}
    assert drawn["roll_to_roll.png"].stat().st_size > 10_000
    bare = rolled(secondary=None, cooling__0__to="0.25 m", casting__length="0.25 m")
    run(bare, tmp_path / "bare")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "bare")]


def test_zones_of_a_face_are_shown() -> None:
    case = rolled(secondary=secondary(circuit=[circuit(on=["wide_face_intrados"])]))
    met = faces_met(case, case.machine.pairs(), 0.65)
    kinds = {name: [stretch.kind for stretch in found] for name, found in met.items()}
    pitch = ["contact", "shade", "spray", "run_off"]
    assert kinds["intrados"] == ["shade", *pitch, *pitch]
    assert kinds["extrados"] == ["shade", "contact", "shade", "contact", "shade"]
    assert set(kinds["narrow face"]) == {"shade"}
