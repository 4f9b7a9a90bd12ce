"""What stands below the table of several runs: base, references, and which bounds are met."""

from __future__ import annotations

import math
from collections.abc import Sequence

from castfem.base.shown_units import difference_of, place_said
from castfem.post.compare.runs import Run, heat_shared
from castfem.post.compare.table import SHARE, Line
from castfem.post.report.cautions import cautions_of_all
from castfem.post.report.crack_places import crack_places, defects_of
from castfem.post.report.results_table import UNCHANGED
from castfem.runs.results.headline import plain_label
from castfem.runs.results.numbers import shown, unit_shown
from castfem.runs.results.roll_load import RollLoads

_SEPARATOR = "; "  # between the parts of a note
_HERE = "castfem compare"  # a part that sends the reader of a single run to this very table


def remarks(runs: Sequence[Run], base: Run, table: Sequence[Line]) -> list[str]:
    """Return what a reader of the table must know.

    The base, sources and notes of the references, which bounds are met, different ends.
    """
    found = [f"base: {base.label}", *heat_shared(runs)]
    found += cautions_of_all({run.label: (run.folder, run.summary) for run in runs})
    who = dict.fromkeys(c.reference.source for run in runs for c in run.summary.references)
    if who:
        found.append(f"references: {'; '.join(who)}")
    for run in runs:
        keys = dict.fromkeys(k for c in run.summary.references for k in c.reference.changed)
        if keys:
            found.append(f"references of {run.label} are {UNCHANGED}: {', '.join(keys)} differs")
    found += _bounds(runs, table)
    notes: dict[str, dict[str, None]] = {}
    for run in runs:
        for comparison in run.summary.references:
            reference = comparison.reference
            quantity = run.summary.quantities.get(reference.quantity)
            label = reference.quantity if quantity is None else plain_label(quantity)
            note = _SEPARATOR.join(
                part for part in reference.note.split(_SEPARATOR) if _HERE not in part
            )
            if note:
                notes.setdefault(f"{label}: {note}", {})[run.label] = None
    found += [f"note ({', '.join(who)}) {text}" for text, who in notes.items()]
    ends = {
        place_said(run.summary.quantities["position"].value, beyond=math.inf)
        for run in runs
        if "position" in run.summary.quantities
    }
    for run in runs:
        loads = None if run is base else RollLoads.of(run.folder)
        if loads is not None and (of_base := RollLoads.of(base.folder)) is not None:
            found += [f"from {base.label} to {run.label}: {one}" for one in loads.changes(of_base)]
        defects, places = defects_of(run.folder), crack_places(run.folder, run.summary)
        found += [f"defects of {run.label}: {defects}"] if defects else []
        worst = [] if places is None else [*places.worst] or [places.nowhere]
        found += [f"worst of {run.label}: {one}" for one in worst if one]
    if len(ends) > 1:
        found.append(f"the runs end at different positions: {', '.join(sorted(ends))}")
    return found


def _bounds(runs: Sequence[Run], table: Sequence[Line]) -> list[str]:
    """Which runs keep to the bounds given for them, and by how much others miss theirs."""
    found = {}
    for heading, verdict in (("bounds met", True), ("bounds missed", False)):
        parts = []
        for line in table:
            those = [i for i in range(len(runs)) if line.verdict(i) is verdict]
            names = [runs[i].label + ("" if verdict else _miss(line, i)) for i in those]
            unit = f", {SHARE}" if line.unit == SHARE else ""
            parts += [f"{line.label}{unit} ({', '.join(names)})"] if names else []
        found[heading] = "; ".join(parts)
    return [f"{heading}: {text}" for heading, text in found.items() if text]


def _miss(line: Line, run: int) -> str:
    """By how much a run misses its bound, with a blank in front."""
    by = abs(line.ours[run] - line.theirs[run])
    if line.unit == SHARE:
        return f" by {by:.1f} points"
    unit = difference_of(line.scale.unit)
    return f" by {shown(line.scale.factor * by, unit)} {unit_shown(unit)}"
