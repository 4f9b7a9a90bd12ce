"""Tables h(T, W) of a nozzle: coefficients over surface temperature and water, from a CSV file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.csv_files import UnreadableError, read_csv
from castfem.base.quantities import HeatTransferCoefficient, Kind, Notation, WaterFlow
from castfem.base.table_notation import schema_of_columns
from castfem.base.units import nearest

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler
    from pydantic_core import CoreSchema

    from castfem.physics.thermal.spray_water import CoefficientTable

_KINDS: dict[str, Kind] = {
    "temperature": Kind("K", "degC"),
    "water": WaterFlow.__metadata__[0],  # type: ignore[attr-defined]
    "value": HeatTransferCoefficient.__metadata__[0],  # type: ignore[attr-defined]
}
_UNITS = {"temperature": "temperature_unit", "water": "water_unit", "value": "unit"}
_HEADER = "temperature [degC], water [L/(m^2 s)], value [W/(m^2 K)]"


@dataclass(frozen=True, slots=True)
class NozzleTable(Notation):
    """Annotation of a field that takes h(T, W): a CSV file, or columns."""

    takes: str = 'CSV file `{ file = "nozzle.csv" }`, or its columns'

    def read(self, given: object) -> CoefficientTable | None:
        """Return the table, or raise ValueError."""
        from castfem.physics.thermal.spray_water import CoefficientTable

        if given is None or isinstance(given, CoefficientTable):
            return given
        if not isinstance(given, Mapping):
            raise ValueError('a table is needed, { file = "nozzle.csv" } with ' + _HEADER)
        if "file" in given:
            if len(given) > 1:
                raise ValueError("a table with a file takes no other key")
            return _from_file(Path(str(given["file"])))
        return _from_columns(given)

    def write(self, value: CoefficientTable | None) -> Any:
        """Return what reads back to the same table."""
        if value is None:
            return None
        rows = [
            (t, w, h)
            for t, line in zip(value.temperatures, value.values, strict=True)
            for w, h in zip(value.water, line, strict=True)
        ]
        return {
            name: [kind.write(row[i]) for row in rows]
            for i, (name, kind) in enumerate(_KINDS.items())
        }

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        ways = schema_of_columns(_KINDS, tuple(_UNITS.values()))
        return {"anyOf": ways, "description": "h(T, W), from a file"}


def _from_file(path: Path) -> CoefficientTable:
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise ValueError(f"cannot read the table '{path}': {error}") from None
    names = [heading.name for heading in file.headings]
    if sorted(names) != sorted(_KINDS) or not file.rows:
        raise ValueError(f"'{path}' line {file.line}: a header and rows are needed: {_HEADER}")
    for row in file.rows:
        if len(row.cells) != len(names):
            raise ValueError(f"'{path}' line {row.line}: {len(row.cells)} cells, not {len(names)}")
    columns: dict[str, Any] = {}
    for i, heading in enumerate(file.headings):
        columns[heading.name] = [row.cells[i] for row in file.rows]
        columns[_UNITS[heading.name]] = heading.unit
    try:
        return _from_columns(columns, tuple(row.line for row in file.rows))
    except ValueError as error:
        raise ValueError(f"'{path}' {error}") from None


def _from_columns(given: Mapping[str, Any], lines: Sequence[int] = ()) -> CoefficientTable:
    """Return the table in columns, a row for each temperature and flow, in any order."""
    from castfem.physics.thermal.spray_water import CoefficientTable

    allowed = (*_KINDS, *_UNITS.values(), "file")
    for key in given:
        if key not in allowed:
            raise ValueError(
                f"unknown key '{key}' in a table h(T, W); allowed: {', '.join(allowed)}"
                f"{nearest(str(key), allowed)}"
            )
    for name in _KINDS:
        if not isinstance(given.get(name), Sequence) or isinstance(given[name], str):
            raise ValueError(f"a table h(T, W) needs the column '{name}'")
    lengths = {len(given[name]) for name in _KINDS}
    if len(lengths) > 1:
        raise ValueError("the columns of a table h(T, W) must be equally long")
    found: dict[tuple[float, float], float] = {}
    for i in range(lengths.pop()):
        where = f"line {lines[i]}" if lines else f"row {i + 1}"
        t, w, h = (_cell(name, given[name][i], given.get(_UNITS[name]), where) for name in _KINDS)
        if (t, w) in found:
            raise ValueError(f"{where}: this temperature and flow stand there twice")
        found[t, w] = h
    temperatures, water = (tuple(sorted({key[k] for key in found})) for k in range(2))
    if len(temperatures) < 2 or len(water) < 2:
        raise ValueError("at least two temperatures and two flows are needed")
    if water[0] != 0.0:
        raise ValueError("the flows must begin at 0: what holds at the edge of a spray")
    gaps = [(t, w) for t in temperatures for w in water if (t, w) not in found]
    if gaps:
        at = [_KINDS[name].write(x) for name, x in zip(_KINDS, gaps[0], strict=False)]
        raise ValueError(f"no value at {at[0]} and {at[1]}; one for each pair is needed")
    values = tuple(tuple(found[t, w] for w in water) for t in temperatures)
    return CoefficientTable(temperatures, water, values)


def _cell(name: str, cell: object, unit: object, where: str) -> float:
    """Read a cell, in the unit of its column where it has none itself."""
    text = str(cell).strip()
    try:
        try:
            float(text)
        except ValueError:
            return _KINDS[name].read(text)
        if not unit:
            raise ValueError(f"name the unit of the column, {name} [{_KINDS[name].shown}]")
        return _KINDS[name].read(f"{text} {unit}")
    except ValueError as error:
        raise ValueError(f"{where}: {name} ({text}): {error}") from None
