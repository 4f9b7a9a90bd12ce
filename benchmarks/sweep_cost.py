"""Cost of a sweep besides its time loops: imports, set-up, first run, parent process, figures.

Writes a table of docs/scripting.md. The processor time of a worker of `castfem sweep` is measured
run by run, and the sum is compared with the time of the command. Compiled forms and meshes are in a
cache of their own, as for a user with only this case. The gain of two runs at once is measured in
wall time, which is meaningful only on a machine with two free cores; the load is recorded with it.

    python -m benchmarks throughput
"""

from __future__ import annotations

import gc
import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import mean
from time import perf_counter, process_time
from typing import Any

from benchmarks.processes import answer, argument, castfem, launch
from benchmarks.report import Output, table

CASE, RUNS, FOLLOWED = "billet125/taper_1", 32, 6
WORKERS = 2
PARTS = {
    "march": "the time loops",
    "each": "set-up and end of each run",
    "first": "extra time of a worker's first run",
    "imports": "start of a worker, its imports",
    "parent": "the sweep itself: plan, progress, table",
    "figures": "figures of a run, with `--figures`",
}


def coarse() -> list[str]:
    """Return the assignments of `--accuracy coarse`."""
    from castfem.model import load_case, shipped_cases
    from castfem.studies.accuracy.sizes import changes, factors_of

    found = changes(load_case(shipped_cases.find(CASE)), factors_of("coarse"))
    return [f"{key}={value}" for key, value in found.items()]


def tapers(count: int) -> list[str]:
    """Return `count` tapers from 0.8 to 1.2 %/m."""
    return [f"{0.8 + 0.4 * i / (count - 1):.4g} %/m" for i in range(count)]


def follow(count: int) -> dict[str, float]:
    """Do runs like a worker, in a process of its own; return processor times by part, s."""
    from castfem.model import load_case, shipped_cases
    from castfem.post.plots.figures import draw_figures
    from castfem.runs.loop import TimeLoop
    from castfem.studies.sweep.work import Job, work

    begun, loops = process_time(), [0.0]
    run = TimeLoop.run

    def timed(loop: TimeLoop) -> None:
        start = process_time()
        run(loop)
        loops.append(process_time() - start)

    TimeLoop.run = timed  # type: ignore[method-assign]
    other, sizes, path = [], coarse(), shipped_cases.find(CASE)
    with tempfile.TemporaryDirectory() as home:
        for name in tapers(count):
            case = load_case(path, [*sizes, f"mould.taper={name}"])
            folder = Path(home, name.partition(" ")[0])
            start = process_time()
            outcome = work(Job(name, folder, case))
            assert not outcome.failed, outcome.message
            if not other:
                gc.freeze()
            other.append(process_time() - start - loops[-1])
        start = process_time()
        draw_figures(folder)
        drawn = process_time() - start
    return {
        "march": mean(loops[1:]), "each": mean(other[1:]), "first": other[0] - mean(other[1:]),
        "imports": begun, "figures": drawn,
    }  # fmt: skip


def on_coarse(command: str, *words: str, cache: str) -> float:
    """Return the processor time of a castfem command on the coarse case, s."""
    sizes = [word for assignment in coarse() for word in ("--set", assignment)]
    return castfem(command, CASE, *sizes, *words, environment={"XDG_CACHE_HOME": cache}).processor


def sweep(count: int, folder: Path, cache: str) -> float:
    """Return the processor time of a whole sweep, s."""
    values = "mould.taper=" + ",".join(tapers(count))
    return on_coarse("sweep", "-j", str(WORKERS), "--set", values, "-o", str(folder), cache=cache)


def measured(count: int, followed: int, cache: str) -> list[dict[str, Any]]:
    """Measure one sweep; return a row for each part."""
    cached = {"XDG_CACHE_HOME": cache}
    # The first launch fills the cache with forms and meshes, the second is measured.
    for runs in (2, followed):
        found = launch("benchmarks.sweep_cost", {"count": runs}, environment=cached)
    with tempfile.TemporaryDirectory() as home:
        whole = sweep(count, Path(home, "sweep"), cache)
        found["parent"] = sweep(count, Path(home, "sweep"), cache)  # all its runs are finished
    times = {"march": count, "each": count, "first": WORKERS, "imports": WORKERS, "parent": 1}
    return [
        {"part": part, "each [s]": found[part], "times": times.get(part, 0), "whole [s]": whole}
        for part in PARTS
    ]


def at_once(turns: int, cache: str) -> list[dict[str, Any]]:
    """Measure wall time of two coupled billets, alternately one after the other and at once."""
    rows = []
    for turn in range(turns):
        for together in (False, True):
            load, begun = os.getloadavg()[0], perf_counter()
            with tempfile.TemporaryDirectory() as home, ThreadPoolExecutor(1 + together) as pool:

                def run(taper: str, home: str = home) -> None:
                    words = "--set", f"mould.taper={taper} %/m", "-o", f"{home}/{taper}"
                    on_coarse("run", *words, cache=cache)

                list(pool.map(run, ("1", "1.1")))
                seconds = perf_counter() - begun
            rows.append({"turn": turn, "at once": together, "wall [s]": seconds, "load": load})
    return rows


def show(output: Output) -> None:
    """Write the table from the data."""
    rows, pairs = output.rows("sweep_cost"), output.rows("sweep_at_once")
    if not rows:
        return
    total = sum(row["each [s]"] * row["times"] for row in rows)
    lines = [
        {
            "part": PARTS[row["part"]],
            "each": row["each [s]"],
            "times": row["times"] or None,
            "share": 100 * row["each [s]"] * row["times"] / total if row["times"] else None,
        }
        for row in rows
    ]
    headings = {"part": "part", "each": "s each", "times": "times", "share": "% of all"}
    runs = next(row["times"] for row in rows if row["part"] == "march")
    best = {way: min(r["wall [s]"] for r in pairs if r["at once"] is way) for way in (False, True)}
    least, most = min(r["load"] for r in pairs), max(r["load"] for r in pairs)
    text = (
        f"{runs:.0f} coarse billets (`--accuracy coarse`, {CASE}) on {WORKERS} workers, seconds of "
        f"the processor. The whole command took {rows[0]['whole [s]']:.0f} s, the parts add up to "
        f"{total:.0f} s.\n\n"
        + table(lines, headings, {"each": ".2f", "share": ".1f"})
        + f"\n\nTwo at once were {best[False] / best[True]:.2f} times as fast as one "
        f"after the other, in wall-clock time (best of each), on two cores whose load "
        f"was {least:.1f} to {most:.1f}, these runs included."
    )
    output.insert("throughput", text)


def main(output: Output, quick: bool) -> None:
    """Measure a sweep and two runs at once; write data and table."""
    with tempfile.TemporaryDirectory() as cache:
        rows = measured(*((4, 3) if quick else (RUNS, FOLLOWED)), cache)
        output.csv("sweep_cost", rows)
        output.csv("sweep_at_once", at_once(1 if quick else 2, cache))
    show(output)


if __name__ == "__main__":
    answer(follow(argument()["count"]))
