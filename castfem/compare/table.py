"""The results of several runs side by side, with their references and ratios to a base run."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.compare.chief import chief, plain_label
from castfem.compare.runs import Run
from castfem.output.files import write_text
from castfem.output.summary import from_si

if TYPE_CHECKING:
    from rich.table import Table

CSV_NAME = "compare.csv"
RATIOS = ("heat_removed", "heat_removed_slice")  # also shown as a share of the base run's
SHARE = "% of base"


@dataclass(frozen=True, slots=True)
class Line:
    """A quantity of all runs.

    Attributes:
        label: What it is, and where.
        unit: Of the values.
        ours: Value of each run, NaN where it has none.
        theirs: Its reference, NaN where it has none.
    """

    label: str
    unit: str
    ours: tuple[float, ...]
    theirs: tuple[float, ...]


def lines(runs: Sequence[Run], base: Run, *, everything: bool = False) -> list[Line]:
    """Return the chief quantities, those with references, and the ratios to the base run.

    Args:
        runs: In the order of the columns.
        base: By which the ratios are taken.
        everything: All quantities instead of the chief ones.
    """
    all_of = [run.summary.quantities for run in runs]
    references = [c for run in runs for c in run.summary.references if not c.note]
    names = list(dict.fromkeys(n for q in all_of for n in q)) if everything else chief(all_of)
    referred = [c.reference.quantity for c in references]
    names += [name for name in dict.fromkeys(referred) if name not in names]
    found: list[Line] = []
    for name in names:
        inner = {c.reference.at for c in references if c.reference.quantity == name}
        for at in (None, *sorted(place for place in inner if place is not None)):
            line = _line(runs, name, at)
            found.append(line)
            if name in RATIOS:
                found.append(_ratio(line, runs.index(base)))
    return found


def _line(runs: Sequence[Run], name: str, at: float | None) -> Line:
    """One quantity, at the end of the runs or where references hold."""
    quantity = next(r.summary.quantities[name] for r in runs if name in r.summary.quantities)
    ours, theirs = [], []
    for run in runs:
        mine = run.summary.quantities.get(name)
        value = mine.value if mine is not None and at is None else math.nan
        expected = math.nan
        for comparison in run.summary.references:
            reference = comparison.reference
            if reference.quantity == name and reference.at == at and not comparison.note:
                expected = reference.value
                value = comparison.ours
        ours.append(from_si(value, quantity.unit))
        theirs.append(from_si(expected, quantity.unit))
    label = plain_label(quantity) + ("" if at is None else f", at {1e3 * at:.6g} mm")
    return Line(label, quantity.unit, tuple(ours), tuple(theirs))


def _ratio(line: Line, base: int) -> Line:
    """A line as percentage of the base run's."""

    def share(values: Sequence[float]) -> tuple[float, ...]:
        whole = values[base]
        return tuple(100.0 * v / whole if whole else math.nan for v in values)

    theirs = share(line.theirs)
    if len({value for value in theirs if math.isfinite(value)}) < 2:  # one reference for all
        theirs = (math.nan,) * len(theirs)
    return Line(line.label, SHARE, share(line.ours), theirs)


def remarks(runs: Sequence[Run], base: Run) -> list[str]:
    """Return what a reader of the table must know: the base, the sources, different ends."""
    found = [f"base: {base.label}"]
    who = dict.fromkeys(c.reference.source for run in runs for c in run.summary.references)
    if who:
        found.append(f"references: {'; '.join(who)}")
    ends = {
        f"{1e3 * run.summary.quantities['position'].value:.6g} mm"
        for run in runs
        if "position" in run.summary.quantities
    }
    if len(ends) > 1:
        found.append(f"the runs end at different positions: {', '.join(sorted(ends))}")
    return found


def printed(runs: Sequence[Run], table: Sequence[Line], width: int) -> list[Table]:
    """Return the tables for the terminal: equally many runs in each, as they fit side by side.

    References stand in a column of their own if all runs have the same ones, else in brackets
    behind our values.

    Args:
        runs: As in `lines`.
        table: From `lines`.
        width: Of the terminal, characters.
    """
    from castfem.output.show import unit_shown

    labels = ["\n".join(textwrap.wrap(line.label, 26)) for line in table]
    first = [("quantity", labels), ("unit", [unit_shown(line.unit) for line in table])]
    alone = have_common_references(table)
    if alone:
        expected = [next(filter(math.isfinite, line.theirs), math.nan) for line in table]
        cells = [
            _cell(value, math.nan, line.unit) if math.isfinite(value) else ""
            for value, line in zip(expected, table, strict=True)
        ]
        first.append(("reference", cells))
    room = width - sum(_width(*column) for column in first)
    columns: list[tuple[str, list[str]]] = []
    for number, run in enumerate(runs):
        header = "\n".join(textwrap.wrap(run.label, 13))
        if not alone and any(math.isfinite(line.theirs[number]) for line in table):
            header += "\n(reference)"
        cells = [
            _cell(line.ours[number], math.nan if alone else line.theirs[number], line.unit)
            for line in table
        ]
        columns.append((header, cells))
    fitting = max(1, room // max(_width(*column) for column in columns))
    each = math.ceil(len(columns) / math.ceil(len(columns) / fitting))
    blocks = [columns[i : i + each] for i in range(0, len(columns), each)]
    return [_block([*first, *block]) for block in blocks]


def have_common_references(table: Sequence[Line]) -> bool:
    """Return whether there are references, and those of a quantity are the same for all runs."""
    different = [{value for value in line.theirs if math.isfinite(value)} for line in table]
    return any(different) and all(len(values) < 2 for values in different)


def _block(columns: Sequence[tuple[str, list[str]]]) -> Table:
    from rich import box
    from rich.table import Table

    found = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    for number, (header, _) in enumerate(columns):
        found.add_column(header, justify="left" if number < 2 else "right")
    for cells in zip(*(cells for _, cells in columns), strict=True):
        found.add_row(*cells)
    return found


def _width(header: str, cells: Sequence[str]) -> int:
    """How wide a column is, with the two spaces behind it."""
    return max(len(part) for text in (header, *cells) for part in text.split("\n")) + 2


def _cell(ours: float, theirs: float, unit: str) -> str:
    from castfem.output.show import shown

    def text(value: float) -> str:
        return f"{value:.1f}" if unit == SHARE and math.isfinite(value) else shown(value, unit)

    return text(ours) + (f" ({text(theirs)})" if math.isfinite(theirs) else "")


def write_csv(folder: Path, runs: Sequence[Run], table: Sequence[Line]) -> Path:
    """Write the table: a row a quantity, a column a run, and one for its references if it has any.

    Raises:
        RunFailure: It cannot be written.
    """
    expected = [any(math.isfinite(line.theirs[i]) for line in table) for i in range(len(runs))]
    head = ["quantity", "unit"]
    for run, some in zip(runs, expected, strict=True):
        head += [run.label, f"{run.label}: reference"] if some else [run.label]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    for line in table:
        cells = [line.label, line.unit]
        for ours, theirs, some in zip(line.ours, line.theirs, expected, strict=True):
            cells += [_number(ours), _number(theirs)] if some else [_number(ours)]
        writer.writerow(cells)
    write_text(folder / CSV_NAME, text.getvalue(), durable=False)
    return folder / CSV_NAME


def _number(value: float) -> str:
    return f"{value:.12g}" if math.isfinite(value) else ""
