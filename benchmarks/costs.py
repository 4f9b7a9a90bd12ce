"""Run time and memory of a thermal run by part of the program, mesh and number of ranks."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.accuracy import default_settings
from benchmarks.billet import Result, refined, run
from benchmarks.probe import measure
from benchmarks.processes import castfem
from benchmarks.report import Columns, Output, power, table
from castfem.base.stopwatch import LIBRARIES, TIME_LOOP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FACTORS = (2.8, 2.0, 1.4, 1.0, 0.7, 0.5, 0.25, 0.13)
"""Factors on all sizes of the shipped mesh: from a draft to far below a reference."""
USED = 0.5
"""The smallest factor in use; below it, only the shipped step is measured."""

SECTIONS = {
    "petsc": "PETSc: solver, factorisations, products",
    "assembly": "DOLFINx: assembly",
    "python": "residual, Jacobian and norms in numpy",
    "law": "constitutive law",
    "time loop": "stepping",
    "results": "results of each step",
}


def shares(result: Result) -> dict[str, float]:
    """Return the share of each section in the time loop without output."""
    total = sum(result.sections.get(n, 0.0) for n in TIME_LOOP)
    return {n: result.sections.get(n, 0.0) / total for n in TIME_LOOP if n in result.sections}


SHIPPED = "as shipped"


def libraries(result: Result) -> float:
    """Return the share of the time loop inside PETSc and DOLFINx."""
    return sum(s for n, s in shares(result).items() if n in LIBRARIES)


def scaling(factors: tuple[float, ...], repeats: int) -> list[dict[str, Any]]:
    """Measure run time against the number of cells, with shipped, fixed and adaptive steps."""
    rows = []
    shipped = default_settings()
    for factor in factors:
        mesh = refined(shipped, factor)
        for name, settings in (
            (SHIPPED, mesh),
            ("0.1 s", replace(mesh, tolerance=None, step=0.1)),
            ("5 K", replace(mesh, step=None, tolerance=5.0)),
        )[: None if factor >= USED else 1]:
            found = run(settings, repeats=repeats, patience=4.0)
            rows.append(
                {
                    "stepping": name,
                    "factor": factor,
                    "cells": found.cells,
                    "vertices": found.vertices,
                    "steps": found.steps,
                    "newton": found.newton,
                    "seconds": found.wall,
                    "microseconds": 1e6 * found.wall / (found.newton * found.vertices),
                    "libraries_percent": 100 * libraries(found),
                }
            )
    return rows


def exponent(rows: list[dict[str, Any]], stepping: str) -> float:
    """Return the power of the number of cells with which the run time grows."""
    return power([r for r in rows if r["stepping"] == stepping], "seconds")


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Draw run time over the number of cells, with the slopes 1 and 1.2."""
    from castfem.post.plots.style import look, new_figure

    with look():
        figure = new_figure(5.2, 3.6)
        axis = figure.subplots()
        for name, colour in ((SHIPPED, "#0072b2"), ("0.1 s", "#009e73"), ("5 K", "#d55e00")):
            own = [r for r in rows if r["stepping"] == name]
            label = f"adaptive, {name}" if name == "5 K" else name
            axis.plot(
                [r["cells"] for r in own], [r["seconds"] for r in own], "o-", color=colour,
                label=f"{label}: cells$^{{{exponent(rows, name):.2f}}}$",
            )  # fmt: skip
        own = [r for r in rows if r["stepping"] == SHIPPED]
        x = np.array([own[0]["cells"], own[-1]["cells"]], float)
        for slope, style in ((1.0, ":"), (1.2, "--")):
            axis.plot(
                x, own[0]["seconds"] * (x / x[0]) ** slope, style, color="#777777",
                linewidth=1.0, label=f"cells$^{{{slope:g}}}$",
            )  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel="cells", ylabel="run time [s]")
        axis.legend()
    return figure


def processes(factors: tuple[float, ...], repeats: int) -> list[dict[str, Any]]:
    """Measure memory and run time on one rank and on two, each in a process of its own."""
    rows = []
    for factor in factors:
        settings = replace(refined(default_settings(), factor), tolerance=None, step=0.1)
        one, two = (measure(settings, ranks, repeats) for ranks in (1, 2))
        if abs(one["corner"] - two["corner"]) > 1e-6:
            raise RuntimeError(f"one rank and two differ: {one['corner']} and {two['corner']}")
        rows.append(
            {
                "vertices": one["vertices"],
                "memory_mb": one["memory_mb"],
                "imports_mb": one["memory_before_mb"],
                "one_rank_s": one["seconds"],
                "two_ranks_s": two["seconds"],
                "gain": one["seconds"] / two["seconds"],
            }
        )
    return rows


