"""Length of the coupling windows: what it costs in accuracy, and what its error control saves.

Writes a table of docs/coupling.md. The quarter billet in moulds to 360 mm; errors against windows
of 0.05 s.
"""

from __future__ import annotations

from time import process_time
from typing import Any

from mpi4py import MPI

from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET, mesh
from benchmarks.report import Columns, Output
from castfem.base.errors import RunFailure
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.summary import summarise

MOULDS = {"taper_1": (1.2, COARSE), "taper_0": (1.2, COARSE), "taper_minus_3": (2.0, mesh(2.0))}
"""Cells at the surface [mm], and the keys that make them."""
WINDOWS = (0.25, 0.5, 1.0, 2.0, 4.0)
LENGTHS = {"taper_minus_3": WINDOWS[:-1]}
"""Where they are not all: at -3 %/m longer ones are cut back by the mechanics."""
REFERENCE = 0.05
FREE = 1e6  # K: no window is cut back for its error
COMPARED = {
    "heat": "heat_removed", "peak": "von_mises_max", "gap": "gap_max", "shell": "shell_corner",
}  # fmt: skip
"""Columns and the results they compare."""


def run(mould: str, window: float, allowed: float | None) -> dict[str, Any]:
    """One case to its end, or as far as it comes; a row with values for errors."""
    size, cells = MOULDS[mould]
    keys = [*QUIET, *cells, "casting.length=360 mm", f"coupling.interval={window} s"]
    keys += [] if allowed is None else [f"coupling.window_error={allowed} K"]
    simulation = build(load_case(CASES / f"{mould}.toml", tuple(keys)), MPI.COMM_SELF)
    loop = TimeLoop(simulation)
    start, status = process_time(), "finished"
    try:
        loop.run()
    except RunFailure:
        status = "failed"
    seconds = process_time() - start
    found = summarise(loop.run_state, status).quantities
    counts = loop.run_state.counts
    simulation.destroy()
    control = "yes" if allowed is None else "no"
    row: dict[str, Any] = {
        "mould": NAMES[mould], "cells": size, "window": window, "control": control,
        "windows": counts.windows, "passes": counts.coupling_iterations,
        "cut": counts.cut_back + counts.cut_for_error,
    }  # fmt: skip
    ended = status == "finished"
    row |= {key: found[name].value if ended else None for key, name in COMPARED.items()}
    return row | {"seconds": seconds}


HEAD: Columns = {
    "mould": "mould", "cells": "cells [mm]", "window": "window [s]",
    "control": "error controlled", "windows": "windows", "passes": "iterations", "cut": "cut back",
    "heat": ("heat [%]", "+.2f"), "peak": ("peak stress [%]", "+.1f"),
    "gap": ("largest gap [µm]", "+.1f"), "shell": ("shell, corner [%]", "+.1f"),
    "seconds": ("time [s]", ".1f"),
}  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Every mould and length, without and with control, against short windows."""
    rows = []
    for mould in ["taper_0"] if quick else MOULDS:
        fine = run(mould, REFERENCE, FREE)
        for window in WINDOWS[2:3] if quick else LENGTHS.get(mould, WINDOWS):
            for allowed in (FREE, None):
                row = run(mould, window, allowed)
                for key in COMPARED:
                    if row[key] is not None:  # the gap in um, since it may be next to nothing
                        away = row[key] - fine[key]
                        row[key] = 1e6 * away if key == "gap" else 100.0 * away / fine[key]
                rows.append(row)
                print(f"  {row}", flush=True)
    output.csv("windows", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    output.table("windows", output.rows("windows"), HEAD)
