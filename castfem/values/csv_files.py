"""CSV files whose header names each column and its unit: `temperature [degC], value [MPa]`.

Blank lines and those that begin with # are passed over, columns are parted by commas or, if the
header is, by semicolons or tabs; a cell in quotes may hold any. Between semicolons or tabs a number
may have a decimal comma, "3,6" or "3,6 m/min", and is handed on with a point.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

DECIMAL_COMMAS = "numbers with decimal commas need semicolons between the columns"
_DECIMAL_COMMA = re.compile(r"([+-]?\d*),(\d+(?:[eE][+-]?\d+)?)(?=\s|$)")


class UnreadableError(ValueError):
    """A file cannot be read; the text says why, without its name."""


@dataclass(frozen=True, slots=True)
class Heading:
    """Head of a column.

    Attributes:
        text: As it stands in the file.
        name: Without the unit.
        unit: Empty where none is given.
    """

    text: str
    name: str
    unit: str

    @classmethod
    def of(cls, cell: str) -> Heading:
        """Return the head in a cell, `name [unit]`."""
        name, _, rest = cell.partition("[")
        return cls(cell, name.strip(), rest.rpartition("]")[0].strip())


@dataclass(frozen=True, slots=True)
class Row:
    """A row under the header.

    Attributes:
        line: Its number in the file, from 1.
        cells: Texts without the blanks around them.
    """

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CsvFile:
    """What stands in a file.

    Attributes:
        headings: Of the columns; none in a file that is empty.
        line: Number of the header's line.
        first: That line as it stands in the file.
        rows: Under the header.
        separator: Between the cells.
    """

    headings: tuple[Heading, ...]
    line: int
    first: str
    rows: tuple[Row, ...]
    separator: str


def read_csv(path: Path) -> CsvFile:
    """Read a CSV file; whether its columns are those that are needed is for the caller to tell.

    Raises:
        UnreadableError: There is no such file, or it is no text.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise UnreadableError(error.strerror or str(error)) from None
    except UnicodeDecodeError:
        raise UnreadableError("not a text in UTF-8; save it as that (CSV UTF-8)") from None
    kept = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not kept:
        return CsvFile((), 1, "", (), ",")
    first = kept[0][1].strip()
    separator = next((one for one in ";\t" if one in first), ",")
    texts = (line for _, line in kept)
    reader = csv.reader(texts, delimiter=separator, skipinitialspace=True)
    rows, begun = [], 0
    for cells in reader:  # one in quotes may go over several lines
        stripped = (cell.strip() for cell in cells)
        rows.append(Row(kept[begun][0], tuple(_pointed(t, separator) for t in stripped)))
        begun = reader.line_num
    head, *body = rows
    headings = tuple(Heading.of(cell) for cell in head.cells)
    return CsvFile(headings, head.line, first, tuple(body), separator)


def _pointed(cell: str, separator: str) -> str:
    """A cell whose number has a point for its decimal comma."""
    found = _DECIMAL_COMMA.match(cell) if separator != "," else None
    return cell if found is None else f"{found[1]}.{found[2]}{cell[found.end() :]}"
