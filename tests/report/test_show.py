"""`castfem show`: the table, and what it says of runs that did not end well; the figures."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from rich.console import Console

from castfem.errors import InputError
from castfem.output.fields import Fields
from castfem.output.folder import FIGURES, OutputFolder
from castfem.output.history import read_history
from castfem.output.summary import Zone
from castfem.output.xdmf import FieldWriter
from castfem.plots.figures import draw_figures
from castfem.plots.history import curves, draw_heat, draw_steps, probes_with
from castfem.plots.section import Steel, draw_states, draw_temperature, section_triangles
from castfem.plots.section import state_shares as shares_of
from castfem.plots.style import Course
from castfem.report.show import show, shown

from .imagined import HALF, LIQUIDUS, SOLIDUS, rectangle, write_run


def printed(folder: Path, **options: bool) -> str:
    stream = io.StringIO()
    show(folder, Console(file=stream, width=110), **options)
    return stream.getvalue()


def cells_of(text: str, label: str) -> list[str]:
    """The line of a table that begins with a label, its cells apart."""
    (line,) = [line for line in text.splitlines() if line.startswith(label + " ")]
    return re.split(r"  +", line[len(label) :].strip())


def test_the_table_shows_ours_theirs_and_the_difference(finished_run):
    text = printed(finished_run, figures=False)
    assert "125 mm billet, idealised mould" in text
    assert "finished in 2.8 s on 2 ranks" in text
    row = cells_of(text, "heat removed, 60 mm slice")
    assert row == ["139.2", "kJ", "142.7", "-3.5 (-2.5 %)", "[3]"]
    assert "[3] Pascon 2003, Fig. 99" in text
    row = cells_of(text, "surface, mid-face")
    assert row[2] == "1242.0"
    assert row[3].endswith(" K")
    assert cells_of(text, "solidus") == ["1452.0", "°C"]
    assert cells_of(text, "metallurgical length") == ["-", "m"]
    assert cells_of(text, "enthalpy given off") == ["2.38", "MJ/m"]
    assert "accepted 412, rejected 3" in text
    assert "march 2.54 s" in text
    assert "412 MB" in text


def test_show_draws_every_figure_and_says_where(finished_run):
    text = printed(finished_run)
    for name in FIGURES:
        path = finished_run / "figures" / f"{name}.png"
        assert f"figures in {path.parent}: " in text
        assert path.name in text
        image = matplotlib.image.imread(path)
        assert min(image.shape[:2]) > 400
        assert image[..., :3].std() > 0.02  # something is drawn


def test_an_interrupted_run_shows_its_last_good_state(tmp_path):
    write_run(tmp_path, finish=False)
    text = printed(tmp_path, figures=False)
    assert text.startswith("interrupted on 2 ranks")
    assert cells_of(text, "position") == ["0.6", "m"]
    assert "last checkpoint at t = 3.2 s, 192 mm below the meniscus" in text


def test_a_failed_run_says_why_and_where_to_look(tmp_path):
    write_run(tmp_path, finish=False)
    folder = OutputFolder(tmp_path)
    folder.begin("x = 1\n")
    folder.fail("no convergence at t = 0.1 s")
    folder.close()
    text = printed(tmp_path, figures=False)
    assert "failed on 1 rank: no convergence at t = 0.1 s" in text
    assert "no step has been taken yet" in text
    assert str(tmp_path / "run.log") in text


def test_a_run_at_work_is_called_running(tmp_path):
    folder = OutputFolder(tmp_path)
    folder.begin("x = 1\n")
    assert printed(tmp_path).startswith("running on 1 rank")
    folder.close()


def test_a_folder_without_a_run_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match=r"holds no run of castfem \(no run\.json\)"):
        show(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        show(tmp_path / "nowhere")
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        show(tmp_path)


def test_the_table_is_shown_although_figures_cannot_be_drawn(finished_run, tmp_path):
    run = tmp_path / "copy"
    shutil.copytree(finished_run, run)
    (run / "fields.h5").write_text("damaged")
    text = printed(run)
    assert "139.2" in text
    assert "figures: " in text
    assert "cannot be read" in text


def test_figures_need_no_display_and_no_pyplot(finished_run, tmp_path):
    run = tmp_path / "copy"
    shutil.copytree(finished_run, run)
    shutil.rmtree(run / "figures", ignore_errors=True)
    code = f"""
