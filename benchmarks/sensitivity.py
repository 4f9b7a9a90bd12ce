"""Cost of derivatives of a run by one parameter and by six: in time loops and in whole runs.

Times are processor times, the least of several alternate runs, on which other work on the machine
has the least effect. Cases are the thermal billet and the billet in its mould; whole runs are
measured as the command of a user and as the function of a script.
Writes tables of docs/sensitivity.md.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.processes import castfem
from benchmarks.report import Output
from castfem.api import run, sensitivities
from castfem.model import Case
from castfem.model.build.simulation import build
from castfem.model.load import load
from castfem.runs.loop import TimeLoop
from castfem.studies.sensitivity.followed_run import Recorder, follow
from castfem.studies.sensitivity.readings import Readings, asked_quantities

THERMAL, COUPLED = "billet125/thermal", "billet125/taper_1"
SIX = (
    "cooling.mould.coefficient", "cooling.mould.wall", "casting.superheat", "casting.speed",
    "steel.solidus", "steel.latent_heat",
)  # fmt: skip
OF = ("heat_removed", "surface_temperature_mid_face", "surface_temperature_corner")
SIX_OF_MOULD = (
    "mould.taper", "cooling.mould.gap_conductivity", "casting.speed", "casting.superheat",
    "law.strength", "steel.conductivity",
)  # fmt: skip
OF_MOULD = ("heat_removed", "von_mises_max", "axial_strain")
COUNTS = (0, 1, 6)
TURNS, TURNS_COUPLED = 7, 3
CELLS: dict[str, dict[str, Any]] = {
    "3 mm, 45 mm": {
        "casting.length": "45 mm", "mesh.surface_size": "3 mm", "mesh.corner_size": "3 mm",
    },
    "shipped, 150 mm": {"casting.length": "150 mm"},
    "shipped, 600 mm": {},
}  # fmt: skip
"""Changes of the case: the start of the run on coarse cells, then shipped cells."""


def _case(name: str, changes: dict[str, Any]) -> Case:
    return (
        load(name)
        .with_({"output.fields": [], "output.figures": False, "reference": []})
        .with_(changes)
    )


def _thermal(case: Case, count: int) -> tuple[float, float]:
    """Run a thermal case; return processor times of set-up and time loop, s."""
    start, simulation = process_time(), build(case, MPI.COMM_SELF)
    derivatives = follow(simulation, SIX[:count]) if count else None
    begun = process_time()
    TimeLoop(simulation).run()
    taken = begun - start, process_time() - begun
    if derivatives is not None:
        derivatives.destroy()
    simulation.destroy()
    return taken


def _coupled(case: Case, count: int) -> tuple[float, float]:
    """Run a billet in its mould; return processor times of set-up and time loop, s."""
    start, simulation = process_time(), build(case, MPI.COMM_SELF)
    loop = TimeLoop(simulation)
    if count:
        slopes = follow(simulation, SIX_OF_MOULD[:count])
        readings = Readings(simulation, slopes, asked_quantities(simulation, OF_MOULD))
        recorder = Recorder(simulation, slopes, readings, None)
        loop = TimeLoop(simulation, recorder, unsampled=recorder.unsampled)
    begun = process_time()
    loop.run()
    taken = begun - start, process_time() - begun
    if count:
        slopes.destroy()
    simulation.destroy()
    return taken


def _in_turn(turns: int, take: Callable[[int], Any]) -> np.ndarray:
    """Return the least time for each number of parameters; the first turn compiles."""
    return np.array([[take(count) for count in COUNTS] for _ in range(turns)]).min(axis=0)


def _rows(labels: dict[str, Any], times: np.ndarray) -> list[dict[str, Any]]:
    """Return a row per number of parameters from times of the time loop, and of set-up if any."""
    parts = times.reshape(len(COUNTS), -1)
    return [
        labels
        | {"parameters": count, **dict(zip(("seconds", "setup"), row[::-1].tolist(), strict=False))}
        | {"more": 100.0 * (row[-1] / parts[0, -1] - 1.0), "differences": 100.0 * count}
        for count, row in zip(COUNTS, parts, strict=True)
    ]


def spent(*words: str) -> float:
    """Return the processor time of a castfem command in a process and folder of its own, s."""
    with tempfile.TemporaryDirectory() as home:
        return castfem(*words, "-o", f"{home}/run").processor


def _whole(short: dict[str, Any], turns: int) -> list[dict[str, Any]]:
    """Measure whole runs with and without derivatives, as commands and as functions."""
    case_words = COUPLED, *(f"--set={key}={value}" for key, value in short.items())

    def command(count: int) -> float:
        to = ",".join(SIX_OF_MOULD[:count])
        of = ("--of", ",".join(OF_MOULD), "--to", to)
        return spent("sensitivity", *case_words, *of) if count else spent("run", *case_words)

    def called(case: Case, to: tuple[str, ...], of: tuple[str, ...]) -> Callable[[int], float]:
        def take(count: int) -> float:
            start = process_time()
            _ = sensitivities(case, to=to[:count], of=of) if count else run(case)
            return process_time() - start

        return take

    coupled = load(COUPLED).with_({"output.figures": False, **short})
    ways = {
        "command": command,
        "Python": called(coupled, SIX_OF_MOULD, OF_MOULD),
        "Python, temperatures alone": called(_case(THERMAL, short), SIX, OF),
    }
    return [
        row for way, take in ways.items() for row in _rows({"given": way}, _in_turn(turns, take))
    ]


def main(output: Output, quick: bool) -> None:
    """Measure time loops of both billets and whole runs."""
    short = {"casting.length": "45 mm"} if quick else {}
    thermal = _case(THERMAL, short)
    times = _in_turn(1 if quick else TURNS, lambda count: _thermal(thermal, count))
    output.csv("sensitivity_cost", _rows({}, times))
    turns = 1 if quick else TURNS_COUPLED + 1
    rows = []
    for cells, changes in list(CELLS.items())[: 1 if quick else None]:
        case = _case(COUPLED, changes)
        times = _in_turn(turns, lambda count, case=case: _coupled(case, count))  # type: ignore[misc]
        rows += _rows({"cells": cells}, times)
    output.csv("sensitivity_coupled", rows)
    output.csv("sensitivity_whole", _whole(short, turns))
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    head = {
        "parameters": "parameters", "setup": ("set-up, s", ".2f"),
        "seconds": ("time loop, s", ".2f"), "more": ("beyond a plain one, %", ".0f"),
        "differences": ("one-sided differences, %", ".0f"),
    }  # fmt: skip
    output.table("cost", output.rows("sensitivity_cost"), head)
    output.table("coupled", output.rows("sensitivity_coupled"), {"cells": "cells, length"} | head)
    head = {
        "given": "whole run, as", "parameters": "parameters",
        "seconds": ("processor time, s", ".1f"), "more": ("beyond a plain run, %", ".0f"),
    }  # fmt: skip
    output.table("whole", output.rows("sensitivity_whole"), head)
