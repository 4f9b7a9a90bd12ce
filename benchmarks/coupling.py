"""Staggered coupling: what repeating a window costs, and what it saves from.

Writes the table of docs/coupling.md. The quarter billet in moulds, on cells of 1.2 mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET
from benchmarks.report import Columns, Output
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.runs.results.summary import summarise

AS_THESIS = (
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
)  # fmt: skip
# With fed liquid the corner of the first shell may melt open off the wall, which ends the run.
STRONG = (
    "cooling.mould.surface.0.coefficient=20000 W/(m^2 K)",
    'casting.length="300 mm"',
    *AS_THESIS,
)
CASES_TO_RUN = (
    *((mould, (), 0.1) for mould in ("taper_1", "taper_0")),
    *(("taper_1", STRONG, window) for window in (0.05, 0.1, 0.5)),
)
"""Mould, what is changed, coupling window [s]."""
ITERATIONS = (1, 8)


@dataclass
class Faces:
    """Sits where a recorder does: temperature of the mid-face at the end of each window, K."""

    temperature: list[float] = field(default_factory=list)

    def step(self, run: RunState, sample: Sample) -> None:
        """Note a window."""
        self.temperature.append(float(sample.profiles["mid_face"].temperature[0]))


def run(mould: str, changes: tuple[str, ...], window: float, allowed: int) -> dict[str, Any]:
    """Run one case; a row of the table."""
    keys = (*QUIET, *COARSE, f"coupling.interval={window} s", f"coupling.passes={allowed}")
    if allowed > 1:
        keys += ("coupling.window_error=1000 K",)  # what repeating does by itself
    simulation = build(load_case(CASES / f"{mould}.toml", (*keys, *changes)), MPI.COMM_SELF)
    faces = Faces()
    loop = TimeLoop(simulation, faces)  # type: ignore[arg-type]
    start = process_time()
    loop.run()
    seconds = process_time() - start
    found = summarise(loop.run_state, "finished")
    simulation.destroy()
    late = faces.temperature[len(faces.temperature) // 4 :]
    return {
        "case": NAMES[mould] + (", 20 kW/(m² K), to 300 mm, elastic liquid" if changes else ""),
        "window": window,
        "allowed": allowed,
        "windows": loop.run_state.counts.windows,
        "iterations": loop.run_state.counts.coupling_iterations,
        "cut": loop.run_state.counts.cut_back,
        "not_converged": loop.run_state.counts.gap_not_converged,
        "swing": float(np.abs(np.diff(late, 2)).mean()),
        "heat": found.quantities["heat_removed_slice"].value / 1e3,
        "peak": found.quantities["von_mises_max"].value / 1e6,
        "seconds": seconds,
    }


HEAD: Columns = {
    "case": "case", "window": "window [s]", "allowed": "iterations allowed", "windows": "windows",
    "iterations": "iterations", "cut": "cut back", "not_converged": "not converged",
    "swing": ("swing of the mid-face [K]", ".1f"), "heat": ("heat [kJ]", ".2f"),
    "peak": ("peak stress [MPa]", ".1f"), "seconds": ("time [s]", ".1f"),
}  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Every case with one iteration and with the shipped number."""
    rows = []
    for case in CASES_TO_RUN[-1:] if quick else CASES_TO_RUN:
        for allowed in ITERATIONS:
            rows.append(run(*case, allowed))
            print(f"  {rows[-1]}", flush=True)
    output.csv("coupling", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    output.table("coupling", output.rows("coupling"), HEAD)
