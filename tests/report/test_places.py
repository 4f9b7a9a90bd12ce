"""Results at places of the strand: `--at`, the table along it, sweeps of many keys."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from synthetic_run import summary, write_run

from castfem.api import Result
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.post.compare.runs import read_runs
from castfem.post.compare.study_tables import sweep_table
from castfem.post.compare.table import lines
from castfem.post.report.show import show
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.places import quantities_at, read_positions
from castfem.studies.sweep.record import Row

WIDTH = 80


def text_of(folder: Path, **options: object) -> str:
    stream = io.StringIO()
    show(folder, Console(file=stream, width=WIDTH), figures=False, **options)  # type: ignore[arg-type]
    return stream.getvalue()


def test_positions_are_read_with_their_unit() -> None:
    assert read_positions(["800 mm", "1.2 m"]) == [pytest.approx(0.8), pytest.approx(1.2)]
    with pytest.raises(InputError) as caught:
        read_positions(["800", "soon"])
    assert [text.partition(":")[0] for text in caught.value.problems] == ["--at 800", "--at soon"]
    assert "; a length is needed, such as" in caught.value.problems[1]


def test_between_two_rows_by_straight_lines(finished_run: Path) -> None:
    table = read_history(finished_run / "history.csv")
    at = 0.3137
    found = quantities_at(table, at, finished_run)
    expected = np.interp(at, table["position"], table["shell_mid_face"])
    assert found["shell_mid_face"].value == pytest.approx(1e-3 * expected)
    assert found["surface_temperature_mid_face"].unit == "K"
    row = table.iloc[7]
    exact = quantities_at(table, float(row["position"]), finished_run)
    assert exact["heat_removed"].value == pytest.approx(row["heat_removed"], rel=1e-12)


def test_an_error_of_the_end_stands_where_the_end_is_asked_for(finished_run: Path) -> None:
    """A mould that ends with the run has no place of its own on the way."""
    found = summary()
    end = 0.6
    position = Quantity(end, "m", "position")
    shell = replace(found.quantities["shell_mid_face"], error=2e-4)
    found = replace(found, quantities={"position": position, "shell_mid_face": shell})
    assert found.errors_near(end) == {"shell_mid_face": 2e-4}
    assert found.errors_near(0.5 * end) == {}
    at = quantities_at(read_history(finished_run / "history.csv"), end, finished_run, found)
    assert at["shell_mid_face"].error == 2e-4


def test_python_asks_for_a_place(finished_run: Path) -> None:
    result = Result(finished_run)
    assert result.at("300 mm") == result.at(0.3)
    assert result.at("300 mm")["position"] == pytest.approx(0.3)
    with pytest.raises(InputError, match=r"700 mm is not between 0 mm and 600 mm"):
        result.at("700 mm")
    with pytest.raises(InputError, match=r"20 m is not between 0 mm and 600 mm"):
        result.at("20 m")


def test_show_prints_the_places_that_are_asked_for(finished_run: Path) -> None:
    text = text_of(finished_run, at=[0.2, 0.4])
    assert "200 mm" in text and "400 mm" in text and "Balance" not in text
    assert max(map(len, text.splitlines())) <= WIDTH
    (row,) = [line for line in text.splitlines() if line.startswith("shell, mid-face")]
    cells = row.split()[-2:]
    found = [Result(finished_run).at(p)["shell_mid_face"] for p in (0.2, 0.4)]
    assert [float(cell) for cell in cells] == pytest.approx([1e3 * v for v in found], abs=0.006)


def zoned(tmp_path: Path) -> Path:
    """A run that passes the end of its mould and of a zone."""
    write_run(tmp_path)
    folder = OutputFolder(tmp_path)
    summary = Summary.load(tmp_path)
    assert summary is not None
    ends = ((0.0, 0.2, "mould"), (0.2, 0.45, "foot spray"), (0.45, 0.6, "spray"))
    zones = [{"name": n, "start": a, "end": b, "whole": b < 0.6} for a, b, n in ends]
    content = summary.to_json() | {"zones": zones, "mould_exit": 0.2}
    folder.write_summary(Summary.from_json(content))
    return tmp_path


def test_a_table_along_the_strand(tmp_path: Path) -> None:
    text = text_of(zoned(tmp_path))
    table = text[text.index("Along the strand") : text.index("What to look at")]
    head = table.splitlines()[1:5]
    words = " ".join(" ".join(head).split())
    for name in ("mould", "exit", "foot", "spray", "end", "200 mm", "450 mm", "600 mm"):
        assert name in words
    assert "surface, mid-face" in table and "heat removed per m" in table
    assert max(map(len, table.splitlines())) <= WIDTH


def test_no_table_without_places_on_the_way(finished_run: Path) -> None:
    assert "Along the strand" not in text_of(finished_run)


def test_compare_at_a_place(finished_run: Path, tmp_path: Path) -> None:
    write_run(tmp_path / "other")
    runs = read_runs([finished_run, tmp_path / "other"])
    table = lines(runs, runs[0], at=[0.3])
    assert table and all(line.label.endswith(", at 300 mm") for line in table)
    shell = next(line for line in table if line.label.startswith("shell, mid-face"))
    expected = Result(finished_run).at(0.3)["shell_mid_face"]
    assert shell.ours == pytest.approx([1e3 * expected] * 2)


def many_keys(count: int) -> list[Row]:
    names = [f"casting.quite_a_long_key_{i}" for i in range(count)]
    found = {
        "shell_mid_face": Quantity(0.00475, "mm", "shell, mid-face"),
        "shell_corner": Quantity(0.0099, "mm", "shell, corner"),
        "surface_temperature_mid_face": Quantity(1515.15, "degC", "surface, mid-face"),
        "surface_temperature_corner": Quantity(1315.15, "degC", "surface, corner"),
        "heat_removed": Quantity(2.38e6, "MJ/m", "heat removed per m"),
    }
    return [
        Row(f"run{j}", {n: f"{i + j} mm" for i, n in enumerate(names)}, "finished", found, 1.0, "")
        for j in range(2)
    ]


@pytest.mark.parametrize("keys", [2, 6])
def test_a_sweep_of_many_keys_shows_its_results(keys: int) -> None:
    text = "\n".join(sweep_table(many_keys(keys), WIDTH).lines(WIDTH))
    for number in ("4.75", "9.90", "1242.0", "1042.0"):
        assert text.count(number) == 2
    assert max(map(len, text.splitlines())) <= WIDTH
    if keys == 6:
        assert all(f"quite_a_long_key_{i} {i + 1} mm" in text for i in range(6))
