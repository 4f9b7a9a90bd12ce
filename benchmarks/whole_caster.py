"""What a whole caster takes, against as many separate runs of its slices, and where its pool ends.

Writes a table and the numbers of docs/caster.md. Times are those of the processor, which other work
on the machine counts little in.

    python -m benchmarks whole_caster
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.report import ROOT, Output
from castfem.model import Case, load_case, shipped_cases
from castfem.model.caster_slices import by_plant, followed, slice_of, starts_of
from castfem.post.plots.caster_figures import strand_figure
from castfem.runs.caster.files import read_table
from castfem.runs.output.run_record import RunRecord
from castfem.studies.accuracy.sizes import assignments

SHORT = {"casting.length": "12 m", "caster.end": "600 s"}
"""Of the case, by which ranks are measured."""
RANK = """
import sys, time
from mpi4py import MPI
from castfem.model import load_case
from castfem.runs.caster.run import run_caster
run_caster(load_case(sys.argv[1]), sys.argv[2])
spent = MPI.COMM_WORLD.gather(time.process_time())
MPI.COMM_WORLD.rank or print(*spent)
"""
CASE, LADLE = "slab1200/ladle_change", "ladle change"
SPEEDS: dict[str, Any] = {
    "time": ["0 min", "12 min", "13 min", "20 min", "21 min", "60 min"],
    "speed": [f"{speed} m/min" for speed in (1.2, 1.2, 0.8, 0.8, 1.2, 1.2)],
}
"""Of the plant: two changes of speed within an hour, and nothing else."""
TWICE: dict[str, Any] = {"caster.plant": SPEEDS, "caster.every": "26.4 s"}
HISTORIES: dict[str, dict[str, Any]] = {
    LADLE: {},
    "two changes of speed": TWICE | {"caster.spacing": "13.2 s"},
    "likewise, to 16 min": TWICE | {"caster.spacing": "4.4 s", "caster.end": "16 min"},
}
"""Of the plant, by the changes to the case."""
SEPARATE = {LADLE: (30, 50, 70), "two changes of speed": (90, 170, 250)}
"""The slices that are run by themselves as well, by history."""


def coarse() -> Case:
    """The case at `--accuracy coarse`."""
    path = shipped_cases.find(CASE)
    own = load_case(path)
    return load_case(path, [*assignments(own, "coarse"), f"title={own.title}"])


def castfem(*words: str) -> tuple[float, float]:
    """Run a command; seconds of the processor and of the clock."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    subprocess.run([sys.executable, "-m", "castfem.cli", *words, "-q"], check=True, cwd=ROOT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, perf_counter() - begun


def together(history: str, case: Case, home: Path) -> dict[str, Any]:
    """The caster in one process."""
    folder, path = home / history.replace(" ", "_"), home / "case.toml"
    path.write_text(case.resolved_toml(), encoding="utf-8")
    spent, wall = castfem("caster", str(path), "-o", str(folder), "--no-figures")
    return {"history": history, "processor [s]": spent, "wall [s]": wall, **read(case, folder)}


def read(case: Case, folder: Path) -> dict[str, Any]:
    """What its files tell."""
    numbers, _, _ = read_table(folder / "caster.csv")
    time, pool = numbers["time"], numbers["metallurgical_length"]
    assert case.caster is not None
    start, end = case.caster.window
    seen = np.flatnonzero(np.isfinite(pool))  # of a short machine its end is never within
    least = int(seen[np.argmin(pool[seen])]) if seen.size else 0
    return {
        "slices": len(starts_of(case)), "at once": int(numbers["slices"].max()),
        "clock [s]": end - start, "followed [s]": sum(followed(case)),
        "memory [MB]": RunRecord.load(folder).memory_mb,
        "pool at first [m]": pool[0], "pool shortest [m]": pool[least],
        "shortest at [min]": time[least] / 60.0, "pool at last [m]": pool[-1],
        "pool longest [m]": float(pool[seen].max()) if seen.size else np.nan,
        "balance [-]": np.nanmax(np.abs(numbers["energy_error"])),
    }  # fmt: skip


