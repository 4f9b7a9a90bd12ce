"""Run time of a caster that follows its plant, for each row of a file with a row every 10 s.

A slab with mean coefficients of cooling and one from roll to roll, `--accuracy coarse`, change
their speed at each row. Wall time and processor time are those of one core; other work on the
machine has little effect on the second.

    python -m benchmarks caster_follow
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import Output
from castfem.model import Case, load_case, shipped_cases
from castfem.model.load import changed
from castfem.runs.caster.plant_file import PlantFile
from castfem.runs.caster.run import run_caster
from castfem.studies.accuracy.sizes import assignments

CASES = {"mean coefficients": "slab1200/thermal", "roll to roll": "slab1200/sprays"}
"""Cases by their cooling."""
SLICES, ROWS, APART = 100, 12, 10.0
"""Number of slices in the strand, number of rows, and time between two rows, s."""


class Fed(PlantFile):
    """A plant file that gets its next row as soon as the previous one has been processed."""

    def __init__(self, path: Path, rows: int) -> None:
        super().__init__(path)
        self._left, self.spent = rows, list[tuple[float, float]]()
        path.write_text("time [s], speed [m/min]\n")

    def take(self) -> int:
        """Record the time at the end of the previous row and add the next row."""
        self.spent.append((time.perf_counter(), time.process_time()))
        if self._left:
            self._left -= 1
            number = len(self)
            with self.path.open("a") as file:
                file.write(f"{number * APART:g}, {1.2 + 0.02 * (number % 3):g}\n")
        return super().take()


def case_of(name: str, slices: int, rows: int, quick: bool) -> Case:
    """Return a case as a caster with a number of slices in its strand, to the last row."""
    path = shipped_cases.find(name)
    case = load_case(path, [*assignments(load_case(path), "coarse")])
    length = 1.0 if quick else case.casting.length
    plant = {"time": ["0 s", "1e6 s"], "speed": ["1.2 m/min"] * 2}
    table = {
        "plant": plant, "spacing": f"{length / slices} m", "every": f"{APART} s",
        "end": f"{(rows - 1) * APART} s",
    }  # fmt: skip
    return changed(case, {"caster": table, "casting.length": f"{length} m"})


def measured(cooling: str, slices: int, rows: int, quick: bool) -> dict[str, Any]:
    """Follow some rows; return the times of each, without the first ones, which fill the strand."""
    case = case_of(CASES[cooling], slices, rows, quick)
    with tempfile.TemporaryDirectory() as home:
        source = Fed(Path(home, "plant.csv"), rows)
        while len(source) < 2:
            source.take()
        run_caster(case, Path(home, "out"), comm=MPI.COMM_SELF, source=source)
        source.spent.append((time.perf_counter(), time.process_time()))
    each = np.diff(np.array(source.spent), axis=0)[3:]
    return {
        "cooling": cooling, "slices": slices, "rows": len(each),
        "clock [s]": float(np.median(each[:, 0])),
        "processor [s]": float(np.median(each[:, 1])),
        "longest, processor [s]": float(each[:, 1].max()),
    }  # fmt: skip


def show(output: Output) -> None:
    """Write the table from the data."""
    columns = {
        "cooling": "cooling", "slices": "slices", "rows": "rows",
        "clock [s]": ("a row, s by the clock", ".2g"),
        "processor [s]": ("of the processor", ".2g"),
        "longest, processor [s]": ("the longest", ".2g"),
    }  # fmt: skip
    if rows := output.rows("caster_follow"):
        output.table("caster follow", rows, columns)


def main(output: Output, quick: bool) -> None:
    """Follow both casters; write data and table."""
    slices, rows = (3, 6) if quick else (SLICES, ROWS)
    output.csv("caster_follow", [measured(c, slices, rows, quick) for c in CASES])
    show(output)
