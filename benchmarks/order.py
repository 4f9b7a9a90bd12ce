"""Who goes first, temperature or mechanics: the counterpart of the thesis' Figure 84.

Draws the figure of docs/coupling.md and fills its table: the corner of a billet in a strong mould,
as the heat has it and as the mechanics were given it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mpi4py import MPI

from benchmarks.billet_run import CASES, COARSE, QUIET
from benchmarks.report import Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

FINE = "coupling.interval=0.05 s"
ORDERS = {
    "mechanics first": (),
    "temperature first": ("coupling.order=thermal_first", "coupling.window_error=1000 K"),
    "windows of 0.05 s": ("coupling.order=thermal_first", FINE),
}


@dataclass
class Corner:
    """Sits where a recorder does: the corner's surface at the end of each window."""

    time: list[float] = field(default_factory=list)  #: s
    heat: list[float] = field(default_factory=list)  #: temperature, °C
    given: list[float] = field(default_factory=list)  #: what the mechanics were strained with, °C
    peak: list[float] = field(default_factory=list)  #: largest von Mises stress of the slice, MPa

    def step(self, run: RunState, sample: Sample) -> None:
        """Note a window."""
        mechanical = run.state.mechanical
        assert mechanical is not None and sample.mechanics is not None
        given = run.simulation.probes.sample(mechanical.temperature)["corner"].temperature[0]
        self.time.append(sample.time)
        self.heat.append(float(sample.profiles["corner"].temperature[0]) - ZERO_CELSIUS)
        self.given.append(float(given) - ZERO_CELSIUS)
        self.peak.append(sample.mechanics.peak / 1e6)


def run(*changes: str) -> Corner:
    """Run the shipped case on coarse cells."""
    case = load_case(CASES / "mechanics_first.toml", (*QUIET, *COARSE[:4], *changes))
    simulation, corner = build(case, MPI.COMM_SELF), Corner()
    TimeLoop(simulation, corner).run()  # type: ignore[arg-type]
    simulation.destroy()
    return corner


def figure(found: dict[str, Corner]) -> Any:
    """Temperatures of heat and mechanics over time, an order beside the other."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.2, 3.0), layout="constrained")
    exact = found["windows of 0.05 s"]
    panels = drawn.subplots(1, 2, sharey=True)
    for axes, (name, corner) in zip(panels, found.items(), strict=False):
        axes.plot(exact.time, exact.heat, color="0.6", label="heat, short windows")
        axes.plot(corner.time, corner.heat, "o", color="C3", label="heat")
        axes.plot(
            corner.time, corner.given, "--s", color="C0", ms=4, label="given to the mechanics"
        )
        axes.set_title(name)
        axes.set_xlabel("time [s]")
    panels[0].set_ylabel("corner [°C]")
    panels[1].legend()
    return drawn


def main(output: Output, quick: bool) -> None:
    """The figure and the table."""
    orders = dict(list(ORDERS.items())[:2]) if quick else ORDERS
    found = {name: run(*changes) for name, changes in orders.items()}
    if not quick:
        output.figure("mechanics_first", figure(found))
    rows = []
    for time in (1.0, 2.0, 3.0):
        row: dict[str, Any] = {"time": time}
        for name, corner in found.items():
            i = min(range(len(corner.time)), key=lambda k, c=corner: abs(c.time[k] - time))
            row |= {f"{name}: heat": corner.heat[i], f"{name}: given": corner.given[i]}
            row[f"{name}: peak"] = corner.peak[i]
        rows.append(row)
    output.csv("mechanics_first", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("mechanics_first")
    found = [key.removesuffix(": heat") for key in rows[0] if key.endswith(": heat")]
    shown = [
        {
            "time": r["time"],
            "order": name,
            **{k: r[f"{name}: {k}"] for k in ("heat", "given", "peak")},
        }
        for r in rows
        for name in found
    ]
    head = {
        "time": "time [s]", "order": "order", "heat": ("corner, heat [°C]", ".0f"),
        "given": ("given to the mechanics [°C]", ".0f"), "peak": ("peak stress [MPa]", ".1f"),
    }  # fmt: skip
    output.table("order", shown, head)
