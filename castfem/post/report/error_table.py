"""The table of errors for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.shown_units import Scale, place_said, scale_of
from castfem.runs.results.headline import headline, plain_label
from castfem.runs.results.numbers import error_shown, shown, unit_shown
from castfem.studies.accuracy.table import Entry, ErrorTable, Part

if TYPE_CHECKING:
    from rich.table import Table


def main_names(entries: Mapping[str, Entry]) -> list[str]:
    """Return the headline numbers that have an error."""
    return headline([{n: quantity_of(e) for n, e in entries.items()}])


def quantity_of(entry: Entry) -> Quantity:
    """Return a number as results have it, without its error."""
    return Quantity(to_si(entry.value, entry.unit), entry.unit, entry.label)


def printed(table: ErrorTable) -> list[Table]:
    """Return the tables of the end of the run and of places on its way, the latter first."""
    ways = [(f"At {place_said(at)}", entries) for at, entries in table.places.items()]
    end = [("At the end of the run" if ways else "", table.quantities)]
    return [_table(title, entries) for title, entries in (*ways, *end)]


def _table(title: str, entries: Mapping[str, Entry]) -> Table:
    """Return the headline numbers with their errors and what makes these.

    Behind the part of each of the sizes stands the order of convergence in brackets, where one
    shows.
    """
    from rich import box
    from rich.table import Table

    found = Table(
        title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD,
        show_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    axes = list(dict.fromkeys(axis for e in entries.values() for axis in e.parts))
    found.add_column("quantity", overflow="fold")  # rich would cut off what is one long word
    found.add_column("castfem", justify="right", no_wrap=True)
    found.add_column("\N{PLUS-MINUS SIGN}", justify="right", no_wrap=True)
    found.add_column("unit", no_wrap=True)
    for axis in axes:
        found.add_column(f"from\n{axis}", justify="right", no_wrap=True)
    for name in main_names(entries):
        entry = entries[name]
        scale = scale_of(entry.unit, name)
        found.add_row(
            plain_label(quantity_of(entry)),
            shown(scale(entry.value), scale.unit),
            error_shown(scale.factor * entry.error(), scale.unit),
            unit_shown(scale.unit),
            *(_part(entry.parts.get(axis), scale) for axis in axes),
        )
    return found


def _part(part: Part | None, scale: Scale) -> str:
    if part is None or not math.isfinite(part.error):
        return "-"
    order = f" ({part.order:.1f})" if part.order is not None else ""
    return error_shown(scale.factor * part.error) + order


def unknown(table: ErrorTable) -> list[str]:
    """Return a line for each run that told nothing, and for the numbers that have no error."""
    lost = [
        plain_label(quantity_of(entry))
        for entry in (table.quantities[name] for name in main_names(table.quantities))
        if not math.isfinite(entry.error())
    ]
    none = [f"no error of {', '.join(lost)}: too few of the runs tell it"] if lost else []
    return none + [
        f"{run.axis} x {run.factor:.3g}: nothing of this run: {run.message}"
        for run in table.runs
        if run.message
    ]
