"""How a displaced wall is written: in columns, or in a CSV file with a head of names and units.

    position [mm], way [mm], x [mm], y [mm]
    0, 0, 0.112, 0
    0, 12.5, 0.111, 0.021

A row for every place at every position: how far it has moved, in x and y.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.csv_files import UnreadableError, read_csv
from castfem.base.errors import InputError
from castfem.base.quantities import Kind, Notation
from castfem.base.table_notation import schema_of_columns
from castfem.base.types import Array
from castfem.physics.mould.displaced import WallDisplacement

COLUMNS = ("position", "way", "x", "y")
_KIND = Kind("m", "mm")
_HEADER = "position [mm], way [mm], x [mm], y [mm]"


@dataclass(frozen=True, slots=True)
class WallShape(Notation):
    """Annotation of a field that takes a displaced wall.

    Attributes:
        takes: In words, for the reference page.
    """

    takes: str = 'CSV file `{ file = "wall.csv" }`, or its columns'

    def read(self, given: object) -> WallDisplacement:
        """Return the wall, or raise ValueError."""
        if isinstance(given, WallDisplacement):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(f'a displaced wall is needed: {{ file = "wall.csv" }}, {_HEADER}')
        if "file" in given:
            if len(given) > 1:
                raise ValueError("a displaced wall with a file takes no other key")
            return read_wall(Path(str(given["file"])))
        for key in given:
            if key not in (*COLUMNS, "unit"):
                fix = f"allowed: {', '.join((*COLUMNS, 'unit', 'file'))}"
                raise ValueError(f"unknown key '{key}' in a displaced wall; {fix}")
        unit = given.get("unit")
        columns = [_column(name, given.get(name), unit) for name in COLUMNS]
        return gathered(np.array(columns).T) if len({*map(len, columns)}) == 1 else _unequal()

    def write(self, value: WallDisplacement) -> Any:
        """Return what reads back to the same wall."""
        rows = flat(value)
        return {**{name: rows[:, i].tolist() for i, name in enumerate(COLUMNS)}, "unit": "m"}

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        ways = schema_of_columns(COLUMNS, ("unit",))
        return {"anyOf": ways, "description": "displaced wall, from a file"}


def flat(wall: WallDisplacement) -> Array:
    """Return the rows (n, 4) of position, way, x, y, m."""
    position, way = np.meshgrid(wall.positions, wall.ways, indexing="ij")
    return np.column_stack([position.ravel(), way.ravel(), wall.moved.reshape(-1, 2)])


def gathered(rows: Array) -> WallDisplacement:
    """Return the wall of rows (n, 4) in any order, m.

    Raises:
        ValueError: They do not make up a table of all places at all positions.
    """
    positions, ways = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    if len(rows) != len(positions) * len(ways):
        raise ValueError(
            f"{len(rows)} rows do not make {len(positions)} positions of {len(ways)} places each; "
            "every place stands once at every position"
        )
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    moved = rows[order, 2:].reshape(len(positions), len(ways), 2)
    if not (rows[order, 1].reshape(len(positions), -1) == ways).all():
        raise ValueError("a place stands twice at one position of the displaced wall")
    return WallDisplacement(positions, ways, moved)


def read_wall(path: Path) -> WallDisplacement:
    """Read a displaced wall from a CSV file.

    Raises:
        ValueError: It cannot be read, or is none; told with its name.
    """
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise ValueError(f"cannot read the displaced wall '{path}': {error}") from None
    if tuple(heading.name for heading in file.headings) != COLUMNS or not file.rows:
        raise ValueError(f"'{path}' line {file.line}: a header and rows are needed: {_HEADER}")
    rows = []
    for row in file.rows:
        where = f"'{path}' line {row.line}"
        if len(row.cells) != len(COLUMNS):
            raise ValueError(f"{where}: {len(row.cells)} cells, not {len(COLUMNS)}: {_HEADER}")
        cells = []
        for cell, heading in zip(row.cells, file.headings, strict=True):
            try:
                cells.append(_KIND.read(f"{cell} {heading.unit}"))
            except ValueError as error:
                raise ValueError(f"{where}: {heading.name} ({cell}): {error}") from None
        rows.append(cells)
    try:
        return gathered(np.array(rows))
    except ValueError as error:
        raise ValueError(f"'{path}': {error}") from None


def write_wall(path: Path, wall: WallDisplacement, about: str) -> None:
    """Write a displaced wall to a CSV file, whole or not at all.

    Raises:
        InputError: It cannot be written.
    """
    lines = [f"# {about}", _HEADER]
    lines += [", ".join(f"{1e3 * cell:.9g}" for cell in row) for row in flat(wall)]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def _column(name: str, cells: object, unit: object) -> list[float]:
    if not isinstance(cells, Sequence) or isinstance(cells, str) or not cells:
        raise ValueError(f"a displaced wall needs the column '{name}', a list of lengths")
    found = []
    for row, cell in enumerate(cells, start=1):
        bare = isinstance(cell, int | float) and not isinstance(cell, bool)
        if bare and not math.isfinite(cell):
            raise ValueError(f"'{name}' row {row}: a finite number is needed")
        try:
            found.append(_KIND.read(f"{cell!r} {unit}" if bare and unit else cell))
        except ValueError as error:
            raise ValueError(f"'{name}' row {row} ({cell!r}): {error}") from None
    return found


def _unequal() -> WallDisplacement:
    raise ValueError("the columns of a displaced wall must be equally long")
