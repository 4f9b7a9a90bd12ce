"""Tables as data: headings, rows and notes, for the screen, HTML and CSV.

    say(console, Table(("roll", "position [m]"), [("1", "0.930"), ("2", "1.205")]))

The page of `castfem report` shows the same data with its macro `table`.
"""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from castfem.base.atomic_files import write_text

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

_GAP = "  "  # between columns
_WHOLE = "\N{NO-BREAK SPACE}"  # in texts that must stay on one line
FAILED = "failed"
"""Mark of a row: a failed run."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells below headings."""

    heads: Sequence[str]  #: headings with their unit in brackets; empty for rows without headings
    rows: Sequence[Sequence[str]]  #: printed cells; they may have several lines
    title: str = ""  #: above the table
    #: indices of text columns, aligned left; numbers are aligned right
    words: Sequence[int] = (0,)
    #: number of leading columns repeated in each block when a wide table is split; 0: not split
    repeated: int = 0
    notes: Sequence[str] = ()  #: lines below it
    #: marks of a row (row, -1) or a cell (row, column)
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)

    @property
    def columns(self) -> list[list[str]]:
        """The cells of each column below its heading."""
        rows = [self.heads, *self.rows] if self.heads else self.rows
        return [list(column) for column in zip(*rows, strict=True)]

    @property
    def numbers(self) -> set[int]:
        """Indices of the columns of numbers."""
        count = len(self.heads or (self.rows or ((),))[0])
        return set(range(count)) - {i % count for i in self.words}

    def lines(self, width: int | None = None) -> list[str]:
        """The lines of text, of natural width or limited to a number of characters.

        In a narrow table cells continue in the next line; words are not divided.
        """
        return [text for text, _ in self.styled(width)]

    def styled(self, width: int | None = None) -> Iterator[tuple[str, str]]:
        """Yield each line and its style; see `lines`."""
        if self.title:
            yield self.title, "bold"
        if self.heads:
            yield from self._below_headings(width)
        else:
            yield from ((line, "") for line in self._behind_labels(width))
        for note in self.notes:
            lines = [note] if width is None else _wrapped(note, width, "", "")
            yield from ((line, "") for line in lines)

    def _below_headings(self, width: int | None) -> Iterator[tuple[str, str]]:
        columns = self.columns
        for block in self._blocks(columns, width):
            widths = _widths([columns[i] for i in block], width)
            yield from ((line, "") for line in self._row(self.heads, block, widths))
            yield "─" * (sum(widths) + len(_GAP) * (len(widths) - 1)), ""
            for number, row in enumerate(self.rows):
                style = "red" if self.marks.get((number, -1)) == FAILED else ""
                yield from ((line, style) for line in self._row(row, block, widths))
            if block[-1] < len(columns) - 1:
                yield "", ""

    def _behind_labels(self, width: int | None) -> Iterator[str]:
        """Rows without headings: the last cell continues in further, indented lines."""
        *columns, _ = self.columns
        block = range(len(columns))
        for row in self.rows:
            (start,) = self._row(row, block, [*map(_widest, columns)], padded=True)
            if width is None:
                yield (start + row[-1]).rstrip().replace(_WHOLE, " ")
                continue
            # Further lines are indented to the label's width if that leaves 42 characters.
            indent = " " * (len(start) if width - len(start) >= 42 else 11)
            for line in _wrapped(row[-1], width, start, indent):
                yield line.replace(_WHOLE, " ")

    def csv(self) -> str:
        """The table as comma-separated values."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.heads, *self.rows])
        return text.getvalue()

    def write_csv(self, path: Path) -> Path:
        """Write the table as comma-separated values."""
        write_text(path, self.csv(), durable=False)
        return path

    def _blocks(self, columns: Sequence[Sequence[str]], width: int | None) -> list[list[int]]:
        """Indices of the columns of each block: few blocks of about equal width."""
        every = list(range(len(columns)))
        if width is None or not self.repeated:
            return [every]
        first, rest = every[: self.repeated], every[self.repeated :]
        wide = [_widest(column) + len(_GAP) for column in columns]
        for each in range(len(rest), 0, -1):
            count = -(-len(rest) // each)
            even = -(-len(rest) // count)
            blocks = [[*first, *rest[i : i + even]] for i in range(0, len(rest), even)]
            if all(sum(wide[i] for i in block) - len(_GAP) <= width for block in blocks):
                return blocks
        return [[*first, i] for i in rest] or [every]

    def _row(
        self, row: Sequence[str], block: Sequence[int], widths: Sequence[int], padded: bool = False
    ) -> list[str]:
        """The lines of a row; with padding before the next column."""
        numbers = self.numbers
        cells = [
            [part for line in row[i].split("\n") for part in _wrapped(line, width, "", "")]
            for i, width in zip(block, widths, strict=True)
        ]
        found = []
        for number in range(max(map(len, cells))):
            texts = (cell[number] if number < len(cell) else "" for cell in cells)
            parts = [
                text.rjust(width) if i in numbers else text.ljust(width)
                for text, i, width in zip(texts, block, widths, strict=True)
            ]
            line = _GAP.join([*parts, ""] if padded else parts)
            found.append((line if padded else line.rstrip()).replace(_WHOLE, " "))
        return found


def pairs(rows: Sequence[tuple[str, str]], title: str = "") -> Table:
    """A table without headings, of labels and texts."""
    return Table((), rows, title, words=(0, 1))


def listed(label: str, entries: Sequence[str]) -> Table:
    """Entries after a label, separated by commas; no entry is divided between lines."""
    return pairs([(label, ", ".join(entry.replace(" ", _WHOLE) for entry in entries))])


def say(out: Console, *parts: Table | str, style: str = "") -> None:
    """Print tables and lines; lines are not wrapped, since paths must stay whole.

    Tables fit the screen. Rows printed to a file or another program are not wrapped; a table that
    can be split into blocks has the width of the console there, too.
    """
    for part in parts:
        if isinstance(part, str):
            lines = [(part, style)]
        else:
            wraps = out.is_terminal or part.repeated
            lines = list(part.styled(out.width if wraps else None)) if part.rows else []
        for line, look in lines:
            out.print(line, style=look or None, highlight=False, soft_wrap=True, markup=False)


def _widest(column: Sequence[str]) -> int:
    return max(len(line) for cell in column for line in cell.split("\n"))


def _widths(columns: Sequence[Sequence[str]], width: int | None) -> list[int]:
    """Widths of columns within a total width; at least those of their longest words."""
    wishes = [_widest(column) for column in columns]
    if width is None or sum(wishes) + len(_GAP) * (len(columns) - 1) <= width:
        return wishes
    found = [max(len(word) for cell in c for word in f"{cell} ".split(" ")) for c in columns]
    spare = max(width - len(_GAP) * (len(columns) - 1) - sum(found), 0)
    for i in sorted(range(len(columns)), key=lambda i: wishes[i] - found[i]):
        more = min(wishes[i] - found[i], spare)
        found[i] += more
        spare -= more
    return found


def _wrapped(text: str, width: int, start: str, indent: str) -> list[str]:
    """The lines of a text after its start, broken between words; further ones are indented."""
    if len(start) + len(text) <= width:
        return [start + text]
    indent += text[: len(text) - len(text.lstrip(" "))]
    lines = textwrap.wrap(
        text, max(width, 1), initial_indent=start, subsequent_indent=indent, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return lines or [start]
