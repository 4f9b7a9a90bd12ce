"""Label and unit of each result, by its name in the summary and in the history."""

from __future__ import annotations

from collections.abc import Mapping

from castfem.base.result_registry import find
from castfem.base.shown_quantity import Quantity, to_si
from castfem.runs.results.resolution import resolved


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
