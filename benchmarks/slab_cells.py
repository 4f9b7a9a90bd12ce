"""Processor time and memory of a coupling window of the slab by number of cells.

The windows are those of cases/slab1200/slab.toml with the shell at #50, nearly all of which is
part of the mechanical equations. Writes a table of docs/slab_error.md.
"""

from __future__ import annotations

from itertools import pairwise
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from mpi4py import MPI

from benchmarks.processes import answer, argument, launch, peak
from benchmarks.report import Output, power
from benchmarks.slab_error import CASES, QUIET, THICK, Setting
from castfem.model import load_case
from castfem.model.build.simulation import build, build_mesh
from castfem.runs import loop

SIZES = (7.5, 5.0, 3.5, 2.5, 1.8, 1.05)  # cells at the wide faces, mm
TO = "casting.length=1.4 m"


def measured(size: float) -> dict[str, Any]:
    """Run some windows in this process with cells of `size` mm; return the row of the table."""
    case = load_case(CASES / "slab.toml", (*QUIET, *Setting(size, 50.0).changes, TO, THICK))
    build(case, MPI.COMM_SELF).destroy()  # compiles before times are measured
    with TemporaryDirectory() as folder:
        start = process_time()
        summary = loop.run(case, folder, comm=MPI.COMM_SELF)
        seconds = process_time() - start
    windows = summary.steps["coupling windows"]
    newton = summary.steps["Newton iterations, mechanics"]
    return {
        "size": size, "cells": len(build_mesh(case).cells), "windows": windows,
        "newton": newton / windows, "ms": 1e3 * seconds / windows,
        "iteration": 1e3 * seconds / newton, "memory": 1e-6 * peak(),
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Run all sizes, each in a process of its own; write data and table."""
    rows = []
    for size in (10.0, 15.0) if quick else SIZES:
        rows.append(launch("benchmarks.slab_cells", {"size": size}))
        print(f"  {rows[-1]}", flush=True)
    for one, other in pairwise(rows):
        other["power"] = power([one, other], "ms")
    rows[0]["power"] = None
    rows.append(
        rows[-1] | {"size": "from first to last", "power": power([rows[0], rows[-1]], "ms")}
    )
    output.csv("slab_cells", rows)
    show(output)


def show(output: Output) -> None:
    """Write the table from the data."""
    head = {
        "size": "cells, mm", "cells": "cells", "newton": ("Newton iterations a window", ".2f"),
        "ms": ("a window, ms", ".0f"), "iteration": ("an iteration, ms", ".0f"),
        "power": ("power of the cells", ".2f"), "memory": ("memory, MB", ".0f"),
    }  # fmt: skip
    output.table("slab cells", output.rows("slab_cells"), head)


if __name__ == "__main__":
    answer(measured(argument()["size"]))
