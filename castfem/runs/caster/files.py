"""Output files of a caster: tables that grow, and are cut back when a run is resumed."""

from __future__ import annotations

import csv
import io
import math
import os
import shutil
import weakref
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import AppendedFile, Closing, saving, write_text
from castfem.base.csv_files import read_csv
from castfem.base.errors import InputError
from castfem.base.result_registry import QuantityDefinition, find
from castfem.base.types import Array
from castfem.runs.output.folder import CASTER_NAME, MOMENTS_NAME, SLICES_NAME, STRAND_ROWS_NAME
from castfem.runs.results.registry import Columns

if TYPE_CHECKING:
    import pandas

    from castfem.model.build.simulation import Simulation
    from castfem.runs.results.sample import Sample

Row = Mapping[str, float | str]
CENTRE = "centre_solid_fraction"
"""A column in all rows of slices."""


class GrowingTable(Closing):
    """A CSV file whose header has the name and unit of each column; numbers have twelve digits.

    Args:
        path: Path of the file.
        heading: Name and unit of each column; no unit for a column of text.
        size: Size in bytes from which an existing file continues; None for a new one.

    Raises:
        InputError: The file is shorter than `size`.
        RunFailure: It cannot be written.
    """

    def __init__(self, path: Path, heading: Sequence[tuple[str, str]], size: int | None) -> None:
        self._names, self._path = [name for name, _ in heading], path
        if size is None:
            cells = [f"{name} [{unit}]" if unit else name for name, unit in heading]
            write_text(path, _line(cells))
        else:
            if not path.is_file() or path.stat().st_size < size:
                raise InputError(f"{path}: rows are missing; run again without --resume")
            with saving(path):
                os.truncate(path, size)
        self._file = AppendedFile(path)

    @property
    def size(self) -> int:
        """Size of the file so far, bytes."""
        return self._path.stat().st_size

    def append(self, rows: Iterable[Row]) -> None:
        """Add all of some rows or none; missing and non-finite values become empty cells."""
        lines = [_line(line) for line in cells(rows, self._names)]
        if lines:
            self._file.append("".join(lines).encode())

    def sync(self) -> None:
        """Flush the file to disk."""
        self._file.sync()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def cells(rows: Iterable[Row], names: Sequence[str]) -> list[list[str]]:
    """Return rows as text, in the order of the columns."""
    return [[_cell(row.get(name, "")) for name in names] for row in rows]


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.12g}" if math.isfinite(value) else ""


def _line(cells: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def definition(column: str) -> tuple[QuantityDefinition, str]:
    """Return the definition of the quantity in a slice's column, and its probe."""
    found = find(column)
    assert found is not None, "castfem has written the column"
    return found


class SliceRows:
    """Makes the row of a slice: columns of its history and central solid fraction."""

    def __init__(self, model: Simulation) -> None:
        self._model, self._columns = model, Columns(model)
        self.heading = list(self._columns.heading)
        self._adds = CENTRE not in dict(self.heading)
        if self._adds:
            self.heading.append((CENTRE, definition(CENTRE)[0].unit))

    def row(self, sample: Sample) -> dict[str, float]:
        """One row, in the units of its columns."""
        found = self._columns.row(sample)
        if self._adds:
            centre = next(iter(sample.profiles.values())).temperature[-1]
            found[CENTRE] = float(np.asarray(self._model.steel.solid_fraction(centre)))
        return found


def read_table(path: Path) -> tuple[dict[str, Array], dict[str, str], dict[str, list[str]]]:
    """Return the numeric columns of such a file, their units, and the text columns.

    Raises:
        InputError: There is no such file, or it is not a table of a caster.
    """
    try:
        file = read_csv(path)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    columns = list(zip(*(row.cells for row in file.rows), strict=True)) or [()] * len(file.headings)
    numbers, words = {}, {}
    for heading, cells in zip(file.headings, columns, strict=True):
        if "[" in heading.text:
            numbers[heading.name] = np.array([float(c) if c else math.nan for c in cells])
        else:
            words[heading.name] = list(cells)
    return numbers, {h.name: h.unit for h in file.headings}, words


def moment_files(folder: Path) -> list[tuple[float, Path]]:
    """Return the files of a caster's moments with their clock times, s."""
    found = (folder / MOMENTS_NAME).glob("strand_*s.vtu")
    return sorted((float(path.stem[len("strand_") : -1]), path) for path in found)


class CasterResult:
    """The output of a caster, read on request, in the units of its files.

    Attributes:
        folder: Folder of the run.
    """

    def __init__(self, folder: Path, temporary: bool = False) -> None:
        self.folder = folder
        if temporary:
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    @cached_property
    def caster(self) -> pandas.DataFrame:
        """One row per output time: speed, end of the liquid core, power, events."""
        return self._read(CASTER_NAME)

    @cached_property
    def strand(self) -> pandas.DataFrame:
        """The strand at each output time: one row per slice, from the meniscus downwards."""
        return self._read(STRAND_ROWS_NAME)

    @cached_property
    def slices(self) -> pandas.DataFrame:
        """One row for each slice that has left the machine, at its exit."""
        return self._read(SLICES_NAME)

    def _read(self, name: str) -> pandas.DataFrame:
        import pandas

        numbers, units, words = read_table(self.folder / name)
        found = pandas.DataFrame({**numbers, **words})
        found.attrs["units"] = units
        return found
