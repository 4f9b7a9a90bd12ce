"""The tables of a run's results, each beside what others have found, and of its balances."""

from __future__ import annotations

import math
from collections.abc import Iterator

from castfem.base.shown_quantity import Quantity, from_si, unit_of_difference
from castfem.base.shown_units import Scale, difference_of, label_shown, plain_unit, scale_of
from castfem.base.table import Table, pairs
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

_NARROW, _WIDE = "_narrow_face", "_mid_face"  # ends of names
UNCHANGED = "of the unchanged case"
"""What stands in place of a difference where the case is not that of the reference any more."""


def result_tables(summary: Summary, title: str = "Results") -> Iterator[Table]:
    """Yield the results, each with what others have found, and the notes on these."""
    sources: dict[str, str] = {}
    rows = result_rows(summary, sources)
    heads = ("quantity", "castfem", "unit", *("reference", "difference", ""))
    count = len(heads) if summary.references else 3
    yield Table(heads[:count], [row[:count] for row in rows], title, words=(0, 2, 5))
    notes = [(mark, source) for source, mark in sources.items()]
    keys = dict.fromkeys(k for c in summary.references for k in c.reference.changed)
    if keys:
        text = f"the case of these references had other values of {', '.join(keys)}"
        notes.append((f"{UNCHANGED}:", text))
    for note in notes:
        yield pairs([note])
    for line in summary.unchecked:
        yield pairs([("not yet checked against its source:", line)])


def balance_tables(summary: Summary) -> Iterator[Table]:
    """Yield the balances of a run."""
    for name, terms in summary.balances.items():
        rows = [(label_shown(term.label), *cells("", term)) for term in terms.values()]
        title = f"Balance of {name.replace('_', ' ')}"
        yield Table(("term", "value", "unit"), rows, title, words=(0, 2))


def result_rows(summary: Summary, sources: dict[str, str]) -> list[tuple[str, ...]]:
    """Label, ours, unit, theirs, difference, source; one row a reference or a lone quantity.

    `sources` is filled with the mark of each source and its note.
    """
    rows: list[tuple[str, ...]] = []
    referred = {c.reference.quantity for c in summary.references}
    found = summary.quantities
    ends = [n for n in ENDS if n in found and math.isfinite(found[n].value)]  # of the pool
    for name in dict.fromkeys((*ends, *found)):
        quantity, twin = found[name], found.get(name.replace(_NARROW, _WIDE))
        alone = name.endswith(_NARROW) and name not in referred
        if alone and twin is not None and cells(name, quantity) == cells(name, twin):
            continue  # as on the other faces of a square
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
