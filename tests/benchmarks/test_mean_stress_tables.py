"""The tables on the mean stress: what they say of rules and terms, in their shortest form."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from benchmarks import mean_stress
from benchmarks.report import Output


def read(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "data" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_tables_of_the_mean_stress(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    square = {"square": mean_stress.MESHES["square"]}
    monkeypatch.setattr(mean_stress, "MESHES", square)
    mean_stress.main(Output(tmp_path, "mechanics.md"), quick=True)
    for row in read(tmp_path, "locking"):
        if row["cell"] == "quadrilateral":
            assert abs(float(row["two"])) < 0.5
            assert abs(float(row["one"])) > 50.0
    linear, four = read(tmp_path, "inf_sup")
    assert (linear["unfelt"], four["unfelt"]) == ("1", "2")
    assert float(linear["n4"]) > 0.95 * float(linear["n2"])
    assert float(four["n4"]) < 0.7 * float(four["n2"])
    for linear, four in zip(*[iter(read(tmp_path, "mean_stress"))] * 2, strict=True):
        assert float(linear["punch"]) < 0.5 * float(four["punch"])
    page = (tmp_path / "mechanics.md").read_text(encoding="utf-8")
    assert "| square | 1, x, y | 1 | 0.45 | 0.45 |" in page
