"""Notation of quantities that depend on temperature, time or position in a case file.

In a case file such a quantity is a single value, two columns with their units named once,

    [cooling.surface.coefficient]
    temperature = [700, 900, 1100]
    temperature_unit = "degC"
    value = [400, 300, 250]
    unit = "W/(m^2 K)"

or a CSV file, `{ file = "spray.csv" }`, whose header names the columns and their units:
`temperature [degC], value [W/(m^2 K)]`. Between the rows it is linear, beyond them constant.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from castfem.base import units
from castfem.base.csv_files import DECIMAL_COMMAS, UnreadableError, read_csv
from castfem.base.quantities import Kind, Notation
from castfem.base.tables import ARGUMENTS, Table


@dataclass(frozen=True, slots=True)
class Curve(Notation):
    """Annotation of a field that takes a single value or a `Table`."""

    kind: Kind  #: unit and bounds of the value
    over: str  #: argument of a table, "temperature", "time" or "position"
    others: tuple[str, ...] = ()  #: other allowed arguments

    @property
    def quantity(self) -> Kind:
        """See `Notation`."""
        return self.kind

    @property
    def arguments(self) -> str:
        """Allowed arguments of a table, as text."""
        *most, last = (self.over, *self.others)
        return f"{', '.join(most)} or {last}" if most else last

    def read(self, given: object) -> float | Table:
        """Return the value in SI, or a table; raise ValueError if it is neither."""
        over = self._over(given)
        if isinstance(given, Table):
            if given.over != over:
                raise ValueError(f"a table over {over} is needed, not over {given.over}")
            _check(over, given.arguments, given.values)
            return given
        if not isinstance(given, Mapping):
            return self.kind.read(given)
        columns, places = _columns(given, over, self.kind)
        try:
            x = _column(over, columns[over], columns.get(f"{over}_unit"), ARGUMENTS[over], places)
            y = _column("value", columns["value"], columns.get("unit"), self.kind, places)
            _check(over, x, y, places)
        except ValueError as error:
            raise ValueError(f"'{given['file']}': {error}" if "file" in given else error) from None
        return Table(over, x, y)

    def _over(self, given: object) -> str:
        """Argument of a given table."""
        over = self.over
        for other in self.others:
            of_other = isinstance(given, Table) and given.over == other
            if isinstance(given, Mapping):
                of_other = other in given or _first_of_file(given.get("file")) == other
            over = other if of_other else over
        return over

    def write(self, value: float | Table) -> Any:
        """Return what reads back to the same value: a text, a number, or a dict of columns."""
        if not isinstance(value, Table):
            return self.kind.write(value)
        x, x_unit = _written(value.arguments, ARGUMENTS[value.over])
        y, y_unit = _written(value.values, self.kind)
        columns = {value.over: x, f"{value.over}_unit": x_unit, "value": y, "unit": y_unit}
        return {key: entry for key, entry in columns.items() if entry is not None}

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        single = self.kind.json_schema()
        (file, columns), *more = (
            schema_of_columns((over, "value"), (f"{over}_unit", "unit"), least=2)
            for over in (self.over, *self.others)
        )
        text = f"{single['description']}; or a table over {self.arguments}"
        others = (columns for _, columns in more)
        return {"anyOf": [single, columns, file, *others], "description": text}

    def described(self, example: object = None) -> str:
        """See `Notation.described`."""
        return f"{self.kind.described(example)}, or a table over {self.arguments}"


def _columns(
    given: Mapping[str, Any], over: str, kind: Kind
) -> tuple[dict[str, Any], Sequence[str]]:
    """Return the columns and their units, from the table itself or from its file.

    The place of each row, "line 3", is returned as well; empty for the table itself.
    """
    if "file" in given:
        if len(given) > 1:
            raise ValueError("a table with a file takes no other key")
        return _columns_of_file(Path(str(given["file"])), over, kind)
    allowed = (over, f"{over}_unit", "value", "unit", "file")
    for key in given:
        if key not in allowed:
            fix = f"allowed: {', '.join(allowed)}{units.nearest(str(key), allowed)}"
            raise ValueError(f"unknown key '{key}' in a table over {over}; {fix}")
    for key in (over, "value"):
        if key not in given:
            raise ValueError(f"a table over {over} needs the column '{key}'")
    return dict(given), ()


def _check(over: str, x: Sequence[float], y: Sequence[float], places: Sequence[str] = ()) -> None:
    """Refuse too few rows, or rows that do not increase, by their place or number."""
    if len(x) != len(y):
        raise ValueError(f"{len(x)} rows of {over}, but {len(y)} of value")
    if len(x) < 2:
        raise ValueError(f"a table needs at least two rows, this one has {len(x)}")
    for row in range(1, len(x)):
        if not x[row] > x[row - 1]:
            this, before = (_place(places, number) for number in (row, row - 1))
            text = f"{this} does not exceed {before}"
            raise ValueError(f"{over} must increase from row to row; {text}")


def _place(places: Sequence[str], number: int) -> str:
    """Place of a row, counted from 0: its line, or its number if there is none."""
    return places[number] if places else f"row {number + 1}"


def schema_of_columns(
    names: Collection[str],
    others: Collection[str],
    *,
    needed: Collection[str] | None = None,
    cells: Sequence[str] = ("number", "string"),
    least: int = 0,
) -> list[dict[str, Any]]:
    """Return the JSON schemas of a table in a file, and of one in columns.

    Args:
        names: Names of the columns.
        others: Further allowed keys, such as that of a unit.
        needed: Required columns; all by default.
        cells: JSON types of the cells in a column.
        least: Smallest number of rows.
    """
    column: dict[str, Any] = {"type": "array", "items": {"type": list(cells)}}
    if least:
        column["minItems"] = least
    columns = {
        "type": "object",
        "properties": {name: column for name in names}
        | {key: {"type": "string"} for key in others},
        "required": list(names if needed is None else needed),
        "additionalProperties": False,
    }
    file = {
        "type": "object",
        "properties": {"file": {"type": "string"}},
        "required": ["file"],
        "additionalProperties": False,
    }
    return [file, columns]


def _written(values: tuple[float, ...], kind: Kind) -> tuple[list[float], str | None]:
    """Return a column that `_column` reads back to the same floats, and its unit."""
    if kind.unit == "1":
        return list(values), None
    numbers = _shown(values, kind)
    return (list(numbers), kind.shown) if numbers else (list(values), kind.unit)


@lru_cache(maxsize=32)  # a run writes its case several times; a long table takes seconds
def _shown(values: tuple[float, ...], kind: Kind) -> tuple[float, ...]:
    """Return a column in its shown unit; () if other floats would be read back."""
    numbers = tuple(float(f"{units.convert(v, kind.unit, kind.shown):.12g}") for v in values)
    return numbers if _column("value", numbers, kind.shown, kind) == values else ()


def _column(
    name: str, cells: object, unit: object, kind: Kind, places: Sequence[str] = ()
) -> tuple[float, ...]:
    """Read one column in SI; `unit` is that of plain numbers, None if there is none."""
    if not isinstance(cells, Sequence) or isinstance(cells, str):
        raise ValueError(f"'{name}' must be a list of values")
    if not cells:
        raise ValueError(f"'{name}' is empty; a table needs at least two rows")
    if unit is not None and not isinstance(unit, str):
        raise ValueError(f"the unit of '{name}' must be a text, such as \"{kind.unit}\"")
    if isinstance(unit, str) and (found := _all_numbers(cells, unit, kind)):
        return found
    values = []
    for row, cell in enumerate(cells):
        bare = isinstance(cell, int | float) and not isinstance(cell, bool)
        try:
            if bare and not math.isfinite(cell):
                raise ValueError("a finite number is needed")
            if bare and unit is None and kind.unit != "1":
                _no_unit(name, kind)
            values.append(kind.read(f"{cell!r} {unit}" if bare and unit else cell))
        except ValueError as error:
            where = _place(places, row)
            raise ValueError(f"'{name}' {where} ({cell!r}): {error}") from None
    return tuple(values)


def _all_numbers(cells: Sequence[object], unit: str, kind: Kind) -> tuple[float, ...]:
    """Return a column of numbers of one unit; () if a cell is faulty or something else."""
    numbers = [
        cell
        for cell in cells
        if isinstance(cell, int | float)
        and not isinstance(cell, bool)
        and abs(cell) <= units.LARGEST
    ]
    if len(numbers) < len(cells):
        return ()
    try:
        found = units.parse_numbers(numbers, unit, kind.unit, difference=kind.difference)
        kind.bounded(min(found))
        kind.bounded(max(found))
    except ValueError:
        return ()  # errors are reported by row
    return found


def _no_unit(name: str, kind: Kind) -> NoReturn:
    key = "unit" if name == "value" else f"{name}_unit"
    raise ValueError(f'name the unit of the column once, {key} = "{kind.shown or kind.unit}"')


def _columns_of_file(path: Path, over: str, kind: Kind) -> tuple[dict[str, Any], Sequence[str]]:
    """Return the columns of a CSV file with the header `temperature [degC], value [...]`.

    The second column may have any name. A cell with its own unit stays a text.
    """
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise ValueError(f"the table '{path}': {error}") from None
    header = f"{over} [unit], value [unit]"
    if not file.headings:
        raise ValueError(f"'{path}' is empty; its first line must be '{header}'")
    # The column of values may have the quantity's name, "flux", if its unit agrees.
    if len(file.headings) != 2 or file.headings[0].name != over or not file.headings[1].name:
        raise ValueError(f"the first line of '{path}' must be '{header}', not '{file.first}'")
    columns: dict[str, Any] = {over: [], "value": []}
    for row in file.rows:
        if len(row.cells) != 2:
            fix = f"; {DECIMAL_COMMAS}" if len(row.cells) > 2 else ""
            raise ValueError(f"line {row.line} of '{path}' must hold two numbers{fix}")
        for cells, cell in zip(columns.values(), row.cells, strict=True):
            cells.append(_number_or_text(cell))
    expected = zip(file.headings, columns.values(), (ARGUMENTS[over], kind), strict=True)
    for heading, cells, its in expected:
        bare = any(isinstance(cell, float) for cell in cells)
        if bare and not heading.unit and its.unit != "1":
            raise ValueError(
                f"'{path}' line {file.line}: {heading.name} has no unit; write it in the header, "
                f"such as '{heading.name} [{its.shown or its.unit}]'"
            )
    for key, heading in zip((f"{over}_unit", "unit"), file.headings, strict=True):
        columns[key] = heading.unit or None
    return columns, [f"line {row.line}" for row in file.rows]


def _number_or_text(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _first_of_file(path: object) -> str | None:
    """Name of the first column of a CSV file; None if `Curve` will refuse it."""
    try:
        headings = read_csv(Path(str(path))).headings if isinstance(path, str) else []
    except UnreadableError:
        return None
    return headings[0].name if headings else None
