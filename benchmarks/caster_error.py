"""Error of a whole caster against processor time: spacing of slices, cells, steps in time.

A slab with mean coefficients of cooling slows down. The end of its liquid pool over time and the
surface temperature at a pyrometer are compared with the finest run of each kind.

    python -m benchmarks caster_error
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import Output
from castfem.base.types import Array
from castfem.model import Case, load_case, shipped_cases
from castfem.model.load import changed
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.studies.accuracy.sizes import MESH, STEP, changes

CASE = "slab1200/thermal"
COARSE = {"slices": 4.0, "cells": 1.5, "steps": 2.0}
"""Spacing, m, and cells and steps relative to the case, where they are not varied."""
KINDS: dict[str, tuple[float, ...]] = {
    "slices": (4.0, 2.0, 1.0, 0.5),
    "cells": (1.5, 1.0, 0.625, 0.4),
    "steps": (4.0, 2.0, 1.0, 0.5, 0.125),
}
"""Varied sizes from coarse to fine; the last is the reference."""
SPEEDS = {
    "time": ["0 s", "10 min", "10.5 min", "60 min"],
    "speed": [f"{speed} m/min" for speed in (1.2, 1.2, 0.9, 0.9)],
}
END, PLACE, FACE = "30 min", "10 m", "mid_face_intrados"
"""End of the run, position of the pyrometer and the probe that it measures."""


def case_of(sizes: Mapping[str, float], quick: bool) -> Case:
    """Return the caster with a spacing of slices, m, and relative sizes of cells and steps."""
    case = load_case(shipped_cases.find(CASE))
    finer = changes(case, {MESH: sizes["cells"], STEP: sizes["steps"]})
    table = {
        "plant": SPEEDS, "spacing": f"{sizes['slices']} m", "every": "30 s", "end": END,
        "pyrometer": [{"name": "pyrometer", "at": PLACE, "on": FACE}],
    }  # fmt: skip
    short: dict[str, Any] = {}
    if quick:
        table |= {"end": "4 min"}
        table["pyrometer"] = [{"name": "pyrometer", "at": "3 m", "on": FACE}]
        short = {"casting.length": "6 m"}
    return changed(case, {**finer, "caster": table, **short})


def followed(case: Case) -> dict[str, Any]:
    """Run the caster; return processor time, and end of the pool and pyrometer over time."""
    with tempfile.TemporaryDirectory() as home:
        begun = time.process_time()
        run_caster(case, Path(home, "out"), comm=MPI.COMM_SELF)
        spent = time.process_time() - begun
        strand, _, _ = read_table(Path(home, "out", "caster.csv"))
        readings, _, _ = read_table(Path(home, "out", "pyrometers.csv"))
    surface = next(values for name, values in readings.items() if name.startswith("surface"))
    order = np.argsort(readings["time"])
    return {
        "processor [s]": spent,
        "pool": (strand["time"], strand["metallurgical_length"]),
        "pyrometer": (readings["time"][order], surface[order]),
    }


def apart(fine: tuple[Array, Array], coarse: tuple[Array, Array]) -> float:
    """Return the largest difference of two curves at the times of the fine one that both have."""
    x, y = coarse
    finite = np.isfinite(y)
    if not finite.any():
        return np.nan
    within = np.isfinite(fine[1]) & (fine[0] >= x[finite].min()) & (fine[0] <= x[finite].max())
    differences = np.abs(fine[1] - np.interp(fine[0], x[finite], y[finite]))[within]
    return float(differences.max()) if differences.size else np.nan


def show(output: Output) -> None:
    """Write the table from the data."""
    columns: dict[str, Any] = {
        "varied": "varied", "size": ("spacing [m], or size over the case's", ".3g"),
        "processor [s]": ("processor, s", ".0f"), "pool [m]": ("end of the pool, m", ".3f"),
        "pyrometer [K]": ("pyrometer, K", ".2f"),
    }  # fmt: skip
    if rows := output.rows("caster_error"):
        output.table("caster error", rows, columns)


def main(output: Output, quick: bool) -> None:
    """Run all casters; write data and table."""
    rows = []
    for kind, sizes in KINDS.items():
        sizes = sizes[:2] if quick else sizes
        runs = [followed(case_of({**COARSE, kind: size}, quick)) for size in sizes]
        for size, run in zip(sizes[:-1], runs, strict=False):
            row = {"varied": kind, "size": size, "processor [s]": run["processor [s]"]}
            row["pool [m]"] = apart(runs[-1]["pool"], run["pool"])
            row["pyrometer [K]"] = apart(runs[-1]["pyrometer"], run["pyrometer"])
            rows.append(row)
            print(f"  {row}", flush=True)
        output.csv("caster_error", rows)
    show(output)
