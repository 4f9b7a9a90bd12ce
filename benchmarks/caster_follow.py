"""How long a caster that follows its plant takes for a row that comes 10 s after the one before.

A slab with mean coefficients of cooling and one from roll to roll, `--accuracy coarse`, change
their speed at each row. Times are of one core: by the clock, and of the processor, in which other
work on the machine counts little.

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
"""The cases by how they are cooled."""
SLICES, ROWS, APART = 100, 12, 10.0
"""Slices inside, rows that are followed, and s between two of them."""


class Fed(PlantFile):
    """A file that gets its next row as soon as the one before has been worked through."""

    def __init__(self, path: Path, rows: int) -> None:
        super().__init__(path)
        self._left, self.spent = rows, list[tuple[float, float]]()
        path.write_text("time [s], speed [m/min]\n")

    def take(self) -> int:
        """Note how long the row before took, and add one."""
        self.spent.append((time.perf_counter(), time.process_time()))
        if self._left:
            self._left -= 1
            number = len(self)
            with self.path.open("a") as file:
                file.write(f"{number * APART:g}, {1.2 + 0.02 * (number % 3):g}\n")
        return super().take()


def case_of(name: str, slices: int, rows: int, quick: bool) -> Case:
    """A case as a caster of so many slices at once, to the last row."""
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
    """Follow some rows; what each has taken, the first two left out, which begin the strand."""
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
    """Make the table anew."""
    columns = {
        "cooling": "cooling", "slices": "slices", "rows": "rows",
        "clock [s]": ("a row, s by the clock", ".2g"),
        "processor [s]": ("of the processor", ".2g"),
        "longest, processor [s]": ("the longest", ".2g"),
    }  # fmt: skip
    if rows := output.rows("caster_follow"):
        output.table("caster follow", rows, columns)


def main(output: Output, quick: bool) -> None:
    """Measure, and write data and table."""
    slices, rows = (3, 6) if quick else (SLICES, ROWS)
    output.csv("caster_follow", [measured(c, slices, rows, quick) for c in CASES])
    show(output)
