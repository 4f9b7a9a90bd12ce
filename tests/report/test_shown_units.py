"""Units of the plant, SI or one's own: tables, figures and report follow, files do not."""

from __future__ import annotations

import io
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from synthetic_run import write_run

from castfem.base.result_registry import declared, usual_unit
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
from castfem.post.compare.places import places
from castfem.post.html.page import write
from castfem.post.plots.chosen_units import in_chosen_units
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.style import new_figure
from castfem.post.report.show import show
from castfem.runs.output.summary import Summary

OWN = ShownUnits.read({"temperature": "degF", "length": "inch", "shell": "cm", "shell_corner": "m"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("units") / "one", steps=20)


def printed(folder: Path) -> str:
    stream = io.StringIO()
    show(folder, Console(file=stream, width=110), figures=False)
    return stream.getvalue()


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


def test_the_name_goes_before_what_it_measures_and_the_longer_before_the_shorter() -> None:
    with shown_in(OWN):
        assert scale_of("mm", "shell_mid_face")(10.0) == pytest.approx(1.0)
        assert scale_of("mm", "shell_corner")(10.0) == pytest.approx(0.01)
        assert scale_of("mm", "gap_corner")(25.4) == pytest.approx(1.0)
        assert scale_of("degC")(100.0) == pytest.approx(212.0)
        difference = scale_of("K")
        assert difference(10.0) == pytest.approx(18.0)  # no offset
        assert plain_unit(difference.unit) == "°F"
        assert scale_of("MPa").unit == "MPa"
        with shown_in(ShownUnits("si")):  # who was asked first has chosen
            assert said(100.0, "degC", ".1f") == "212 °F"
    assert said(100.0, "degC", ".1f") == "100.0 °C"


def test_every_quantity_has_a_si_unit_and_a_name_that_may_be_chosen() -> None:
    for definition in declared():
        unit = definition.shown or definition.unit
        assert documented(plain_unit(unit)) == unit
        if coherent(unit) == "1":
            continue
        assert usual_unit(definition.name) == unit
        with shown_in(ShownUnits("si")):
            assert scale_of(unit, definition.name).unit == coherent(unit)


def test_the_table_of_a_run(folder: Path) -> None:
    plant = printed(folder)
    with shown_in(ShownUnits("si")):
        si = printed(folder)
    with shown_in(OWN):
        own = printed(folder)
    mid_face = Summary.load(folder).quantities["shell_mid_face"].value
    assert row(plant, "shell, mid-face")[:2] == [f"{1e3 * mid_face:.2f}", "mm"]
    assert float(row(si, "shell, mid-face")[0]) == pytest.approx(mid_face, rel=1e-3)
    assert row(si, "shell, mid-face")[1] == "m"
    assert float(row(own, "shell, mid-face")[0]) == pytest.approx(1e2 * mid_face, rel=1e-3)
    assert row(own, "solidus") == ["2645.6", "°F"]
    # a difference of temperatures has no zero to lose
    kelvin, fahrenheit = (row(text, "surface, mid-face")[3] for text in (plant, own))
    assert float(fahrenheit.split()[0]) == pytest.approx(1.8 * float(kelvin.split()[0]), abs=0.1)
    assert fahrenheit.endswith("°F")


def test_the_case_of_a_run_chooses_and_the_command_line_goes_before(folder: Path, tmp_path, capsys):
    run = shutil.copytree(folder, tmp_path / "run")
    (run / "case.toml").write_text('[output]\nunits = "si"\n', encoding="utf-8")
    before = {name: (run / name).read_bytes() for name in ("history.csv", "summary.json")}
    assert row(printed(run), "solidus") == ["1725.2", "K"]
    assert execute(["show", str(run), "--units", "temperature=degF"]) == 0
    assert row(capsys.readouterr().out, "solidus") == ["2645.6", "°F"]
    assert before == {name: (run / name).read_bytes() for name in before}


def test_figures_are_drawn_alike_and_numbered_otherwise() -> None:
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
    """Also those that have no label of their own."""
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


def test_report_and_figures_of_a_run(folder: Path, tmp_path: Path) -> None:
    run = shutil.copytree(folder, tmp_path / "run")
    with shown_in(OWN):
        text = write([run], tmp_path / "report.html").read_text(encoding="utf-8")
        assert draw_figures(run)
    assert "temperature [°F]" in text
    assert "position below the meniscus [inch]" in text
    assert "°C" not in re.sub(r"<details>.*?</details>", "", text, flags=re.DOTALL)
