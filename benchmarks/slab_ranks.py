"""One rank and two on the slab: where the time of a Newton iteration goes, by the clock.

    python -m benchmarks.slab_ranks '{"size": 1.8}'          (mpirun -n 2 before it)

Some windows of cases/slab1200/slab.toml with 3680 cells, with the shell that it has as it leaves
the mould and with that of #50.  One rank and two take turns, ranks do not give way to other work:
it takes two free cores.  Writes a table of docs/slab.md.
"""

from __future__ import annotations

import json
import sys
from time import perf_counter
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from benchmarks.probe import launch
from benchmarks.report import Output, table
from benchmarks.slab_error import CASES, QUIET, THICK, Setting
from benchmarks.slice_probe import FACTOR, SOLVE, events
from castfem.case import load_case
from castfem.results.summary import summarise
from castfem.simulation.simulation import build
from castfem.time_loop.loop import TimeLoop

SIZE = 1.8  # mm at the wide faces: 3680 cells
TO = "casting.length=1 m"
SHELLS: dict[str, tuple[str, ...]] = {"as it leaves the mould": (), "that of #50": (THICK,)}
OWN = (
    "mechanics.solver={ mat_mumps_icntl_7 = 7, mat_mumps_icntl_8 = 77, mat_mumps_icntl_13 = 0 }",
)
WAYS: dict[str, tuple[int, tuple[str, ...]]] = {
    "1": (1, ()), "2": (2, ()), "2, as MUMPS chooses": (2, OWN),
}  # fmt: skip
TURNS = 3
SAME = 1e-8
PARTS = ("factor", "solve", "assembly", "law")


def measured(given: dict[str, Any]) -> dict[str, Any]:
    """Run some windows on all ranks; seconds of a Newton iteration by part, on this rank."""
    comm = MPI.COMM_WORLD
    PETSc.Log.begin()
    keys = (*QUIET, *Setting(given["size"], 50.0).changes, TO, *given["keys"])
    simulation = build(load_case(CASES / "slab.toml", keys), comm)
    before = dict(simulation.watch.seconds)
    loop = TimeLoop(simulation)
    comm.Barrier()
    start = perf_counter()
    loop.run()
    wall = perf_counter() - start
    run, newton = loop.run_state, loop.run_state.counts.newton_mechanics
    spent = {n: s - before.get(n, 0.0) for n, s in simulation.watch.seconds.items()}
    parts = {"factor": events(FACTOR), "solve": events(SOLVE)}
    parts |= {n: spent[n] for n in PARTS if n not in parts}
    strain = summarise(run, "finished").quantities["axial_strain"].value
    assert simulation.mechanics is not None
    points = len(simulation.mechanics.problem.active.rows)
    most = max(comm.allgather(points)) / comm.allreduce(points) * comm.size
    simulation.destroy()
    return {
        "newton": newton, "iteration": 1e3 * wall / newton, "uneven": 100.0 * (most - 1.0),
        "strain": strain, **{n: 1e3 * s / newton for n, s in parts.items()},
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """All ways by turns, for both shells.

    Raises:
        RuntimeError: Ranks do not come to the same strain.
    """
    rows = []
    size, turns = (7.5, 1) if quick else (SIZE, TURNS)
    for shell, keys in SHELLS.items():
        runs: dict[str, list[dict[str, Any]]] = {name: [] for name in WAYS}
        for _ in range(turns):
            for name, (ranks, more) in WAYS.items():
                given = {"size": size, "keys": [*keys, *more]}
                runs[name].append(launch("benchmarks.slab_ranks", given, ranks, gives_way=False))
                print(f"  {shell}, {name}: {runs[name][-1]}", flush=True)
        strains = [run["strain"] for those in runs.values() for run in those]
        if not np.allclose(strains, strains[0], rtol=SAME, atol=0.0):
            raise RuntimeError(f"ranks differ: {strains}")
        rows += [_row(shell, name, those, runs["1"]) for name, those in runs.items()]
    output.csv("slab_ranks", rows)
    show(output)


def _row(
    shell: str, name: str, runs: list[dict[str, Any]], alone: list[dict[str, Any]]
) -> dict[str, Any]:
    """The quickest run of one way, and its gain over one rank, turn by turn."""
    best = min(runs, key=lambda run: run["iteration"])
    gains = [a["iteration"] / b["iteration"] for a, b in zip(alone, runs, strict=True)]
    known = {n: best[n] for n in ("newton", "iteration", *PARTS)}
    other = best["iteration"] - sum(best[n] for n in PARTS)
    row = {"shell": shell, "ranks": name, **known, "other": other, "uneven": best["uneven"]}
    ratio = min(a["iteration"] for a in alone) / best["iteration"]
    return row | {"gain": ratio, "least": min(gains), "most": max(gains)}


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "shell": "shell", "ranks": "ranks", "iteration": "an iteration, ms",
        "factor": "factorisation", "solve": "substitution", "assembly": "assembly", "law": "law",
        "other": "all else", "uneven": "points of one rank, more than its share, %",
        "gain": "gain", "least": "least of a turn", "most": "most",
    }  # fmt: skip
    forms = dict.fromkeys(("iteration", "other", "uneven", *PARTS), ".0f")
    forms |= dict.fromkeys(("gain", "least", "most"), ".2f")
    if rows := output.rows("slab_ranks"):
        output.insert("slab ranks", table(rows, head, forms))


if __name__ == "__main__":
    found = measured(json.loads(sys.argv[1]))
    if MPI.COMM_WORLD.rank == 0:
        print("RESULT " + json.dumps(found))
