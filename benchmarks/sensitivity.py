"""Derivatives of a run: what six parameters cost, and how right they are against differences.

The billet's temperatures through its mould. The cost is processor time in memory, the least of
seven by turns, which other work on the machine disturbs least; differences are those of whole runs
on the same steps, at the best of three distances.
Writes tables of docs/sensitivity.md.
"""

from __future__ import annotations

from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import Output, table
from castfem.api import load
from castfem.case import Case
from castfem.sensitivity.linear import StageTangent
from castfem.sensitivity.parameters import Parameter, read_parameters
from castfem.sensitivity.result import Sensitivity
from castfem.sensitivity.run import follow, sensitivity
from castfem.sensitivity.varied import surface_heat
from castfem.simulation.simulation import build, case_steel
from castfem.thermal import problem as heat_balance
from castfem.thermal.stepper import GAMMA
from castfem.time_loop.loop import TimeLoop

CASE = "billet125/thermal"
SIX = (
    "cooling.mould.coefficient", "cooling.mould.wall", "casting.superheat", "casting.speed",
    "steel.solidus", "steel.latent_heat",
)  # fmt: skip
OF = ("heat_removed", "surface_temperature_mid_face", "surface_temperature_corner")
DEPTH = ("shell_mid_face", "shell_corner")
SHARES = (1e-3, 1e-4, 1e-5)  # of a parameter, or of 100 K: distances of differences
WIDE = (("casting.speed", 0.2), ("casting.superheat", 10.0))  # over several cells of the shell
TURNS = 7
REPEATS = 20  # of a factor


def _case(quick: bool) -> Case:
    changes: dict[str, Any] = {"output.fields": [], "output.figures": False, "reference": []}
    if quick:
        coarse = ("surface_size", "corner_size")
        changes |= {"casting.length": "120 mm", **{f"mesh.{key}": "1 mm" for key in coarse}}
    return load(CASE).with_(changes)


def _plain(case: Case) -> tuple[float, dict[str, float]]:
    """Processor time of the time loop, s, and its results."""
    simulation = build(case, MPI.COMM_SELF)
    simulation.problem.tolerance = 1e-12
    start = process_time()
    sample = TimeLoop(simulation).run()
    seconds = process_time() - start
    found = {"heat_removed": sample.removed}
    for name, profile in sample.profiles.items():
        found[f"surface_temperature_{name}"] = float(profile.temperature[0])
        found[f"shell_{name}"] = sample.shell[name]
    simulation.destroy()
    return seconds, found


def _cost(case: Case) -> list[dict[str, Any]]:
    """Processor times, s, of set-up and time loop: plain, and with derivatives by one and six."""
    times: dict[int, list[tuple[float, float]]] = {0: [], 1: [], 6: []}
    for _ in range(TURNS):
        for count, taken in times.items():
            start = process_time()
            simulation = build(case, MPI.COMM_SELF)
            if count:
                derivatives = follow(simulation, SIX[:count])
            begun = process_time()
            TimeLoop(simulation).run()
            taken.append((begun - start, process_time() - begun))
            if count:
                derivatives.destroy()
            simulation.destroy()
    plain = min(loop for _, loop in times[0])
    rows = []
    for count, taken in times.items():
        loop = min(loop for _, loop in taken)
        rows.append(
            {
                "parameters": count, "setup": min(setup for setup, _ in taken), "seconds": loop,
                "more": 100.0 * (loop / plain - 1.0), "differences": 100.0 * count,
            }
        )  # fmt: skip
    return rows


def _least(case: Case) -> list[dict[str, Any]]:
    """Processor time of a plain stage that is kept, of a factor, of back substitutions, ms."""
    stage = np.inf
    for _ in range(TURNS):
        simulation = build(case, MPI.COMM_SELF)
        problem, loop, start = simulation.problem, TimeLoop(simulation), process_time()
        loop.run()
        kept = 2 * loop.run_state.counts.taken  # stages
        stage = min(stage, (process_time() - start) / kept)
    state, tangent = loop.run_state.state.thermal, StageTangent(problem)
    slope = surface_heat(problem.cooling, state.point.temperature, state.time)[1]
    tau = GAMMA * (case.thermal.time.step or 0.0)
    rights = np.outer(np.ones(len(SIX)), problem.volume)
    none = np.zeros((len(SIX), len(problem.fixed)))
    tangent.factor(state.point, slope, tau)
    tangent.solve(rights, none)  # what is made once is made
    taken = []
    works = (
        lambda: tangent.factor(state.point, slope, tau), lambda: tangent.solve(rights, none),
    )  # fmt: skip
    for work in works:
        least = np.inf
        for _ in range(REPEATS):
            start = process_time()
            work()
            least = min(least, process_time() - start)
        taken.append(least)
    tangent.destroy()
    simulation.destroy()
    stage, factor, solves = (1e3 * seconds for seconds in (stage, *taken))
    share = 100.0 * (factor + solves) / stage
    return [{"stage": stage, "factor": factor, "solves": solves, "share": share}]


