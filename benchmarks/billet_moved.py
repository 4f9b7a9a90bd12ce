"""What the billets' numbers were while all liquid was elastic, and what has moved them.

Writes a table of docs/billet.md.  "then" are the results of the last version in which the liquid of
every mould was elastic, as its own `python -m benchmarks billet` wrote them; they stay in the data,
for a later version cannot make them anew.  "elastic" is that liquid with all else as it is now,
run here: what lies between the two is due to areas, masses and mean stress, which at +3 %/m
stand apart: "areas" has the true ones, "mean stress" its linear one too.  "now" are the moulds as
shipped, of `billet_study`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.billet_run import MOULDS, NAMES, SHOWN, run
from benchmarks.billet_study import MORE, at_the_exit, told
from benchmarks.report import Output, table

ELASTIC = (
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
    "mechanics.strain=small",
)  # fmt: skip
"""That of the ideal mould in all: `taper_minus_3_as_thesis` is one of these."""
LEFT_OUT = ("penetration", "newton", "seconds")  # no results
KEYS = {k: v for k, v in {**SHOWN, **MORE}.items() if k not in LEFT_OUT}


def main(output: Output, quick: bool) -> None:
    """The moulds with elastic liquid, beside what is known of then and now."""
    then = [r for r in output.rows("billet_moved") if r["version"] not in ("elastic", "now")]
    ideal = run("idealised")
    rows = []
    for mould in MOULDS[:2] if quick else MOULDS:
        one = ideal if mould == "idealised" else run(mould, ELASTIC)
        values = at_the_exit(one, ideal)
        rows.append({"version": "elastic", "mould": NAMES[mould], **{k: values[k] for k in KEYS}})
    now = [
        {"version": "now", "mould": r["mould"], **{k: r[k] for k in KEYS}}
        for r in output.rows("billet_moulds")
    ]
    output.csv("billet_moved", [*then, *rows, *now])
    show(output)


def moved(then: Any, elastic: Any, now: Any, form: str) -> str:
    """Write a cell: then, moved by all else and by the liquid, now; empty if nothing moves."""
    known = [None if v is None or not np.isfinite(v) else float(v) for v in (then, elastic, now)]
    first, between, last = known
    if first is None and last is None:
        return ""
    if first is None or last is None or between is None:
        ends = ["none" if v is None else format(v, form) for v in (first, last)]
        return f"{ends[0]} → {ends[1]}"
    if float(format(last - first, form)) == 0.0:
        return ""
    steps = [format(b - a, "+" + form) for a, b in ((first, between), (between, last))]
    steps = [step if float(step) else "+0" for step in steps]
    return f"{format(first, form)} {steps[0]} {steps[1]} = {format(last, form)}"


def show(output: Output) -> None:
    """The table, from the data."""
    found = {(r["version"], r["mould"]): r for r in output.rows("billet_moved")}
    thesis = {mould: told(mould) for mould in MOULDS}
    lines = []
    for key, (label, form) in KEYS.items():
        cells: dict[str, Any] = {"what": label}
        for mould, name in NAMES.items():
            rows = [found.get((version, name), {}) for version in ("then", "elastic", "now")]
            text = moved(*(row.get(key) for row in rows), form)
            if text and key in thesis[mould]:
                text += f" ({thesis[mould][key]})"
            cells[mould] = text
        if any(cells[mould] for mould in NAMES):
            lines.append(cells)
    output.insert("billet moved", table(lines, {"what": "at the exit of the mould", **NAMES}, {}))
