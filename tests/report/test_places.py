"""Results at places of the strand, and in the displayed units."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import printed, summary, write_run

from castfem.api import Result
from castfem.base.errors import InputError
from castfem.base.result_registry import declared, usual_unit
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import (
    ShownUnits,
    coherent,
    documented,
    plain_unit,
    said,
    scale_of,
    shown_in,
)
from castfem.cli import execute
from castfem.post.compare.runs import read_runs
from castfem.post.compare.sections import places
from castfem.post.compare.table import lines
from castfem.post.html.page import write
from castfem.post.plots.chosen_units import in_chosen_units
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.style import new_figure
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.labels import quantities_at, read_positions

WIDTH = 80


def test_positions_are_read_with_their_unit() -> None:
    assert read_positions(["800 mm", "1.2 m"]) == [pytest.approx(0.8), pytest.approx(1.2)]
    with pytest.raises(InputError) as caught:
        read_positions(["800", "soon"])
    assert [text.partition(":")[0] for text in caught.value.problems] == ["--at 800", "--at soon"]
    assert "; a length is needed, such as" in caught.value.problems[1]


def test_rows_are_interpolated_linearly(finished_run: Path) -> None:
    table = read_history(finished_run / "history.csv")
    at = 0.3137
    found = quantities_at(table, at, finished_run)
    expected = np.interp(at, table["position"], table["shell_mid_face"])
    assert found["shell_mid_face"].value == pytest.approx(1e-3 * expected)
    assert found["surface_temperature_mid_face"].unit == "K"
    row = table.iloc[7]
    exact = quantities_at(table, float(row["position"]), finished_run)
    assert exact["heat_removed"].value == pytest.approx(row["heat_removed"], rel=1e-12)


def test_error_at_the_end_applies_at_the_end(finished_run: Path) -> None:
    """A mould that ends with the run has no place of its own."""
    found = summary()
    end = 0.6
    position = Quantity(end, "m", "position")
    shell = replace(found.quantities["shell_mid_face"], error=2e-4)
    found = replace(found, quantities={"position": position, "shell_mid_face": shell})
    assert found.errors_near(end) == {"shell_mid_face": 2e-4}
    assert found.errors_near(0.5 * end) == {}
    at = quantities_at(read_history(finished_run / "history.csv"), end, finished_run, found)
    assert at["shell_mid_face"].error == 2e-4


def test_python_evaluates_a_place(finished_run: Path) -> None:
    result = Result(finished_run)
    assert result.at("300 mm") == result.at(0.3)
    assert result.at("300 mm")["position"] == pytest.approx(0.3)
    with pytest.raises(InputError, match=r"700 mm is not between 0 mm and 600 mm"):
        result.at("700 mm")
    with pytest.raises(InputError, match=r"20 m is not between 0 mm and 600 mm"):
        result.at("20 m")


def test_show_prints_requested_places(finished_run: Path) -> None:
    text = printed(finished_run, WIDTH, figures=False, at=[0.2, 0.4])
    assert "200 mm" in text and "400 mm" in text and "Balance" not in text
    assert max(map(len, text.splitlines())) <= WIDTH
    (row,) = [line for line in text.splitlines() if line.startswith("shell, mid-face")]
    cells = row.split()[-2:]
    found = [Result(finished_run).at(p)["shell_mid_face"] for p in (0.2, 0.4)]
    assert [float(cell) for cell in cells] == pytest.approx([1e3 * v for v in found], abs=0.006)


def zoned(tmp_path: Path) -> Path:
    """Write a run that passes the end of its mould and of a zone."""
    write_run(tmp_path)
    folder = OutputFolder(tmp_path)
    summary = Summary.load(tmp_path)
    ends = ((0.0, 0.2, "mould"), (0.2, 0.45, "foot spray"), (0.45, 0.6, "spray"))
    zones = [{"name": n, "start": a, "end": b, "whole": b < 0.6} for a, b, n in ends]
    content = summary.to_json() | {"zones": zones, "mould_exit": 0.2}
    folder.write_summary(Summary.from_json(content))
    return tmp_path


def test_table_along_the_strand(tmp_path: Path) -> None:
    text = printed(zoned(tmp_path), WIDTH, figures=False)
    table = text[text.index("Along the strand") : text.index("Remarks")]
    head = table.splitlines()[1:5]
    words = " ".join(" ".join(head).split())
    for name in ("mould", "exit", "foot", "spray", "end", "200 mm", "450 mm", "600 mm"):
        assert name in words
    assert "surface, mid-face" in table and "heat removed per m" in table
    assert max(map(len, table.splitlines())) <= WIDTH


def test_no_table_without_places(finished_run: Path) -> None:
    assert "Along the strand" not in printed(finished_run, WIDTH, figures=False)


def test_compare_at_a_place(finished_run: Path, tmp_path: Path) -> None:
    write_run(tmp_path / "other")
    runs = read_runs([finished_run, tmp_path / "other"])
    table = lines(runs, runs[0], at=[0.3])
    assert table and all(line.label.endswith(", at 300 mm") for line in table)
    shell = next(line for line in table if line.label.startswith("shell, mid-face"))
    expected = Result(finished_run).at(0.3)["shell_mid_face"]
    assert shell.ours == pytest.approx([1e3 * expected] * 2)


# Units of the plant, SI or chosen ones: tables, figures and report follow, files do not


OWN = ShownUnits.read({"temperature": "degF", "length": "inch", "shell": "cm", "shell_corner": "m"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("units") / "one", steps=20)


def row(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(label + " ")]
    return re.split(r"  +", line[len(label) :].strip())


@pytest.mark.parametrize(
    ("usual", "value", "si", "unit"),
    [
        ("degC", 1242.0, 1515.15, "K"), ("K", 10.0, 10.0, "K"), ("mK", 10.0, 0.01, "K"),
        ("mm", 4.75, 4.75e-3, "m"), ("kN", 2.0, 2e3, "N"), ("kN/m", 2.0, 2e3, "N/m"),
        ("kN m", 2.0, 2e3, "N m"), ("MJ/m", 2.0, 2e6, "J/m"), ("kJ", 2.0, 2e3, "J"),
        ("MPa", 3.0, 3e6, "Pa"), ("kW/m^2", 2.0, 2e3, "W/m^2"), ("percent", 80.0, 80.0, "percent"),
        ("-", 0.5, 0.5, "-"), ("m/min", 3.6, 0.06, "m/s"), ("L/min", 60.0, 1e-3, "m^3/s"),
    ],
)  # fmt: skip
def test_si(usual: str, value: float, si: float, unit: str) -> None:
    with shown_in(ShownUnits("si")):
        scale = scale_of(usual)
    assert (scale(value), scale.unit) == (pytest.approx(si, rel=1e-14), unit)
    assert scale.back(scale(value)) == pytest.approx(value, rel=1e-14)


def test_name_precedes_dimension_and_long_precedes_short() -> None:
    with shown_in(OWN):
        assert scale_of("mm", "shell_mid_face")(10.0) == pytest.approx(1.0)
        assert scale_of("mm", "shell_corner")(10.0) == pytest.approx(0.01)
        assert scale_of("mm", "gap_corner")(25.4) == pytest.approx(1.0)
        assert scale_of("degC")(100.0) == pytest.approx(212.0)
        difference = scale_of("K")
        assert difference(10.0) == pytest.approx(18.0)  # no offset
        assert plain_unit(difference.unit) == "°F"
        assert scale_of("MPa").unit == "MPa"
        with shown_in(ShownUnits("si")):  # the outer choice is kept
            assert said(100.0, "degC", ".1f") == "212 °F"
    assert said(100.0, "degC", ".1f") == "100.0 °C"


def test_every_quantity_has_a_si_unit_and_a_name() -> None:
    for definition in declared():
        unit = definition.shown or definition.unit
        assert documented(plain_unit(unit)) == unit
        if coherent(unit) == "1":
            continue
        assert usual_unit(definition.name) == unit
        with shown_in(ShownUnits("si")):
            assert scale_of(unit, definition.name).unit == coherent(unit)


def test_table_of_a_run(folder: Path) -> None:
    plant = printed(folder, figures=False)
    with shown_in(ShownUnits("si")):
        si = printed(folder, figures=False)
    with shown_in(OWN):
        own = printed(folder, figures=False)
    mid_face = Summary.load(folder).quantities["shell_mid_face"].value
    assert row(plant, "shell, mid-face")[:2] == [f"{1e3 * mid_face:.2f}", "mm"]
    assert float(row(si, "shell, mid-face")[0]) == pytest.approx(mid_face, rel=1e-3)
    assert row(si, "shell, mid-face")[1] == "m"
    assert float(row(own, "shell, mid-face")[0]) == pytest.approx(1e2 * mid_face, rel=1e-3)
    assert row(own, "solidus") == ["2645.6", "°F"]
    # a temperature difference has no zero offset
    kelvin, fahrenheit = (row(text, "surface, mid-face")[3] for text in (plant, own))
    assert float(fahrenheit.split()[0]) == pytest.approx(1.8 * float(kelvin.split()[0]), abs=0.1)
    assert fahrenheit.endswith("°F")


def test_command_line_precedes_the_units_of_the_case(folder: Path, tmp_path, capsys):
    run = shutil.copytree(folder, tmp_path / "run")
    (run / "case.toml").write_text('[output]\nunits = "si"\n', encoding="utf-8")
    before = {name: (run / name).read_bytes() for name in ("history.csv", "summary.json")}
    assert row(printed(run, figures=False), "solidus") == ["1725.2", "K"]
    assert execute(["show", str(run), "--units", "temperature=degF"]) == 0
    assert row(capsys.readouterr().out, "solidus") == ["2645.6", "°F"]
    assert before == {name: (run / name).read_bytes() for name in before}


def test_figures_keep_their_limits_in_other_units() -> None:
    figure = new_figure(4.0, 3.0)
    axes = figure.subplots()
    axes.plot([0.0, 600.0], [0.0, 25.4])
    axes.set_xlabel("position [mm]", gid="position")
    axes.set_ylabel("gap\n[mm]", gid="gap_corner")
    limits = axes.get_xlim(), axes.get_ylim()
    with shown_in(OWN):
        in_chosen_units(figure)
        in_chosen_units(figure)
    assert (axes.get_xlim(), axes.get_ylim()) == limits
    assert axes.get_ylabel() == "gap\n[inch]"
    figure.canvas.draw()
    ticks = np.array(axes.get_yticks())
    texts = [float(t.get_text().replace("\N{MINUS SIGN}", "-")) for t in axes.get_yticklabels()]
    assert ticks / 25.4 == pytest.approx(texts, abs=1e-9)
    assert np.diff(texts) == pytest.approx(np.round(np.diff(texts), 2))  # round inches


def test_sections_side_by_side_have_one_unit() -> None:
    """Also those without an own label."""
    square = np.array([[0.0, 0.0], [62.5, 62.5]])
    figure, axes = places([square] * 6, "sections", bar=False)
    with shown_in(OWN):
        in_chosen_units(figure)
    figure.canvas.draw()
    for one in axes:
        for axis in (one.xaxis, one.yaxis):
            texts = [
                float(t.get_text().replace("\N{MINUS SIGN}", "-")) for t in axis.get_ticklabels()
            ]
            assert np.array(axis.get_ticklocs()) / 25.4 == pytest.approx(texts, abs=1e-9)
    assert [bool(one.yaxis.label.get_visible()) for one in axes] == [True, False, False] * 2


def test_report_and_figures_have_chosen_units(folder: Path, tmp_path: Path) -> None:
    run = shutil.copytree(folder, tmp_path / "run")
    with shown_in(OWN):
        text = write([run], tmp_path / "report.html").read_text(encoding="utf-8")
        assert draw_figures(run)
    assert "temperature [°F]" in text
    assert "position below the meniscus [inch]" in text
    assert "°C" not in re.sub(r"<details>.*?</details>", "", text, flags=re.DOTALL)
