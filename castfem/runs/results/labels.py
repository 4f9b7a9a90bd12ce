"""Results by name: label, unit, resolution of depths by the cells; results at positions."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.result_registry import find
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.shown_units import place_said, plain_unit
from castfem.base.types import Flags
from castfem.runs.output.history import needs_strand
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    from castfem.runs.output.history import Columns


STAIR = 1.0 / 6.0
"""Error of a shell depth as a fraction of the cell that contains the solidus."""
_DEPTH = re.compile(r"(?:shell|liquidus_depth|fs[1-9]\d?)_(\w+)")


def resolved(
    quantities: dict[str, Quantity], cell: Callable[[str], float | None]
) -> dict[str, Quantity]:
    """Return the results, with the depths of isotherms rounded to the resolution of the cells.

    Args:
        quantities: Results by name.
        cell: Size of the cell that contains the solidus, by name of a probe, m; NaN or None if
            there is none. Other isotherms are deeper, in cells that are no smaller.
    """
    found = {}
    for name, one in quantities.items():
        depth = _DEPTH.fullmatch(name)
        size = None if depth is None else cell(depth[1])
        known = size is not None and math.isfinite(size)
        found[name] = replace(one, resolution=STAIR * size) if size and known else one
    return found


_NO_PROBES = ("min", "max")  # suffixes of columns over the whole section


def last_quantities(row: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Quantity]:
    """Return the results of a row by name, in column order; position and time first."""
    results = {}
    for name in sorted(row, key=lambda column: column not in ("position", "time")):
        found = find(name)
        if found is not None and found[0].row:
            definition, probe = found
            results[name] = definition.result(to_si(row[name], units[name]), probe)

    def cell(probe: str) -> float | None:
        name = f"solidus_cell_{probe}"
        return to_si(row[name], units[name]) if name in row else None

    return resolved(results, cell)


def probes_with(table: Columns, prefix: str) -> dict[str, str]:
    """Return probe to column for the columns `prefix_PROBE` with any value.

    Columns of the whole slice with this prefix are not included.
    """
    return {
        name[len(prefix) + 1 :]: name
        for name in map(str, table.columns)
        if name.startswith(f"{prefix}_")
        and name[len(prefix) + 1 :] not in _NO_PROBES
        and ((known := find(name)) is None or known[1])
        and has_values(table, name)
    }


def has_values(table: Columns, name: str) -> bool:
    """Whether a column exists and has any value."""
    return name in table and not np.isnan(table[name]).all()


def beside_wall(table: Columns) -> Flags:
    """Rows (n,) in which a probe has a wall beside it: those in the mould; without a probe all."""
    known = [~np.isnan(table[column]) for column in probes_with(table, "gap").values()]
    return np.any(known, axis=0) if known else np.ones(len(table), dtype=bool)


def unit_of(table: Columns, name: str) -> str:
    """Unit of a column as written in figures."""
    return plain_unit(str(table.attrs["units"][name]))


def read_positions(given: Sequence[str]) -> list[float]:
    """Convert positions given by a user, such as "800 mm", to m."""
    found, problems = [], []
    for text in given:
        try:
            found.append(units.parse(text, "m"))
        except ValueError as error:
            problems.append(f"--at {text}: {error}")
    if problems:
        raise InputError(problems)
    return found


def read_number(name: str, given: float | str | None, unit: str) -> float | None:
    """Convert a number in SI units, or a text with a unit, to SI; None is returned unchanged.

    Raises:
        InputError: It is neither; `name` says what is meant.
    """
    if given is None or (isinstance(given, Real) and not isinstance(given, bool)):
        return None if given is None else float(given)
    if not isinstance(given, str):
        raise InputError(
            f"{name}: must be a number in {unit}, or one with its unit (given: {given!r})"
        )
    try:
        return units.parse(given, unit)
    except ValueError as error:
        raise InputError(f"{name} {given}: {error}") from None


def quantities_at(
    table: Columns,
    position: float,
    folder: Path | str,
    summary: Summary | None = None,
) -> dict[str, Quantity]:
    """Return the results at a position of the slice, by linear interpolation between two rows.

    Raises:
        InputError: The run has not reached it.
    """
    columns = {str(name): np.asarray(table[name]) for name in table}
    needs_strand(columns, folder)
    places = columns["position"]
    start, end = float(places[0]), float(places[-1])
    slack = ROUNDING * max(end, 1e-3)
    if not start - slack <= position <= end + slack:
        raise InputError(
            f"{folder}: {place_said(position)} is not between {place_said(start)} and "
            f"{place_said(end)}, where the run begins and ends; ask for a place within, or run it "
            "farther (casting.length)"
        )
    # A stopped strand passes a position more than once: the first time counts.
    after = min(int(np.searchsorted(places, position - slack)), len(places) - 1)
    if abs(places[after] - position) <= slack or after == 0:
        values = {name: float(column[after]) for name, column in columns.items()}
    else:
        share = (position - places[after - 1]) / (places[after] - places[after - 1])
        values = {
            name: float(column[after - 1] + share * (column[after] - column[after - 1]))
            for name, column in columns.items()
        }
    found = last_quantities(values, table.attrs["units"])
    errors = {} if summary is None else summary.errors_near(position)
    return {name: replace(one, error=errors.get(name)) for name, one in found.items()}
