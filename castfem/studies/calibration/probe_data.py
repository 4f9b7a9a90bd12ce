"""Measured values at points of a case: `tc1.temperature` is of a probe or a thermocouple tc1.

A probe, `[[output.probe]]`, lies in the strand; the thermocouples of `[[mould.tube.thermocouple]]`
lie in the copper, whose temperature follows from the heat that a run gives to the wall.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castfem.base.errors import InputError, choices
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.units import nearest, parse_any
from castfem.model import Case
from castfem.model.mould import CopperThermocouples
from castfem.runs.output.folder import PROBES_NAME
from castfem.runs.output.history import read_columns
from castfem.runs.results.probes import HEAT, MECHANICS, PHASES

_UNITS = dict((*HEAT, *PHASES, *MECHANICS))
_DOT = "."  # between the name of the probe and that of its column


def is_of_probe(name: str) -> bool:
    """Return whether a measured column is of a probe."""
    return _DOT in name


def unit_at_probe(name: str) -> str | None:
    """Return the unit of a column of a probe, "1" for none; None if there is no such column."""
    unit = _UNITS.get(name.rpartition(_DOT)[2])
    return "1" if unit == "-" else unit


def misfit(name: str, unit: str) -> str:
    """Return why a unit does not measure a column of a probe; "" if it does, or is not known."""
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
    """Return what a run has at a probe where the slice came to a position (m).

    Raises:
        InputError: It has no such probe, or has not been there.
    """
    probe, _, column = name.rpartition(_DOT)
    table = read_columns(folder / PROBES_NAME / f"{probe}.csv")
    places = table["position"]
    if column not in table or not len(places) or not places[0] <= position <= places[-1] * 1.000001:
        raise InputError(f"{folder}: probe {probe} has no {column} at {1e3 * position:g} mm")
    unit = str(table.attrs["units"][column])
    value = float(np.interp(position, places, table[column]))
    return Quantity(to_si(value, unit), unit, f"{column.replace('_', ' ')} at {probe}")
