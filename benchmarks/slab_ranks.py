"""One rank and two on the slab: where the time of a Newton iteration goes, by the clock.

    python -m benchmarks.slab_ranks '{"size": 1.8}'          (mpirun -n 2 before it)

Some windows of cases/slab1200/slab.toml with 3680 cells, with the shell that it has as it leaves
the mould and with that of #50.  One rank and two take turns, ranks do not give way to other work.
The same window does the same work in each turn, so the quickest of each window counts; the first,
in which programs are loaded, does not.  It takes two free cores: turns go on until each rank has
had a core to itself in the windows that count, and the table says how far it had.  Writes a table
of docs/slab_error.md.
"""

from __future__ import annotations

import json
import sys
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from benchmarks.probe import launch
from benchmarks.report import Output, table
from benchmarks.slab_error import CASES, QUIET, THICK, Setting
from benchmarks.slice_probe import FACTOR, SOLVE, events
from castfem.model import load_case
from castfem.model.build.simulation import Simulation, build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.runs.results.summary import summarise

SIZE = 1.8  # mm at the wide faces: 3680 cells
TO = "casting.length=1.25 m"
SHELLS: dict[str, tuple[str, ...]] = {"as it leaves the mould": (), "that of #50": (THICK,)}
OWN = (
    "mechanics.solver={ mat_mumps_icntl_7 = 7, mat_mumps_icntl_8 = 77, mat_mumps_icntl_13 = 0 }",
)
WAYS: dict[str, tuple[int, tuple[str, ...]]] = {
    "1": (1, ()), "2": (2, ()), "2, as MUMPS chooses": (2, OWN),
}  # fmt: skip
TURNS, MOST = 3, 24
CALM = 95.0  # % of the time that a rank had a core
SAME = 1e-8
PARTS = ("factor", "solve", "assembly", "law")


class _Clock:
    """Notes at the end of each window what it has taken so far, on this rank, s."""

    def __init__(self, simulation: Simulation) -> None:
        self._watch, self.rows = simulation.watch, [[0.0]]

    def step(self, run: RunState, sample: Sample) -> None:
        """See `castfem.runs.recorder`."""
        spent = self._watch.seconds
        parts = {"factor": events(FACTOR), "solve": events(SOLVE)} | {
            name: spent.get(name, 0.0) for name in ("assembly", "law")
        }
        clocks = [perf_counter(), process_time()]
        newton = float(run.counts.newton_mechanics)
        self.rows.append([newton, *clocks, *(parts[name] for name in PARTS)])


def measured(given: dict[str, Any]) -> dict[str, Any]:
    """Run some windows on all ranks; what each takes by part, on this rank.

    Returns:
        windows: Newton iterations, seconds, least processor time of a rank, seconds by part, of
        each but the first. uneven: What a rank has more points than its share, %.
    """
    comm = MPI.COMM_WORLD
    PETSc.Log.begin()
    keys = (*QUIET, *Setting(given["size"], 50.0).changes, TO, *given["keys"])
    simulation = build(load_case(CASES / "slab.toml", keys), comm)
    clock = _Clock(simulation)
    loop = TimeLoop(simulation, clock)  # type: ignore[arg-type]
    comm.Barrier()
    loop.run()
    rows = np.diff(np.array(clock.rows[2:]), axis=0)  # from the end of the first window
    rows[:, 2] = np.min(comm.allgather(rows[:, 2]), axis=0)
    strain = summarise(loop.run_state, "finished").quantities["axial_strain"].value
    assert simulation.mechanics is not None
    points = len(simulation.mechanics.problem.active.rows)
    most = max(comm.allgather(points)) / comm.allreduce(points) * comm.size
    simulation.destroy()
    return {"windows": rows.tolist(), "strain": strain, "uneven": 100.0 * (most - 1.0)}


def main(output: Output, quick: bool) -> None:
    """All ways by turns, for both shells.

    Raises:
        RuntimeError: Ranks do not come to the same strain.
    """
    rows = []
    size, least, turns = (7.5, 1, 1) if quick else (SIZE, TURNS, MOST)
    for shell, keys in SHELLS.items():
        runs: dict[str, list[dict[str, Any]]] = {name: [] for name in WAYS}
        for turn in range(turns):
            for name, (ranks, more) in WAYS.items():
                if turn >= least and _quickest(runs[name])["core"] >= CALM:
                    continue
                given = {"size": size, "keys": [*keys, *more]}
                runs[name].append(launch("benchmarks.slab_ranks", given, ranks, gives_way=False))
                print(f"  {shell}, {name}: {_quickest(runs[name][-1:])}", flush=True)
        strains = [run["strain"] for those in runs.values() for run in those]
        if not np.allclose(strains, strains[0], rtol=SAME, atol=0.0):
            raise RuntimeError(f"ranks differ: {strains}")
        rows += [_row(shell, name, those, runs["1"]) for name, those in runs.items()]
    output.csv("slab_ranks", rows)
    show(output)


def _quickest(runs: list[dict[str, Any]]) -> dict[str, float]:
    """Milliseconds of an iteration, each window by the run that was quickest in it."""
    found = np.array([run["windows"] for run in runs])
    best = found[found[..., 1].argmin(axis=0), np.arange(found.shape[1])].sum(axis=0)
    iteration, core, *parts = 1e3 * best[1:] / best[0]
    told = {"newton": best[0], "iteration": iteration, "core": 100.0 * core / iteration} | dict(
        zip(PARTS, parts, strict=True)
    )
    return {name: float(value) for name, value in told.items()}


def _row(
    shell: str, name: str, runs: list[dict[str, Any]], alone: list[dict[str, Any]]
) -> dict[str, Any]:
    """The quickest windows of one way, and its gain over one rank."""
    best = _quickest(runs)
    gain = _quickest(alone)["iteration"] / best["iteration"]
    ranks = WAYS[name][0]
    # Amdahl: 1 / gain = alone + (1 - alone) / ranks
    alone_share = 100.0 * (ranks / gain - 1.0) / (ranks - 1.0) if ranks > 1 else None
    return {
        "shell": shell, "ranks": name, **best,
        "other": best["iteration"] - sum(best[n] for n in PARTS), "uneven": runs[0]["uneven"],
        "gain": gain, "alone": alone_share,
    }  # fmt: skip


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "shell": "shell", "ranks": "ranks", "iteration": "an iteration, ms",
        "factor": "factorisation", "solve": "substitution", "assembly": "assembly", "law": "law",
        "other": "all else", "gain": "gain", "alone": "as if not shared, %",
        "uneven": "points of one rank, more than its share, %",
        "core": "of the time a rank had a core, %",
    }  # fmt: skip
    forms = dict.fromkeys(("iteration", "other", "core", "uneven", "alone", *PARTS), ".0f")
    forms["gain"] = ".2f"
    if rows := output.rows("slab_ranks"):
        output.insert("slab ranks", table(rows, head, forms))


if __name__ == "__main__":
    found = measured(json.loads(sys.argv[1]))
    if MPI.COMM_WORLD.rank == 0:
        print("RESULT " + json.dumps(found))
