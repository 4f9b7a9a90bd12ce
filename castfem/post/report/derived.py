"""Numbers of a run that its history tells, for tables of many runs: the thinnest shell, contact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.tolerances import ROUNDING
from castfem.post.plots.history import curves
from castfem.post.report.remarks import OPEN, mould_exit, spells
from castfem.post.report.roll_load import RollLoads
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import last_quantities


def derived(folder: Path, summary: Summary) -> dict[str, Quantity]:
    """Return those that a run has; none without a history.

    The shell is the thinnest at the probes where the mould ends. Contact is lost where the first of
    the probes loses it, and regained where the last of those that do has it again; NaN where it
    is not. Bulge and force of rolls are the largest on the way.
    """
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:
        return {}
    if len(table) < 2 or "position" not in table:
        return {}
    position, units = table["position"].to_numpy(), table.attrs["units"]
    loads = RollLoads.of(folder)
    found = {} if loads is None else loads.quantities()
    at, name = mould_exit(position, summary)
    row = {c: float(np.interp(at, position, table[c])) for c in table if str(c) in units}
    depths = {n: q for n, q in last_quantities(row, units).items() if n.startswith("shell_")}
    if depths:
        thinnest = min(depths, key=lambda shell: depths[shell].value)
        its, error = summary.quantities.get(thinnest), summary.errors_near(at).get(thinnest)
        if error is None and its is not None and at >= position[-1] * (1.0 - ROUNDING):
            error = its.error
        found["shell_least"] = replace(
            depths[thinnest], label=f"thinnest shell, {name}", shown_unit="mm",
            error=error,
        )  # fmt: skip
    gaps = [table[c].to_numpy() for _, _, c in curves(table, "gap")]
    lost = [spell for gap in gaps for spell in spells(gap, position, OPEN)]
    if gaps:
        first = min((spell.start for spell in lost), default=np.nan)
        found["contact_lost"] = Quantity(first, "mm", "contact lost at, first probe")
    if lost:
        open_ = any(not spell.regained for spell in lost)
        last = np.nan if open_ else max(spell.end for spell in lost)
        found["contact_regained"] = Quantity(last, "mm", "contact regained at, last probe")
    return found
