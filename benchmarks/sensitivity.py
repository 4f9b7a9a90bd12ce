"""Derivatives of a run: what six parameters cost, and how right they are against differences.

The billet's temperatures through its mould. The cost is processor time in memory, the least of
seven by turns, which other work on the machine disturbs least; differences are those of whole runs
on the same steps, at the best of three distances.
Then why the factor is not shared between stages, and what the billet in its mould costs, its time
loop alone, and whole: as the command that a user gives, and as the function that a script calls.
Writes tables of docs/sensitivity.md.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any
from unittest.mock import patch

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from benchmarks.plain_run import measure
from benchmarks.report import ROOT, Output, table
from castfem.api import load, run, sensitivities
from castfem.base.types import Array
from castfem.model import Case
from castfem.model.build.simulation import build, case_steel
from castfem.physics.materials.curve import CurvePoint
from castfem.physics.thermal import problem as heat_balance
from castfem.physics.thermal.options import ITERATIVE
from castfem.physics.thermal.stepper import GAMMA
from castfem.runs.loop import TimeLoop
from castfem.studies.sensitivity.differentiated_steps import followed
from castfem.studies.sensitivity.linear import StageTangent
from castfem.studies.sensitivity.parameters import Parameter, read_parameters
from castfem.studies.sensitivity.perturbed_simulation import surface_heat
from castfem.studies.sensitivity.readings import Readings, asked_quantities
from castfem.studies.sensitivity.recorder import FollowedLoop, Recorder
from castfem.studies.sensitivity.result import Sensitivity
from castfem.studies.sensitivity.run import follow, sensitivity

_Place = tuple[CurvePoint, Array, float]  # of StageTangent.factor

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
TURNS_COUPLED, TURNS_WHOLE = 3, 3
EVERY = 5  # stages, of which one is looked at
COUPLED = "billet125/taper_1"
# What is asked is a ratio: the start of the run, on cells that a search would find coarse, and on
# those it is shipped with.
CELLS: dict[str, dict[str, Any]] = {
    "3 mm, 45 mm": {
        "casting.length": "45 mm", "mesh.surface_size": "3 mm", "mesh.corner_size": "3 mm",
    },
    "shipped, 150 mm": {"casting.length": "150 mm"},
    "shipped, 600 mm": {},
}  # fmt: skip
OF_MOULD = ("heat_removed", "von_mises_max", "axial_strain")
SIX_OF_MOULD = (
    "mould.taper", "cooling.mould.gap_conductivity", "casting.speed", "casting.superheat",
    "law.strength", "steel.conductivity",
)  # fmt: skip


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


def _matrices(problem: heat_balance.ThermalProblem, run: Callable[[], Any]) -> list[list[_Place]]:
    """What makes the matrix of each Newton iterate of the stages of a run, their solution last."""
    stages: list[list[_Place]] = []
    iterates: list[CurvePoint] = []
    solve, jacobian = problem.solve_stage, problem.jacobian

    def noted_jacobian(x: PETSc.Vec, out: PETSc.Mat) -> None:
        iterates.append(problem.curve.at(x.getArray(readonly=True)))
        jacobian(x, out)

    def noted_stage(base: Array, guess: Array, tau: float, time: float) -> heat_balance.Stage:
        iterates.clear()
        stage = solve(base, guess, tau, time)
        if iterates:  # else it was solved when the scheme looked ahead
            stages.append([
                (point, surface_heat(problem.cooling, point.temperature, time)[1], tau)
                for point in (*iterates, stage.point)
            ])  # fmt: skip
        return stage

    laid = {"jacobian": noted_jacobian, "solve_stage": noted_stage}
    with patch.multiple(problem, **laid):
        run()
    return stages


def _iterations(factored: StageTangent, other: StageTangent, right: Array) -> int:
    """Iterations of conjugate gradients for the matrix of `other` by the factor of `factored`."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setType("cg")
    pc = factored.solver.getPC()
    ksp.setPC(pc)
    ksp.setOperators(other.matrix, factored.matrix)
    ksp.setTolerances(rtol=ITERATIVE["ksp_rtol"])
    pc.setReusePreconditioner(True)
    given = other.matrix.createVecLeft()
    given.setArray(right)
    found = given.duplicate()
    ksp.solve(given, found)
    taken = int(ksp.getIterationNumber())
    pc.setReusePreconditioner(False)
    for thing in (given, found, ksp):
        thing.destroy()
    return taken


def _shared(case: Case) -> list[dict[str, Any]]:
    """Iterations for one right-hand side with the exact factor of another matrix of the run."""
    simulation = build(case, MPI.COMM_SELF)
    problem = simulation.problem
    stages = _matrices(problem, TimeLoop(simulation).run)
    factored, other = StageTangent(problem), StageTangent(problem)
    right = problem.volume * np.random.default_rng(0).normal(size=len(problem.volume))
    taken: dict[str, list[int]] = {}
    for i in range(4, len(stages), EVERY):
        *iterates, solution = stages[i]
        pairs = {
            "Newton's last matrix": (iterates[-1], solution),
            "Newton's first matrix": (iterates[0], solution),
            "matrix at the end of the stage before": (stages[i - 1][-1], solution),
            "the same, for Newton's first matrix": (stages[i - 1][-1], iterates[0]),
            "of two stages before": (stages[i - 2][-1], solution),
        }
        for name, (one, two) in pairs.items():
            factored.factor(*one)
            other.factor(*two)
            taken.setdefault(name, []).append(_iterations(factored, other, right))
    rows: list[dict[str, Any]] = [
        {"factor": name, "least": min(n), "median": float(np.median(n)), "most": max(n)}
        for name, n in taken.items()
    ]
    for thing in (factored, other, simulation):
        thing.destroy()
    return rows