def alone(history: str, case: Case, numbers: Sequence[int], home: Path) -> list[dict[str, Any]]:
    """Some of its slices, each by castfem run."""
    base, starts, rows = by_plant(case), starts_of(case), []
    for number in numbers:
        one, path = slice_of(base, starts[number - 1]), home / f"{number}.toml"
        path.write_text(one.resolved_toml(), encoding="utf-8")
        spent, _ = castfem(
            "run", str(path), "-o", str(home / str(number)), "--set", "output.figures=false"
        )
        row = {"history": history, "slice": number, "processor [s]": spent}
        rows.append(row | {"followed [s]": one.casting.duration})
    return rows


def by_ranks(case: Case, home: Path) -> list[dict[str, Any]]:
    """Some ranks that share the slices: what each spends, waiting for the others included."""
    (home / "ranks.toml").write_text(case.resolved_toml(), encoding="utf-8")
    rows: list[dict[str, Any]] = []
    for ranks in (1, 2):
        words = [sys.executable, "-c", RANK, str(home / "ranks.toml"), str(home / f"ranks_{ranks}")]
        launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
        done = subprocess.run(
            [*launcher, *words], check=True, cwd=ROOT, capture_output=True, text=True
        )
        most = max(float(word) for word in done.stdout.split())
        rows.append({"ranks": ranks, "slices": len(starts_of(case)), "busiest rank [s]": most})
    return rows


def show(output: Output) -> None:
    """Make the tables anew."""
    if shared := output.rows("whole_caster_ranks"):
        rows = [
            {**row, "faster": shared[0]["busiest rank [s]"] / row["busiest rank [s]"]}
            for row in shared
        ]
        columns: dict[str, Any] = {
            "ranks": "ranks", "slices": "slices", "faster": ("times as fast", ".2f"),
            "busiest rank [s]": ("processor, busiest rank, s", ".1f"),
        }  # fmt: skip
        output.table("caster ranks", rows, columns)
    found, single = output.rows("whole_caster"), output.rows("whole_caster_alone")
    if not (found and single):
        return
    # Of all slices that were run by themselves: they cost the same whatever they have met.
    apart = sum(r["processor [s]"] for r in single) / sum(r["followed [s]"] for r in single)
    lines: list[Mapping[str, Any]] = [
        {
            **row, "real": row["clock [s]"] / row["processor [s]"],
            "ratio": apart * row["followed [s]"] / row["processor [s]"],
        }
        for row in found
    ]  # fmt: skip
    columns = {
        "history": "history", "slices": "slices", "at once": "at once",
        "processor [s]": ("processor, s", ".0f"), "real": ("as fast as the caster", ".2g"),
        "memory [MB]": ("memory, MB", ".0f"), "ratio": ("separate runs take, times", ".2f"),
    }  # fmt: skip
    output.table("whole caster", lines, columns)


def main(output: Output, quick: bool) -> None:
    """Measure, and write data and table."""
    case = coarse()
    shorter = case.with_(SHORT)
    cases = {name: case.with_(changes) for name, changes in HISTORIES.items()}
    single = SEPARATE
    if quick:
        small = {"casting.length": "1 m", "caster.spacing": "0.6 m", "caster.end": "60 s"}
        cases, single = {LADLE: case.with_(small)}, {LADLE: (2,)}
        shorter = cases[LADLE]
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        output.csv("whole_caster_ranks", by_ranks(shorter, home))
        rows = [alone(name, cases[name], numbers, home) for name, numbers in single.items()]
        output.csv("whole_caster_alone", list(chain.from_iterable(rows)))
        output.csv("whole_caster", [together(name, one, home) for name, one in cases.items()])
        shown = strand_figure(home / LADLE.replace(" ", "_"), case.title, case.casting.length)
        output.figure("strand_over_time", shown)
    show(output)
