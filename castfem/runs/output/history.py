"""history.csv: one row per step, units in the header, never a partial row."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import AppendedFile, Closing, write_text
from castfem.base.constants import same_or_before
from castfem.base.errors import InputError
from castfem.base.types import Array

if TYPE_CHECKING:
    import pandas

HISTORY_NAME = "history.csv"
_ANEW = "run again without --resume"
_COLUMN = re.compile(r"(.*?) \[(.*)\]")


class History(Closing):
    """Appends rows to a CSV file whose first line is `name [unit],name [unit],...`.

    Numbers have twelve significant digits; missing and non-finite values are empty cells. A row is
    passed to the operating system in one piece, so that a killed run leaves complete rows.
    """

    _names: tuple[str, ...]
    _file: AppendedFile

    def __init__(self, path: Path | str, columns: Sequence[tuple[str, str]]) -> None:
        """Create the file, replacing an existing one.

        Args:
            path: Path of the file.
            columns: Name and unit of each column; the first is ("time", "s"). A dimensionless
                number has the unit "-".

        Raises:
            RunFailure: The file cannot be written.
            ValueError: A name or unit could not be read back from the header.
        """
        for name, unit in columns:
            if not name or not unit or set(name + unit) & set(',"\n[]'):
                raise ValueError(f"column {name!r} [{unit}] cannot be written")
        if len({name for name, _ in columns}) != len(columns):
            raise ValueError("two columns have the same name")
        if not columns or columns[0] != ("time", "s"):
            raise ValueError("the first column is time in s")
        self._names = tuple(name for name, _ in columns)
        write_text(Path(path), _line([f"{name} [{unit}]" for name, unit in columns]))
        self._file = AppendedFile(Path(path))

    @classmethod
    def resume(
        cls,
        path: Path | str,
        upto_time: float,
        columns: Sequence[tuple[str, str]] | None = None,
        rows: int | None = None,
    ) -> History:
        """Open the file of an earlier run, dropping all rows after `upto_time` [s] atomically.

        Args:
            path: Path of the file.
            upto_time: The last time to keep.
            columns: Required columns; None accepts any.
            rows: Required number of rows up to that time, with increasing times; None accepts any.

        Raises:
            InputError: The file is missing, not a history, has other columns, or lacks rows.
            RunFailure: The file cannot be written.
        """
        path = Path(path)
        if not path.is_file():
            raise InputError(f"{path}: no such file; {_ANEW}")
        header, lines = _complete_lines(path)
        found = _columns(path, header)
        if columns is not None and found != list(columns):
            raise InputError(f"{path}: has other columns than this run; {_ANEW}")
        kept, times = [header], []
        for number, row in enumerate(lines, start=2):
            try:
                time = float(row.split(",", 1)[0])
            except ValueError as error:
                fix = "remove the line, or run again without --resume"
                raise InputError(
                    f"{path}: line {number} has no time ({row[:40]}); {fix}"
                ) from error
            if same_or_before(time, upto_time):
                kept.append(row)
                times.append(time)
        if rows is not None and len(times) != rows:
            raise InputError(
                f"{path}: has {len(times)} rows to {upto_time:g} s, of {rows} that were written: "
                f"it has been changed; restore the file, or {_ANEW}"
            )
        if any(later <= time for time, later in pairwise(times)):
            raise InputError(f"{path}: its times do not increase; correct it, or {_ANEW}")
        history = cls.__new__(cls)
        history._names = tuple(name for name, _ in found)
        write_text(path, "".join(f"{line}\n" for line in kept))
        history._file = AppendedFile(path)
        return history

    def append(self, row: Mapping[str, float]) -> None:
        """Add one row; columns that are not given stay empty.

        Raises:
            RunFailure: The file cannot be written.
            ValueError: A name is not a column.
        """
        unknown = row.keys() - set(self._names)
        if unknown:
            raise ValueError(f"no such column: {', '.join(sorted(unknown))}")
        cells = [f"{float(row.get(name, math.nan)):.12g}" for name in self._names]
        text = _line([cell if math.isfinite(float(cell)) else "" for cell in cells])
        self._file.append(text.encode())

    def sync(self) -> None:
        """Flush the rows to disk."""
        self._file.sync()

    def close(self) -> None:
        """Close the file; without it nothing is lost."""
        self._file.close()


class Columns:
    """A history with one array per column, used like a pandas table but without loading pandas.

    Attributes:
        columns: Names, without units.
        attrs: Unit of each column in `attrs["units"]`.
    """

    def __init__(self, values: Mapping[str, Array], units: Mapping[str, str]) -> None:
        """Store columns of equal length, and their units."""
        self._values = dict(values)
        self.columns = tuple(self._values)
        self.attrs = {"units": dict(units)}

    def __getitem__(self, name: str) -> Array:
        """Values of one column (rows,)."""
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        """Number of rows."""
        return len(next(iter(self._values.values())))


def read_columns(path: Path | str) -> Columns:
    """Read a history as arrays of floats by column name.

    An incomplete last row, left by a kill, is dropped.
    """
    path = Path(path)
    header, rows = _complete_lines(path)
    columns = _columns(path, header)
    values = [[_number(path, cell) for cell in row.split(",")] for row in rows]
    if any(len(row) != len(columns) for row in values):
        raise InputError(f"{path}: a row does not have the {len(columns)} cells of the header")
    for before, this in pairwise(row[0] for row in values):
        if not this >= before:  # also true for NaN
            raise InputError(f"{path}: its times do not increase ({this:g} s after {before:g} s)")
    across = np.array(values, dtype=np.float64).reshape(len(rows), len(columns)).T.copy()
    return Columns(dict(zip((name for name, _ in columns), across, strict=True)), dict(columns))


def read_history(path: Path | str) -> pandas.DataFrame:
    """Read a history as a pandas table; the units are in `table.attrs["units"]`."""
    import pandas

    found = read_columns(path)
    table = pandas.DataFrame({name: found[name] for name in found}, dtype=float)
    table.attrs.update(found.attrs)
    return table


def last_row(path: Path | str) -> tuple[dict[str, float], dict[str, str]] | None:
    """Read the last complete row of a history without the rest of the file.

    Returns:
        Values by column, NaN for empty cells, and units by column; None if there is no row.

    Raises:
        InputError: There is no such file, or it is not a history.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            header = file.readline()
            columns = _columns(path, header.decode().rstrip("\n"))
            size = file.seek(0, os.SEEK_END)
            row = 20 * len(columns)  # largest size in bytes: numbers and commas
            file.seek(max(len(header), size - 2 * row))
            rows = file.read().split(b"\n")[:-1]
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if not rows:
        return None
    cells = rows[-1].decode(errors="replace").split(",")
    if len(cells) != len(columns):
        raise InputError(f"{path}: a row does not have the {len(columns)} cells of the header")
    values = [_number(path, cell) for cell in cells]
    return {name: value for (name, _), value in zip(columns, values, strict=True)}, dict(columns)


