"""Temperature and mechanics in turns: what repeating an interval costs, and what it saves from.

Writes the table of docs/coupling.md. The quarter billet in moulds, on cells of 1.2 mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET
from benchmarks.report import Output, table
from castfem.case import load_case
from castfem.results.run_state import RunState
from castfem.results.sample import Sample
from castfem.results.summary import summarise
from castfem.simulation.simulation import build
from castfem.time_loop.loop import TimeLoop

STRONG = ("cooling.mould.surface.0.coefficient=20000 W/(m^2 K)", 'casting.length="300 mm"')
TURNS = (
    *((mould, (), 0.1) for mould in ("taper_1", "taper_0")),
    *(("taper_1", STRONG, interval) for interval in (0.05, 0.1, 0.5)),
)
"""Mould, what is changed, interval [s]."""
PASSES = (1, 8)


@dataclass
class Faces:
    """Sits where a recorder does: temperature of the mid-face at the end of each interval, K."""

    temperature: list[float] = field(default_factory=list)

    def step(self, run: RunState, sample: Sample) -> None:
        """Note an interval."""
        self.temperature.append(float(sample.profiles["mid_face"].temperature[0]))


def run(mould: str, changes: tuple[str, ...], interval: float, passes: int) -> dict[str, Any]:
    """March one scene; a row of the table."""
    keys = (*QUIET, *COARSE, f"coupling.interval={interval} s", f"coupling.passes={passes}")
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
        "scene": NAMES[mould] + (", 20 kW/(m² K), to 300 mm" if changes else ""),
        "interval": interval,
        "allowed": passes,
        "intervals": loop.run_state.counts.windows,
        "passes": loop.run_state.counts.coupling_iterations,
        "cut": loop.run_state.counts.cut_back,
        "unsettled": loop.run_state.counts.gap_not_converged,
        "swing": float(np.abs(np.diff(late, 2)).mean()),
        "heat": found.quantities["heat_removed_slice"].value / 1e3,
        "peak": found.quantities["von_mises_max"].value / 1e6,
        "seconds": seconds,
    }


HEAD = {
    "scene": "scene",
    "interval": "interval [s]",
    "allowed": "passes allowed",
    "intervals": "intervals",
    "passes": "passes",
    "cut": "cut back",
    "unsettled": "not settled",
    "swing": "swing of the mid-face [K]",
    "heat": "heat [kJ]",
    "peak": "peak stress [MPa]",
    "seconds": "time [s]",
}
FORMS = {"swing": ".1f", "heat": ".2f", "peak": ".1f", "seconds": ".1f"}


def main(output: Output, quick: bool) -> None:
    """Every case with one iteration and with the shipped number."""
    rows = []
    for case in TURNS[-1:] if quick else TURNS:
        for passes in PASSES:
            rows.append(run(*case, passes))
            print(f"  {rows[-1]}", flush=True)
    output.csv("turns", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    output.insert("turns", table(output.rows("turns"), HEAD, FORMS))
