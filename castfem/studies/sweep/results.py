"""The table of a sweep: what was varied and what came of it, one row a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from castfem.base import units
from castfem.base.errors import CastfemError
from castfem.base.shown_quantity import Quantity
from castfem.base.table import Table
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.derived import derived
from castfem.runs.results.places import quantities_at
from castfem.studies.sweep.record import Record

TABLE_NAME = "sweep.csv"


@dataclass(frozen=True, slots=True)
class Row:
    """A run and its results.

    Attributes:
        name: Of the run.
        given: Key to value of what is varied.
        status: "finished", "failed" or "waiting".
        quantities: Its results, empty if it has none.
        seconds: How long it took.
        message: Why it failed.
        label: What it is called, if not by what is varied.
    """

    name: str
    given: Mapping[str, str]
    status: str
    quantities: Mapping[str, Quantity]
    seconds: float
    message: str
    label: str = ""


class Named(Protocol):
    """A run as its row has it, a `Variant` or what is left of one of an earlier call."""

    @property
    def name(self) -> str:
        """Of its folder."""

    @property
    def given(self) -> Mapping[str, str]:
        """Key to value of what is varied."""

    @property
    def label(self) -> str:
        """What it is called, if not by what is varied."""


def rows(variants: Sequence[Named], record: Record, at: Sequence[float] = ()) -> list[Row]:
    """Return the rows of a sweep as it stands.

    Args:
        variants: Its runs.
        record: What has become of them.
        at: Positions, m; the results there stand before those at the end.
    """
    found = []
    for variant in variants:
        entry = record.entries[variant.name]
        status = "failed" if entry.message else "finished" if entry.physics else "waiting"
        quantities: Mapping[str, Quantity] = {}
        message = entry.message
        if status == "finished":
            try:
                summary = Summary.load(record.folder / variant.name)
                folder = record.folder / variant.name
                quantities = {**summary.quantities, **derived(folder, summary)} if summary else {}
                quantities = {**_results_at(folder, at), **quantities}
            except CastfemError as error:
                message = str(error)
        found.append(
            Row(
                variant.name,
                variant.given,
                status,
                quantities,
                entry.seconds,
                message,
                variant.label,
            )
        )
    return found


def _results_at(folder: Path, at: Sequence[float]) -> dict[str, Quantity]:
    """Results of a run at some positions, m, by name and position.

    Raises:
        InputError: It has no history, or has not been there.
    """
    if not at:
        return {}
    table = read_history(folder / HISTORY_NAME)
    found = {}
    for position in at:
        place = f"at {1e3 * position:.6g} mm"
        for name, quantity in quantities_at(table, position, folder).items():
            if name != "position":
                found[f"{name} {place}"] = replace(quantity, label=f"{quantity.label}, {place}")
    return found


def write_table(path: Path, table: Sequence[Row]) -> None:
    """Write every quantity of the runs in documented units as CSV, a row a run.

    Raises:
        RunFailure: It cannot be written.
    """
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
    for key in table[0].given if table else ():
        values = [row.given[key] for row in table]
        numbers = [_split(value) for value in values]
        common = {unit for pair in numbers if pair for unit in [pair[1]]}
        if len(common) == 1 and all(pair or not v for pair, v in zip(numbers, values, strict=True)):
            (unit,) = common
            headers.append(f"{key} [{unit}]" if unit else key)
            columns.append([pair[0] if pair else "" for pair in numbers])
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
