"""What made the coupled billet faster, and what did not: levers pulled one at a time, in pairs.

Writes a section of docs/benchmarks_mechanics.md. Each lever is a run with one thing otherwise than
shipped, by a key of the case or by taking back what the program does; all are run by turns, and
each is held against the mean of the runs as shipped of its own turn. Times are those of the
processor, of the time loop.

The state before is run in pairs with this one if BEFORE names a checkout of it:

    BEFORE=../castfem_before python -m benchmarks faster

Without that its row stays what it was.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, QUIET, every, mesh
from benchmarks.billet_trade import COMPARED
from benchmarks.report import ROOT, Output, table
from castfem.model import load_case
from castfem.model.build.simulation import Simulation, build
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.runs.loop import TimeLoop
from castfem.runs.results.summary import quantities

SHIPPED = "as shipped"
BEFORE = "before"
TURNS, PAIRS = 2, 3

Change = Callable[[MechanicalStepper], None]


def unchanged(mechanics: MechanicalStepper) -> None:
    """Leave all as it is."""


def every_cell(mechanics: MechanicalStepper) -> None:
    """Have the deep liquid take part in every step."""
    problem = mechanics.problem
    cells = np.arange(problem.section.cells, dtype=np.int32)
    assert problem.liquid is not None
    problem.liquid.cells_to = lambda layer: cells  # type: ignore[method-assign]


def law_again(mechanics: MechanicalStepper) -> None:
    """Ask the law again when contacts are let go of."""
    problem = mechanics.problem
    hold = problem.interactions.hold

    def forgetting(on: bool) -> bool:
        problem._integrated = None
        return hold(on)

    problem.interactions.hold = forgetting  # type: ignore[method-assign]


def free_at_once(mechanics: MechanicalStepper) -> None:
    """Let contacts open from the first iteration on."""
    mechanics.problem.interactions.hold = lambda on: False  # type: ignore[method-assign]


def from_rest(mechanics: MechanicalStepper) -> None:
    """Start each step where the last has ended."""
    mechanics.extrapolate = False


SOLVER = "mechanics.solver."
LEVERS: dict[str, tuple[tuple[str, ...], Change]] = {
    SHIPPED: ((), unchanged),
    "deep liquid takes part in every step": ((), every_cell),
    "law asked again as contacts are let go": ((), law_again),
    "no extrapolation": ((), from_rest),
    "contacts may open from the start": ((), free_at_once),
    "MUMPS without scaling": ((f"{SOLVER}mat_mumps_icntl_8=0",), unchanged),
    "MUMPS, ordering METIS": ((f"{SOLVER}mat_mumps_icntl_7=5",), unchanged),
    "MUMPS, ordering SCOTCH": ((f"{SOLVER}mat_mumps_icntl_7=3",), unchanged),
    "each factor for two iterations": ((f"{SOLVER}snes_lag_jacobian=2",), unchanged),
    "windows of 0.2 s": ((every(0.2),), unchanged),
}
QUICK = (*mesh(2.0), every(0.5))


def marched(keys: Sequence[str], change: Change = unchanged) -> dict[str, Any]:
    """Run the billet at +1 %/m: seconds of its time loop, counts, and what it came to."""
    simulation = build(load_case(CASES / "taper_1.toml", (*QUIET, *keys)), MPI.COMM_SELF)
    assert simulation.mechanics is not None
    change(simulation.mechanics)
    laws = _counted(simulation)
    loop = TimeLoop(simulation)
    start = process_time()
    sample = loop.run()
    seconds = process_time() - start
    values = {name: one.shown for name, one in quantities(sample).items()}
    newton = loop.run_state.counts.newton_mechanics
    simulation.destroy()
    return {"seconds": seconds, "newton": newton, "law": len(laws), "values": values}


def _counted(simulation: Simulation) -> list[None]:
    """A list that grows by an entry with each call of the law at all points that have stress."""
    found: list[None] = []
    watch, section = simulation.watch, simulation.watch.section

    def counting(name: str) -> Any:
        if name == "kinematics":
            found.append(None)
        return section(name)

    watch.section = counting  # type: ignore[method-assign]
    return found


def moved(one: dict[str, float], other: dict[str, float]) -> float:
    """Largest relative difference of two runs' results."""
    return max(abs(one[k] - other[k]) / abs(other[k]) for k in COMPARED)


