"""Tables on narrow screens: no word is cut where there is room for each."""

from __future__ import annotations

import io

import pytest
from rich import box
from rich.console import Console
from rich.table import Table

from castfem.post.report.table_layout import keep_words


def printed(width: int) -> list[str]:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    for i, head in enumerate(("at the optimum", "value", "noise", "numerical error", "left", "")):
        table.add_column(head, justify="left" if i == 0 else "right", overflow="fold")
    table.add_row("von_mises_max [MPa]", "31.32", "0.00057", "0.72", "", "objective")
    name = "heat_removed >= 98 % of idealised [MJ/m]"
    table.add_row(name, "17.69", "1.4e-05", "0.091", "8.9e-05 \N{PLUS-MINUS SIGN} 0.096", "binds")
    stream = io.StringIO()
    console = Console(file=stream, width=width)
    keep_words(table, console.width)
    console.print(table)
    return stream.getvalue().splitlines()


@pytest.mark.parametrize("width", [64, 72, 80, 100, 140])
def test_no_word_is_cut(width: int) -> None:
    lines = printed(width)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    for word in ("von_mises_max", "objective", "heat_removed", "idealised", "numerical", "8.9e-05"):
        assert word in words, lines
    if width == 140:
        assert len(lines) == 4


def test_where_words_have_no_room_the_table_is_as_it_was() -> None:
    assert max(map(len, printed(30))) <= 30
