"""CSV files whose header names each column and its unit: `temperature [degC], value [MPa]`.

Blank lines, rows without a filled cell and lines that begin with # are passed over, and so are
empty columns at the right. Columns are separated by commas or, if the header is, by semicolons or
tabs; a first line `sep=;`, as Excel writes it, names another separator. A cell in quotes may hold
any.

Between semicolons or tabs a number may have a decimal comma, "3,6" or "3,6 m/min", and is handed on
with a point. Whether the comma or the point is the decimal mark is decided once for the file;
thousands separators are refused.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

DECIMAL_COMMAS = "numbers with decimal commas need semicolons between the columns"
_NUMBER = re.compile(r"[+-]?(?=[.,]?\d)([\d.,]+)(?:[eE][+-]?\d+)?(?=\s|$)")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}(?=\s|$)")  # or three decimals
_EXCEL = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)
_NO_UNIT = "-"  # what castfem writes for a number without unit


class UnreadableError(ValueError):
    """A file cannot be read; the text says why, without its name."""


@dataclass(frozen=True, slots=True)
class Heading:
    """Head of a column."""

    text: str  #: as it stands in the file
    name: str  #: without the unit
    unit: str  #: empty where none is given, or "-"

    @classmethod
    def of(cls, cell: str) -> Heading:
        """Return the head in a cell, `name [unit]`."""
        name, _, rest = cell.partition("[")
        unit = rest.rpartition("]")[0].strip()
        return cls(cell, name.strip(), "" if unit == _NO_UNIT else unit)


@dataclass(frozen=True, slots=True)
class Row:
    """A row under the header."""

    line: int  #: its number in the file, from 1
    cells: tuple[str, ...]  #: texts without the blanks around them


@dataclass(frozen=True, slots=True)
class CsvFile:
    """What stands in a file."""

    headings: tuple[Heading, ...]  #: of the columns; none in a file that is empty
    line: int  #: number of the header's line
    first: str  #: that line as it stands in the file
    rows: tuple[Row, ...]  #: under the header
    separator: str  #: between the cells


def read_csv(path: Path) -> CsvFile:
    """Read a CSV file; whether its columns are those that are needed is for the caller to tell.

    Raises:
        UnreadableError: There is no such file, it is no text, or what its numbers mean is not
            certain.
    """
    try:
        if path.is_fifo():  # it would be waited for, and can be read only once
            raise UnreadableError("is a pipe, not a file; write it to a file first")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise UnreadableError(error.strerror or str(error)) from None
    except UnicodeDecodeError:
        raise UnreadableError("is not UTF-8 text; save it in that encoding (CSV UTF-8)") from None
    return parse_csv(lines)


def parse_csv(lines: Sequence[str]) -> CsvFile:
    """Return what stands in the lines of a CSV file; see `read_csv`.

    Raises:
        UnreadableError: What its numbers mean is not certain.
    """
    kept = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    named = _EXCEL.fullmatch(kept[0][1]) if kept else None
    if named:
        del kept[0]
    if not kept:
        return CsvFile((), 1, "", (), ",")
    first = kept[0][1].strip()
    separator = named[1] if named else next((one for one in ";\t" if one in first), ",")
    head, *body = _rows(kept, separator)
    if separator != ",":
        body = _with_points(body, separator)
    headings = tuple(Heading.of(cell) for cell in head.cells)
    return CsvFile(headings, head.line, first, tuple(body), separator)


def with_unit(cell: str, unit: str) -> str:
    """Return a number of a file with the unit of its column; anything else as it is."""
    try:
        float(cell)
    except ValueError:
        return cell
    return f"{cell} {unit}".strip()


def _rows(kept: list[tuple[int, str]], separator: str) -> list[Row]:
    """The header and the rows that have a filled cell, without the empty columns at the right."""
    reader = csv.reader((line for _, line in kept), delimiter=separator, skipinitialspace=True)
    rows: list[Row] = []
    begun = width = 0
    try:
        for cells in reader:  # one in quotes may go over several lines
            stripped = [cell.strip() for cell in cells]
            while len(stripped) > width and not stripped[-1]:
                stripped.pop()
            if any(stripped) or not rows:
                width = width or len(stripped)
                rows.append(Row(kept[begun][0], tuple(stripped)))
            begun = reader.line_num
    except csv.Error as error:  # a cell that is longer than csv takes
        fix = "is a quotation mark missing that ends a cell?"
        raise UnreadableError(f"line {kept[begun][0]}: {error}; {fix}") from None
    return rows


def _with_points(rows: list[Row], separator: str) -> list[Row]:
    """The rows, the numbers in them with a decimal point."""
    seen: dict[str, list[tuple[Row, str]]] = {",": [], ".": []}
    for row in rows:
        for cell in row.cells:
            found = _NUMBER.match(cell)
            marks = re.sub(r"\d", "", found[1]) if found else ""
            if len(marks) == 1:
                seen[marks].append((row, cell))
            elif "," in marks:
                raise UnreadableError(
                    f'line {row.line}: "{cell}" has thousands separators; write it without'
                )
    commas, points = seen[","], seen["."]
    if commas and points:
        (row, cell), (other, its) = commas[0], points[0]
        raise UnreadableError(
            f'line {row.line}: "{cell}" has a comma, "{its}" in line {other.line} a point; write '
            "all numbers with the same decimal mark and without thousands separators"
        )
    # A point stands for thousands only where the comma is the decimal mark, as semicolons suggest.
    doubtful = commas or (points if separator == ";" else [])
    if doubtful and all(_THOUSANDS.match(cell) for _, cell in doubtful):
        row, cell = doubtful[0]
        whole, mark, decimals = re.split("([.,])", cell.split()[0])
        raise UnreadableError(
            f'line {row.line}: "{cell}" can be {whole}{decimals} or {whole}.{decimals}, and no '
            f"number of the file tells which; write {whole}{decimals}, or "
            f"{whole}{mark}{decimals}0 with four decimals"
        )
    return [Row(row.line, tuple(_pointed(cell) for cell in row.cells)) for row in rows]


def _pointed(cell: str) -> str:
    """A cell whose number has a point for its decimal comma."""
    found = _NUMBER.match(cell)
    return cell if found is None else found[0].replace(",", ".") + cell[found.end() :]