def needs_strand(columns: Container[str], folder: Path | str) -> None:
    """Refuse the history of a tensile test, which has no positions.

    Raises:
        InputError: `position` is not among the columns.
    """
    if "position" not in columns:
        raise InputError(f"{folder}: is a tensile test; use castfem show {folder}")


def _line(cells: Sequence[str]) -> str:
    return ",".join(cells) + "\n"


def _number(path: Path, cell: str) -> float:
    """Value of a cell, NaN if it is empty."""
    try:
        return float(cell) if cell else math.nan
    except ValueError as error:
        raise InputError(f"{path}: {cell[:40]!r} is not a number") from error


def _complete_lines(path: Path) -> tuple[str, list[str]]:
    """The header, and all rows that end with a newline."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    lines = text.split("\n")[:-1]
    if not lines:
        raise InputError(f"{path}: is empty; a history begins with the names of its columns")
    return lines[0], [line for line in lines[1:] if line]


def _columns(path: Path, header: str) -> list[tuple[str, str]]:
    found = [_COLUMN.fullmatch(cell) for cell in header.split(",")]
    columns: list[tuple[str, Any]] = [(m.group(1), m.group(2)) for m in found if m]
    if len(columns) != len(found) or columns[0][0] != "time":
        raise InputError(f"{path}: line 1 is not 'time [s],name [unit],...'")
    names = [name for name, _ in columns]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"{path}: line 1: two columns are called {twice}")
    return columns
