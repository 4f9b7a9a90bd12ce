"""Where benchmarks put their results: markers of a page, tables, CSV files."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from benchmarks.report import PAGE, Output, front, table

TEXT = """# Page

<!-- begin one -->
old
<!-- end one -->

between

<!-- begin one more -->
<!-- end one more -->
"""


@pytest.fixture
def output(tmp_path: Path) -> Output:
    (tmp_path / "page.md").write_text(TEXT, encoding="utf-8")
    return Output(tmp_path, "page.md")


def test_text_stands_between_its_markers_and_nowhere_else(output: Output) -> None:
    output.insert("one", "| a \\1 |\n\n")
    page = output.page.read_text(encoding="utf-8")
    assert page == TEXT.replace("old\n", "| a \\1 |\n")
    output.insert("one", "| a \\1 |")
    assert output.page.read_text(encoding="utf-8") == page, "the second time changes nothing"
    output.insert("one more", "new")
    assert output.page.read_text(encoding="utf-8") == page.replace(
        "<!-- end one more", "new\n<!-- end one more"
    )


def test_unknown_marker_is_an_error_and_leaves_the_page(output: Output) -> None:
    with pytest.raises(KeyError, match=r"page\.md has no place for 'two'"):
        output.insert("two", "text")
    assert output.page.read_text(encoding="utf-8") == TEXT


def test_page_is_copied_to_another_folder(tmp_path: Path) -> None:
    original = PAGE.read_text(encoding="utf-8")
    output = Output(tmp_path / "new")
    output.insert("shares", "short")
    assert "<!-- begin shares -->\nshort\n<!-- end shares -->" in output.page.read_text("utf-8")
    assert PAGE.read_text(encoding="utf-8") == original


@pytest.mark.parametrize("page", ["benchmarks.md", "benchmarks_mechanics.md", "billet.md"])
def test_markers_of_the_pages_are_pairs_and_filled(page: str) -> None:
    text = PAGE.with_name(page).read_text(encoding="utf-8")
    begun, ended = (re.findall(rf"<!-- {word} (.+?) -->", text) for word in ("begin", "end"))
    assert begun == ended
    assert len(begun) == len(set(begun)) > 3
    assert not re.search(r"<!-- begin (.+?) -->\s*<!-- end", text)


def test_table_and_csv(output: Output) -> None:
    rows = [{"what": "a", "x": 1.23456789, "y": None}, {"what": "b", "x": 20.0, "y": 3}]
    assert table(rows, {"what": "", "x": "x [m]", "y": "y"}, {"x": ".2f"}).splitlines() == [
        "|  | x [m] | y |",
        "|:--|--:|--:|",
        "| a | 1.23 |  |",
        "| b | 20.00 | 3 |",
    ]
    output.csv("rows", rows)
    with (output.folder / "data" / "rows.csv").open(encoding="utf-8") as file:
        assert list(csv.DictReader(file)) == [
            {"what": "a", "x": "1.23456789", "y": ""},
            {"what": "b", "x": "20", "y": "3"},
        ]
    assert output.rows("rows") == [
        {"what": "a", "x": 1.23456789, "y": None},
        {"what": "b", "x": 20, "y": 3},
    ]
    odd = [{"what": "1e-4", "flag": True, "x": 1e-9, "y": float("inf")}]
    output.csv("odd", odd)
    assert output.rows("odd") == odd, "what somebody called 1e-4 is a word"
    assert output.rows("none") == []


def test_front_keeps_what_no_other_run_beats() -> None:
    rows = [{"seconds": s, "e": e} for s, e in ((3, 1.0), (1, 5.0), (2, 7.0), (4, 1.0), (5, 0.5))]
    assert front(rows, "e") == ([1, 3, 5], [5.0, 1.0, 0.5])
