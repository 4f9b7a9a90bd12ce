"""Result tables of a run: beside references, balances, along the strand."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_quantity import Quantity, from_si, unit_of_difference
from castfem.base.shown_units import (
    Scale,
    difference_of,
    label_shown,
    place_said,
    plain_unit,
    scale_of,
)
from castfem.base.table import Table, pairs
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary_file import SIGNS, Comparison, Summary
from castfem.runs.results.headline import AT_PROBES, ENDS, HEADLINE, at_places, repeats
from castfem.runs.results.labels import quantities_at
from castfem.runs.results.numbers import (
    cells,
    is_small_rate,
    resolution_in,
    rounded,
    shown,
    small_rate,
    unit_shown,
    value_cells,
    with_error,
)
from castfem.runs.results.run_case import case_with

_NARROW, _WIDE = "_narrow_face", "_mid_face"  # ends of names
UNCHANGED = "of the unchanged case"
"""Shown instead of a difference if the case no longer is that of the reference."""


def result_tables(summary: Summary, title: str = "Results") -> Iterator[Table]:
    """Yield the results, each with its references, and the notes on these."""
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
    """Label, ours, unit, theirs, difference, source; one row per reference or lone quantity.

    `sources` is filled with the mark of each source and its note.
    """
    rows: list[tuple[str, ...]] = []
    referred = {c.reference.quantity for c in summary.references}
    found = summary.quantities
    # ends of the liquid core
    ends = [n for n in ENDS if n in found and math.isfinite(found[n].value)]
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
    """Difference of our value from theirs, to the digits of theirs; the excess over a bound."""
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


_NAMES = (
    *AT_PROBES,
    *(name for name in at_places("heat_flux") if "mid_face" in name),
    "heat_removed",
    "cooling_power",
    "temperature_max",
    "gap_mid_face",
    "gap_corner",
    "von_mises_max",
)
"""Columns that the table of places has, if the run has them."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place along the strand."""

    name: str  #: label; empty for a requested position
    position: float  #: below the meniscus, m


def places_of(folder: Path, summary: Summary | None, end: float) -> list[Place]:
    """Return the places for columns: ends of zones, bending, straightening, run (`end`, m)."""
    found: list[Place] = []
    if summary is not None:
        found += [Place(zone.name, zone.end) for zone in summary.zones if zone.whole]
        if summary.mould_exit is not None:
            found = [p for p in found if not _same(p.position, summary.mould_exit)]
            found.append(Place("mould exit", summary.mould_exit))
    bends = _bends(folder)
    found = [p for p in found if not any(_same(p.position, bend.position) for bend in bends)]
    found += bends
    found = [p for p in found if p.position < end and not _same(p.position, end)]
    return [*sorted(found, key=lambda p: p.position)[: 8 - 1], Place("end", end)]


def _bends(folder: Path) -> list[Place]:
    """Ends of bending and straightening, and misaligned rolls, of a case with rolls."""
    case = case_with(folder, "[machine")
    rolls = None if case is None or case.machine is None else case.machine.pairs()
    if rolls is None:
        return []
    from castfem.physics.machine.bending_zones import phases
    from castfem.runs.results.crack_index import BENDS

    off = [i for i, pair in enumerate(rolls.pairs) if pair.offset]
    return [
        Place(f"{phase.kind} ends", rolls.pairs[phase.last].position)
        for phase in phases(rolls)
        if phase.kind in BENDS
    ] + [Place(f"roll {i + 1} off", rolls.pairs[i].position) for i in off]


def table_names(runs: Sequence[Mapping[str, Quantity]], *, everything: bool = False) -> list[str]:
    """Return the results for a table of places: those that differ between the faces, or all."""
    names = list(dict.fromkeys(name for run in runs for name in run))
    if everything:
        return names
    chosen = [name for name in names if AT_FRACTION.fullmatch(name)]
    shells = at_places("shell")
    named = [name for name in (*shells, *chosen, *_NAMES, *HEADLINE) if name in names]
    return [name for name in dict.fromkeys(named) if not repeats(name, runs)]


def _same(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-6)


def table_at(folder: Path, positions: Sequence[float]) -> Table:
    """The table of all results at some positions, m."""
    table = read_columns(folder / HISTORY_NAME)
    if not len(table):
        raise InputError(f"{folder}: no step has been taken yet")
    summary = Summary.load(folder)
    runs = [quantities_at(table, position, folder, summary) for position in positions]
    names = [n for n in table_names(runs, everything=True) if n != "position"]
    return _table("Results on the way", [Place("", p) for p in positions], runs, names)


def table_along(folder: Path, summary: Summary | None) -> Table | None:
    """The table at the ends of zones, bending and straightening; None if there are none."""
    try:
        table = read_columns(folder / HISTORY_NAME)
    except InputError:
        return None
    if len(table) < 2 or "position" not in table:
        return None
    start, end = (float(table["position"][i]) for i in (0, -1))
    places = [place for place in places_of(folder, summary, end) if place.position >= start]
    if len(places) < 2:
        return None
    runs = [quantities_at(table, place.position, folder, summary) for place in places]
    return _table("Along the strand", places, runs, table_names(runs))


def _table(
    title: str,
    places: Sequence[Place],
    runs: Sequence[Mapping[str, Quantity]],
    names: Sequence[str],
) -> Table:
    rows = []
    for name in names:
        some = next(run[name] for run in runs if name in run)
        scale = scale_of(some.shown_unit, name)
        numbers = [_cell(run.get(name), scale) for run in runs]
        rows.append((some.label, unit_shown(scale.unit), *numbers))
    heads = ("quantity", "unit", *map(_heading, places))
    return Table(heads, rows, title, words=(0, 1), repeated=2)


def _heading(place: Place) -> str:
    """Heading of a column: the place in words, its position in mm or m."""
    at = place_said(place.position, near=".5g", beyond=math.nextafter(10.0, 0.0))
    return "\n".join([*place.name.split(" "), at]).strip()


def _cell(quantity: Quantity | None, scale: Scale) -> str:
    if quantity is None:
        return "-"
    resolution = resolution_in(scale, quantity)
    return value_cells(quantity.shown, scale, quantity.shown_error, resolution)[0]
