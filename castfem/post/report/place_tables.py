"""The table of results at several places of one run, as wide as the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import Scale, place_said, scale_of
from castfem.post.report.places import Place, places_of, table_names
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.numbers import resolution_in, shown, unit_shown, with_error
from castfem.runs.results.places import quantities_at

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_SPACES = 2  # behind a column


def print_places(out: Console, folder: Path, positions: Sequence[float]) -> None:
    """Print all results at some positions, m.

    Raises:
        InputError: There is no history, or the run has not been there.
    """
    table = read_history(folder / HISTORY_NAME)
    if table.empty:
        raise InputError(f"{folder}: no step has been taken yet")
    places = [Place("", position) for position in positions]
    summary = Summary.load(folder)
    runs = [quantities_at(table, position, folder, summary) for position in positions]
    names = [n for n in table_names(runs, everything=True) if n != "position"]
    for block in _blocks("Results on the way", places, runs, names, out.width):
        out.print(block, "", highlight=False)


def print_along(out: Console, folder: Path, summary: Summary | None) -> None:
    """Print what there is at the ends of zones, bending and straightening, if there are any."""
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:
        return
    if len(table) < 2 or "position" not in table:
        return
    position = table["position"]
    start, end = float(position.iloc[0]), float(position.iloc[-1])
    places = [place for place in places_of(folder, summary, end) if place.position >= start]
    if len(places) < 2:
        return
    runs = [quantities_at(table, place.position, folder, summary) for place in places]
    for block in _blocks("Along the strand", places, runs, table_names(runs), out.width):
        out.print(block, "", highlight=False)


def _blocks(
    title: str,
    places: Sequence[Place],
    runs: Sequence[Mapping[str, Quantity]],
    names: Sequence[str],
    width: int,
) -> list[Table]:
    """Tables with a row a quantity and a column a place, equally many columns in each."""
    some = {name: next(run[name] for run in runs if name in run) for name in names}
    first = [("quantity", [q.label for q in some.values()])]
    scales = {name: scale_of(q.shown_unit, name) for name, q in some.items()}
    first.append(("unit", [unit_shown(scale.unit) for scale in scales.values()]))
    columns = [
        (_heading(place), [_cell(run.get(name), scales[name]) for name in names])
        for place, run in zip(places, runs, strict=True)
    ]
    room = width - sum(_width(*column) for column in first)
    fitting = max(1, room // max(_width(*column) for column in columns))
    count = -(-len(columns) // fitting)
    each = -(-len(columns) // count)
    return [_block(title, [*first, *columns[i : i + each]]) for i in range(0, len(columns), each)]


def _heading(place: Place) -> str:
    """What stands above a column: the place in words, its position in mm or m."""
    p = place.position
    at = place_said(p, near=".5g", beyond=math.nextafter(10.0, 0.0))
    return "\n".join([*place.name.split(" "), at]).strip()


def _cell(quantity: Quantity | None, scale: Scale) -> str:
    if quantity is None:
        return "-"
    error = quantity.shown_error
    value = shown(scale(quantity.shown), scale.unit, resolution_in(scale, quantity))
    return with_error(value, None if error is None else scale.factor * error)


def _width(header: str, cells: Sequence[str]) -> int:
    return max(map(len, [*header.split("\n"), *cells])) + _SPACES


def _block(title: str, columns: Sequence[tuple[str, Sequence[str]]]) -> Table:
    from rich import box
    from rich.table import Table

    found = Table(
        title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD,
        show_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    for number, (header, _) in enumerate(columns):
        found.add_column(header, justify="left" if number < 2 else "right", no_wrap=number > 0)
    for cells in zip(*(cells for _, cells in columns), strict=True):
        found.add_row(*cells)
    return found