def start_up(repeats: int) -> dict[str, float]:
    """Run the shipped case by the command line; return times by part, s.

    The first run of a new user compiles forms and meshes the section; further runs read both from
    the caches.
    """
    with tempfile.TemporaryDirectory() as folder:
        caches = {"XDG_CACHE_HOME": f"{folder}/cache"}
        first = _command_line(Path(folder, "first"), caches)
        further = [_command_line(Path(folder, f"run{i}"), caches) for i in range(repeats)]
    best = min(further, key=lambda times: times["before_loop"])
    best["processor"] = min(times["processor"] for times in further)
    return {f"first_{k}": v for k, v in first.items()} | best


def _command_line(folder: Path, environment: dict[str, str]) -> dict[str, float]:
    """Measure one `castfem run`; return its times by part, s."""
    spent = castfem("run", "billet125/thermal", "-o", str(folder), environment=environment)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    wall = summary["wall_time"]
    loop = sum(wall.get(n, 0.0) for n in (*TIME_LOOP, "output"))
    setup = sum(t for n, t in wall.items() if n.startswith("setup"))
    figures = [p.stat().st_mtime for p in (folder / "figures").glob("*")]
    drawing = max(figures) - (folder / "summary.json").stat().st_mtime if figures else 0.0
    return {
        "whole": spent.wall,
        "processor": spent.processor,
        "loop": loop,
        "setup": setup,
        "output": wall.get("output", 0.0),
        "steps": float(summary["steps"]["accepted"]),
        "figures": max(drawing, 0.0),
        "before_loop": spent.wall - loop - max(drawing, 0.0),
    }


def main(output: Output, quick: bool = False) -> None:
    """Measure everything; write tables, CSV and figure."""
    shipped = run(default_settings(), repeats=2 if quick else 9, patience=5.0)
    parts = [
        {"section": SECTIONS[n], "seconds": shipped.sections[n], "percent": 100 * share}
        for n, share in shares(shipped).items()
        if shipped.sections[n] > 0
    ]
    parts.sort(key=lambda r: -r["seconds"])
    inside = {
        "section": "**inside PETSc and DOLFINx**",
        "seconds": None,
        "percent": 100 * libraries(shipped),
    }
    output.csv("shares", [*parts, inside])
    rows = scaling(FACTORS[:3] if quick else FACTORS, 2 if quick else 3)
    output.csv("scaling", rows)
    output.figure("scaling", draw(rows))
    rows = processes((1.0,) if quick else (2.0, 1.0, 0.5), 1 if quick else 3)
    output.csv("processes", rows)
    _start_up(output, quick)
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    head: Columns = {
        "section": "part of the time loop", "seconds": ("time [s]", ".3f"),
        "percent": ("share [%]", ".0f"),
    }  # fmt: skip
    output.table("shares", output.rows("shares"), head)
    rows = output.rows("scaling")
    headings = {
        "stepping": "step", "cells": "cells", "vertices": "vertices", "steps": "steps",
        "newton": "Newton iterations", "seconds": "time loop [s]",
        "microseconds": "per vertex and iteration [us]", "libraries_percent": "in PETSc [%]",
    }  # fmt: skip
    formats = {"seconds": ".3f", "microseconds": ".2f", "libraries_percent": ".0f"}
    powers = ", ".join(
        f"cells^{exponent(rows, n):.2f} ({word})"
        for n, word in ((SHIPPED, SHIPPED), ("0.1 s", "step 0.1 s"), ("5 K", "adaptive, 5 K"))
    )
    large = [r for r in rows if r["stepping"] == SHIPPED and r["factor"] <= USED]
    words = f"Run time grows as {powers}."
    if len(large) > 1:
        from_on = f"{large[0]['cells']} cells on as cells^{power(large, 'seconds'):.2f}"
        words = f"{words[:-1]}; as shipped, from {from_on}."
    output.insert("scaling", f"{table(rows, headings, formats)}\n\n{words}")
    head = {
        "vertices": "vertices", "memory_mb": ("memory [MB]", ".0f"),
        "imports_mb": ("of it before the simulation is built [MB]", ".0f"),
        "one_rank_s": ("1 rank [s]", ".2f"), "two_ranks_s": ("2 ranks [s]", ".2f"),
        "gain": ("gain", ".2f"),
    }  # fmt: skip
    output.table("processes", output.rows("processes"), head)
    output.table("start up", output.rows("start_up"), {"what": "", "s": ("time [s]", ".3f")})


def _start_up(output: Output, quick: bool) -> None:
    times = start_up(1 if quick else 3)
    rows = [
        {"what": "first run ever: until the time loop begins", "s": times["first_before_loop"]},
        {"what": "every further run: until the time loop begins", "s": times["before_loop"]},
        {"what": "of it mesh, forms, operators", "s": times["setup"]},
        {"what": "time loop, without files", "s": times["loop"] - times["output"]},
        {"what": "files during the time loop", "s": times["output"]},
        {"what": "the same for each step", "s": times["output"] / times["steps"]},
        {"what": "figures at the end", "s": times["figures"]},
        {"what": "the whole command, time of the processor", "s": times["processor"]},
    ]
    output.csv("start_up", rows)