def _moved(case: Case, parameter: Parameter, by: float) -> dict[str, float]:
    """Results of a run with a parameter moved, on the same steps of the strand."""
    moved = parameter.case_at(case, parameter.value + by)
    if parameter.key == "casting.speed":
        step = case.thermal.time.step
        assert step is not None
        longer = parameter.value / (parameter.value + by)
        moved = moved.with_({"thermal.time.step": f"{step * longer!r} s"})
    return _plain(moved)[1]


def _differences(case: Case, parameter: Parameter, by: float) -> dict[str, float]:
    above, below = (_moved(case, parameter, sign * by) for sign in (1.0, -1.0))
    return {name: (above[name] - below[name]) / (2.0 * by) for name in above}


def _rows_of_accuracy(case: Case, found: Sensitivity, shares: tuple[float, ...]) -> list[Any]:
    """Relative distance of each derivative from the nearest of some differences."""
    rows: list[dict[str, Any]] = []
    for p in read_parameters(case, case_steel(case), SIX):
        size = 100.0 if p.unit in ("degC", "K") else abs(p.value)
        tried = [_differences(case, p, share * size) for share in shares]
        off = {
            name: min(abs(one[name] / found.gradient[name][p.name] - 1.0) for one in tried)
            for name in OF
        }
        rows.append({"parameter": p.name, **off})
    return rows


def main(output: Output, quick: bool) -> None:
    """Cost, accuracy, and derivatives of the shell beside wide differences."""
    case = _case(quick)
    output.csv("sensitivity_cost", _cost(case))
    output.csv("sensitivity_least", _least(case))
    steel = case_steel(case)
    given, heat_balance.BALANCE = heat_balance.BALANCE, 1e-13  # differences of runs tell more
    try:
        found = sensitivity(case, (*OF, *DEPTH), SIX, comm=MPI.COMM_SELF)
        rows = _rows_of_accuracy(case, found, SHARES[: 1 if quick else 3])
    finally:
        heat_balance.BALANCE = given
    output.csv("sensitivity_accuracy", rows)
    fronts: list[dict[str, Any]] = []
    for key, by in WIDE:
        (p,) = read_parameters(case, steel, [key])
        wide = _differences(case, p, by)
        fronts += [
            {
                "depth": one.quantity, "parameter": key, "unit": f"mm/({p.unit})",
                "mesh": 1e3 * one.of_mesh, "evened": 1e3 * one.value,
                "error": 1e3 * one.evened[1] if one.evened else np.nan,
                "wide": 1e3 * wide[one.quantity],
            }
            for one in found.derivatives
            if one.quantity in DEPTH and one.parameter == key
        ]  # fmt: skip
    output.csv("sensitivity_fronts", fronts)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    head = {
        "parameters": "parameters", "setup": "set-up, s", "seconds": "time loop, s",
        "more": "beyond a plain one, %", "differences": "one-sided differences, %",
    }  # fmt: skip
    forms = {"setup": ".2f", "seconds": ".2f", "more": ".0f", "differences": ".0f"}
    output.insert("cost", table(output.rows("sensitivity_cost"), head, forms))
    head = {
        "stage": "plain stage, ms", "factor": "factor, ms", "solves": "six back substitutions, ms",
        "share": "both, % of the stage",
    }  # fmt: skip
    forms = {"stage": ".1f", "factor": ".1f", "solves": ".1f", "share": ".0f"}
    output.insert("least", table(output.rows("sensitivity_least"), head, forms))
    head = {
        "parameter": "by", "heat_removed": "heat removed",
        "surface_temperature_mid_face": "surface, mid-face",
        "surface_temperature_corner": "surface, corner",
    }  # fmt: skip
    forms = dict.fromkeys(OF, ".1e")
    output.insert("accuracy", table(output.rows("sensitivity_accuracy"), head, forms))
    head = {
        "depth": "depth", "parameter": "by", "unit": "unit", "mesh": "of the discrete run",
        "evened": "evened out", "error": "its error", "wide": "of runs far apart",
    }  # fmt: skip
    forms = {"mesh": ".4f", "evened": ".4f", "error": ".4f", "wide": ".4f"}
    output.insert("fronts", table(output.rows("sensitivity_fronts"), head, forms))
