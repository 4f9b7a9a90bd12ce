"""Places of a run that are worth a column, and what is told of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_quantity import Quantity
from castfem.post.report.run_case import case_with
from castfem.runs.output.summary import Summary
from castfem.runs.results.faces import at_places, repeats
from castfem.runs.results.headline import AT_PROBES, HEADLINE

_MOST = 8  # places in the table of a run that was asked for none
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
    """A place along the strand.

    Attributes:
        name: What is there; empty of one that was asked for.
        position: Below the meniscus, m.
    """

    name: str
    position: float


def places_of(folder: Path, summary: Summary | None, end: float) -> list[Place]:
    """Return the places of a run that are worth a column: zone ends, bending, straightening, end.

    Args:
        folder: Of the run.
        summary: Of it; None of one that has not ended.
        end: Where it ended, m.
    """
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
    return [*sorted(found, key=lambda p: p.position)[: _MOST - 1], Place("end", end)]


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
