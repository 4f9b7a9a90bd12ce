"""`castfem show`: the table, and messages about runs that did not end well."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil

import matplotlib.image
import pytest
from rich.console import Console
from synthetic_run import printed, write_run

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.table import FAILED, Table, listed, pairs, say
from castfem.post.report.show import show
from castfem.post.report.tables import result_rows
from castfem.runs.output.folder import FIGURES, OutputFolder
from castfem.runs.output.summary_file import Comparison, Reference, Summary
from castfem.runs.results.headline import headline
from castfem.runs.results.numbers import shown, with_error


def cells_of(text: str, label: str) -> list[str]:
    """Return the cells of the table row that begins with a label."""
    (line,) = [line for line in text.splitlines() if line.startswith(label + " ")]
    return re.split(r"  +", line[len(label) :].strip())


def test_table_has_our_value_reference_and_difference(finished_run):
    text = printed(finished_run, figures=False)
    assert "125 mm billet, idealised mould" in text
    assert "finished in 2.8 s on 2 ranks" in text
    row = cells_of(text, "heat removed, 60 mm slice")
    assert row == ["139.2", "kJ", "142.7", "-3.5 (-2.5 %)", "[3]"]
    assert "[3]  Pascon 2003, Fig. 99" in text
    row = cells_of(text, "surface, mid-face")
    assert row[2] == "1242.0"
    assert row[3].endswith(" K")
    assert cells_of(text, "solidus") == ["1452.0", "°C"]
    assert cells_of(text, "metallurgical length") == ["-", "m"]
    assert cells_of(text, "enthalpy given off") == ["2.38", "MJ/m"]
    assert "accepted 412, rejected 3" in text
    assert "time loop 2.54 s" in text
    assert "412 MB" in text


def test_show_draws_every_figure_and_prints_its_path(finished_run):
    text = printed(finished_run)
    for name in FIGURES:
        path = finished_run / "figures" / f"{name}.png"
        assert f"figures in {path.parent}: " in text
        assert path.name in text
        image = matplotlib.image.imread(path)
        assert min(image.shape[:2]) > 400
        assert image[..., :3].std() > 0.02  # the figure is not empty


def test_interrupted_run_shows_its_last_good_state(tmp_path):
    write_run(tmp_path, finish=False)
    text = printed(tmp_path, figures=False)
    assert "killed or aborted" in text.splitlines()[0]
    assert cells_of(text, "position") == ["0.6", "m"]
    assert "last checkpoint at t = 3.2 s, 192 mm below the meniscus" in text


def test_missing_history_is_reported(finished_run, tmp_path):
    folder = shutil.copytree(finished_run, tmp_path / "run")
    assert "history.csv is missing" not in printed(folder, figures=False)
    (folder / "history.csv").unlink()
    assert "history.csv is missing" in printed(folder, figures=False)


def test_failed_run_is_shown_with_its_reason(tmp_path):
    write_run(tmp_path, finish=False)
    folder = OutputFolder(tmp_path)
    folder.begin("x = 1\n")
    folder.fail("no convergence at t = 0.1 s")
    folder.close()
    text = printed(tmp_path, figures=False)
    assert "failed on 1 rank: no convergence at t = 0.1 s" in text
    assert "no step has been taken yet" in text
    assert str(tmp_path / "run.log") in text


def test_active_run_is_called_running(tmp_path):
    folder = OutputFolder(tmp_path)
    folder.begin("x = 1\n")
    assert printed(tmp_path).startswith("running on 1 rank")
    folder.close()


def test_folder_without_a_run_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match=r"holds no run of castfem \(no run\.json\)"):
        show(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        show(tmp_path / "nowhere")
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        show(tmp_path)


def test_table_is_shown_without_figures(castfem, finished_run, tmp_path):
    run = tmp_path / "copy"
    shutil.copytree(finished_run, run)
    (run / "fields.h5").write_text("damaged")
    text = printed(run)
    assert "139.2" in text
    assert "figures: " in text
    assert "cannot be read" in text
    assert castfem("show", finished_run).status == 0
    assert castfem("show", run).status == 1


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1241.96, "degC", "1242.0"),
        (4.756, "mm", "4.76"),
        (3.14159e-12, "-", "3.142e-12"),
        (float("nan"), "mm", "-"),
        (16803.4, "kW", "16803"),
        (-3.2e-4, "mm", "0.00"),
        (-0.04, "degC", "0.0"),
        (-0.006, "mm", "-0.01"),
        (3.7409e-4, "1/s", "37.41e-5"),
        (0.0, "1/s", "0"),
    ],
)
def test_values_have_their_significant_digits(value, unit, text):
    assert shown(value, unit) == text


def test_small_rates_share_their_exponent():
    assert with_error(shown(1.742e-4, "1/s"), 2.1e-6) == "17.42e-5 \N{PLUS-MINUS SIGN} 0.21e-5"
    assert with_error("3.142e-12", 1e-13) == "3.142e-12 \N{PLUS-MINUS SIGN} 1e-13"
    reference = Reference("straightening_I2_max", 22e-5, "1/s", "thesis")
    quantities = {"straightening_I2_max": Quantity(1.615e-4, "1/s", "largest I2")}
    found = (Comparison(reference, 1.615e-4),)
    rows = result_rows(Summary("x", "finished", quantities, found), {})
    assert [row[1:5] for row in rows] == [("16.15e-5", "1/s", "22e-5", "-5.85e-5 (-26.6 %)")]


def test_faces_of_a_square_have_one_row(tmp_path):
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
    assert cells_of(text, "gap, mid-face")[:4] == ["0.00", "mm", "0.00", "+0.00 (-200.0 %)"]
    assert "narrow face" not in text.replace("surface, narrow face", "")
    assert cells_of(text, "surface, narrow face") == ["1200.0", "°C"]  # another than the mid-face


def test_small_gaps_are_shown_in_micrometres(tmp_path):
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


def test_bounds_are_met_or_missed_with_their_notes(tmp_path):
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
    assert "[1]  a book: a share of 99 %\n[2]  a book\n" in text


def test_summary_of_a_run_is_what_show_prints(finished_run):
    content = json.loads((finished_run / "summary.json").read_text())
    text = printed(finished_run, figures=False)
    for quantity in content["quantities"].values():
        assert quantity["label"] in text
    for reference in content["references"]:
        assert reference["source"] in text


NAMES = ("narrow_face", "mid_face_intrados", "corner_intrados", "mid_face_extrados",
         "corner_extrados")  # fmt: skip


def slab(**values: float) -> dict[str, Quantity]:
    """Return results of half a slab, whose shell is 20 mm at all places without a value."""
    return {
        f"{kind}_{name}": Quantity(1e-3 * values.get(name, 20.0 + i), "mm", f"{kind}, {name}")
        for kind in ("shell", "surface_temperature")
        for i, name in enumerate(NAMES)
    }


def shells(names: list[str]) -> list[str]:
    return [name.removeprefix("shell_") for name in names if name.startswith("shell_")]


def test_equally_cooled_faces_are_one() -> None:
    alike = slab(mid_face_extrados=21.0, corner_extrados=22.0)
    assert shells(headline([alike])) == ["mid_face_intrados", "narrow_face", "corner_intrados"]
    assert "mid_face_extrados" in shells(headline([alike, slab()]))


def test_all_places_of_a_full_section_are_shown() -> None:
    parts = [f"corner_{side}_{half}" for side in ("intrados", "extrados") for half in
             ("right", "left")]  # fmt: skip
    names = ["mid_face_intrados", "mid_face_extrados", "narrow_face_right", "narrow_face_left"]
    whole = {
        f"shell_{name}": Quantity(1e-3 * i, "mm", name)
        for i, name in enumerate((*names, *parts), 1)
    }
    assert shells(headline([whole])) == [*names, *parts]
    same = {name: Quantity(0.02, "mm", name) for name in whole}
    assert shells(headline([same])) == ["mid_face_intrados", "narrow_face_right",
                                        "corner_intrados_right"]  # fmt: skip


# Tables: no word is cut on a narrow screen; blocks next to each other; the same data as CSV


HEADS = ("at the optimum", "value", "noise", "numerical error", "left", "")
ROWS = [
    ("von_mises_max [MPa]", "31.32", "0.00057", "0.72", "", "objective"),
    (
        "heat_removed >= 98 % of idealised [MJ/m]", "17.69", "1.4e-05", "0.091",
        "8.9e-05 \N{PLUS-MINUS SIGN} 0.096", "binds",
    ),
]  # fmt: skip
WORDS = ("von_mises_max", "objective", "heat_removed", "idealised", "numerical", "8.9e-05")


@pytest.mark.parametrize("width", [64, 72, 80, 100, 140])
def test_no_word_is_cut(width: int) -> None:
    lines = Table(HEADS, ROWS).lines(width)
    assert max(map(len, lines)) <= width
    assert set(WORDS) <= set(" ".join(lines).split()), lines
    if width == 140:
        assert len(lines) == 4


def test_wide_table_is_split_into_blocks_of_equal_width() -> None:
    runs = [f"run {i}" for i in range(5)]
    table = Table(("quantity", *runs), [("shell", *map(str, range(5)))], repeated=1)
    lines = table.lines(32)
    heads = [line for line in lines if line.startswith("quantity")]
    assert heads == ["quantity  run 0  run 1  run 2", "quantity  run 3  run 4"]
    assert max(map(len, lines)) <= 32
    assert len([line for line in table.lines(12) if line.startswith("quantity")]) == 5
    assert len(table.lines(200)) == len(table.lines()) == 3


def test_entries_of_a_list_are_not_split() -> None:
    stream = io.StringIO()
    screen = Console(file=stream, width=30, force_terminal=True, color_system=None)
    say(screen, listed("steps:", ["accepted 412", "rejected 3"]), pairs([("a", "long " * 12)]))
    lines = stream.getvalue().splitlines()
    assert lines[:2] == ["steps:  accepted 412,", " " * 11 + "rejected 3"]
    assert max(map(len, lines)) <= 30


def test_rows_are_not_split_in_a_file() -> None:
    stream = io.StringIO()
    say(Console(file=stream, width=40), Table(HEADS, ROWS))
    assert len(stream.getvalue().splitlines()) == 4


def test_csv_has_the_cells_and_a_failed_row_is_red() -> None:
    table = Table(("run", "shell [mm]"), [("a, b", "4.75"), ("c", "")], marks={(1, -1): FAILED})
    assert list(csv.reader(table.csv().splitlines())) == [list(table.heads), *map(list, table.rows)]
    assert [style for _, style in table.styled()] == ["", "", "", "red"]
