"""Run time of a caster with mechanics: slices in a mould, bending and bulging between rolls.

The slab is followed from the meniscus through its mould and its first rolls, `--accuracy coarse`,
while it slows down. Processor time of one core is measured until the first instant, at which all
slices have moved from the meniscus to their positions, and afterwards.

    python -m benchmarks caster_mechanics
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import Output
from castfem.base.progress import Progress
from castfem.model import Case, load_case, shipped_cases
from castfem.model.load import changed
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.output.run_record import RunRecord
from castfem.studies.accuracy.sizes import assignments

CASE = "slab1200/from_meniscus"
LENGTH, SLICES, UNTIL = 3.0, 40, 40.0
"""Length of the strand, m, number of slices in it, and time that is followed, s."""


def case_of(length: float, slices: int, until: float) -> Case:
    """Return the slab as a caster of `slices` slices, slowed down by a sixth within `until` s."""
    path = shipped_cases.find(CASE)
    case = load_case(path, assignments(load_case(path), "coarse"))
    plant = {
        "time": [f"{share * until} s" for share in (0.0, 0.125, 0.375, 1.0)],
        "speed": [f"{speed} m/min" for speed in (1.2, 1.2, 1.0, 1.0)],
    }
    table = {"plant": plant, "spacing": f"{length / slices} m", "every": f"{0.5 * until} s"}
    return changed(case, {"caster": table, "casting.length": f"{length} m"})


class Split(Progress):
    """Records the processor time at the end of the first instant."""

    def __init__(self) -> None:
        super().__init__(-1)
        self.first = np.nan

    def update(self, done: float, clock: float, *rest: Any, **more: Any) -> None:  # type: ignore[override]
        """Record the time when a slice reaches the first instant."""
        if clock <= 0.0:
            self.first = time.process_time()


def measured(case: Case) -> dict[str, Any]:
    """Run the caster in this process; return the row of the table."""
    assert case.caster is not None
    with tempfile.TemporaryDirectory() as home:
        split, begun = Split(), time.process_time()
        run_caster(case, Path(home, "out"), comm=MPI.COMM_SELF, progress=split)
        ended = time.process_time()
        numbers, _, _ = read_table(Path(home, "out", "caster.csv"))
        strand, _, _ = read_table(Path(home, "out", "strand.csv"))
        memory = RunRecord.load(Path(home, "out")).memory_mb
    clock = numbers["time"][-1] - numbers["time"][0]
    return {
        "slices": int(numbers["slices"].max()), "length [m]": case.casting.length,
        "clock [s]": clock, "first instant [s]": split.first - begun,
        "afterwards [s]": ended - split.first, "real time [-]": clock / (ended - split.first),
        "memory [MB]": memory, "balance [-]": float(np.abs(numbers["energy_error"]).max()),
        "roll force [kN/m]": float(np.nanmax(strand["roll_force"])),
    }  # fmt: skip


def show(output: Output) -> None:
    """Write the table from the data."""
    columns: dict[str, Any] = {
        "slices": "slices", "length [m]": ("strand, m", ".3g"),
        "first instant [s]": ("processor to the first instant, s", ".0f"),
        "clock [s]": ("followed then, s", ".0f"),
        "afterwards [s]": ("processor for that, s", ".0f"),
        "real time [-]": ("as fast as the caster", ".2g"), "memory [MB]": ("memory, MB", ".0f"),
    }  # fmt: skip
    if rows := output.rows("caster_mechanics"):
        output.table("caster mechanics", rows, columns)


def main(output: Output, quick: bool) -> None:
    """Run the caster; write data and table."""
    case = case_of(0.1, 2, 2.0) if quick else case_of(LENGTH, SLICES, UNTIL)
    output.csv("caster_mechanics", [measured(case)])
    show(output)
