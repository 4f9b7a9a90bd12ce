"""Label and unit of results by their names, and how exactly depths are resolved by the cells."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.result_registry import find
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.shown_units import plain_unit
from castfem.base.types import Flags

if TYPE_CHECKING:
    from castfem.runs.output.history import Columns


STAIR = 1.0 / 6.0
"""Of the cell in which the solidus lies: how far the curve of the shell is off."""
_DEPTH = re.compile(r"(?:shell|liquidus_depth|fs[1-9]\d?)_(\w+)")


def resolved(
    quantities: dict[str, Quantity], cell: Callable[[str], float | None]
) -> dict[str, Quantity]:
    """Return results, depths of isotherms among them with what their cells resolve.

    Args:
        quantities: By name.
        cell: Size of the cell in which the solidus lies, by the name of a probe, m; NaN or None
            where there is none. The other isotherms lie deeper, in cells that are no smaller.
    """
    found = {}
    for name, one in quantities.items():
        depth = _DEPTH.fullmatch(name)
        size = None if depth is None else cell(depth[1])
        known = size is not None and math.isfinite(size)
        found[name] = replace(one, resolution=STAIR * size) if size and known else one
    return found


_NO_PROBES = ("min", "max")  # ends of names of columns over the whole section


def last_quantities(row: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Quantity]:
    """Return the results of a row by name, in the order of its columns; position and time first."""
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
    """Probe to column, of the columns `prefix_PROBE` that hold any number.

    A column of the whole slice that begins so is none of them.
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
    """Whether a column is there and holds any number."""
    return name in table and not np.isnan(table[name]).all()


def beside_wall(table: Columns) -> Flags:
    """Rows (n,) in which a probe has a wall beside it: those in the mould; all without a probe."""
    known = [~np.isnan(table[column]) for column in probes_with(table, "gap").values()]
    return np.any(known, axis=0) if known else np.ones(len(table), dtype=bool)


def unit_of(table: Columns, name: str) -> str:
    """The unit of a column as figures write it."""
    return plain_unit(str(table.attrs["units"][name]))
