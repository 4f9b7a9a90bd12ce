"""Checks a choice of units against the known quantities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.result_registry import declared, result_names, usual_unit
from castfem.base.shown_units import (
    KINDS,
    SYSTEMS,
    ShownUnits,
    check,
    coherent,
    is_chosen,
    scale_of,
)


def faults(choice: ShownUnits) -> Iterator[tuple[str, str]]:
    """Yield unknown quantities, and units of another dimension."""
    for name in choice.names:
        usual = usual_unit(name)
        if usual is None:
            known = (*KINDS, "system", *(d.name for d in declared()), *result_names())
            near = units.nearest(name, known) or f"; what is measured is {', '.join(KINDS)}"
            yield name, f"is no kind of quantity and no result of a run{near}"
            continue
        if coherent(usual) == "1":
            yield name, "is a plain number or a percentage, which has no other unit"
            continue
        try:
            check(name, coherent(usual), choice.own[name])
        except ValueError as error:
            yield name, str(error).removeprefix(f"{name}: ")


def read_choice(given: Sequence[str]) -> ShownUnits:
    """Return a choice made on the command line: "si", "plant", or NAME=UNIT.

    Raises:
        InputError: It cannot be read, or a unit has another dimension.
    """
    table: dict[str, str] = {}
    for text in given:
        name, is_one, unit = text.partition("=")
        if not is_one and text not in SYSTEMS:
            raise InputError(f"--units {text}: plant, si, or NAME=UNIT such as temperature=degF")
        table |= {name.strip(): unit.strip()} if is_one else {"system": text}
    try:
        choice = ShownUnits.read(table)
    except ValueError as error:
        raise InputError(f"--units {error}") from None
    problems = [f"--units {name}: {text}" for name, text in faults(choice)]
    if problems:
        raise InputError(problems)
    return choice


def with_units(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a case with their quantities in the chosen units."""
    if not is_chosen():
        return dict(tables)
    found = {key: _turned(value) for key, value in tables.items()}
    for key, unit in tables.items():
        if key == "unit" or key.endswith("_unit"):
            of = "value" if key == "unit" else key.removesuffix("_unit")
            if isinstance(tables.get(of), list) and isinstance(unit, str):
                found[of], found[key] = _column(tables[of], unit)
    return found


def _turned(value: Any) -> Any:
    """Convert the quantities in a value of a case to the chosen units."""
    if isinstance(value, Mapping):
        return with_units(value)
    if isinstance(value, list):
        return [_turned(one) for one in value]
    try:
        number, unit = units.split(value) if isinstance(value, str) else ("", "")
        if not number or not unit:
            return value
        (shown,), its = _column([float(number)], unit)
    except ValueError:  # not a quantity
        return value
    return f"{shown:.7g} {its}"


def _column(values: Sequence[Any], unit: str) -> tuple[list[Any], str]:
    """Convert values to the chosen units; return them with their unit."""
    try:
        scale = scale_of(unit)
    except ValueError:  # such as in a user's property file
        return list(values), unit
    turned = [scale(one) if isinstance(one, int | float) else one for one in values]
    return [float(f"{v:.9g}") if isinstance(v, float) else v for v in turned], scale.unit