import os, sys
os.environ.pop("DISPLAY", None)
from castfem.plots.figures import draw_figures
assert len(draw_figures({str(run)!r})) == {len(FIGURES)}
assert "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


def test_absent_columns_probes_and_files_are_left_out(tmp_path):
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
def test_the_whole_section_is_shown_and_its_states_have_the_right_area(
    tmp_path, cell, order, part, copies
):
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
        alone, _ = section_triangles(fields, fields.values("temperature"), mirrored=False)
        assert len(mesh.triangles) == copies * len(alone.triangles)
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


def test_long_strands_are_shown_in_metres_with_their_zones(finished_run):
    table = read_history(finished_run / "history.csv")
    time = table["time"].to_numpy()
    zones = (Zone("mould", 0.0, 0.9), Zone("spray", 0.9, 5.0), Zone("beyond", 30.0, 40.0))
    figure = draw_heat(table, Course(time, 2.0 * time, zones), None)
    assert figure is not None
    assert [a.get_xlabel() for a in figure.axes].count("position below the meniscus [m]") == 1
    texts = {t.get_text() for a in figure.axes[0].child_axes for t in a.texts}
    assert texts == {"mould", "spray"}
    tops = [a for a in figure.axes[0].child_axes if "time" in a.get_xlabel()]
    figure.canvas.draw()
    assert tops[0].get_xlim() == pytest.approx((0.0, time[-1]))


def test_heat_rate_is_taken_from_the_heat_removed_where_it_has_no_column(finished_run):
    table = read_history(finished_run / "history.csv")
    units = table.attrs["units"]
    removed = table.drop(columns=["heat_rate"])
    removed["heat_removed"] = 5e5 * removed["time"]
    removed.attrs["units"] = units
    course = Course(table["time"].to_numpy(), table["position"].to_numpy())
    figure = draw_heat(removed, course, None)
    assert figure is not None
    (panel,) = [a for a in figure.axes if a.get_ylabel() == "heat leaving\nthe strand [kW/m]"]
    assert np.allclose(panel.lines[0].get_ydata(), 500.0)


def test_without_a_position_time_is_the_axis(finished_run):
    table = read_history(finished_run / "history.csv")
    nowhere = Course(table["time"].to_numpy(), np.full(len(table), np.nan))
    figure = draw_steps(table, nowhere, None)
    assert figure is not None
    assert figure.axes[-1].get_xlabel() == "time since the meniscus [s]"


def test_probes_are_found_by_their_columns(finished_run):
    table = read_history(finished_run / "history.csv")
    assert probes_with(table, "shell") == {"mid_face": "shell_mid_face", "corner": "shell_corner"}
    table["shell_empty"] = np.nan
    assert "empty" not in probes_with(table, "shell")


def test_curves_that_would_hide_one_another_are_drawn_once(finished_run):
    table = read_history(finished_run / "history.csv")
    units = table.attrs["units"]
    table["shell_narrow_face"] = table["shell_mid_face"] * (1 + 1e-6)
    table.attrs["units"] = units | {"shell_narrow_face": "mm"}
    found = [(label, column) for label, _, column in curves(table, "shell")]
    both = ("mid-face and narrow face", "shell_mid_face")
    assert found == [both, ("corner", "shell_corner")]
    for name in ("mid_face_extrados", "narrow_face_left"):
        table[f"shell_{name}"] = table["shell_mid_face"]
        labels = [label for label, _, _ in curves(table, "shell")]
        expected = "mid-face, narrow face and mid-face extrados"
        assert labels[0] == (expected if "mid" in name else "mid-face and 3 others")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1241.96, "degC", "1242.0"),
        (4.756, "mm", "4.76"),
        (412.0, "-", "412"),
        (3.14159e-12, "-", "3.142e-12"),
        (float("nan"), "mm", "-"),
        (142.71, "kJ", "142.7"),
        (-3.2e-4, "mm", "0.00"),
        (-0.04, "degC", "0.0"),
        (-0.006, "mm", "-0.01"),
    ],
)
def test_values_are_printed_with_the_digits_that_matter(value, unit, text):
    assert shown(value, unit) == text


