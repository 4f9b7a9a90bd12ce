"""The table of a run's results, each beside what others have found, and its balances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from castfem.base.shown_quantity import Quantity, from_si, unit_of_difference
from castfem.base.shown_units import Scale, difference_of, label_shown, plain_unit, scale_of
from castfem.post.report.printing import empty_table, print_line, wrapped
from castfem.runs.output.summary import SIGNS, Comparison, Summary
from castfem.runs.results.headline import ENDS
from castfem.runs.results.numbers import (
    cells,
    is_small_rate,
    resolution_in,
    rounded,
    shown,
    small_rate,
    unit_shown,
    with_error,
)

if TYPE_CHECKING:
    from rich.console import Console

_NARROW, _WIDE = "_narrow_face", "_mid_face"  # ends of names
UNCHANGED = "of the unchanged case"
"""What stands in place of a difference where the case is not that of the reference any more."""


def print_results(out: Console, summary: Summary) -> None:
    """The results, each with what others have found, and the balances."""
    sources: dict[str, str] = {}
    rows = result_rows(summary, sources)
    others = ("reference", "difference", "") if summary.references else ()
    table = empty_table("Results", "quantity", "castfem", "unit", *others)
    for row in rows:
        table.add_row(*row[: 3 + len(others)])
    if rows:
        out.print(table, highlight=False)
    for source, mark in sources.items():
        for line in wrapped(out, source, f"{mark} "):
            print_line(out, line)
    keys = dict.fromkeys(k for c in summary.references for k in c.reference.changed)
    if keys:
        text = f"the case of these references had other values of {', '.join(keys)}"
        for line in wrapped(out, text, f"{UNCHANGED}: "):
            print_line(out, line)
    for line in summary.unchecked:
        for part in wrapped(out, line, "from memory, not compared with its source: "):
            print_line(out, part)
    out.print()
    for name, terms in summary.balances.items():
        table = empty_table(f"Balance of {name.replace('_', ' ')}", "term", "value", "unit")
        for quantity in terms.values():
            table.add_row(label_shown(quantity.label), *cells("", quantity))
        out.print(table, "", highlight=False)


def result_rows(summary: Summary, sources: dict[str, str]) -> list[tuple[str, ...]]:
    """Label, ours, unit, theirs, difference, source; one row a reference or a lone quantity.

    `sources` is filled with the mark of each source and its note.
    """
    rows: list[tuple[str, ...]] = []
    referred = {c.reference.quantity for c in summary.references}
    for name, quantity in _ends_first(summary.quantities):
        twin = summary.quantities.get(name.replace(_NARROW, _WIDE))
        if name.endswith(_NARROW) and name not in referred and _same(name, quantity, twin):
            continue
        label = quantity.label
        mine = [c for c in summary.references if c.reference.quantity == name and not c.missing]
        if all(c.reference.at is not None for c in mine):
            rows.append((label_shown(label), *cells(name, quantity), "", "", ""))
        rows.extend(_comparison_row(c, label, sources, quantity) for c in mine)
    for comparison in summary.references:
        if comparison.missing:
            label = f"{comparison.reference.quantity} ({comparison.missing})"
            rows.append(_comparison_row(comparison, label, sources))
    return rows


def _ends_first(quantities: Mapping[str, Quantity]) -> list[tuple[str, Quantity]]:
    """The results, ends of the pool first where the strand has come to them."""
    first = [n for n in ENDS if n in quantities and math.isfinite(quantities[n].value)]
    return [(n, quantities[n]) for n in dict.fromkeys((*first, *quantities))]


def _same(name: str, one: Quantity, other: Quantity | None) -> bool:
    """Whether two quantities would be printed alike, as those of the faces of a square."""
    return other is not None and cells(name, one) == cells(name, other)


def _comparison_row(
    comparison: Comparison, label: str, sources: dict[str, str], quantity: Quantity | None = None
) -> tuple[str, ...]:
    """A row in the unit of the reference; at the end of the run with the error of the quantity."""
    reference = comparison.reference
    scale, usual = scale_of(reference.shown_unit, reference.quantity), reference.shown_unit
    unit = scale.unit
    if reference.at is not None:
        label += f", at {1e3 * reference.at:.6g} mm"
    theirs = shown(scale(from_si(reference.value, usual)), unit)
    difference = "met" if comparison.met else _difference(comparison, theirs, scale)
    source = reference.source + (f": {reference.note}" if reference.note else "")
    mark = sources.setdefault(source, f"[{len(sources) + 1}]")
    digits = None if quantity is None or reference.at else resolution_in(scale, quantity)
    ours = shown(scale(from_si(comparison.ours, usual)), unit, digits)
    if quantity is not None and quantity.error is not None and reference.at is None:
        error = from_si(quantity.error, unit_of_difference(usual))
        ours = with_error(ours, scale.factor * error)
    return (
        label_shown(label),
        ours,
        unit_shown(unit),
        SIGNS[reference.kind] + theirs,
        difference,
        mark,
    )


def _difference(comparison: Comparison, theirs: str, scale: Scale) -> str:
    """How far ours is from theirs, to the digits of theirs; how far a bound is missed."""
    if comparison.reference.changed:
        return UNCHANGED
    value, relative = scale.factor * comparison.shown_difference, 100 * comparison.relative
    if not math.isfinite(value):
        return ""
    digits = len(theirs.partition(".")[2])
    sign, before = "+", ""
    if comparison.met is False:
        sign, before, value, relative = "", "missed by ", abs(value), abs(relative)
    if is_small_rate(theirs):
        text = small_rate(value, f"{sign}.4g")
    elif "e" in theirs:
        text = f"{value:{sign}.4g}"
    else:
        text = f"{rounded(value, digits):{sign}.{digits}f}"
    if difference_of(scale.unit) != scale.unit:
        text += f" {plain_unit(difference_of(scale.unit))}"
    if math.isfinite(relative):
        text += f" ({relative:{sign}.1f} %)"
    return before + text
