"""Tables of finished studies, which are text in their pages and are compared with their data.

A comment over such a table names its file of docs/data:

    <!-- data windows.csv -->
    | mould | window [s] | heat [%] |
    |:--|--:|--:|
    | +1 %/m | 0.25 | +0.01 |

Each row of the table is one of the file, in the same order. The words, or else the numbers, of each
column of the table are those of one column of the file, rounded to the digits that the table
shows; a cell with several numbers has a column for each. Words of the first column may differ from
the file, as may words without a number in any column. `<!-- data FILE.csv rows 1 3 -->` selects
rows of the file; in `<!-- data FILE.csv transposed -->` its rows are the columns of the table.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from typing import Any

from benchmarks.report import Output

_TABLE = re.compile(
    r"<!-- data (\w+)\.csv(?: rows ([\d ]+?))?( transposed)? -->\n\|(.*)\n\|.*\n((?:\|.*\n)+)"
)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class KeptTable:
    """A table of a page, transposed if necessary so that its rows are those of a file."""

    line: int  #: line of the page, from 1
    name: str  #: name of its file in docs/data, without ending
    chosen: tuple[int, ...]  #: selected rows of the file, from 1; () for all
    headings: tuple[str, ...]  #: headings of the columns
    columns: tuple[tuple[str, ...], ...]  #: cells of each column

    def wrong(self, folder: Path) -> list[str]:
        """Return a message for each column that is not in the file.

        Args:
            folder: A folder with the layout of docs/.
        """
        rows = Output(folder).rows(self.name)
        if self.chosen:
            rows = [rows[number - 1] for number in self.chosen if number <= len(rows)]
        if not rows or len(rows) != len(self.columns[0]):
            return [f"{len(self.columns[0])} rows, {self.name}.csv has {len(rows)}"]
        errors = [column_error(cells, rows) for cells in self.columns]
        named = list(zip(self.headings, errors, strict=True))
        if not any(map(_is_number, self.columns[0])):
            del named[0]  # names of the rows
        return [f"{head}: {error} in {self.name}.csv" for head, error in named if error]


def kept_tables(text: str) -> list[KeptTable]:
    """Return the tables of a page that are compared with a file."""
    found = []
    for match in _TABLE.finditer(text):
        name, chosen, transposed, head, body = match.groups()
        lines = [_cells(line) for line in (f"|{head}", *body.splitlines())]
        columns: Sequence[tuple[str, ...]] = list(zip(*lines, strict=True))
        if transposed:
            columns = lines
        line = text.count("\n", 0, match.start()) + 1
        numbers = tuple(int(word) for word in (chosen or "").split())
        headings = tuple(column[0] for column in columns)
        rest = tuple(column[1:] for column in columns)
        found.append(KeptTable(line, name, numbers, headings, rest))
    return found


def column_error(cells: Sequence[str], rows: Sequence[Row]) -> str:
    """Return a message on numbers of a column that are not in the file; "" without any."""
    if any(all(map(_same, cells, (row[key] for row in rows))) for key in rows[0]):
        return ""
    for numbers in zip_longest(*(_NUMBER.findall(cell) for cell in cells)):
        present = [line for line in zip(numbers, cells, rows, strict=True) if line[0]]
        missing = [
            [n for n, cell, row in present if not (_same(cell, row[key]) or rounds(row[key], n))]
            for key in rows[0]
        ]
        if least := min(missing, key=len):
            return f"no column has {', '.join(least)}"
    return ""


def rounds(value: Any, text: str) -> bool:
    """Whether a number of the file, rounded to the digits of a table, is the number there."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        return False
    shown = Decimal(text)
    exponent = shown.as_tuple().exponent
    assert isinstance(exponent, int)
    half = Decimal("0.5000001").scaleb(exponent)
    return abs(Decimal(str(value)) - shown) <= half


def _same(cell: str, value: Any) -> bool:
    """Whether a cell has the words of the file, or both are empty."""
    return cell.strip("*`") == ("" if value is None else value)


def _is_number(cell: str) -> bool:
    """Whether a cell is only a number."""
    return _NUMBER.fullmatch(cell) is not None


def _cells(line: str) -> tuple[str, ...]:
    """Return the cells of a line of a table."""
    return tuple(cell.strip() for cell in line.strip().strip("|").split("|"))