def test_faces_of_a_square_have_one_row_and_nothing_has_no_sign(tmp_path):
    write_run(tmp_path, steps=4)
    whole = json.loads((tmp_path / "summary.json").read_text())
    gap = {"value": -1e-9, "unit": "mm", "label": "gap, mid-face"}
    hot = {"value": 1200.0, "unit": "degC", "label": "surface, narrow face"}
    whole["quantities"] |= {"gap_mid_face": gap, "surface_temperature_narrow_face": hot}
    whole["quantities"]["gap_narrow_face"] = gap | {"label": "gap, narrow face"}
    reference = {"quantity": "gap_mid_face", "value": 1e-9, "unit": "mm", "source": "a book"}
    found = {"ours": -1e-9, "difference": -2e-9, "relative": -2.0, "note": ""}
    whole["references"] = [reference | found | {"at": None}]
    (tmp_path / "summary.json").write_text(json.dumps(whole))
    text = printed(tmp_path, figures=False)
    assert cells_of(text, "gap, both faces")[:4] == ["0.00", "mm", "0.00", "+0.00 (-200.0 %)"]
    assert "narrow face" not in text.replace("surface, narrow face", "")
    assert cells_of(text, "surface, narrow face") == ["1200.0", "°C"]  # another than the mid-face


def test_gaps_below_a_hundredth_of_a_millimetre_are_told_in_micrometres(tmp_path):
    write_run(tmp_path, steps=4)
    whole = json.loads((tmp_path / "summary.json").read_text())
    for name, value in (("max", 4.87e-3), ("corner", -6e-3), ("mid_face", 8e-6), ("edge", 0.012)):
        whole["quantities"][f"gap_{name}"] = {"value": value, "unit": "mm", "label": f"gap, {name}"}
    whole["quantities"]["size_edge"] = {"value": 4e-3, "unit": "mm", "label": "size, edge"}
    (tmp_path / "summary.json").write_text(json.dumps(whole))
    text = printed(tmp_path, figures=False)
    assert cells_of(text, "gap, max") == ["4.9", "µm"]
    assert cells_of(text, "gap, corner") == ["-6.0", "µm"]
    assert cells_of(text, "gap, mid_face") == ["0.00", "mm"]
    assert cells_of(text, "gap, edge") == ["0.01", "mm"]
    assert cells_of(text, "size, edge") == ["0.00", "mm"]


def test_bounds_are_met_or_missed_and_notes_stand_with_their_source(tmp_path):
    write_run(tmp_path, steps=4)
    whole = json.loads((tmp_path / "summary.json").read_text())
    ours = {"quantity": "heat_removed_slice", "unit": "kJ", "source": "a book", "at": None}
    ours |= {"ours": 139.2, "difference": None, "relative": None, "met": None, "missing": ""}
    whole["references"] = [
        ours | {"value": 141.3, "kind": "at_least", "note": "a share of 99 %"},
        ours | {"value": 150.0, "kind": "at_most", "note": ""},
    ]
    (tmp_path / "summary.json").write_text(json.dumps(whole))
    text = printed(tmp_path, figures=False)
    first, second = (
        re.split(r"  +", line.strip())[3:]
        for line in text.splitlines()
        if line.startswith("heat removed, 60 mm slice ")
    )
    assert first == ["≥ 141.3", "missed by 2.1 (1.5 %)", "[1]"]
    assert second == ["≤ 150", "met", "[2]"]
    assert "[1] a book: a share of 99 %\n[2] a book\n" in text


def test_on_a_screen_long_lines_go_on_below_their_beginning(strained_run):
    stream = io.StringIO()
    screen = Console(file=stream, width=70, force_terminal=True, color_system=None)
    show(strained_run, screen, figures=False)
    lines = stream.getvalue().splitlines()
    (start,) = [i for i, line in enumerate(lines) if line.startswith("highest contact pressure")]
    assert max(map(len, lines)) <= 70
    assert lines[start].endswith(" at 600 mm, t = 10 s; of the probes")
    assert lines[start + 1].strip() == "corner, 0.12"
    assert lines[start + 1].startswith(" " * 11)


def test_summary_of_a_run_is_what_show_prints(finished_run):
    content = json.loads((finished_run / "summary.json").read_text())
    text = printed(finished_run, figures=False)
    for quantity in content["quantities"].values():
        assert quantity["label"] in text
    for reference in content["references"]:
        assert reference["source"] in text
