"""`castfem sensitivity`: table, files and figure."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from rich.console import Console
from small_case import write_small

from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import ShownUnits, shown_in
from castfem.base.table import say
from castfem.cli.app import app
from castfem.cli.sensitivity import head_of, remarks, table_of
from castfem.post.plots.chosen_units import in_chosen_units
from castfem.post.plots.studies import draw_tornado
from castfem.studies.sensitivity.parameters import Parameter
from castfem.studies.sensitivity.result import Derivative, Sensitivity, ShownRow


def test_table_files_and_figure(tmp_path: Path) -> None:
    target = tmp_path / "out"
    words = [
        "sensitivity", str(write_small(tmp_path)), "-o", str(target),
        "--of", "heat_removed,shell_mid_face", "--to", "casting.speed=0.1 m/min,cooling.mould.wall",
    ]  # fmt: skip
    done = CliRunner().invoke(app, words, env={"COLUMNS": "120"})
    assert done.exit_code == 0, done.output
    assert "60 mm below the meniscus" in done.output
    line = next(x for x in done.output.splitlines() if "by casting.speed, 3.6 m/min" in x)
    assert "MJ/m/(m/min)" in line
    content = json.loads((target / "sensitivity.json").read_text())
    speed, wall = content["derivatives"][:2]
    assert (
        f"{speed['value']:.4g} (error unknown) MJ" in line and f"{speed['elasticity']:+.3f}" in line
    )
    assert speed["value"] < 0.0 and wall["elasticity"] is None  # degrees Celsius have no per cent
    assert content["parameters"]["casting.speed"] == {"value": 3.6, "unit": "m/min", "spread": 0.1}
    picture = matplotlib.image.imread(target / "sensitivity.png")
    assert picture.shape[0] > 200 and picture.std() > 0.01
    missing = [n for n in ("shell_mid_face",) if content["derivatives"][2]["value"] is None]
    assert bool(missing) == ("the front has passed too few cells" in done.output)


@pytest.mark.parametrize("words", [[], ["--to", "casting.nothing"]])
def test_invalid_input_is_reported_in_a_line(tmp_path: Path, words: list[str]) -> None:
    done = CliRunner().invoke(app, ["sensitivity", str(write_small(tmp_path)), *words])
    assert done.exit_code != 0


FOUND = Sensitivity(
    "a case",
    0.06,
    {
        "surface_temperature_mid_face": Quantity(1500.0, "degC", "surface, mid-face"),
        "shell_mid_face": Quantity(5e-3, "mm", "shell, mid-face"),
    },
    (
        Parameter("casting.speed", "casting.speed", 3.6, "m/min", 0.1, step=1e-5),
        Parameter("cooling.mould.wall", "cooling.0.wall", 160.0, "degC", 10.0, step=1e-3),
        Parameter("steel.conductivity", "", 100.0, "percent", 1.0, steel="conductivity", step=1e-3),
    ),
    tuple(
        Derivative(name, by, slope, slope)
        for name, slope in (("surface_temperature_mid_face", 9.0), ("shell_mid_face", 2.54e-3))
        for by in ("casting.speed", "cooling.mould.wall", "steel.conductivity")
    ),
    1,
)


def test_chosen_units_are_used() -> None:
    def rows() -> list[tuple[float, str, float, str, float]]:
        shown = [ShownRow.of(row) for row in FOUND.rows()]
        return [(r.at, r.at_unit, r.value, r.unit, r.spread) for r in shown]

    def close(got: tuple[float, str, float, str, float], wanted: tuple[object, ...]) -> bool:
        return all(
            one == other if isinstance(other, str) else one == pytest.approx(other, rel=1e-12)
            for one, other in zip(got, wanted, strict=True)
        )

    usual = rows()
    assert usual[0] == (3.6, "m/min", 9.0, "K/(m/min)", 0.1)
    assert close(usual[4], (160.0, "degC", 2.54, "mm/K", 10.0))
    with shown_in(ShownUnits.read("si")):
        si = rows()
        assert "0.06 m below" in head_of(FOUND)
    assert close(si[0], (0.06, "m/s", 540.0, "K/(m/s)", 0.1 / 60.0))
    assert close(si[1], (433.15, "K", 9.0, "K/K", 10.0))
    assert close(si[3], (0.06, "m/s", 0.1524, "m/(m/s)", 0.1 / 60.0))
    with shown_in(ShownUnits.read({"temperature": "degF", "shell": "inch"})):
        own = rows()
        out = io.StringIO()
        say(Console(file=out, width=120), table_of(FOUND))
    assert close(own[1], (320.0, "degF", 9.0, "degF/degF", 18.0))
    assert close(own[4], (320.0, "degF", 0.1 / 1.8, "inch/degF", 18.0))
    assert close(own[5], (100.0, "percent", 0.1, "inch/percent", 1.0))
    # 1500 K are 2240.3 °F
    assert (
        "surface, mid-face: 2240.3" in out.getvalue()
        and "0.05556 (error unknown) inch/" in out.getvalue()
    )


def test_freezing_slice_is_reported_to_change_in_steps() -> None:
    assert not any("cell by cell" in line for line in remarks(FOUND))
    taper = Parameter("mould.taper", "mould.taper", 1.0, "%/m", 0.1, step=1e-4)
    strength = Parameter("law.strength", "", 100.0, "percent", 1.0, law="strength", step=1e-3)
    mould = replace(FOUND, parameters=(taper, strength), derivatives=(), strained=True)
    assert remarks(mould) == []
    both = replace(mould, parameters=(taper, *FOUND.parameters, strength))
    (line,) = remarks(both)
    assert line.startswith("by casting.speed, cooling.mould.wall, steel.conductivity: the shell")


def test_windows_cut_for_their_error_are_reported() -> None:
    """If compared runs cut others, their results jump, which no derivative shows."""
    assert not any("were cut" in line for line in remarks(FOUND))
    (line,) = (one for one in remarks(replace(FOUND, windows=23, cut=3)) if "were cut" in one)
    assert line.startswith("coupling windows were cut for their error 3 times on the way to 23")


@pytest.mark.parametrize(
    ("slope", "message"),
    [(0.0, "depends on none of them"), (math.nan, "no derivative of it is known")],
)
def test_result_without_bars_has_no_axes(
    tmp_path: Path, monkeypatch: Any, slope: float, message: str
) -> None:
    kept: list[Figure] = []
    monkeypatch.setattr("castfem.post.plots.studies.save", lambda figure, path: kept.append(figure))
    none = [Derivative("shell_mid_face", one.name, slope, slope) for one in FOUND.parameters]
    some = (one for one in FOUND.derivatives if one.quantity != "shell_mid_face")
    draw_tornado(replace(FOUND, derivatives=(*some, *none)), tmp_path / "none.png")
    surface, shell = kept[0].axes
    assert surface.axison and not surface.texts
    assert not shell.axison and not shell.patches
    assert shell.texts[0].get_text() == f"shell, mid-face\n{message}"


def test_units_of_the_case_and_of_the_command(tmp_path: Path) -> None:
    write_small(tmp_path)
    words = ["sensitivity", str(tmp_path / "case.toml"), "--to", "casting.superheat"]
    done = CliRunner().invoke(app, [*words, "--units", "shell=degC"])
    assert done.exit_code == 1 and "--units shell" in str(done.exception)


def test_accuracy_is_that_of_the_run(tmp_path: Path) -> None:
    """As in the other commands; the cells of the run are coarser."""
    path = write_small(tmp_path)
    words = ["sensitivity", str(path), "--of", "heat_removed", "--to", "casting.speed"]
    words += ["--set", "length=3 mm", "--no-figures"]
    heat = {}
    for word in ("default", "coarse"):
        target = tmp_path / word
        done = CliRunner().invoke(app, [*words, "-o", str(target), "--accuracy", word])
        assert done.exit_code == 0, done.output
        content = json.loads((target / "sensitivity.json").read_text())
        heat[word] = content["quantities"]["heat_removed"]["value"]
    assert heat["coarse"] != heat["default"] == pytest.approx(heat["coarse"], rel=0.2)


def test_figure_has_the_chosen_units(tmp_path: Path, monkeypatch: Any) -> None:
    kept: list[Figure] = []

    def keep(figure: Figure, path: Path) -> None:
        in_chosen_units(figure)
        kept.append(figure)

    monkeypatch.setattr("castfem.post.plots.studies.save", keep)
    with shown_in(ShownUnits.read({"temperature": "degF", "shell": "inch"})):
        draw_tornado(FOUND, tmp_path / "none.png")
    surface, shell = kept[0].axes[:2]
    assert surface.get_ylim() == (-0.6, 2.6)
    assert surface.get_xlabel() == "change of surface, mid-face [°F]"
    assert shell.get_xlabel() == "change of shell, mid-face [inch]"
    assert {text.get_text() for text in surface.get_yticklabels()} == {
        "casting.speed \N{PLUS-MINUS SIGN}0.1 m/min",
        "cooling.mould.wall \N{PLUS-MINUS SIGN}18 °F",
        "steel.conductivity \N{PLUS-MINUS SIGN}1 %",
    }
