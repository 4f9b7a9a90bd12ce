"""The table of a sweep: what was varied and what came of it, one row a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from castfem.base import units
from castfem.base.errors import CastfemError
from castfem.base.shown_quantity import Quantity
from castfem.base.table import Table
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary import Summary
from castfem.runs.results.derived import derived
from castfem.runs.results.places import quantities_at
from castfem.studies.sweep.record import Record, Status

TABLE_NAME = "sweep.csv"


@dataclass(frozen=True, slots=True)
class Row:
    """A run and its results."""

    name: str  #: of the run
    given: Mapping[str, str]  #: key to value of what is varied
    status: Status
    quantities: Mapping[str, Quantity]  #: its results, empty if it has none
    seconds: float  #: duration
    message: str  #: why it failed
    label: str = ""  #: what it is called, if not by what is varied


def rows(names: Iterable[str], record: Record, at: Sequence[float] = ()) -> list[Row]:
    """Return the rows of a sweep as it stands.

    Args:
        names: Of its runs.
        record: What has become of them.
        at: Positions, m; the results there stand before those at the end.
    """
    found = []
    for name in names:
        entry, folder = record.entries[name], record.folder / name
        quantities: Mapping[str, Quantity] = {}
        message = entry.message
        if entry.status == "finished":
            try:
                summary = Summary.load(folder)
                quantities = {**summary.quantities, **derived(folder, summary)} if summary else {}
                quantities = {**_results_at(folder, at), **quantities}
            except CastfemError as error:
                message = str(error)
        found.append(
            Row(name, entry.given, entry.status, quantities, entry.seconds, message, entry.label)
        )
    return found


def _results_at(folder: Path, at: Sequence[float]) -> dict[str, Quantity]:
    """Results of a run at some positions, m, by name and position."""
    if not at:
        return {}
    table = read_columns(folder / HISTORY_NAME)
    found = {}
    for position in at:
        place = f"at {1e3 * position:.6g} mm"
        for name, quantity in quantities_at(table, position, folder).items():
            if name != "position":
                found[f"{name} {place}"] = replace(quantity, label=f"{quantity.label}, {place}")
    return found


def write_table(path: Path, table: Sequence[Row]) -> None:
    """Write every quantity of the runs in documented units as CSV, a row a run."""
    keys, cells = varied(table)
    names = {name: q.shown_unit for row in table for name, q in row.quantities.items()}
    results = [f"{name} [{unit}]" for name, unit in names.items()]
    found = []
    for row, own in zip(table, cells, strict=True):
        values = [row.quantities.get(name) for name in names]
        numbers = [f"{q.shown:.12g}" if q and math.isfinite(q.shown) else "" for q in values]
        took = f"{row.seconds:.3f}" if row.seconds else ""
        found.append((row.name, *own, row.status, *numbers, took, row.message))
    heads = ("run", *keys, "status", *results, "wall_time [s]", "message")
    Table(heads, found).write_csv(path)


def varied(table: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Return the headers of what is varied, and its cells row by row.

    The unit goes to the header if all values have the same one.
    """
    headers, columns = [], []
    for key in dict.fromkeys(key for row in table for key in row.given):
        values = [row.given.get(key, "") for row in table]
        parts = [_split(value) if value else ("", None) for value in values]
        shared = {part[1] for part in parts if part} - {None}
        if len(shared) == 1 and all(parts):
            (unit,) = shared
            headers.append(f"{key} [{unit}]" if unit else key)
            columns.append([part[0] if part else "" for part in parts])
        else:
            headers.append(key)
            columns.append([value.strip("\"'") for value in values])
    return headers, [[column[row] for column in columns] for row in range(len(table))]


def _split(value: str) -> tuple[str, str] | None:
    """Return number and unit of a value, None if it is something else."""
    try:
        return units.split(value.strip("\"'"))
    except ValueError:
        return None
