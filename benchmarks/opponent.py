"""castfem and a plain script on scikit-fem: processor time at equal error.

The thermal billet in its mould (`cases/billet125/thermal.toml`) is compared with the converged
reference, half the thermal slab down 4 m of its caster (`cases/slab1200/sprays.toml`) with a run on
fine cells in short steps. Both programs get the same meshes and the best of their options. The
cheapest run of each within an error level is then repeated, alternately with that of the other.
Times are processor times of the time loop with its results, without set-up and files.

    tools/env.sh benchmark
    python -m benchmarks opponent
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from statistics import median
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks import accuracy
from benchmarks.billet import INSTANTS, LATE, billet_case
from benchmarks.reference import load
from benchmarks.report import ROOT, Columns, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

SLAB, TO = ROOT / "cases" / "slab1200" / "sprays.toml", 4.0  # m, through 14 rolls
QUIET = ("output.figures=false", "output.fields=[]", "output.every=1000 s")
SETTLED = 0.02  # distance below the mould from which surfaces are compared, m
PAIRS = 5
OURS, THEIRS = "castfem", "scikit-fem"


@dataclass(frozen=True, slots=True)
class Track:
    """Results and cost of a run."""

    time: Array  #: ends of its steps (n,), s
    values: Array  #: mid-face and corner, degC, heat of the whole section, MJ/m (3, n)
    vertices: int  #: number of unknowns
    newton: int  #: number of Newton iterations
    seconds: float  #: processor time

    def at(self, times: Array) -> Array:
        """Return the values at other times by linear interpolation (3, m)."""
        return np.array([np.interp(times, self.time, line) for line in self.values])


@dataclass(frozen=True, slots=True)
class Race:
    """A case for both programs and their options."""

    name: str
    probes: tuple[str, str]  #: probes whose surface temperatures are compared
    case: Callable[[float, float], Case]  #: case by size of cells, mm, and step, s, or error, K
    ours: tuple[float, ...]  #: castfem's steps, s, or errors of a step, K
    theirs: tuple[tuple[str, float, float | None], ...]  #: scheme, largest and first step, s
    sizes: tuple[float, ...]  #: sizes of cells, mm
    levels: tuple[tuple[float, float], ...]  #: error levels, K and % of the heat
    norm: Callable[[Array], float]  #: norm of an error over time
    unit: str  #: unit of castfem's steps
    fine: tuple[float, ...] = ()  #: arguments of `case` for the reference; () for the stored one


class Listener:
    """Keeps the compared results of each step; replaces the recorder of a run."""

    def __init__(self, probes: tuple[str, str]) -> None:
        self.probes = probes
        self.kept: list[tuple[float, ...]] = []

    def step(self, run: RunState, sample: Sample) -> None:
        """Keep the sample of a step."""
        surfaces = (sample.profiles[p].temperature[0] - ZERO_CELSIUS for p in self.probes)
        if sample.time > 0.0:
            self.kept.append((sample.time, *surfaces, 1e-6 * sample.removed))


def billet(size: float, step: float) -> Case:
    """Return the billet in equal steps."""
    sizes = {"surface_size": size, "corner_size": size, "step": step}
    return billet_case(replace(accuracy.GRADED, **sizes))


def slab(
    size: float, kelvin: float, core: float = 24.0, face: float = 30.0, largest: float = 2.0
) -> Case:
    """Return half the slab in adaptive steps of a tolerance, K, and a largest step, s."""
    keys = {"surface_size": size, "corner_size": size, "core_size": core, "face_size": face}
    mesh = [f"mesh.{name}={value:g} mm" for name, value in keys.items()]
    steps = {"tolerance": f"{kelvin:g} K", "largest": f"{largest:g} s"}
    adaptive = [f"thermal.time.adaptive.{name}={value}" for name, value in steps.items()]
    return load_case(SLAB, (*QUIET, f"casting.length={TO:g} m", *mesh, *adaptive))


BILLET = Race(
    "billet", ("mid_face", "corner"), billet, (0.5, 0.25, 0.1),
    tuple((scheme, step, None) for scheme in ("bdf2", "sdirk2") for step in (0.5, 0.25, 0.1)),
    (0.8, 0.6, 0.4, 0.3, 0.2), accuracy.LEVELS, lambda x: float(np.abs(x).max()), "s",
)  # fmt: skip
STRAND = Race(
    "slab", ("mid_face_intrados", "corner_intrados"), slab, (8.0, 4.0, 2.0),
    (("sdirk2", 2.0, 0.05), ("sdirk2", 2.0, 0.1), ("sdirk2", 2.0, 0.2), ("sdirk2", 1.0, 0.05),
     ("sdirk2", 1.0, 0.1), ("sdirk2", 0.5, 0.05), ("bdf2", 2.0, 0.02), ("bdf2", 2.0, 0.05),
     ("bdf2", 1.0, 0.02), ("bdf2", 1.0, 0.05), ("bdf2", 0.5, 0.02), ("bdf2", 0.25, 0.02)),
    (2.0, 1.5, 1.0, 0.5), ((4.0, 0.2), (2.0, 0.1), (1.0, 0.05)),
    lambda x: float(np.sqrt(np.mean(x**2))), "K", (0.25, 0.2, 6.0, 15.0, 0.25),
)  # fmt: skip


def ours(race: Race, case: Case) -> Track:
    """Run a case by castfem."""
    simulation, listener = build(case, MPI.COMM_SELF), Listener(race.probes)
    loop = TimeLoop(simulation, listener)  # type: ignore[arg-type]
    start = process_time()
    loop.run()
    seconds = process_time() - start
    vertices = simulation.section.owned
    newton = simulation.problem.iterations
    simulation.destroy()
    time, *values = np.array(listener.kept).T
    return Track(time, np.array(values), vertices, newton, seconds)


def theirs(race: Race, case: Case) -> Callable[[str, float, float | None], Track]:
    """Return a function that runs the plain script on the mesh of a case."""
    from benchmarks.plain_script import Script

    simulation = build(case, MPI.COMM_SELF)
    script, section, end = Script(simulation), simulation.section, case.casting.duration
    points = section.vertex_space.tabulate_dof_coordinates()[:, :2]
    starts = [simulation.probes.lines[name][0] for name in race.probes]
    probes = [int(np.argmin(np.linalg.norm(points - start, axis=1))) for start in starts]
    scale = 1e-6 * section.multiplicity

    def march(scheme: str, largest: float, first: float | None) -> Track:
        instants, kept, script.newton = script.instants(end, largest, first), [], 0
        start = process_time()
        for time, u, s in script.march(instants, scheme):
            kept.append((time, *script.temperature(u[probes]) - ZERO_CELSIUS, float(s.sum())))
        seconds = process_time() - start
        time, *surfaces, stored = np.array(kept).T
        first_heat = float(script.stored(np.full(section.owned, script.poured)).sum())
        values = np.array([*surfaces, scale * (first_heat - stored)])
        return Track(time, values, section.owned, script.newton, seconds)

    return march


def truth(race: Race) -> tuple[Array, Array]:
    """Return the times of comparison (n,), s, and the reference values (3, n)."""
    if not race.fine:
        values = load()["rounded"].values
        return INSTANTS[LATE], np.array([values[n][LATE] for n in ("mid_face", "corner", "heat")])
    case = race.case(*race.fine)
    below = np.arange(case.zones()[1].start + SETTLED, TO - 1e-9, 0.005)  # from roll to roll
    times: Array = np.asarray(below / case.casting.speed, float)
    return times, ours(race, case).at(times)


def compare(race: Race) -> list[dict[str, Any]]:
    """Do all runs of both programs; repeat the cheapest ones within each level alternately."""
    times, right = truth(race)
    rows: list[dict[str, Any]] = []
    runs: list[Callable[[], Track]] = []

    def add_row(code: str, size: float, how: str, run: Callable[[], Track]) -> None:
        found = run()
        off = found.at(times) - right
        runs.append(run)
        rows.append({
            "case": race.name, "code": code, "size_mm": size, "how": how,
            "vertices": found.vertices, "steps": len(found.time), "newton": found.newton,
            "kelvin": max(race.norm(off[0]), race.norm(off[1])),
            "heat_percent": 100.0 * float(np.abs(off[2] / right[2]).max()),
            "seconds": found.seconds, "level": None, "ratio": None,
        })  # fmt: skip

    for size in race.sizes:
        for step in race.ours:
            case = race.case(size, step)
            add_row(OURS, size, f"SDIRK2, {step:g} {race.unit}", partial(ours, race, case))
        march = theirs(race, race.case(size, race.ours[0]))
        for way in race.theirs:
            steps = f"{way[1]:g} s" if way[2] is None else f"{way[2]:g} to {way[1]:g} s"
            how = f"{way[0].upper()}, {steps}"
            add_row(THEIRS, size, how, partial(march, *way))
    tries = len(rows)
    for kelvin, percent in race.levels:
        pair = []
        for code in (OURS, THEIRS):
            near = [(r["seconds"], i) for i, r in enumerate(rows[:tries]) if r["code"] == code
                    and r["kelvin"] <= kelvin and r["heat_percent"] <= percent]  # fmt: skip
            pair += [min(near)[1]] if near else []
        if len(pair) == 2:
            turns = np.array([[runs[i]().seconds for i in pair] for _ in range(PAIRS)])
            level = {"level": f"{kelvin:g} K, {percent:g} %"}
            ratio = {"ratio": median(turns[:, 1] / turns[:, 0])}
            for i, spent, more in zip(pair, turns.T, ({}, ratio), strict=True):
                rows.append(rows[i] | level | {"seconds": median(spent)} | more)
    return rows


def main(output: Output, quick: bool = False) -> None:
    """Compare the programs on both cases; write table and CSV."""
    try:
        import skfem  # noqa: F401
    except ModuleNotFoundError:
        print("opponent: scikit-fem is missing: tools/env.sh benchmark")
        return
    races = [BILLET, STRAND]
    if quick:
        races = [replace(BILLET, ours=(0.5,), theirs=BILLET.theirs[:1], sizes=(1.2, 0.8))]
    output.csv("opponent", list(chain.from_iterable(compare(race) for race in races)))
    show(output)


def show(output: Output) -> None:
    """Write the table from the data."""
    head: Columns = {
        "case": "case", "level": "asked for", "code": "code", "size_mm": "cells [mm]",
        "how": "steps", "vertices": "vertices", "steps": "steps taken",
        "newton": "Newton iterations", "kelvin": ("error [K]", ".2f"),
        "heat_percent": ("heat [%]", ".3f"), "seconds": ("time [s]", ".3f"),
        "ratio": ("times castfem's", ".1f"),
    }  # fmt: skip
    output.table("opponent", [row for row in output.rows("opponent") if row["level"]], head)
