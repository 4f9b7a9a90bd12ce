"""The tables of studies: results of a sweep, errors of a case."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from castfem.base.shown_quantity import Quantity, to_si, unit_of_difference
from castfem.base.shown_units import Scale, place_said, plain_unit, scale_of
from castfem.base.table import FAILED, Table
from castfem.runs.results.headline import headline, plain_label
from castfem.runs.results.numbers import error_shown, resolution_in, shown, unit_shown
from castfem.studies.accuracy.estimate import Estimate
from castfem.studies.accuracy.table import Entry, ErrorTable
from castfem.studies.sweep.plan import shortened
from castfem.studies.sweep.record import TABLE_NAME, Row, varied

if TYPE_CHECKING:
    import pandas

_Column = tuple[str, list[str]]
"""Heading and cells."""


def sweep_table(table: Sequence[Row], width: int) -> Table:
    """The varied values, and as many headline results as fit beside them in `width` characters."""
    columns, results = _leading_columns(table), _main_columns(table)
    remarks = [_remark(row) for row in table]
    left = width - min(30, max(map(len, remarks)))
    wanted = sum(map(_width, results[:4]))  # shown before all varied values have their own columns
    if left - sum(map(_width, columns)) < wanted:
        columns = _folded(columns)
    room = left - sum(map(_width, columns))
    beside = list(results)
    while beside and (room := room - _width(beside[0])) >= 0:
        columns.append(beside.pop(0))
    words = [i for i, (_, cells) in enumerate(columns) if any("\n" in cell for cell in cells)]
    rows = [
        (*(cells[number] for _, cells in columns), remark) for number, remark in enumerate(remarks)
    ]
    names = ", ".join(" ".join(heading.replace("-\n", "-").split()) for heading, _ in beside)
    return Table(
        (*(heading for heading, _ in columns), ""),
        rows,
        words=(*words, len(columns)),
        notes=[f"not shown, but in {TABLE_NAME}: {names}"] if beside else [],
        marks={(i, -1): FAILED for i, row in enumerate(table) if row.status == FAILED},
    )


def _leading_columns(table: Sequence[Row]) -> list[_Column]:
    """Header and cells of the columns that distinguish the runs.

    Named runs need no varied values that would be cut off.
    """
    columns = []
    named = any(row.label for row in table)
    if named:
        columns.append(("run", [row.label or row.name for row in table]))
    keys, cells = varied(table)
    for key, values in zip(keys, zip(*cells, strict=True), strict=True):
        short = [shortened(value) for value in values]
        if not named or short == list(values):
            leaf, _, unit = key.partition(" ")
            columns.append((_header(leaf.rpartition(".")[2], unit), short))
    return columns


def _folded(columns: Sequence[_Column]) -> list[_Column]:
    """Varied values in one column, one line per key: the table is for the results."""
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


def _main_columns(table: Sequence[Row]) -> list[_Column]:
    """Header and cells of the headline results, the most important first."""
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
        found.append((_header(plain_label(some), f"[{plain_unit(scale.unit)}]"), cells))
    return found


def _header(name: str, unit: str) -> str:
    """A heading with one or two words per line."""
    return "\n".join([*textwrap.wrap(name, 12, break_long_words=False), unit]).strip()


def _width(column: _Column) -> int:
    """Width of a column, including the gap after it."""
    heading, cells = column
    return max(len(line) for text in (heading, *cells) for line in text.split("\n")) + 2


def _remark(row: Row) -> str:
    """Status of a run, unless it has finished."""
    if row.status == "finished" and not row.message:
        return ""
    return f"{row.status}: {row.message}" if row.message else row.status


def error_tables(table: ErrorTable) -> list[Table]:
    """The errors at positions along the strand and at the end of the run, the latter last."""
    ways = [(f"At {place_said(at)}", entries) for at, entries in table.places.items()]
    end = [("At the end of the run" if ways else "", table.quantities)]
    return [_errors(title, entries) for title, entries in (*ways, *end)]


def _errors(title: str, entries: Mapping[str, Entry]) -> Table:
    """The headline numbers with their errors and the parts of these.

    The observed order of convergence, if any, follows each part in brackets.
    """
    axes = list(dict.fromkeys(axis for e in entries.values() for axis in e.parts))
    rows = []
    for name in main_names(entries):
        entry = entries[name]
        scale = scale_of(entry.unit, name)
        rows.append(
            (
                plain_label(quantity_of(entry)),
                shown(scale(entry.value), scale.unit),
                error_shown(scale.factor * entry.error(), scale.unit),
                unit_shown(scale.unit),
                *(_part(entry.parts.get(axis), scale) for axis in axes),
            )
        )
    heads = ("quantity", "castfem", "\N{PLUS-MINUS SIGN}", "unit", *(f"from\n{a}" for a in axes))
    return Table(heads, rows, title, words=(0, 3))


def _part(part: Estimate | None, scale: Scale) -> str:
    if part is None or not math.isfinite(part.error):
        return "-"
    order = f" ({part.order:.1f})" if part.order is not None else ""
    return error_shown(scale.factor * part.error) + order


def without_error(table: ErrorTable) -> list[str]:
    """Return a line for each run without results, and one for the numbers without an error."""
    lost = [
        plain_label(quantity_of(entry))
        for entry in (table.quantities[name] for name in main_names(table.quantities))
        if not math.isfinite(entry.error())
    ]
    none = [f"no error of {', '.join(lost)}: too few runs to estimate it"] if lost else []
    return none + [
        f"{run.axis} x {run.factor:.3g}: no result of this run: {run.message}"
        for run in table.runs
        if run.message
    ]


def sweep_in_si(table: Sequence[Row]) -> pandas.DataFrame:
    """Return the varied values of a sweep and the results in SI, one row per run."""
    import pandas

    content: list[dict[str, Any]] = []
    for row in table:
        results = {name: quantity.value for name, quantity in row.quantities.items()}
        varied = {key: value.strip('"') for key, value in row.given.items()}
        ended = {"seconds": row.seconds, "message": row.message}
        content.append({"run": row.name, **varied, "status": row.status, **results, **ended})
    return pandas.DataFrame(content).set_index("run")


def errors_in_si(found: ErrorTable) -> pandas.DataFrame:
    """Return the errors of a case in SI, one row per result."""
    import pandas

    rows = []
    for name, entry in found.quantities.items():
        value = to_si(entry.value, entry.unit)
        unit = unit_of_difference(entry.unit)
        row: dict[str, Any] = {
            "name": name,
            "label": entry.label,
            "unit": Quantity(value, entry.unit, "").unit,
        }
        row |= {"value": value, "error": to_si(entry.error(), unit)}
        rows.append(row | {axis: to_si(part.error, unit) for axis, part in entry.parts.items()})
    table = pandas.DataFrame(rows).set_index("name")
    table.attrs["not run"] = {run.name: run.message for run in found.runs if run.message}
    return table


def main_names(entries: Mapping[str, Entry]) -> list[str]:
    """Return the headline numbers with an error."""
    return headline([{n: quantity_of(e) for n, e in entries.items()}])


def quantity_of(entry: Entry) -> Quantity:
    """Return a number in the form of results, without its error."""
    return Quantity(to_si(entry.value, entry.unit), entry.unit, entry.label)
