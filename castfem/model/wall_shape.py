"""Notation of a displaced wall: columns, or a CSV file with a header of names and units.

    position [mm], way [mm], x [mm], y [mm]
    0, 0, 0.112, 0
    0, 12.5, 0.111, 0.021

One row for each place at every position: the displacement of the wall in x and y.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.errors import InputError
from castfem.base.named_columns import Columns
from castfem.base.quantities import Kind, Notation
from castfem.base.table_notation import schema_of_columns
from castfem.base.types import Array
from castfem.physics.mould.displaced import WallDisplacement

COLUMNS = ("position", "way", "x", "y")
_COLUMNS = Columns(
    dict.fromkeys(COLUMNS, Kind("m", "mm")),
    dict.fromkeys(COLUMNS, "unit"),
    "displaced wall",
    "position [mm], way [mm], x [mm], y [mm]",
)


@dataclass(frozen=True, slots=True)
class WallShape(Notation):
    """Annotation of a field that takes a displaced wall."""

    #: as text, for the reference page
    takes: str = 'CSV file `{ file = "wall.csv" }`, or its columns'

    def read(self, given: object) -> WallDisplacement:
        """Return the wall, or raise ValueError."""
        if isinstance(given, WallDisplacement):
            return given
        if not isinstance(given, Mapping):
            text = f'{{ file = "wall.csv" }}, {_COLUMNS.header}'
            raise ValueError(f"a displaced wall is needed: {text}")
        return _COLUMNS.read(given, lambda rows, places: gathered(rows))

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
        ValueError: They do not form a complete table of places and positions.
    """
    positions, ways = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    if len(rows) != len(positions) * len(ways):
        raise ValueError(
            f"{len(rows)} rows do not make {len(positions)} positions of {len(ways)} places each; "
            "each place is needed once at each position"
        )
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    moved = rows[order, 2:].reshape(len(positions), len(ways), 2)
    if not (rows[order, 1].reshape(len(positions), -1) == ways).all():
        raise ValueError("a place appears twice at one position of the displaced wall")
    return WallDisplacement(positions, ways, moved)


def write_wall(path: Path, wall: WallDisplacement, about: str) -> None:
    """Write a displaced wall to a CSV file, atomically."""
    lines = [f"# {about}", _COLUMNS.header]
    lines += [", ".join(f"{1e3 * cell:.9g}" for cell in row) for row in flat(wall)]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
