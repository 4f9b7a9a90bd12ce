"""One run of a freezing slice, timed step by step; by itself in a process of its own.

    python -m benchmarks.slice_probe '{"cells": 900}'          (mpirun -n 2 before it)

prints times, memory and sizes as JSON.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from benchmarks.probe import peak
from benchmarks.slices import CoolingSlice, Heat
from castfem import meshes
from castfem.physics.constitutive.elasticity import Solidity
from castfem.physics.constitutive.parameters import load_elasticity, load_law
from castfem.physics.machine import Machine, Steady
from castfem.physics.materials import load_steel
from castfem.physics.mechanics.definition import Slice
from castfem.physics.mechanics.ferrostatic import Ferrostatic
from castfem.physics.mechanics.planes import PlainPlanes, allowed_strains
from castfem.physics.thermal.flux_laws import Contact

SECTIONS = {
    "quarter": {"width": 0.125, "height": 0.125, "symmetry": "quarter"},
    "half": {"width": 1.2, "height": 0.22, "symmetry": "half"},
}
FACTOR = ("MatCholFctrSym", "MatCholFctrNum", "MatLUFactorSym", "MatLUFactorNum")
SOLVE = ("MatSolve", "MatMatSolve")


@dataclass(frozen=True, slots=True)
class Run:
    """What to run.

    Attributes:
        cells: About how many. section: Of `SECTIONS`: a billet's quarter, half a slab.
        before: Seconds in which a shell grows first, not timed. growth: Their steps, s.
        steps: Steps that are timed.
        step: Their length, s. options: PETSc options of the mechanics.
        large: Large strain.
    """

    cells: int = 900
    section: str = "quarter"
    before: float = 4.0
    growth: float = 1.0
    steps: int = 20
    step: float = 0.25
    options: dict[str, Any] = field(default_factory=dict, hash=False)
    large: bool = False


def mesh_of(run: Run) -> meshes.SectionMesh:
    """The section with sizes from 1 to 10 (surface to core) and about as many cells as wanted."""
    low, high = 0.02, 5.0

    def made(factor: float) -> meshes.SectionMesh:
        sizes = {"surface_size": 1e-3 * factor, "core_size": 1e-2 * factor}
        given = SECTIONS[run.section] | sizes
        return meshes.build("rectangle", cell="quadrilateral", **given)

    for _ in range(24):
        middle = float(np.sqrt(low * high))
        if len(made(middle).cells) > run.cells:
            low = middle
        else:
            high = middle
        if high < 1.002 * low:
            break
    return made(high)


def cooling_slice(run: Run, comm: MPI.Comm = MPI.COMM_SELF) -> CoolingSlice:
    """The freezing slice of the tests: contact with a cold wall, ferrostatic pressure."""
    steel = load_steel("carbon_042")
    mesh = mesh_of(run)
    start = steel.liquidus + 20.0
    names = [g for g in mesh.groups if not g.startswith("symmetry")]
    heat = Heat(
        steel, start, (400.0, start + 2.0), {n: Contact(1600.0, 433.15, 0.15) for n in names}
    )
    elasticity = load_elasticity("elastic_steel", Solidity.of(steel, stiffness_ratio=1e-5))
    slice_ = Slice(
        load_law("norton_hoff_kozlowski", elasticity),
        steel.thermal_strain,
        PlainPlanes(allowed_strains(mesh.groups)),
        ferrostatic=Ferrostatic(Machine(Steady(0.06)).head(7000.0), steel.solid_fraction),
        large_strain=run.large,
    )
    return CoolingSlice(mesh, heat, slice_, comm, run.options)


def events(names: tuple[str, ...]) -> float:
    """Seconds PETSc has spent in these events on this rank."""
    return float(sum(PETSc.Log.Event(n).getPerfInfo()["time"] for n in names))


def measure(run: Run, comm: MPI.Comm = MPI.COMM_SELF, repeats: int = 1) -> dict[str, Any]:
    """Run and time the mechanics.

    The same run does the same work in the same step. With several of them the fastest of each
    step counts: on a machine with other work that is the nearest to the truth.

    Args:
        run: What to run.
        comm: Ranks.
        repeats: Runs.

    Returns:
        Sizes; means over the steps: step_s, heat_s (of the temperature), newton, and seconds by
        part (see `_parts`); memory of all ranks after the first run.
    """
    PETSc.Log.begin()
    found: dict[str, Any] = {}
    clocks, memory = [], 0.0
    for _ in range(repeats):
        slice_ = cooling_slice(run, comm).advance(run.before, run.growth)
        first, rows = len(slice_.times), []
        for i in range(run.steps):
            before, heating = _parts(slice_), slice_.heating
            slice_.advance(run.before + (i + 1) * run.step, run.step)
            now = _parts(slice_)
            # What else the machine had to do stretched all parts alike.
            own = slice_.times[-1] / slice_.walls[-1]
            parts = [own * (now[n] - before[n]) for n in now]
            rows.append([*parts, slice_.heating - heating, slice_.times[-1]])
        names = [*now, "heat_s", "step_s"]
        clocks.append(rows)
        problem, section = slice_.problem, slice_.section
        found = {
            "cells": section.mesh.topology.index_map(2).size_global,
            "unknowns": problem.space.dofmap.index_map.size_global * 2 + problem.free,
            "points": problem.points.count,
            "newton": float(np.mean(slice_.newton[first:])),
            "generalized_strains": slice_.state.generalized_strains.tolist(),
        }
        slice_.destroy()
        memory = memory or peak()
    times = np.array(clocks)
    means = times[times[..., -1].argmin(axis=0), np.arange(run.steps)].mean(axis=0)
    found |= dict(zip(names, means.tolist(), strict=True))
    found["memory_mb"] = 1e-6 * comm.allreduce(memory)
    return found | {"newton_s": found["step_s"] / max(found["newton"], 1.0)}


def _parts(slice_: CoolingSlice) -> dict[str, float]:
    """Seconds so far, on this rank.

    "factor", "solve": LU. "other": the rest of PETSc and the bordered system. "assembly", "law",
    "kinematics", "python", "step": sections of the stopwatch.
    """
    spent = slice_.watch.seconds
    factor, solve = events(FACTOR), events(SOLVE)
    other = spent.get("petsc", 0.0) - factor - solve
    own = {n: spent.get(n, 0.0) for n in ("assembly", "law", "kinematics", "python", "step")}
    return {"factor": factor, "solve": solve, "other": other, **own}


def main() -> None:
    """Run and print."""
    given = json.loads(sys.argv[1])
    comm = MPI.COMM_WORLD
    before = peak()
    repeats = given.pop("repeats", 1)
    best = measure(Run(**given), comm, repeats)
    best["memory_before_mb"] = 1e-6 * comm.allreduce(before)
    if comm.rank == 0:
        print("RESULT " + json.dumps(best))


if __name__ == "__main__":
    main()
