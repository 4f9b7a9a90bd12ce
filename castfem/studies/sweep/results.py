"""The table of a sweep: what was varied and what came of it, one row a run."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from castfem.base import units
from castfem.base.atomic_files import write_text
from castfem.base.errors import CastfemError
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import plain_unit, scale_of
from castfem.post.report.derived import derived
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.headline import headline, plain_label
from castfem.runs.results.places import quantities_at
from castfem.studies.sweep.plan import shortened
from castfem.studies.sweep.record import Record

if TYPE_CHECKING:
    from rich.table import Table

TABLE_NAME = "sweep.csv"
_LEAST = 4  # results that are shown before what was varied has columns of its own


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
    """Write the table as CSV, `name [unit]` in its header, every quantity of the runs.

    Raises:
        RunFailure: It cannot be written.
    """
    keys, cells = _varied(table)
    names = {name: q.shown_unit for row in table for name, q in row.quantities.items()}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    results = [f"{name} [{unit}]" for name, unit in names.items()]
    writer.writerow(["run", *keys, "status", *results, "wall_time [s]", "message"])
    for row, varied in zip(table, cells, strict=True):
        values = [row.quantities.get(name) for name in names]
        numbers = [f"{q.shown:.12g}" if q and math.isfinite(q.shown) else "" for q in values]
        took = f"{row.seconds:.3f}" if row.seconds else ""
        writer.writerow([row.name, *varied, row.status, *numbers, took, row.message])
    write_text(path, text.getvalue(), durable=False)


def printed(table: Sequence[Row], width: int) -> Table:
    """Return the table for the terminal: what was varied, and as many headline results as fit.

    Those that do not are named below it.

    Args:
        table: The runs.
        width: Of the terminal, characters.
    """
    from rich import box
    from rich.table import Table

    found = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    columns, results = _leading_columns(table), _main_columns(table)
    remarks = [_remark(row) for row in table]
    left = width - min(30, max(map(len, remarks)))
    wanted = sum(_width(*column) for column in results[:_LEAST])
    if left - sum(_width(*column) for column in columns) < wanted:
        columns = _folded(columns)
    room = left - sum(_width(*column) for column in columns)
    beside = list(results)
    while beside and (room := room - _width(*beside[0])) >= 0:
        columns.append(beside.pop(0))
    for header, cells in columns:
        lines = any("\n" in cell for cell in cells)
        found.add_column(header, justify="left" if lines else "right", no_wrap=True)
    found.add_column("")
    for number, row in enumerate(table):
        style = "red" if row.status == "failed" else ""
        found.add_row(*(column[number] for _, column in columns), remarks[number], style=style)
    if beside:
        names = ", ".join(" ".join(header.split()) for header, _ in beside)
        found.caption, found.caption_justify = f"not shown, but in {TABLE_NAME}: {names}", "left"
    return found


def _leading_columns(table: Sequence[Row]) -> list[tuple[str, list[str]]]:
    """Header and cells of what tells the runs apart.

    Runs that have names need no values that would be cut.
    """
    columns = []
    named = any(row.label for row in table)
    if named:
        columns.append(("run", [row.label or row.name for row in table]))
    keys, cells = _varied(table)
    for key, values in zip(keys, zip(*cells, strict=True), strict=True):
        short = [shortened(value) for value in values]
        if not named or short == list(values):
            leaf, _, unit = key.partition(" ")
            columns.append((_header(leaf.rpartition(".")[2], unit), short))
    return columns


def _folded(columns: Sequence[tuple[str, list[str]]]) -> list[tuple[str, list[str]]]:
    """What was varied in one column, a line a key: the results are what the table is read for."""
    if len(columns) < 2:
        return list(columns)
    heads = [header.replace("\n", " ").partition(" [") for header, _ in columns]
    names = [name for name, _, _ in heads]
    units_of = [unit.removesuffix("]") for _, _, unit in heads]
    cells = []
    for values in zip(*(cells for _, cells in columns), strict=True):
        lines = [
            f"{name} {value} {unit}".strip()
            for name, value, unit in zip(names, values, units_of, strict=True)
            if value
        ]
        cells.append("\n".join(shortened(line) for line in lines))
    return [("varied", cells)]


def _main_columns(table: Sequence[Row]) -> list[tuple[str, list[str]]]:
    """Header and cells of the headline results, the most wanted first."""
    from castfem.runs.results.numbers import resolution_in, shown

    all_of = [row.quantities for row in table if row.quantities]
    found = []
    placed = [name for q in all_of for name in q if " at " in name]
    wanted = headline(all_of)
    chosen = [n for n in dict.fromkeys(placed) if n.partition(" at ")[0] in wanted]
    chosen.sort(key=lambda name: wanted.index(name.partition(" at ")[0]))
    for name in chosen or wanted:
        some = next(q[name] for q in all_of if name in q)
        quantities = [row.quantities.get(name) for row in table]
        scale = scale_of(some.shown_unit, name.partition(" at ")[0])
        cells = [
            shown(scale(q.shown), scale.unit, resolution_in(scale, q)) if q else "-"
            for q in quantities
        ]
        unit = scale.unit if scale.unit == some.shown_unit else plain_unit(scale.unit)
        found.append((_header(plain_label(some), f"[{unit}]"), cells))
    return found


def _header(name: str, unit: str) -> str:
    """A heading with a word or two on each line."""
    return "\n".join([*textwrap.wrap(name, 12, break_long_words=False), unit]).strip()


def _width(header: str, cells: Sequence[str]) -> int:
    """How wide a column is, with the two spaces behind it."""
    lines = [line for text in (header, *cells) for line in text.split("\n")]
    return max(map(len, lines)) + 2


def _remark(row: Row) -> str:
    if row.status == "finished" and not row.message:
        return ""
    return f"{row.status}: {row.message}" if row.message else row.status


def _varied(table: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
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
