"""What a reader of a run must know before he uses its numbers: what is not right, or left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.shown_units import said
from castfem.post.plots.history import curves, has_values
from castfem.post.report.remarks import NOT_CONVERGED, OPEN, remarks, spells
from castfem.post.report.reversals import REMELTED
from castfem.post.report.run_case import case_with
from castfem.post.report.wide_gap import wide_gap
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary

FLICKERS = 3  # losses of contact at one probe: taper and shrinkage lose it once or twice
_MOST = 10  # lines below a table of several runs


def cautions(folder: Path, summary: Summary) -> list[str]:
    """Return what to say of a run, a line each; nothing of most.

    Args:
        folder: Of the run, with its case.
        summary: Of the run.
    """
    found = (*summary.warnings, wide_gap(folder, summary), _even(folder))
    return [line for line in found if line]


def cautions_of_all(runs: Mapping[str, tuple[Path, Summary | None]]) -> list[str]:
    """Return what to say of runs below their table, by label; once where it is the same of several.

    Besides `cautions`, that a shell melted again, that contact flickers, or that coupling windows
    did not converge: a single run has these among the things to look at.
    """
    found: dict[str, list[str]] = {}
    for label, (folder, summary) in runs.items():
        told = [] if summary is None else cautions(folder, summary)
        for line in (*told, *_unsteady(folder, summary)):
            found.setdefault(line, []).append(label)
    lines = [
        f"{'all runs' if 1 < len(labels) == len(runs) else ', '.join(labels)}: {line}"
        for line, labels in found.items()
    ]
    if len(lines) > _MOST:
        more = f"and {len(lines) - _MOST} more of this kind"
        lines[_MOST:] = [f"{more}; castfem show FOLDER has those of one run"]
    return lines


def _unsteady(folder: Path, summary: Summary | None) -> Iterator[str]:
    """What went back and forth in a run; nothing without a readable history."""
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:
        return
    for one in remarks(table, summary):
        if one.what in (REMELTED, NOT_CONVERGED):
            yield f"{one.what}, {said(one.value, one.unit, '.2g', one.name)}: {one.where}"
    if not has_values(table, "position"):
        return
    position = table["position"].to_numpy()
    for label, _, column in curves(table, "gap"):
        lost = len(spells(table[column].to_numpy(), position, OPEN))
        if lost >= FLICKERS:
            yield f"contact lost {lost} times, {label}"


def _even(folder: Path) -> str:
    """Say that a flux cools the corner as much as the faces; "" of a run without."""
    case = case_with(folder, "flux")
    if case is None:
        return ""
    from castfem.model.shared_heat import TOLD, even_zones, mend

    zones = list(even_zones(case))
    if not zones:
        return ""
    return (
        f"zone {', '.join(zones)} has {TOLD}. A mould takes less heat there: the surface of the "
        "corner comes out too cold and its shell too thick. Use [mould] with [mechanics], or "
        + mend(case)
    )
