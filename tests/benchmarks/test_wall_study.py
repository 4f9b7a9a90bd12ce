"""What holds a strand in its mould: springs carry next to nothing where held points carry a lot."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from benchmarks import wall_study
from benchmarks.report import Output

pytestmark = pytest.mark.slow


def test_springs_carry_less_than_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wall_study, "SPRINGS", (None, 1e-7))
    wall_study.springs(Output(tmp_path), quick=True)
    with (tmp_path / "data" / "springs.csv").open(encoding="utf-8") as file:
        held, sprung = csv.DictReader(file)
    assert held["points"] == "held"
    assert float(held["carried"]) > 0.1 * float(held["wall"])
    assert float(sprung["carried"]) < 1e-5 * float(sprung["wall"])
    assert float(sprung["drift"]) < 1e-3  # um: the same place but for what springs give way
    wall_study.show_springs(Output(tmp_path))
    assert "| 1e-07 E |" in (tmp_path / "mechanics.md").read_text(encoding="utf-8")
