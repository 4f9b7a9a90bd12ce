"""What was measured on a strand, as a CSV file has it: positions, results, their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.csv_files import DECIMAL_COMMAS, Heading, UnreadableError, read_csv
from castfem.base.errors import InputError
from castfem.base.result_registry import fault, unit_of
from castfem.base.shown_quantity import Quantity
from castfem.base.units import nearest
from castfem.studies.optimisation.probe_data import is_of_probe, misfit, unit_at_probe

if TYPE_CHECKING:
    from collections.abc import Iterable

_ERROR = " error"  # ends the name of a column of errors
_POSITION = "position"
_SAMPLE = "position [mm], surface_temperature_mid_face [degC]"


@dataclass(frozen=True, slots=True)
class Measured:
    """One measured value.

    Attributes:
        position: Below the meniscus, m.
        name: Of the result, as in history.csv; `tc1.temperature` of the probe tc1.
        value: In SI. error: Its standard deviation in SI; NaN where none is given.
        source: File and line it is from, "" for none.
    """

    position: float
    name: str
    value: float
    error: float
    source: str = ""

    @property
    def where(self) -> str:
        """What a message about it begins with."""
        return f"{self.source}: {self.name}" if self.source else self.name


def read_measured(path: Path, known: Iterable[str] = ()) -> list[Measured]:
    """Return the values of a file: a column of positions, one a result, and perhaps its errors.

        position [mm], surface_temperature_mid_face [degC], surface_temperature_mid_face error [K]
        1200, 1043, 10

    Cells may be empty. Either all values have errors, or all are of one result and none has.

    Args:
        path: The file.
        known: Names of results that the case has; none: any will do.

    Raises:
        InputError: The file cannot be used; it names the line and the column.
    """
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise InputError(f"{path}: {error}") from None
    names = [heading.name for heading in file.headings]
    if not names or names[0] != _POSITION or len(names) < 2 or not file.rows:
        raise InputError(f"{path}: line {file.line}: a header and rows are needed, {_SAMPLE}")
    problems = list(_unknown(path, file.line, names, list(known)))
    problems += _misfits(path, file.line, file.headings)
    if problems:
        raise InputError(problems)
    found: list[Measured] = []
    for row in file.rows:
        where = f"{path}: line {row.line}"
        if len(row.cells) != len(names):
            mend = f"; {DECIMAL_COMMAS}" if len(row.cells) > len(names) else ""
            raise InputError(f"{where}: {len(row.cells)} cells, not {len(names)}{mend}")
        cells = {n: (h, c) for n, h, c in zip(names, file.headings, row.cells, strict=True) if c}
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
            found.append(Measured(place, name, _si(*cell, where), off, where))
    _check_errors(path, found)
    return found


def _unknown(path: Path, line: int, names: list[str], known: list[str]) -> Iterable[str]:
    """What is wrong with the columns."""
    for name in names[1:]:
        bare = name.removesuffix(_ERROR)
        if name != bare and bare not in names:
            yield f"{path}: line {line}: {name}: there is no column {bare}"
        elif known and bare not in known:
            yield f"{path}: line {line}: {bare}: no such result of this case{nearest(bare, known)}"
    for name in {n for n in names if names.count(n) > 1}:
        yield f"{path}: line {line}: {name} stands there twice"


def _misfits(path: Path, line: int, headings: Iterable[Heading]) -> Iterable[str]:
    """Units of columns that do not measure their results; unknown results are left to the run."""
    for heading in headings:
        bare = heading.name.removesuffix(_ERROR)
        known = unit_at_probe if is_of_probe(bare) else unit_of
        unit = "mm" if bare == _POSITION else known(bare)
        if not heading.unit and unit not in (None, "1", "percent"):
            usual = "K" if bare != heading.name and unit == "degC" else unit
            told = f"{heading.name} has no unit; write it in the header, {heading.name} [{usual}]"
            yield f"{path}: line {line}: {told}"
            continue
        if not heading.unit or unit is None or bare == _POSITION:
            continue
        try:
            if is_of_probe(bare):
                text = misfit(bare, heading.unit)
                found = ("value", text) if text else None
            else:
                found = fault(bare, f"1 {heading.unit}")
        except ValueError as error:
            found = "value", str(error)
        if found is not None:
            yield f"{path}: line {line}: {heading.text.strip()}: {found[1]}"


def _si(heading: Heading, cell: str, where: str, *, difference: bool = False) -> float:
    """A cell in SI."""
    try:
        number = float(cell)
        if not math.isfinite(number):
            raise ValueError("a finite number is needed")
        if not heading.unit:
            return number
        if heading.name == _POSITION:
            return units.parse(f"{cell} {heading.unit}", "m")
        value, si = units.parse_any(f"{cell} {heading.unit}")
        if difference and si == "K":
            return units.parse(f"{cell} {heading.unit}", "K", difference=True)
        return value
    except ValueError as error:
        raise InputError(f"{where}: {heading.text.strip()} ({cell}): {error}") from None


def _check_errors(path: Path, found: list[Measured]) -> None:
    """Refuse values of several results whose weights nobody has told."""
    if not found:
        raise InputError(f"{path}: holds no measured value")
    having = [math.isfinite(m.error) for m in found]
    if any(having) and not all(having):
        missing = next(m for m in found if not math.isfinite(m.error))
        raise InputError(
            f"{path}: {missing.name} at {1e3 * missing.position:g} mm has no error and others "
            f"have; give all of them, {missing.name}{_ERROR}, or none"
        )
    names = {m.name for m in found}
    if len(names) > 1 and not all(having):
        one = min(names)
        raise InputError(
            f"{path}: values of {len(names)} results need their errors, by which they are weighed: "
            f"a column {one}{_ERROR}"
        )


def residuals(measured: list[Measured], computed: list[Quantity | None]) -> np.ndarray:
    """(computed - measured)/error, the difference in SI where there is no error (n,)."""
    found = []
    for data, ours in zip(measured, computed, strict=True):
        if ours is None or not math.isfinite(ours.value):
            raise InputError(
                f"{data.where} has no value at {1e3 * data.position:g} mm to compare with"
            )
        found.append((ours.value - data.value) / (data.error if data.error > 0.0 else 1.0))
    return np.array(found)
