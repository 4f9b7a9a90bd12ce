"""A cooling that jumps: how far steps of second order come back, and what it costs to stop that."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.accuracy import default_settings
from benchmarks.billet import Settings, billet_case
from benchmarks.report import Output, table
from castfem.base.types import Array
from castfem.model import from_document
from castfem.model.build.simulation import build
from castfem.physics.thermal.stepper import ThermalStepper
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

COEFFICIENTS = (1.6, 8.0, 30.0)  # kW/m2K, to 25 degC, from the meniscus on
STEPS = (0.5, 0.25)  # s
FINE = 0.02  # s
EVERY = 0.5  # s between the instants of comparison
FROM = 2.0  # s: where they begin
KINDS = ("SDIRK2 alone", "as shipped", "backward Euler")


@contextmanager
def alone(kind: str) -> Iterator[None]:
    """Steps of second order that nobody looks at, for the first of `KINDS`."""
    look_ahead = ThermalStepper._look_ahead
    if kind == KINDS[0]:
        ThermalStepper._look_ahead = lambda *_: (False, None)  # type: ignore[method-assign,assignment]
    try:
        yield
    finally:
        ThermalStepper._look_ahead = look_ahead  # type: ignore[method-assign]


class Listener:
    """What is compared, after each step."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.temperatures: list[Array] = []
        self.mid_face: list[float] = []

    def step(self, run: RunState, sample: Sample) -> None:
        """Keep it."""
        self.times.append(sample.time)
        self.temperatures.append(run.state.thermal.point.temperature)
        self.mid_face.append(float(sample.profiles["mid_face"].temperature[0]))


def run_case(settings: Settings, coefficient: float) -> dict[str, Any]:
    """Quench the billet with a coefficient (kW/m2K); what came of it."""
    document = billet_case(settings).document()
    law = {"law": "convection", "coefficient": f"{coefficient} kW/(m^2 K)", "ambient": "25 degC"}
    document["cooling"][0]["surface"] = [law]
    document["output"] = {"fields": []}
    simulation = build(from_document(document, "jump"), MPI.COMM_SELF)
    heard = Listener()
    try:
        run = TimeLoop(simulation, heard)  # type: ignore[arg-type]
        start = perf_counter()
        run.run()
        wall = perf_counter() - start
    finally:
        simulation.destroy()
    instants = np.arange(FROM, run.run_state.state.time + 1e-9, EVERY)
    at = np.searchsorted(heard.times, instants - 1e-6)
    return {
        "rise": max(float(np.diff(heard.temperatures, axis=0).max()), 0.0),
        "mid_face": np.array(heard.mid_face)[at],
        "heat": run.run_state.state.thermal.removed,
        "steps": run.run_state.counts.steps,
        "limited": run.run_state.counts.limited,
        "newton": run.run_state.counts.newton,
        "seconds": wall,
    }


def main(output: Output, quick: bool = False) -> None:
    """The shipped mesh and one of 2 mm, quenched; table and CSV."""
    shipped = default_settings()
    coarse = replace(shipped, surface_size=2.0, corner_size=2.0)
    rows = []
    for mesh in (coarse,) if quick else (coarse, shipped):
        for coefficient in COEFFICIENTS[2:] if quick else COEFFICIENTS:
            exact = run_case(replace(mesh, step=0.1 if quick else FINE), coefficient)
            for step in STEPS[:1] if quick else STEPS:
                for kind in KINDS:
                    scheme = "backward_euler" if kind == KINDS[2] else "sdirk2"
                    with alone(kind):
                        found = run_case(replace(mesh, scheme=scheme, step=step), coefficient)
                    apart = np.abs(found["mid_face"] - exact["mid_face"]).max()
                    rows.append(
                        {
                            "surface_size_mm": mesh.surface_size,
                            "coefficient_kW": coefficient,
                            "step_s": step,
                            "kind": kind,
                            "rise_K": found["rise"],
                            "limited": found["limited"],
                            "mid_face_K": float(apart),
                            "heat_percent": 100.0 * (found["heat"] / exact["heat"] - 1.0),
                            "newton": found["newton"],
                            "seconds": found["seconds"],
                        }
                    )
    output.csv("jumps", rows)
    print(f"jumps: {len(rows)} runs")
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("jumps")
    headings = {
        "surface_size_mm": "surface size [mm]", "coefficient_kW": "coefficient [kW/m²K]",
        "step_s": "step [s]", "kind": "steps", "rise_K": "comes back by [K]", "limited": "limited",
        "mid_face_K": "mid-face [K]", "heat_percent": "heat [%]", "newton": "Newton iterations",
    }  # fmt: skip
    formats = {"rise_K": ".1f", "mid_face_K": ".3f", "heat_percent": "+.4f"}
    output.insert("jumps", table(rows, headings, formats))
