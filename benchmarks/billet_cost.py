"""Run time of the coupled billet: by mould, contact, part of the program and number of cells.

Writes the section of docs/benchmarks_mechanics.md. All times are processor times.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from time import process_time
from typing import Any

from mpi4py import MPI

from benchmarks.billet_run import CASES, MOULDS, NAMES, QUIET, every, mesh, touch
from benchmarks.report import Columns, Output, power, table
from castfem.base.stopwatch import LIBRARIES, Stopwatch
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.physics.mechanics.state import MechanicalResult
from castfem.runs.loop import TimeLoop

RUBBED = 'mould.friction={law="coulomb", coefficient=0.3}'
MOULDS: dict[str, tuple[str, tuple[str, ...]]] = {
    **{NAMES[m]: (m, ()) for m in MOULDS},
    "+1 %/m, Coulomb 0.3": ("taper_1", (RUBBED,)),
    "+1 %/m, Nitsche": ("taper_1", (touch("nitsche", 10),)),
}
NINE_HUNDRED = mesh(0.75)  # 891
REPEATS = 2
SIZES = (1.2, 0.8, 0.5, 0.35)
GROWN = ("taper_1", "taper_0")
MECHANICS = "mechanics: "


class Divided(Stopwatch):
    """A stopwatch of processor time that counts the sections of the mechanics separately."""

    def __init__(self) -> None:
        super().__init__(process_time)
        self.side = ""

    def start(self, name: str) -> None:
        """Enter section `name`; within a step of the mechanics it counts as theirs."""
        super().start(self.side + name)

    def mechanics(self) -> dict[str, float]:
        """Return the seconds of the mechanics by section."""
        n = len(MECHANICS)
        return {k[n:]: s for k, s in self.seconds.items() if k.startswith(MECHANICS)}


def run_case(mould: str, changes: Sequence[str]) -> dict[str, Any]:
    """Run one billet; return its total seconds, those of the mechanics by section, and counts."""
    watch = Divided()
    simulation = build(load_case(CASES / f"{mould}.toml", (*QUIET, *changes)), MPI.COMM_SELF, watch)
    assert simulation.mechanics is not None
    step = simulation.mechanics.step

    def watched(*arguments: Any) -> MechanicalResult:
        watch.side = MECHANICS
        try:
            with watch.section("stepping"):
                return step(*arguments)
        finally:
            watch.side = ""

    simulation.mechanics.step = watched  # type: ignore[method-assign]
    loop = TimeLoop(simulation)
    before, start = sum(watch.seconds.values()), process_time()
    with watch.section("time loop"):
        loop.run()
    found: dict[str, Any] = {
        "cells": simulation.section.mesh.topology.index_map(2).size_global,
        "windows": loop.run_state.counts.windows,
        "iterations": loop.run_state.counts.coupling_iterations or loop.run_state.counts.windows,
        "cut": loop.run_state.counts.cut_back,
        "newton": loop.run_state.counts.newton_mechanics,
        "seconds": process_time() - start,
        "watched": sum(watch.seconds.values()) - before,
        "libraries": sum(s for k, s in watch.seconds.items() if k.endswith(LIBRARIES)),
        "parts": watch.mechanics(),
    }
    simulation.destroy()
    keys = textwrap.shorten(" ".join(changes), 90, placeholder=" ...")
    print(f"  {mould} {keys}: {found['seconds']:.1f} s", flush=True)
    return found


def numbers(found: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers of a run that the tables show: times in ms, shares in %."""
    parts: Mapping[str, float] = found["parts"]
    mechanics, newton = sum(parts.values()), found["newton"]
    inside = sum(parts.get(name, 0.0) for name in LIBRARIES)
    return {
        "cells": found["cells"],
        "newton": newton / found["windows"],
        "iterations": found["iterations"],
        "cut": found["cut"],
        "seconds": found["seconds"],
        "window_ms": 1e3 * found["seconds"] / found["windows"],
        "iteration_ms": 1e3 * mechanics / newton,
        "mechanics": 100.0 * mechanics / found["watched"],
        "libraries_mechanics": 100.0 * inside / mechanics,
        "libraries": 100.0 * found["libraries"] / found["watched"],
        "law": 100.0 * parts.get("law", 0.0) / mechanics,
        "contact": 100.0 * parts.get("contact", 0.0) / mechanics,
    }


