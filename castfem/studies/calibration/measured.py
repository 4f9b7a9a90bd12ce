"""Measurements from a CSV file, and the corresponding results of a run.

`tc1.temperature` is a value at a probe, `[[output.probe]]`, in the strand, or at a thermocouple of
`[[mould.tube.thermocouple]]` in the copper, whose temperature follows from the heat of the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from castfem.base import units
from castfem.base.csv_files import DECIMAL_COMMAS, Heading, UnreadableError, read_csv
from castfem.base.errors import InputError, choices
from castfem.base.result_registry import fault, unit_of
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.types import Array
from castfem.base.units import nearest, parse_any
from castfem.model import Case
from castfem.model.mould import CopperThermocouples
from castfem.runs.output.folder import PROBES_NAME
from castfem.runs.output.history import read_columns
from castfem.runs.results.probes import HEAT, MECHANICS, PHASES

_ERROR = " error"  # suffix of the names of error columns
_POSITION = "position"
_SAMPLE = "position [mm], surface_temperature_mid_face [degC]"


@dataclass(frozen=True, slots=True)
class Measured:
    """One measured value."""

    position: float  #: position below the meniscus, m
    name: str  #: name of the result, as in history.csv; `tc1.temperature` for the probe tc1
    value: float  #: SI
    error: float  #: standard deviation, SI; NaN if not given
    source: str = ""  #: file and line, "" if unknown

    @property
    def where(self) -> str:
        """Start of messages about it."""
        return f"{self.source}: {self.name}" if self.source else self.name


def read_measured(path: Path) -> list[Measured]:
    """Return the values of a file: a column of positions, one per result, optionally its errors.

        position [mm], surface_temperature_mid_face [degC], surface_temperature_mid_face error [K]
        1200, 1043, 10

    Cells may be empty. Either all values have errors, or all belong to one result and none has.
    """
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise InputError(f"{path}: {error}") from None
    names = [heading.name for heading in file.headings]
    where = f"{path}: line {file.line}"
    if not names or names[0] != _POSITION or len(names) < 2 or not file.rows:
        raise InputError(f"{where}: a header and rows are needed, {_SAMPLE}")
    problems = [*_unknown_columns(names), *_wrong_units(file.headings)]
    if problems:
        raise InputError([f"{where}: {problem}" for problem in problems])
    found: list[Measured] = []
    for row in file.rows:
        where = f"{path}: line {row.line}"
        if len(row.cells) != len(names):
            fix = f"; {DECIMAL_COMMAS}" if len(row.cells) > len(names) else ""
            raise InputError(f"{where}: {len(row.cells)} cells, not {len(names)}{fix}")
        cells = {h.name: (h, c) for h, c in zip(file.headings, row.cells, strict=True) if c}
        found += _values(cells, where)
    _check_errors(path, found)
    return found


def _values(cells: dict[str, tuple[Heading, str]], where: str) -> Iterator[Measured]:
    """Values of a row, from its cells by column."""
    if _POSITION not in cells:
        raise InputError(f"{where}: the position is missing")
    place = _si(*cells[_POSITION], where)
    if place < 0.0:
        raise InputError(f"{where}: the position lies above the meniscus, from which it counts")
    for name, cell in cells.items():
        if name == _POSITION or name.endswith(_ERROR):
            continue
        own = cells.get(name + _ERROR)
        off = math.nan if own is None else _si(*own, where, difference=True)
        if off <= 0.0:
            raise InputError(f"{where}: {name}{_ERROR} must be above 0")
        yield Measured(place, name, _si(*cell, where), off, where)


def _unknown_columns(names: list[str]) -> Iterator[str]:
    for name in names[1:]:
        bare = name.removesuffix(_ERROR)
        if name != bare and bare not in names:
            yield f"{name}: there is no column {bare}"
    for name in {n for n in names if names.count(n) > 1}:
        yield f"{name} appears twice"


def _wrong_units(headings: Iterable[Heading]) -> Iterator[str]:
    """Units of columns with the wrong dimension; unknown results are reported by the run."""
    for heading in headings:
        bare = heading.name.removesuffix(_ERROR)
        unit = (unit_at_probe if is_of_probe(bare) else unit_of)(bare)
        unit = "mm" if bare == _POSITION else unit
        if not heading.unit:
            if unit not in (None, "1", "percent"):
                usual = "K" if bare != heading.name and unit == "degC" else unit
                fix = f"write it in the header, {heading.name} [{usual}]"
                yield f"{heading.name} has no unit; {fix}"
        elif unit is not None and bare != _POSITION:
            try:
                found = fault(bare, f"1 {heading.unit}") if not is_of_probe(bare) else None
                text = misfit(bare, heading.unit) if is_of_probe(bare) else found and found[1]
            except ValueError as error:
                text = str(error)
            if text:
                yield f"{heading.text.strip()}: {text}"


def _si(heading: Heading, cell: str, where: str, *, difference: bool = False) -> float:
    try:
        number = float(cell)
        if not math.isfinite(number):
            raise ValueError("a finite number is needed")
        if not heading.unit:
            return number
        text = f"{cell} {heading.unit}"
        if heading.name == _POSITION:
            return units.parse(text, "m")
        value, si = units.parse_any(text)
        return units.parse(text, "K", difference=True) if difference and si == "K" else value
    except ValueError as error:
        raise InputError(f"{where}: {heading.text.strip()} ({cell}): {error}") from None


def _check_errors(path: Path, found: list[Measured]) -> None:
    """Refuse values of several results without errors."""
    if not found:
        raise InputError(f"{path}: holds no measured value")
    missing = [m for m in found if not math.isfinite(m.error)]
    if missing and len(missing) < len(found):
        name, place = missing[0].name, 1e3 * missing[0].position
        raise InputError(
            f"{path}: {name} at {place:g} mm has no error, but others have; give all of them, "
            f"{name}{_ERROR}, or none"
        )
    names = {m.name for m in found}
    if len(names) > 1 and missing:
        raise InputError(
            f"{path}: values of {len(names)} results need their errors, by which they are weighed: "
            f"a column {min(names)}{_ERROR}"
        )


def residuals(measured: Sequence[Measured], computed: Sequence[Quantity]) -> Array:
    """(computed - measured)/error (n,), the difference in SI if there is no error."""
    found = []
    for data, ours in zip(measured, computed, strict=True):
        if not math.isfinite(ours.value):
            raise InputError(
                f"{data.where} has no value at {1e3 * data.position:g} mm to compare with"
            )
        found.append((ours.value - data.value) / (data.error if data.error > 0.0 else 1.0))
    return np.array(found)


_UNITS = dict((*HEAT, *PHASES, *MECHANICS))
_DOT = "."  # between the name of the probe and that of its column


def is_of_probe(name: str) -> bool:
    """Return whether a measured column belongs to a probe."""
    return _DOT in name


def unit_at_probe(name: str) -> str | None:
    """Return the unit of a column of a probe, "1" for none; None if there is no such column."""
    unit = _UNITS.get(name.rpartition(_DOT)[2])
    return "1" if unit == "-" else unit


def misfit(name: str, unit: str) -> str:
    """Return why a unit does not fit a column of a probe; "" if it fits, or is unknown."""
    wanted = unit_at_probe(name)
    if wanted is None or parse_any(f"1 {unit}")[1] == parse_any(f"1 {wanted}")[1]:
        return ""
    return f'("{unit}") does not measure {name}; it has a unit such as "{wanted}"'


def missing_column(case: Case, name: str) -> str:
    """Return why a case has no such column of a probe; "" if it has."""
    probe, _, column = name.rpartition(_DOT)
    copper = thermocouples(case)
    names = [*(one.name for one in case.output.probe), *copper]
    if probe not in names:
        there = choices(names) if names else "none; add [[output.probe]]"
        return f"the case has no probe {probe}{nearest(probe, names)}; it has {there}"
    strained = () if case.mechanics is None else MECHANICS
    columns = dict(HEAT[:1] if probe in copper else (*HEAT, *PHASES, *strained))
    if column not in columns:
        return f"a probe has no {column}{nearest(column, columns)}; it has {choices(columns)}"
    return ""


def thermocouples(case: Case) -> dict[str, CopperThermocouples]:
    """Return the rows of thermocouples in the copper of a case, by name."""
    tube = None if case.mould is None else case.mould.tube
    return {} if tube is None else {one.name: one for one in tube.thermocouple}


def value_at(folder: Path, name: str, position: float) -> Quantity:
    """Return the value of a run at a probe and a position (m) of the slice."""
    probe, _, column = name.rpartition(_DOT)
    table = read_columns(folder / PROBES_NAME / f"{probe}.csv")
    places = table["position"]
    if column not in table or not len(places) or not places[0] <= position <= places[-1] * 1.000001:
        raise InputError(f"{folder}: probe {probe} has no {column} at {1e3 * position:g} mm")
    unit = str(table.attrs["units"][column])
    value = float(np.interp(position, places, table[column]))
    return Quantity(to_si(value, unit), unit, f"{column.replace('_', ' ')} at {probe}")
