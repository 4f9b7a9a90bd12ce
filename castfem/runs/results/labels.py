"""Label and unit of each result, by its name in the summary and in the history."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from castfem.base.result_registry import find
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.shown_units import plain_unit
from castfem.runs.results.resolution import resolved

if TYPE_CHECKING:
    import pandas

_NO_PROBES = ("min", "max")  # ends of names of columns over the whole section


def last_quantities(row: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Quantity]:
    """Return the results of a row by name, in the order of its columns; position and time first.

    Args:
        row: Column to value; what is no result is left out.
        units: Of the values.
    """
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


def probes_with(table: pandas.DataFrame, prefix: str) -> dict[str, str]:
    """Probe to column, of the columns `prefix_PROBE` that hold any number.

    A column of the whole slice that begins so is none of them.
    """
    return {
        name[len(prefix) + 1 :]: name
        for name in map(str, table.columns)
        if name.startswith(f"{prefix}_")
        and name[len(prefix) + 1 :] not in _NO_PROBES
        and ((known := find(name)) is None or known[1])
        and table[name].notna().any()
    }


def has_values(table: pandas.DataFrame, name: str) -> bool:
    """Whether a column is there and holds any number."""
    return name in table and bool(table[name].notna().any())


def unit_of(table: pandas.DataFrame, name: str) -> str:
    """The unit of a column as figures write it."""
    return plain_unit(str(table.attrs["units"][name]))
