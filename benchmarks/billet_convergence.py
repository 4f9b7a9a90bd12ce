"""The billet with one thing refined at a time: where the error of the shipped default comes from.

Writes tables of docs/billet.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.billet_run import COARSE, SHOWN, every, mesh, run, touch
from benchmarks.billet_study import columns, picked
from benchmarks.report import Output, table

Choice = Callable[[Any], tuple[str, ...]]
CONVERGENCE: dict[str, tuple[tuple[Any, ...], Choice, Any]] = {
    "mesh [mm]": (
        (1.2, 0.8, 0.5, 0.35), lambda v: (*mesh(v), every(0.2)), 0.8,
    ),
    "window [s]": (
        (0.4, 0.2, 0.1, 0.05, 0.025), lambda v: (*mesh(1.2), every(v)), 0.1,
    ),
    "gap converged to [K]": (
        (1000, 1, 0.01),
        lambda v: (*COARSE, f"coupling.settled={v} K", "coupling.passes=20"), 1,
    ),
    "penalty, factor": ((1, 10, 100), lambda v: (*COARSE, touch("penalty", v)), 10),
    "Nitsche, factor": ((10, 1000), lambda v: (*COARSE, touch("nitsche", v)), 10),
}  # fmt: skip
"""What is refined -> its values, the last the reference; keys of a value; the shipped one."""


def main(output: Output, quick: bool) -> None:
    """Refine one thing at a time, and add up what is left of each at the shipped default."""
    for mould in ("taper_1", "taper_0"):
        rows: list[dict[str, Any]] = []
        for name, (values, changes, shipped) in CONVERGENCE.items():
            first = values.index(shipped)
            for value in values[first : first + 2] if quick else values:
                found = run(mould, changes(value))
                rows.append({"refined": f"{name} = {value}", **picked(found)})
        output.csv(f"billet_convergence_{mould}", rows)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    for mould in ("taper_1", "taper_0"):
        show_convergence(output, mould, output.rows(f"billet_convergence_{mould}"))


def show_convergence(output: Output, mould: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the tables of one mould."""
    more = {
        "penetration": "penetration [µm]",
        "cells": "cells",
        "newton": "Newton iterations",
        "cut": "windows cut back",
        "seconds": "time [s]",
    }
    forms = {k: form for k, (_, form) in SHOWN.items()} | {"gap_max": ".3f", "seconds": ".0f"}
    forms["penetration"] = ".4f"
    lines = [
        {"refined": f"{r['refined']}: {r['failure'][:60]}"} if r["failure"] else r for r in rows
    ]
    text = table(lines, {**columns("refined", rows), **more}, forms)
    output.insert(f"billet convergence {mould}", text)
    errors: list[dict[str, Any]] = []
    for name, (_, _, shipped) in CONVERGENCE.items():
        if name.startswith("Nitsche"):  # the other method is no refinement
            continue
        tried = [r for r in rows if r["refined"].startswith(name)]
        start = [r["refined"] for r in tried].index(f"{name} = {shipped}")
        default, *finer = [r for r in tried[start:] if not r["failure"]]
        # The largest of all differences: the finest may agree by luck where a front has moved.
        error = {
            k: round(max((abs(default[k] - r[k]) for r in finer), default=0.0), 4) for k in SHOWN
        }
        errors.append({"from": name, **error})
    errors.append({"from": "together", **{k: sum(e[k] for e in errors) for k in SHOWN}})
    head = {"from": "error from", **{k: label for k, (label, _) in SHOWN.items()}}
    output.insert(f"billet error {mould}", table(errors, head, dict.fromkeys(SHOWN, ".2g")))
