"""Lines and tables on a console: paths stay whole, long lines are wrapped for a screen alone."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_LEAST, _INDENT = 42, 11  # characters to leave behind a start; else the next lines begin here


def print_line(out: Console, text: str, style: str = "") -> None:
    """A line that is neither wrapped nor coloured by its content: paths stay whole."""
    out.print(text, style=style or None, highlight=False, soft_wrap=True, markup=False)


def wrapped(out: Console, text: str, start: str) -> list[str]:
    """A text behind its start, its further lines below; in one line unless it is for a screen."""
    if not out.is_terminal:
        return [start + text]
    indent = len(start) if out.width - len(start) >= _LEAST else _INDENT
    lines = textwrap.wrap(
        text,
        out.width,
        initial_indent=start,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines or [start]


def print_list(out: Console, start: str, entries: Sequence[str]) -> None:
    """Entries with commas between them, none of them torn by the end of a line."""
    glued = ", ".join(entry.replace(" ", "\N{NO-BREAK SPACE}") for entry in entries)
    for line in wrapped(out, glued, start):
        print_line(out, line.replace("\N{NO-BREAK SPACE}", " "))


def empty_table(title: str, *columns: str) -> Table:
    """An empty table; the first and the last column are words, the others numbers."""
    from rich import box
    from rich.table import Table

    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for number, name in enumerate(columns):
        words = number == 0 or name in ("unit", "")
        table.add_column(name, justify="left" if words else "right", no_wrap=number > 0)
    return table
