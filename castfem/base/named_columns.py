"""Columns of several quantities that form a table, in a case or a CSV file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from castfem.base import units
from castfem.base.csv_files import UnreadableError, read_csv, with_unit
from castfem.base.quantities import Kind
from castfem.base.types import Array

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class Columns:
    """Columns of quantities that form a table, in a case or a CSV file."""

    kinds: Mapping[str, Kind]  #: quantity of each column, by its name
    units: Mapping[str, str]  #: key with the unit of the plain numbers of each column
    what: str  #: name of the described object, for messages
    header: str  #: header of a file, for messages
    optional: Collection[str] = ()  #: columns of `kinds` that may be left out
    #: text columns, which may be left out, and whose cells may be empty
    words: Collection[str] = ()
    #: quantity of columns with any other name; None if there are none
    others: Kind | None = None

    def read(self, given: Mapping[str, Any], make: Callable[[Array, Sequence[str]], Made]) -> Made:
        """Return `make` of the rows (n, columns) in SI and of the places of the rows.

        Raises:
            ValueError: A column or a cell is invalid, or `make` fails.
        """
        return self.read_by_name(
            given, lambda found, places: make(np.transpose([found[n] for n in self.kinds]), places)
        )

    def read_by_name(
        self,
        given: Mapping[str, Any],
        make: Callable[[dict[str, list[Any]], Sequence[str]], Made],
    ) -> Made:
        """Return `make` of the columns in SI, by name, and of the places of the rows.

        Raises:
            ValueError: As `read`.
        """
        if "file" not in given:
            return make(*self._columns(given))
        if len(given) > 1:
            raise ValueError("a table with a file takes no other key")
        path = Path(str(given["file"]))
        try:
            file = read_csv(path)
        except UnreadableError as error:
            raise ValueError(f"the {self.what} '{path}': {error}") from None
        names = [heading.name for heading in file.headings]
        if not file.rows or not self._are_those(names):
            text = f"a header and rows are needed: {self.header}"
            raise ValueError(f"'{path}' line {file.line}: {text}")
        for row in file.rows:
            count = len(row.cells)
            if count > len(names) or not set(names[count:]) <= set(self.words):
                raise ValueError(f"'{path}' line {row.line}: {count} cells, not {len(names)}")
        columns = {
            heading.name: [with_unit((*row.cells, "")[i], heading.unit) for row in file.rows]
            for i, heading in enumerate(file.headings)
        }
        try:
            return make(*self._columns(columns, [row.line for row in file.rows]))
        except ValueError as error:
            colon = "" if str(error).startswith("line ") else ":"
            raise ValueError(f"'{path}'{colon} {error}") from None

    def _are_those(self, names: Sequence[str]) -> bool:
        """Whether a file has the required columns, none twice and no unknown ones."""
        known = {*self.kinds, *self.words}
        needed = set(self.kinds) - set(self.optional)
        return (
            len(names) == len(set(names))
            and needed <= set(names)
            and (self.others is not None or set(names) <= known)
        )

    def _columns(
        self, given: Mapping[str, Any], lines: Sequence[int] = ()
    ) -> tuple[dict[str, list[Any]], list[str]]:
        beside = (*dict.fromkeys(self.units.values()), "file")
        allowed = (*self.kinds, *self.words, *beside)
        if self.others is None:
            for key in given:
                if key not in allowed:
                    fix = f"allowed: {', '.join(allowed)}{units.nearest(str(key), allowed)}"
                    raise ValueError(f"unknown key '{key}' in a {self.what}; {fix}")
        names = [name for name in self.kinds if name in given or name not in self.optional]
        names += [name for name in given if name not in names and name not in beside]
        for name in names:
            cells = given.get(name)
            if not isinstance(cells, Sequence) or isinstance(cells, str) or not cells:
                raise ValueError(f"a {self.what} needs the column '{name}', a list of values")
        counts = {len(given[name]) for name in names}
        if len(counts) > 1:
            raise ValueError(f"the columns of a {self.what} must be equally long")
        places = [f"line {n}" for n in lines] or [f"row {i + 1}" for i in range(counts.pop())]
        found: dict[str, list[Any]] = {}
        for name in names:
            kind, unit = self.kinds.get(name, self.others), given.get(self.units.get(name, ""))
            if name in self.words or kind is None:
                found[name] = [str(cell).strip() for cell in given[name]]
                continue
            found[name] = [
                _cell(name, kind, cell, unit, where)
                for cell, where in zip(given[name], places, strict=True)
            ]
        return found, places


Grid = tuple[tuple[float, ...], tuple[float, ...], tuple[tuple[float, ...], ...]]


def grid_of(rows: Array, places: Sequence[str], kinds: Sequence[Kind], what: str) -> Grid:
    """Return a table over two arguments from rows in any order, one for each pair of arguments.

    Args:
        rows: Both arguments and the value (n, 3), SI.
        places: Place of each row.
        kinds: Quantities of the arguments.
        what: Name of the arguments, for messages: "temperature and flow".

    Returns:
        Both arguments, increasing, and the values with a row for each of the first.

    Raises:
        ValueError: A pair appears twice, or is missing.
    """
    found: dict[tuple[float, float], float] = {}
    cells: Any = rows.tolist()
    for (x, y, value), where in zip(cells, places, strict=True):
        if (x, y) in found:
            raise ValueError(f"{where}: this {what} appear twice")
        found[x, y] = value
    first, second = (tuple(sorted({key[k] for key in found})) for k in range(2))
    gaps = [(x, y) for x in first for y in second if (x, y) not in found]
    if gaps:
        at = [kind.write(x) for kind, x in zip(kinds, gaps[0], strict=False)]
        raise ValueError(f"no value at {at[0]} and {at[1]}; one for each pair is needed")
    return first, second, tuple(tuple(found[x, y] for y in second) for x in first)


def rows_of(grid: Grid) -> list[tuple[float, float, float]]:
    """Return the inverse of `grid_of`: a row for each pair."""
    first, second, values = grid
    return [
        (x, y, value)
        for x, line in zip(first, values, strict=True)
        for y, value in zip(second, line, strict=True)
    ]


def _cell(name: str, kind: Kind, cell: object, unit: object, where: str) -> float:
    """Read a cell, in the unit of its column if it has none."""
    text = str(cell).strip()
    if not text:
        raise ValueError(f"{where}: {name} is empty")
    try:
        try:
            number = float(text)
        except ValueError:
            return kind.read(text)
        if unit:
            return kind.read(f"{text} {unit}")
        if kind.unit != "1":
            raise ValueError(f"name the unit of the column, {name} [{kind.shown}]")
        return kind.read(number)
    except ValueError as error:
        raise ValueError(f"{where}: {name} ({text}): {error}") from None