def moulds(output: Output, quick: bool) -> None:
    """Run all moulds alternately with one mesh; keep the quickest run of each."""
    chosen = dict(list(MOULDS.items())[:: 6 if quick else 1])
    keys = (*mesh(2.0), every(0.5)) if quick else NINE_HUNDRED
    best: dict[str, dict[str, Any]] = {}
    for _ in range(1 if quick else REPEATS):  # alternately: a slow minute affects all moulds
        for label, (mould, changes) in chosen.items():
            found = run_case(mould, (*keys, *changes))
            if label not in best or found["seconds"] < best[label]["seconds"]:
                best[label] = found
    rows: list[dict[str, Any]] = []
    for label, found in best.items():
        row: dict[str, Any] = {"mould": label, **numbers(found)}
        for name in ("window_ms", "iteration_ms"):
            first = rows[0] if rows else row
            row[f"{name}_more"] = 100.0 * (row[name] / first[name] - 1.0)
        rows.append(row)
    output.csv("billet_cost", rows)


def show_moulds(output: Output) -> None:
    """Write the tables of the moulds from the data."""
    rows = output.rows("billet_cost")
    head: Columns = {
        "mould": "mould", "newton": ("Newton a window", ".2f"),
        "iterations": "coupling iterations", "seconds": ("time loop [s]", ".1f"),
        "window_ms": ("a window [ms]", ".0f"),
        "window_ms_more": ("more than idealised [%]", "+.0f"),
        "iteration_ms": ("an iteration of the mechanics [ms]", ".1f"),
        "iteration_ms_more": ("more than idealised [%]", "+.0f"),
    }  # fmt: skip
    output.table("billet cost", rows, head)
    shares = {
        "mechanics": "mechanics, of the time loop",
        "libraries_mechanics": "LU and assembly, of the mechanics",
        "libraries": "LU and assembly, of the time loop", "law": "law, of the mechanics",
        "contact": "contact, of the mechanics",
    }  # fmt: skip
    head = {"mould": "mould"} | {key: (f"{words} [%]", ".0f") for key, words in shares.items()}
    output.table("billet shares", rows, head)


def growth(output: Output, quick: bool) -> None:
    """Measure run time against the number of cells."""
    rows: list[dict[str, Any]] = []
    for mould in GROWN[:1] if quick else GROWN:
        for size in (3.0, 2.0) if quick else SIZES:
            # Short runs are repeated, since noise is a large part of their time.
            keys = (*mesh(size), every(0.5 if quick else 0.1))
            tried = [run_case(mould, keys) for _ in range(2 if size > 0.6 and not quick else 1)]
            found = min(tried, key=lambda f: f["seconds"])
            rows.append({"mould": NAMES[mould], **numbers(found)})
    output.csv("billet_cells", rows)


def show_growth(output: Output) -> None:
    """Write the table of run time against the number of cells from the data."""
    rows = output.rows("billet_cells")
    head = {
        "mould": "mould", "cells": "cells", "newton": "Newton a window", "cut": "cut back",
        "seconds": "time loop [s]", "iteration_ms": "an iteration of the mechanics [ms]",
        "libraries_mechanics": "LU and assembly, of the mechanics [%]",
    }  # fmt: skip
    forms = {"newton": ".2f", "seconds": ".1f", "iteration_ms": ".1f", "libraries_mechanics": ".0f"}
    lines = []
    for name in dict.fromkeys(r["mould"] for r in rows):
        own = [r for r in rows if r["mould"] == name]
        loop, step = power(own, "seconds"), power(own, "iteration_ms")
        lines.append(
            f"* {name}: the time loop as cells^{loop:.2f}, an iteration as cells^{step:.2f}."
        )
    output.insert("billet cells", table(rows, head, forms) + "\n\n" + "\n".join(lines))


def main(output: Output, quick: bool) -> None:
    """Measure run times by mould and by number of cells."""
    moulds(output, quick)
    growth(output, quick)
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    show_moulds(output)
    show_growth(output)
