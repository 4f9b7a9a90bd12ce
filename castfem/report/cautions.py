"""What a reader of a run must know before he uses its numbers: what is not right, or left out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from castfem.output.summary import Summary
from castfem.report.run_case import case_with
from castfem.report.wide_gap import wide_gap

if TYPE_CHECKING:
    from collections.abc import Mapping


def cautions(folder: Path, summary: Summary) -> list[str]:
    """Return what to say of a run, a line each; nothing of most.

    Args:
        folder: Of the run, with its case.
        summary: Of the run.
    """
    found = (*summary.warnings, wide_gap(folder, summary), _even(folder))
    return [line for line in found if line]


def cautions_of_all(runs: Mapping[str, tuple[Path, Summary]]) -> list[str]:
    """Return what to say of runs, by their labels; once where it is the same of several."""
    found: dict[str, list[str]] = {}
    for label, (folder, summary) in runs.items():
        for line in cautions(folder, summary):
            found.setdefault(line, []).append(label)
    return [
        f"{'all runs' if len(labels) == len(runs) else ', '.join(labels)}: {line}"
        for line, labels in found.items()
    ]


def _even(folder: Path) -> str:
    """Say that a flux cools the corner as much as the faces; "" of a run without."""
    case = case_with(folder, "flux")
    if case is None:
        return ""
    from castfem.case.even_flux import TOLD, even_zones, mend

    zones = list(even_zones(case))
    if not zones:
        return ""
    return (
        f"zone {', '.join(zones)} has {TOLD}. A mould takes less heat there: the surface of the "
        "corner comes out too cold and its shell too thick. Use [mould] with [mechanics], or "
        + mend(case)
    )