def alone(root: Path, keys: Sequence[str]) -> tuple[float, int]:
    """Seconds and iterations of a run of a checkout in a process of its own."""
    code = (
        "import sys; from time import process_time as now; from mpi4py import MPI\n"
        "from castfem.model import load_case; from castfem.runs.loop import TimeLoop\n"
        "from castfem.model.build.simulation import build\n"
        "case = load_case(sys.argv[1], tuple(sys.argv[2:]))\n"
        "loop = TimeLoop(build(case, MPI.COMM_SELF)); start = now(); loop.run()\n"
        "print('took', now() - start, loop.run_state.counts.newton_mechanics)\n"
    )
    case = root / "cases" / "billet125" / "taper_1.toml"
    words = [str(root / ".castfem" / "bin" / "python"), "-c", code, str(case), *QUIET, *keys]
    found = subprocess.run(words, cwd=root, capture_output=True, text=True, check=True).stdout
    _, seconds, newton = next(line for line in found.splitlines() if "took" in line).split()
    return float(seconds), int(newton)


def pairs(root: Path, keys: Sequence[str], turns: int) -> Iterator[tuple[float, float, int]]:
    """Seconds of another checkout and of this one, by turns, and iterations of the other."""
    for turn in range(turns):
        seconds, newton = alone(root, keys)
        here, _ = alone(ROOT, keys)
        print(f"  turn {turn + 1}: before {seconds:.2f} s, now {here:.2f} s", flush=True)
        yield seconds, here, newton


def spread(ratios: Sequence[float]) -> dict[str, float]:
    """The middle, the least and the largest of some ratios."""
    return {"ratio": float(np.median(ratios)), "least": min(ratios), "most": max(ratios)}


def before(output: Output, keys: Sequence[str], turns: int) -> list[dict[str, Any]]:
    """The row of the state before: from the checkout that BEFORE names, or as it was."""
    if "BEFORE" not in os.environ:
        return [r for r in output.rows("faster") if r["lever"] == BEFORE]
    found = list(pairs(Path(os.environ["BEFORE"]).resolve(), keys, turns))
    ratios = [old / new for old, new, _ in found]
    seconds = float(np.median([old for old, _, _ in found]))
    row = {"lever": BEFORE, "seconds": seconds, **spread(ratios), "newton": found[0][2]}
    return [row | {"law": None, "moved": None}]


def main(output: Output, quick: bool) -> None:
    """The state before, and all levers by turns."""
    keys, turns = (QUICK, 1) if quick else ((), TURNS)
    rows = before(output, keys, 1 if quick else PAIRS)
    marched((*mesh(2.0), every(1.0)))  # what is compiled and read once is there from now on
    found: dict[str, list[dict[str, Any]]] = {lever: [] for lever in LEVERS}
    ratios: dict[str, list[float]] = {lever: [] for lever in LEVERS}
    for _ in range(turns):
        for lever, (changed, change) in LEVERS.items():
            found[lever].append(marched((*keys, *changed), change))
            print(f"  {lever}: {found[lever][-1]['seconds']:.2f} s", flush=True)
        again = marched(keys)["seconds"]
        base = 0.5 * (found[SHIPPED][-1]["seconds"] + again)
        for lever, runs in found.items():
            ratios[lever].append((again if lever == SHIPPED else runs[-1]["seconds"]) / base)
    shipped = found[SHIPPED][0]["values"]
    for lever, runs in found.items():
        seconds = float(np.median([r["seconds"] for r in runs]))
        row = {"lever": lever, "seconds": seconds, **spread(ratios[lever])}
        row |= {"newton": runs[0]["newton"], "law": runs[0]["law"]}
        rows.append(row | {"moved": moved(runs[0]["values"], shipped)})
    output.csv("faster", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    rows = [r | {"spread": f"{r['least']:.2f} to {r['most']:.2f}"} for r in output.rows("faster")]
    head = {
        "lever": "otherwise", "seconds": "time loop [s]", "ratio": "over as shipped",
        "spread": "of the turns", "newton": "Newton", "law": "law asked",
        "moved": "largest change of a result, relative",
    }  # fmt: skip
    forms = {"seconds": ".1f", "ratio": ".2f", "newton": ".0f", "law": ".0f", "moved": ".0e"}
    output.insert("faster", table(rows, head, forms))
