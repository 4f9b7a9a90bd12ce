"""Places of a run that are worth a column, and the tables of results there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import Scale, place_said, scale_of
from castfem.base.table import Table
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary import Summary
from castfem.runs.results.headline import AT_PROBES, HEADLINE, at_places, repeats
from castfem.runs.results.numbers import resolution_in, unit_shown, value_cells
from castfem.runs.results.places import quantities_at
from castfem.runs.results.run_case import case_with

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
"""What the table of places has, of what a run has."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place along the strand."""

    name: str  #: what is there; empty of one that was asked for
    position: float  #: below the meniscus, m


def places_of(folder: Path, summary: Summary | None, end: float) -> list[Place]:
    """Return the places worth a column: ends of zones, bending, straightening, run (`end`, m)."""
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
    """Ends of bending and straightening, and rolls that are off, of a case with rolls."""
    case = case_with(folder, "[machine")
    rolls = None if case is None or case.machine is None else case.machine.pairs()
    if rolls is None:
        return []
    from castfem.physics.machine.phases import phases
    from castfem.runs.results.crack_index import BENDS

    off = [i for i, pair in enumerate(rolls.pairs) if pair.offset]
    return [
        Place(f"{phase.kind} ends", rolls.pairs[phase.last].position)
        for phase in phases(rolls)
        if phase.kind in BENDS
    ] + [Place(f"roll {i + 1} off", rolls.pairs[i].position) for i in off]


def table_names(runs: Sequence[Mapping[str, Quantity]], *, everything: bool = False) -> list[str]:
    """Return what a table of places has: that is not alike on both faces, or all of it."""
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
    """What there is at the ends of zones, bending and straightening; None where there are none."""
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
    """What stands above a column: the place in words, its position in mm or m."""
    at = place_said(place.position, near=".5g", beyond=math.nextafter(10.0, 0.0))
    return "\n".join([*place.name.split(" "), at]).strip()


def _cell(quantity: Quantity | None, scale: Scale) -> str:
    if quantity is None:
        return "-"
    resolution = resolution_in(scale, quantity)
    return value_cells(quantity.shown, scale, quantity.shown_error, resolution)[0]
