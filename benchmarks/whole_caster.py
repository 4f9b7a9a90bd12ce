"""Cost of a whole caster compared with separate runs of its slices, and the end of its pool.

Writes a table and the numbers of docs/caster.md. Times are processor times, on which other work on
the machine has little effect.

    python -m benchmarks whole_caster
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.processes import answer, argument, castfem, launch
from benchmarks.report import Output
from castfem.model import Case, load_case, shipped_cases
from castfem.model.caster_slices import by_plant, followed, slice_of, starts_of
from castfem.post.plots.caster_figures import strand_figure
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.output.run_record import RunRecord
from castfem.studies.accuracy.sizes import assignments

SHORT = {"casting.length": "12 m", "caster.end": "600 s"}
"""Changes to the case with which ranks are measured."""
CASE, LADLE = "slab1200/ladle_change", "ladle change"
SPEEDS: dict[str, Any] = {
    "time": ["0 min", "12 min", "13 min", "20 min", "21 min", "60 min"],
    "speed": [f"{speed} m/min" for speed in (1.2, 1.2, 0.8, 0.8, 1.2, 1.2)],
}
"""Plant data with two changes of speed within an hour."""
TWICE: dict[str, Any] = {"caster.plant": SPEEDS, "caster.every": "26.4 s"}
HISTORIES: dict[str, dict[str, Any]] = {
    LADLE: {},
    "two changes of speed": TWICE | {"caster.spacing": "13.2 s"},
    "likewise, to 16 min": TWICE | {"caster.spacing": "4.4 s", "caster.end": "16 min"},
}
"""Changes to the case by history of the plant."""
SEPARATE = {LADLE: (30, 50, 70), "two changes of speed": (90, 170, 250)}
"""Slices that are also run separately, by history."""


def coarse() -> Case:
    """Return the case at `--accuracy coarse`."""
    path = shipped_cases.find(CASE)
    case = load_case(path)
    return load_case(path, [*assignments(case, "coarse"), f"title={case.title}"])


def together(history: str, case: Case, home: Path) -> dict[str, Any]:
    """Run the caster in one process; return times and results."""
    folder, path = home / history.replace(" ", "_"), home / "case.toml"
    path.write_text(case.resolved_toml(), encoding="utf-8")
    spent = castfem("caster", str(path), "-o", str(folder), "--no-figures")
    times = {"processor [s]": spent.processor, "wall [s]": spent.wall}
    return {"history": history, **times, **read(case, folder)}


def read(case: Case, folder: Path) -> dict[str, Any]:
    """Read the results of a caster from its files."""
    numbers, _, _ = read_table(folder / "caster.csv")
    time, pool = numbers["time"], numbers["metallurgical_length"]
    assert case.caster is not None
    start, end = case.caster.window
    finite = np.flatnonzero(np.isfinite(pool))  # empty if the pool ends below a short machine
    least = int(finite[np.argmin(pool[finite])]) if finite.size else 0
    return {
        "slices": len(starts_of(case)), "at once": int(numbers["slices"].max()),
        "clock [s]": end - start, "followed [s]": sum(followed(case)),
        "memory [MB]": RunRecord.load(folder).memory_mb,
        "pool at first [m]": pool[0], "pool shortest [m]": pool[least],
        "shortest at [min]": time[least] / 60.0, "pool at last [m]": pool[-1],
        "pool longest [m]": float(pool[finite].max()) if finite.size else np.nan,
        "balance [-]": np.nanmax(np.abs(numbers["energy_error"])),
    }  # fmt: skip


def separately(
    history: str, case: Case, numbers: Sequence[int], home: Path
) -> list[dict[str, Any]]:
    """Run some slices of the caster, each by `castfem run`; return a row for each."""
    base, starts, rows = by_plant(case), starts_of(case), []
    for number in numbers:
        single, path = slice_of(base, starts[number - 1]), home / f"{number}.toml"
        path.write_text(single.resolved_toml(), encoding="utf-8")
        spent = castfem(
            "run", str(path), "-o", str(home / str(number)), "--set", "output.figures=false"
        )
        row = {"history": history, "slice": number, "processor [s]": spent.processor}
        rows.append(row | {"followed [s]": single.casting.duration})
    return rows


def by_ranks(case: Case, home: Path) -> list[dict[str, Any]]:
    """Run the slices on one rank and on two; times include waiting for the other rank."""
    path = home / "ranks.toml"
    path.write_text(case.resolved_toml(), encoding="utf-8")
    rows: list[dict[str, Any]] = []
    for ranks in (1, 2):
        arguments = {"case": str(path), "folder": str(home / f"ranks_{ranks}")}
        spent = launch("benchmarks.whole_caster", arguments, ranks)["spent"]
        rows.append(
            {"ranks": ranks, "slices": len(starts_of(case)), "busiest rank [s]": max(spent)}
        )
    return rows


def on_ranks() -> None:
    """Run a caster on the ranks of this process; return processor times to `launch`, s."""
    arguments = argument()
    run_caster(load_case(arguments["case"]), arguments["folder"])
    spent = MPI.COMM_WORLD.gather(process_time())
    if spent is not None:
        answer({"spent": spent})


def show(output: Output) -> None:
    """Write the tables from the data."""
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
    # Mean of all separate slices, whose cost does not depend on the history of the plant.
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
    """Run casters and slices; write data and tables."""
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
        rows = [separately(name, cases[name], numbers, home) for name, numbers in single.items()]
        output.csv("whole_caster_alone", list(chain.from_iterable(rows)))
        output.csv("whole_caster", [together(name, c, home) for name, c in cases.items()])
        shown = strand_figure(home / LADLE.replace(" ", "_"), case.title, case.casting.length)
        output.figure("strand_over_time", shown)
    show(output)


if __name__ == "__main__":
    on_ranks()
