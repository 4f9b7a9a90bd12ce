"""Tables: no word is cut on a narrow screen; blocks side by side; the same data as CSV."""

from __future__ import annotations

import csv
import io

import pytest
from rich.console import Console

from castfem.base.table import FAILED, Table, listed, pairs, say

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


def test_words_stand_to_the_left_and_numbers_to_the_right() -> None:
    rows = [("1", "-0.9", "a"), ("12", "-12.0", "b")]
    heads, rule, *found = Table(("roll", "height [m]", ""), rows, words=(2,)).lines()
    assert heads == "roll  height [m]" and set(rule) == {"─"}
    assert found == ["   1        -0.9  a", "  12       -12.0  b"]


def test_a_wide_table_is_split_into_blocks_of_equal_width() -> None:
    runs = [f"run {i}" for i in range(5)]
    table = Table(("quantity", *runs), [("shell", *map(str, range(5)))], repeated=1)
    lines = table.lines(32)
    heads = [line for line in lines if line.startswith("quantity")]
    assert heads == ["quantity  run 0  run 1  run 2", "quantity  run 3  run 4"]
    assert max(map(len, lines)) <= 32
    assert len([line for line in table.lines(12) if line.startswith("quantity")]) == 5
    assert len(table.lines(200)) == len(table.lines()) == 3


def test_entries_of_a_list_are_not_parted() -> None:
    stream = io.StringIO()
    screen = Console(file=stream, width=30, force_terminal=True, color_system=None)
    say(screen, listed("steps:", ["accepted 412", "rejected 3"]), pairs([("a", "long " * 12)]))
    lines = stream.getvalue().splitlines()
    assert lines[:2] == ["steps:  accepted 412,", " " * 11 + "rejected 3"]
    assert max(map(len, lines)) <= 30


def test_rows_stay_whole_in_a_file() -> None:
    stream = io.StringIO()
    say(Console(file=stream, width=40), Table(HEADS, ROWS))
    assert len(stream.getvalue().splitlines()) == 4


def test_csv_holds_the_cells_and_a_failed_row_is_red() -> None:
    table = Table(("run", "shell [mm]"), [("a, b", "4.75"), ("c", "")], marks={(1, -1): FAILED})
    assert list(csv.reader(table.csv().splitlines())) == [list(table.heads), *map(list, table.rows)]
    assert [style for _, style in table.styled()] == ["", "", "", "red"]