def _coupled(case: Case, count: int) -> tuple[float, float]:
    """Processor times, s, of set-up and time loop of a billet in its mould, with derivatives."""
    start, simulation = process_time(), build(case, MPI.COMM_SELF)
    loop = TimeLoop(simulation)
    if count:
        slopes = follow(simulation, SIX_OF_MOULD[:count])
        readings = Readings(simulation, slopes, asked_quantities(simulation, OF_MOULD))
        loop = FollowedLoop(simulation, Recorder(simulation, slopes, readings, None))
    begun = process_time()
    loop.run()
    taken = begun - start, process_time() - begun
    if count:
        assert simulation.coupling is not None
        slopes.destroy()
        followed(simulation.coupling).destroy()
    simulation.destroy()
    return taken


def _cost_coupled(quick: bool) -> list[dict[str, Any]]:
    """The same of both meshes: plain, with derivatives by one parameter and by six."""
    rows: list[dict[str, Any]] = []
    for cells, changes in list(CELLS.items())[: 1 if quick else None]:
        case = load(COUPLED).with_(
            {**changes, "output.fields": [], "output.figures": False, "reference": []}
        )
        taken: dict[int, list[tuple[float, float]]] = {0: [], 1: [], len(SIX_OF_MOULD): []}
        for _ in range(1 if quick else TURNS_COUPLED + 1):  # the first compiles
            for count, times in taken.items():
                times.append(_coupled(case, count))
        plain = min(loop for _, loop in taken[0])
        for count, times in taken.items():
            setup, loop = (min(column) for column in zip(*times, strict=True))
            more = 100.0 * (loop / plain - 1.0)
            rows.append(
                {"cells": cells, "parameters": count, "setup": setup, "seconds": loop,
                 "more": more, "differences": 100.0 * count}
            )  # fmt: skip
    return rows


def _whole(quick: bool) -> list[dict[str, Any]]:
    """Processor time of whole runs, plain and with derivatives.

    The billet in its mould as the command that a user gives, and as the function that a script
    calls, which draws nothing; its temperatures as the function.
    """
    short = {"casting.length": "45 mm"} if quick else {}
    case = load(COUPLED).with_({"output.figures": False, **short})
    given = COUPLED, "-q", *(f"--set={key}={value}" for key, value in short.items())
    of = "--of", ",".join(OF_MOULD), "--to"

    def command(count: int) -> float:
        words = ("sensitivity", *given, *of, ",".join(SIX_OF_MOULD[:count]))
        return measure(ROOT, words if count else ("run", *given))["processor [s]"]

    def called(case: Case, to: tuple[str, ...], of: tuple[str, ...]) -> Callable[[int], float]:
        def take(count: int) -> float:
            start = process_time()
            if count:
                sensitivities(case, to=to[:count], of=of)
            else:
                run(case)
            return process_time() - start

        return take

    ways = {
        "command": command,
        "Python": called(case, SIX_OF_MOULD, OF_MOULD),
        "Python, temperatures alone": called(_case(quick), SIX, OF),
    }
    rows: list[dict[str, Any]] = []
    counts = 0, 1, len(SIX)
    for way, take in ways.items():
        turns = 1 if quick else TURNS_WHOLE + 1  # the first compiles
        times = np.array([[take(count) for count in counts] for _ in range(turns)]).min(axis=0)
        rows += [
            {"given": way, "parameters": count, "seconds": float(its),
             "more": 100.0 * (its / times[0] - 1.0)}
            for count, its in zip(counts, times, strict=True)
        ]  # fmt: skip
    return rows


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
    output.csv("sensitivity_shared", _shared(case))
    output.csv("sensitivity_coupled", _cost_coupled(quick))
    output.csv("sensitivity_whole", _whole(quick))
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
    head = {"factor": "factor of", "least": "least", "median": "median", "most": "most"}
    output.insert("shared", table(output.rows("sensitivity_shared"), head, {"median": ".0f"}))
    head = {
        "cells": "cells, length",
        "parameters": "parameters", "setup": "set-up, s", "seconds": "time loop, s",
        "more": "beyond a plain one, %", "differences": "one-sided differences, %",
    }  # fmt: skip
    forms = {"setup": ".2f", "seconds": ".2f", "more": ".0f", "differences": ".0f"}
    output.insert("coupled", table(output.rows("sensitivity_coupled"), head, forms))
    head = {
        "given": "whole run, as", "parameters": "parameters", "seconds": "processor time, s",
        "more": "beyond a plain run, %",
    }  # fmt: skip
    forms = {"seconds": ".1f", "more": ".0f"}
    output.insert("whole", table(output.rows("sensitivity_whole"), head, forms))
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
