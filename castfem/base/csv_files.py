"""CSV files whose header names each column and its unit: `temperature [degC], value [MPa]`.

Blank lines, rows without a filled cell, lines that begin with # and empty columns at the right are
skipped. Columns are separated by commas or, if the header is, by semicolons or tabs; a first line
`sep=;`, as written by Excel, names another separator. A quoted cell may contain any of these.

Between semicolons or tabs a number may have a decimal comma, "3,6" or "3,6 m/min"; it is returned
with a point. The decimal mark is determined once per file; thousands separators are refused.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from castfem.base.units import nearest

DECIMAL_COMMAS = "numbers with decimal commas need semicolons between the columns"
_NUMBER = re.compile(r"[+-]?(?=[.,]?\d)([\d.,]+)(?:[eE][+-]?\d+)?(?=\s|$)")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}(?=\s|$)")  # or three decimals
_EXCEL = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)
_NO_UNIT = "-"  # castfem's unit of a dimensionless number


class UnreadableError(ValueError):
    """A file cannot be read; the text gives the reason without the file name."""


@dataclass(frozen=True, slots=True)
class Heading:
    """Header of a column."""

    text: str  #: heading as in the file
    name: str  #: name without the unit
    unit: str  #: empty if none is given, or "-"

    @classmethod
    def of(cls, cell: str) -> Heading:
        """Return the header from a cell, `name [unit]`."""
        name, _, rest = cell.partition("[")
        unit = rest.rpartition("]")[0].strip()
        return cls(cell, name.strip(), "" if unit == _NO_UNIT else unit)


@dataclass(frozen=True, slots=True)
class Row:
    """A row below the header."""

    line: int  #: its line number in the file, from 1
    cells: tuple[str, ...]  #: texts without surrounding blanks


@dataclass(frozen=True, slots=True)
class CsvFile:
    """Content of a file."""

    headings: tuple[Heading, ...]  #: headers of the columns; none for an empty file
    line: int  #: line number of the header
    first: str  #: header line as in the file
    rows: tuple[Row, ...]  #: rows below the header
    separator: str  #: separator of the cells


def read_csv(path: Path) -> CsvFile:
    """Read a CSV file; the caller checks its columns.

    Raises:
        UnreadableError: There is no such file, it is not text, or its numbers are ambiguous.
    """
    try:
        if path.is_fifo():  # reading would block, and is possible only once
            raise UnreadableError("is a pipe, not a file; write it to a file first")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise UnreadableError(unreadable(path, error)) from None
    except UnicodeDecodeError:
        raise UnreadableError("is not UTF-8 text; save it in that encoding (CSV UTF-8)") from None
    return parse_csv(lines)


def unreadable(path: Path, error: OSError) -> str:
    """Say why a file cannot be read, and for a missing one what to do; without its name."""
    if isinstance(error, FileNotFoundError):
        if not path.parent.is_dir():
            return f"file not found; there is no folder {path.parent}: correct the path"
        beside = sorted(one.name for one in path.parent.glob(f"*{path.suffix}"))
        return f"file not found{nearest(path.name, beside) or '; correct the path'}"
    if isinstance(error, IsADirectoryError):
        return "is a folder; name a file"
    return f"cannot be read: {error.strerror or error}"


def parse_csv(lines: Sequence[str]) -> CsvFile:
    """Return the content of the lines of a CSV file; see `read_csv`.

    Raises:
        UnreadableError: The numbers are ambiguous.
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
    """Return a number with the unit of its column; other cells unchanged."""
    try:
        float(cell)
    except ValueError:
        return cell
    return f"{cell} {unit}".strip()


def _rows(kept: list[tuple[int, str]], separator: str) -> list[Row]:
    """Header and rows that have a filled cell, without the empty columns at the right."""
    reader = csv.reader((line for _, line in kept), delimiter=separator, skipinitialspace=True)
    rows: list[Row] = []
    begun = width = 0
    try:
        for cells in reader:  # a quoted cell may span several lines
            stripped = [cell.strip() for cell in cells]
            while len(stripped) > width and not stripped[-1]:
                stripped.pop()
            if any(stripped) or not rows:
                width = width or len(stripped)
                rows.append(Row(kept[begun][0], tuple(stripped)))
            begun = reader.line_num
    except csv.Error as error:  # a cell too long for csv
        fix = "is a quotation mark missing that ends a cell?"
        raise UnreadableError(f"line {kept[begun][0]}: {error}; {fix}") from None
    return rows


def _with_points(rows: list[Row], separator: str) -> list[Row]:
    """The rows, with decimal points in their numbers."""
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
    # A point separates thousands only if the comma is the decimal mark, as semicolons suggest.
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
    """Replace the decimal comma of a number by a point."""
    found = _NUMBER.match(cell)
    return cell if found is None else found[0].replace(",", ".") + cell[found.end() :]
