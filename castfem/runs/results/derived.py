"""Numbers of a run that its history tells, for tables of many runs: the thinnest shell, contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import last_quantities, probes_with
from castfem.runs.results.roll_load import RollLoads

_SHELLS = ("shell_", "solidus_cell_")  # beginnings of the columns that tell a shell and its cell
OPEN = 1e-3  # mm; a gap beyond counts as lost contact


def derived(folder: Path, summary: Summary) -> dict[str, Quantity]:
    """Return those that a run has; none without a history.

    The shell is the thinnest at the probes where the mould ends. Contact is lost where the first of
    the probes loses it, and regained where the last of those that do has it again; NaN where it
    is not. Bulge and force of rolls are the largest on the way.
    """
    try:
        table = read_columns(folder / HISTORY_NAME)
    except InputError:
        return {}
    if len(table) < 2 or "position" not in table:
        return {}
    position, units = table["position"], table.attrs["units"]
    loads = RollLoads.of(folder)
    found = {} if loads is None else loads.quantities()
    at, name = mould_exit(position, summary)
    shells = [c for c in map(str, table) if c in units and c.startswith(_SHELLS)]
    row = {c: float(np.interp(at, position, table[c])) for c in shells}
    depths = {n: q for n, q in last_quantities(row, units).items() if n.startswith("shell_")}
    if depths:
        thinnest = min(depths, key=lambda shell: depths[shell].value)
        found["shell_least"] = replace(
            depths[thinnest], label=f"thinnest shell of the probes, {name}", shown_unit="mm",
            error=summary.errors_near(at).get(thinnest),
        )  # fmt: skip
    gaps = [table[c] for c in probes_with(table, "gap").values()]
    lost = [spell for gap in gaps for spell in spells(gap, position, OPEN)]
    if gaps:
        first = min((spell.start for spell in lost), default=np.nan)
        found["contact_lost"] = Quantity(first, "mm", "where a probe first loses contact")
    if lost:
        open_ = any(not spell.regained for spell in lost)
        last = np.nan if open_ else max(spell.end for spell in lost)
        found["contact_regained"] = Quantity(last, "mm", "where the last probe regains contact")
    return found


@dataclass(frozen=True, slots=True)
class Spell:
    """A stretch without contact, between two positions [m].

    Attributes:
        start: Where contact was lost.
        end: Where it was found again, or where the history ends.
        regained: Whether it was found again.
    """

    start: float
    end: float
    regained: bool

    @property
    def length(self) -> float:
        """From start to end [m]."""
        return self.end - self.start


def spells(gap: Array, position: Array, threshold: float) -> list[Spell]:
    """Where contact was lost after there had been contact, and until where.

    Args:
        gap: (n,) between surface and wall; what is unknown (NaN) goes on as before.
        position: (n,) growing.
        threshold: The gap beyond which there is no contact; its place is found by straight lines.
    """
    known = np.isfinite(gap)
    gap, position = gap[known], position[known]
    apart = gap > threshold
    changes = np.flatnonzero(apart[1:] != apart[:-1])
    found: list[Spell] = []
    lost: float | None = None
    for i in changes:
        share = (threshold - gap[i]) / (gap[i + 1] - gap[i])
        at = float(position[i] + share * (position[i + 1] - position[i]))
        if apart[i + 1]:
            lost = at
        elif lost is not None:
            found.append(Spell(lost, at, True))
            lost = None
    if lost is not None:
        found.append(Spell(lost, float(position[-1]), False))
    return found


def mould_exit(position: Array, summary: Summary | None) -> tuple[float, str]:
    """Where the mould ends [m], and what to call it: the end of the run when it ends before."""
    ends = None if summary is None else summary.mould_exit
    if ends is not None and ends <= position[-1] * (1 + ROUNDING):
        return ends, "mould exit"
    return float(position[-1]), "end of the run"
