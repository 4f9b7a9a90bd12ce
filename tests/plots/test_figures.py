"""Figures of a run's history and of its section: their contents, and the data they need."""

from __future__ import annotations

import shutil
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from synthetic_run import HALF, LIQUIDUS, SOLIDUS, rectangle, summary, write_run

from castfem.post.plots.along_strand import draw_heat, draw_shell, draw_steps
from castfem.post.plots.figures import RunData, draw_figures
from castfem.post.plots.history import curves, open_front
from castfem.post.plots.section import Steel, draw_states, draw_temperature, section_triangles
from castfem.post.plots.section import state_shares as shares_of
from castfem.post.plots.style import Abscissa, Style
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import FIGURES
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Zone
from castfem.runs.output.xdmf import FieldWriter
from castfem.runs.results.labels import probes_with


def test_figures_need_no_display_and_no_pyplot(finished_run, tmp_path):
    run = tmp_path / "copy"
    shutil.copytree(finished_run, run)
    shutil.rmtree(run / "figures", ignore_errors=True)
    code = f"""
import os, sys
os.environ.pop("DISPLAY", None)
from castfem.post.plots.figures import draw_figures
assert len(draw_figures({str(run)!r})) == {len(FIGURES)}
assert "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


def test_missing_columns_probes_and_files_are_left_out(tmp_path):
    write_run(tmp_path, steps=12)
    text = (tmp_path / "history.csv").read_text()
    table = [line.split(",") for line in text.splitlines()]
    keep = [i for i, name in enumerate(table[0]) if name[:4] in ("time", "posi", "shel", "step")]
    lines = [",".join(line[i] for i in keep) for line in table]
    (tmp_path / "history.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "fields.h5").unlink()
    assert [path.stem for path in draw_figures(tmp_path)] == ["shell", "steps"]
    (tmp_path / "history.csv").unlink()
    assert draw_figures(tmp_path) == []


@pytest.mark.parametrize(
    ("cell", "order", "part", "copies"),
    [
        ("triangle", 1, "whole", 1),
        ("triangle", 2, "half", 2),
        ("quadrilateral", 1, "quarter", 4),
        ("quadrilateral", 2, "quarter", 4),
    ],
)
def test_full_section_is_shown_with_the_area_of_its_states(tmp_path, cell, order, part, copies):
    points, cells = rectangle(6, 4, 0.06, 0.04, cell, order)
    span = LIQUIDUS - SOLIDUS
    values = SOLIDUS - span + 3 * span * points[:, 0] / 0.06  # a third each
    facts = {"symmetry": part, "solidus": SOLIDUS, "liquidus": LIQUIDUS}
    with FieldWriter(tmp_path, points, cells, cell, order, attributes=facts) as writer:
        writer.write(1.0, 0.06, {"temperature": values})
    steel = Steel(SOLIDUS, LIQUIDUS)
    with Fields(tmp_path) as fields:
        mesh, drawn = section_triangles(fields, fields.values("temperature"))
        assert mesh.x.max() == pytest.approx(60)
        assert mesh.x.min() == pytest.approx(-60 if copies > 1 else 0)
        assert mesh.y.min() == pytest.approx(-40 if copies == 4 else 0)
        assert shares_of(mesh, drawn, steel) == pytest.approx((1 / 3, 1 / 3, 1 / 3), abs=2e-6)
        single, _ = section_triangles(fields, fields.values("temperature"), mirrored=False)
        assert len(mesh.triangles) == copies * len(single.triangles)
        for figure in (draw_temperature(fields, steel), draw_states(fields, steel)):
            (axes,) = [a for a in figure.axes if a.get_xlabel() == "x [mm]"]
            assert axes.get_aspect() == 1.0
            assert "60 mm below the meniscus, t = 1 s" in axes.get_title()


def test_shares_of_uniform_and_sharp_fields(tmp_path):
    points, cells = rectangle(2, 2, HALF, HALF, "quadrilateral", 1)
    with FieldWriter(tmp_path, points, cells, "quadrilateral", 1) as writer:
        writer.write(0.0, 0.0, {"temperature": np.full(len(points), 1800.0)})
    with Fields(tmp_path) as fields:
        for level, expected in ((1900.0, (1, 0, 0)), (1700.0, (0, 0, 1))):
            mesh, values = section_triangles(fields, fields.values("temperature"))
            assert shares_of(mesh, values, Steel(level, level + 0.01)) == expected
        assert draw_temperature(fields, Steel(1700.0, 1700.01)) is not None
        assert draw_states(fields, Steel(1700.0, 1700.0)) is not None
        assert draw_states(fields, None) is None


def test_long_strands_are_shown_in_metres(finished_run):
    table = read_history(finished_run / "history.csv")
    time = table["time"].to_numpy()
    zones = (Zone("mould", 0.0, 0.9), Zone("spray", 0.9, 5.0), Zone("beyond", 30.0, 40.0))
    figure = draw_heat(table, Abscissa(time, 2.0 * time, zones), None)
    assert [a.get_xlabel() for a in figure.axes].count("position below the meniscus [m]") == 1
    texts = {t.get_text() for a in figure.axes[0].child_axes for t in a.texts}
    assert texts == {"mould", "spray"}
    tops = [a for a in figure.axes[0].child_axes if "time" in a.get_xlabel()]
    figure.canvas.draw()
    assert tops[0].get_xlim() == pytest.approx((0.0, time[-1]))


def test_heat_rate_is_derived_from_the_heat_removed(finished_run):
    table = read_history(finished_run / "history.csv")
    units = table.attrs["units"]
    removed = table.drop(columns=["heat_rate"])
    removed["heat_removed"] = 5e5 * removed["time"]
    removed.attrs["units"] = units
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    figure = draw_heat(removed, abscissa, None)
    (panel,) = [a for a in figure.axes if a.get_ylabel() == "heat leaving\nthe strand [kW/m]"]
    assert np.allclose(panel.lines[0].get_ydata(), 500.0)


def test_zero_error_has_no_panel(finished_run):
    """A logarithmic axis would have no range."""
    table = read_history(finished_run / "history.csv")
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    labels = [axes.get_ylabel() for axes in draw_steps(table, abscissa, None).axes]
    exact = table.assign(energy_error=0.0)
    exact.attrs["units"] = table.attrs["units"]
    left = [axes.get_ylabel() for axes in draw_steps(exact, abscissa, None).axes]
    assert left == [label for label in labels if "error" not in label] != labels


def test_probes_are_found_by_their_columns(finished_run):
    table = read_history(finished_run / "history.csv")
    assert probes_with(table, "shell") == {"mid_face": "shell_mid_face", "corner": "shell_corner"}
    table["shell_empty"] = np.nan
    assert "empty" not in probes_with(table, "shell")


def test_coinciding_curves_are_drawn_once(finished_run):
    table = read_history(finished_run / "history.csv")
    units = table.attrs["units"]
    table["shell_narrow_face"] = table["shell_mid_face"] * (1 + 1e-6)
    table.attrs["units"] = units | {"shell_narrow_face": "mm"}
    found = [(label, column) for label, _, column in curves(table, "shell")]
    assert found == [("mid-face", "shell_mid_face"), ("corner", "shell_corner")]  # as in tables
    labels = {
        "mid_face_extrados": "mid-face and mid-face extrados",
        "narrow_face_right": "mid-face, mid-face extrados and narrow face right",
        "narrow_face_left": "mid-face and 3 others",
    }
    for name, expected in labels.items():
        table[f"shell_{name}"] = table["shell_mid_face"]
        assert curves(table, "shell")[0][0] == expected


NAN = np.nan


@pytest.mark.parametrize(
    ("depth", "shown"),
    [
        ([0, 80, 90, 746, 746, 746], [0, 80, 90, NAN, NAN, NAN]),
        ([NAN, 0, 90, 746, 746], [NAN, 0, 90, NAN, NAN]),
        ([0, 90, 106, 596.6, 596.4, 595.5, 595.9], [0, 90, 106, NAN, NAN, NAN, NAN]),  # strained
        ([0, 0.39, 0.4, 0.395], [0, 0.39, 0.4, 0.395]),
        ([0, 60, 90, 100, 110, 110], [0, 60, 90, 100, 110, 110]),  # it has moved there
        ([0, 0, 0.4], [0, 0, 0.4]),  # the first shell
        ([0, 0, 0], [0, 0, 0]),
        ([NAN, NAN], [NAN, NAN]),
        ([5], [5]),
        ([746, 746], [746, 746]),  # solid all the way: only this can be shown
        ([0, 9, 20, 12, 15], [0, 9, 20, 12, 15]),  # remelted
    ],
)
def test_open_part_of_a_front_is_shown(depth: list[float], shown: list[float]) -> None:
    depths = np.array(depth, float)
    np.testing.assert_array_equal(open_front(depths), np.array(shown, float))
    np.testing.assert_array_equal(depths, np.array(depth, float))


def test_axis_is_scaled_by_the_shell() -> None:
    position = np.linspace(0.0, 20.0, 41)
    shell = np.where(position < 15.0, 6.5 * np.sqrt(10 * position), 746.0)
    table = pandas.DataFrame({"position": position, "shell_narrow_face": shell})
    table.attrs["units"] = {"position": "m", "shell_narrow_face": "mm"}
    figure = draw_shell(table, Abscissa(60 * position, position, ()), None)
    assert 80.0 < figure.axes[0].get_ylim()[1] < 100.0


@pytest.mark.parametrize(
    ("exit_", "at"), [(None, 0.6), (0.6, 0.6), (0.9, 0.6), (0.2, 0.2), (0.05, 0.05)]
)
def test_state_at_the_mould_exit_is_drawn(tmp_path: Path, exit_: float | None, at: float) -> None:
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        run = RunData(folder, replace(summary(), mould_exit=exit_), files)
        positions = np.asarray(run.fields.positions, float)
        assert abs(positions[run.at_exit] - at) == np.abs(positions - at).min()
        assert RunData(folder, None, files).at_exit == len(positions) - 1


def test_meniscus_is_not_drawn(tmp_path: Path) -> None:
    """If states are far apart the next one is drawn, even if it is farther from the exit."""
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        assert RunData(folder, replace(summary(), mould_exit=1e-4), files).at_exit == 1


def test_stack_of_few_slices_is_not_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        count = len(RunData(folder, None, files).fields.positions)
    for least, expected in ((count, True), (count + 1, False)):
        monkeypatch.setattr("castfem.post.plots.figures.STYLE", Style(slices=least))
        drawn = {path.stem for path in draw_figures(folder)}
        assert ("stack" in drawn) is expected and "temperature" in drawn
