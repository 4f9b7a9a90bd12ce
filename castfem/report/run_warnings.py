"""What makes the results of finished runs doubtful, for tables of several runs.

A single run has it among the things to look at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.errors import InputError
from castfem.output.history import HISTORY_NAME, read_history
from castfem.output.summary import Summary
from castfem.plots.history import curves, has_values
from castfem.report.remarks import NOT_CONVERGED, OPEN, remarks, spells
from castfem.report.reversals import REMELTED
from castfem.values.shown_units import said

if TYPE_CHECKING:
    import pandas

FLICKERS = 3  # losses of contact at one probe: taper and shrinkage lose it once or twice
_MOST = 10  # lines of one table


def warnings_of(folder: Path) -> list[str]:
    """Return a line for each thing that makes the results of a run doubtful.

    These are a shell that melted again, contact lost again and again at one probe, and coupling
    windows whose gap has not converged.  Nothing without a readable history.
    """
    try:
        table, summary = read_history(folder / HISTORY_NAME), Summary.load(folder)
    except InputError:
        return []
    found = [
        f"{one.what}, {said(one.value, one.unit, '.2g', one.name)}: {one.where}"
        for one in remarks(table, summary)
        if one.what in (REMELTED, NOT_CONVERGED)
    ]
    return [*found, *_flickers(table)]


def lines(runs: Mapping[str, Path]) -> list[str]:
    """Return what makes runs doubtful, by label, for the lines below their table."""
    found = [f"look at {label}: {one}" for label, at in runs.items() for one in warnings_of(at)]
    if len(found) > _MOST:
        found[_MOST:] = [
            f"and {len(found) - _MOST} more of this kind; castfem show FOLDER has those of one run"
        ]
    return found


def _flickers(table: pandas.DataFrame) -> Iterator[str]:
    """Yield the probes that lose contact again and again."""
    if not has_values(table, "position"):
        return
    position = table["position"].to_numpy()
    for label, _, column in curves(table, "gap"):
        lost = len(spells(table[column].to_numpy(), position, OPEN))
        if lost >= FLICKERS:
            yield f"contact lost {lost} times, {label}"
