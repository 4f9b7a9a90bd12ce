"""`castfem sensitivity`: table, files and figure."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib.image
import pytest
from small_case import write_small
from typer.testing import CliRunner

from castfem.cli.app import app


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
    assert f"{speed['value']:.4g} MJ" in line and f"{speed['elasticity']:+.3f}" in line
    assert speed["value"] < 0.0 and wall["elasticity"] is None  # degrees Celsius have no per cent
    assert content["parameters"]["casting.speed"] == {"value": 3.6, "unit": "m/min", "spread": 0.1}
    picture = matplotlib.image.imread(target / "sensitivity.png")
    assert picture.shape[0] > 200 and picture.std() > 0.01
    missing = [n for n in ("shell_mid_face",) if content["derivatives"][2]["value"] is None]
    assert bool(missing) == ("the front has passed too few cells" in done.output)


@pytest.mark.parametrize("words", [[], ["--to", "casting.nothing"]])
def test_bad_input_is_answered_in_a_line(tmp_path: Path, words: list[str]) -> None:
    done = CliRunner().invoke(app, ["sensitivity", str(write_small(tmp_path)), *words])
    assert done.exit_code != 0
