"""What a mechanical step costs: where its time goes, cells, ranks, memory, linear solvers."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.probe import launch
from benchmarks.report import Output, table
from benchmarks.slice_probe import Run, cooling_slice, measure
from castfem.fem.compat import assemble_into

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELLS = 900  # of the step that is taken apart
SIZES = (144, 400, 900, 1600, 3600, 8100, 14884)
RANKED = 3600  # cells of the run on two ranks
SLAB = Run(594, "half", step=0.35)
SLAB_STEPS = 3400
PARTS = {
    "factor": "LU: factorisation",
    "solve": "LU: forward and back substitution",
    "other": "PETSc otherwise, bordered system of the scalars",
    "assembly": "DOLFINx: assembly",
    "law": "constitutive law",
    "kinematics": "strain at the points",
    "python": "residual, Jacobian and norms in numpy",
    "step": "start and end of a step",
}
LIBRARIES = ("factor", "solve", "other", "assembly")
OWN = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}
SOLVERS: dict[str, dict[str, Any]] = {
    "MUMPS, symmetric (default)": {},
    "MUMPS, LU": {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"},
    "PETSc's Cholesky": {"pc_type": "cholesky", **OWN},
    "PETSc's LU": {"pc_type": "lu", **OWN},
    "SuperLU_DIST": {"pc_type": "lu", "pc_factor_mat_solver_type": "superlu_dist"},
}


def parts(found: dict[str, Any]) -> dict[str, float]:
    """Seconds a step by part."""
    return {n: max(found[n], 0.0) for n in PARTS}


def libraries(found: dict[str, Any]) -> float:
    """Share of a step inside the linear solver and DOLFINx' assembly."""
    seconds = parts(found)
    return sum(seconds[n] for n in LIBRARIES) / sum(seconds.values())


def single_calls(repeats: int = 12) -> dict[str, float]:
    """Shortest time of one call of each kind, at the end of a step of the freezing billet, s."""
    slice_ = cooling_slice(Run(CELLS)).advance(4.0, 1.0).advance(5.0, 0.25)
    problem = slice_.problem
    forms = problem.kinematics.forms
    strain, _ = problem.kinematics.increments()

    def stiffness() -> None:
        matrix = problem._part.matrix
        assemble_into(matrix, forms.stiffness, problem.constraints.conditions)
        problem.kinematics.volume.add_to(matrix, problem.constraints.free)

    calls = {
        "one assembly of the stiffness": stiffness,
        "one assembly of the forces": lambda: problem._assemble(forms.work),
        "the law, all points once": lambda: problem._material.integrate(strain),
        "strain at the points": lambda: problem.kinematics.increments(),
    }
    found = {}
    for name, call in calls.items():
        times = []
        for _ in range(repeats):
            start = process_time()
            call()
            times.append(process_time() - start)
        found[name] = min(times)
    slice_.destroy()
    return found


def scaling(sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Time and memory against the number of cells, each in a process of its own."""
    rows = []
    for cells in sizes:
        large, repeats = cells > 2000, 1 if cells > 8000 else 2
        # A first step of 1 s would freeze dozens of the smallest cells at once.
        growth = 0.25 if cells > 8000 else 1.0
        steps = 4 if large else 10
        given = {"cells": cells, "steps": steps, "repeats": repeats, "growth": growth}
        found = launch("benchmarks.slice_probe", given)
        seconds = parts(found)
        rows.append(
            {k: found[k] for k in ("cells", "unknowns", "newton", "step_s", "newton_s")}
            | {f"part_{n}_s": seconds[n] for n in PARTS}
            | {"libraries_percent": 100.0 * libraries(found), "memory_mb": found["memory_mb"]}
            | {"imports_mb": found["memory_before_mb"]}
        )
    return rows


def exponent(rows: list[dict[str, Any]], key: str) -> float:
    """Power of the number of cells that a time follows, over all rows."""
    cells, seconds = (np.log([r[k] for r in rows]) for k in ("cells", key))
    return float(np.polyfit(cells, seconds, 1)[0])


def ranks(repeats: int, cells: int = RANKED) -> list[dict[str, Any]]:
    """One rank and two.

    Raises:
        RuntimeError: They do not come to the same strain.
    """
    given = {"cells": cells, "steps": 4, "before": 3.0, "repeats": repeats}
    one, two = (launch("benchmarks.slice_probe", given, n) for n in (1, 2))
    strains = [found["generalized_strains"] for found in (one, two)]
    if not np.allclose(*strains, rtol=1e-8, atol=1e-12):
        raise RuntimeError(f"one rank and two differ: {strains[0]} and {strains[1]}")
    rows = []
    for n, found in ((1, one), (2, two)):
        seconds = parts(found)
        rows.append(
            {"ranks": n, "cells": found["cells"], "step_s": found["step_s"]}
            | {f"{k}_s": seconds[k] for k in ("factor", "solve", "assembly", "law")}
            | {"gain": one["step_s"] / found["step_s"], "memory_mb": found["memory_mb"]}
        )
    return rows


def solvers(sizes: tuple[int, ...], repeats: int) -> list[dict[str, Any]]:
    """Linear solvers: seconds a Newton iteration, all of it and what the solver takes."""
    rows = []
    for name, options in SOLVERS.items():
        row: dict[str, Any] = {"solver": name}
        for cells in sizes:
            run = Run(cells, steps=4, before=2.0, options=options)
            found = measure(run, repeats=repeats)
            row[f"newton_{cells}"] = 1e3 * found["newton_s"]
            solver = found["factor"] + found["solve"] + found["other"]
            row[f"petsc_{cells}"] = 1e3 * solver / found["newton"]
        rows.append(row)
    return rows


def blas() -> str:
    """File name of the BLAS this process uses."""
    maps = Path("/proc/self/maps")
    text = maps.read_text() if maps.exists() else ""
    found = sorted(set(re.findall(r"\S*/(lib(?:open)?blas\S*|libmkl_rt\S*)", text)))
    return ", ".join(os.path.basename(f) for f in found) or "unknown"


COLOURS = {
    "factor": "#0072b2", "solve": "#56b4e9", "other": "#b3d4e8", "assembly": "#009e73",
    "law": "#d55e00", "kinematics": "#e69f00", "python": "#cc79a7", "step": "#999999",
}  # fmt: skip


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Time against cells beside slopes, and what it is made of."""
    from castfem.post.plots.style import look, new_figure

    cells = np.array([r["cells"] for r in rows], float)
    with look():
        figure = new_figure(9.0, 3.8)
        left, right = figure.subplots(1, 2)
        for key, label, colour in (
            ("step_s", "a step", "#0072b2"),
            ("newton_s", "a Newton iteration", "#d55e00"),
        ):
            power = exponent(rows, key)
            seconds = [r[key] for r in rows]
            left.plot(cells, seconds, "o-", color=colour, label=f"{label}: cells$^{{{power:.2f}}}$")
        for slope, style in ((1.0, ":"), (1.3, "--")):
            line = rows[0]["step_s"] * (cells / cells[0]) ** slope
            left.plot(
                cells, line, style, color="#777777", linewidth=1.0,
                label=f"cells$^{{{slope:g}}}$",
            )  # fmt: skip
        left.set(xscale="log", yscale="log", xlabel="cells", ylabel="time [s]")
        left.legend()
        places, bottom = np.arange(len(rows)), np.zeros(len(rows))
        for name, colour in COLOURS.items():
            whole = [sum(r[f"part_{n}_s"] for n in PARTS) for r in rows]
            share = np.array([100.0 * r[f"part_{name}_s"] for r in rows]) / whole
            right.bar(places, share, bottom=bottom, color=colour, label=PARTS[name], width=0.8)
            bottom += share
        right.set_xticks(places, [f"{c:g}" for c in cells], rotation=30)
        right.set(xlabel="cells", ylabel="share of a step [%]", ylim=(0, 100))
        right.grid(visible=False)
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=7.5)
    return figure


def _step(output: Output, quick: bool) -> None:
    """The step of 900 cells, taken apart; and half a slab."""
    found = measure(Run(CELLS, steps=5 if quick else 20), repeats=1 if quick else 4)
    whole = sum(parts(found).values())
    rows: list[dict[str, Any]] = [
        {"part": PARTS[n], "ms": 1e3 * s, "percent": 100 * s / whole}
        for n, s in parts(found).items()
    ]
    rows.sort(key=lambda r: -r["ms"])
    rows.append({"part": "**a step**", "ms": 1e3 * found["step_s"], "percent": 100.0})
    inside = 100.0 * libraries(found)
    rows.append({"part": "**in LU and assembly**", "ms": None, "percent": inside})
    output.csv("mechanical_step", rows)
    calls = [{"call": n, "ms": 1e3 * s} for n, s in single_calls().items()]
    output.csv("mechanical_calls", calls)
    slab = measure(replace(SLAB, steps=4) if quick else SLAB, repeats=1 if quick else 4)
    keys = ("cells", "unknowns", "points", "step_s", "newton", "heat_s")
    cases = [
        {"case": name, **{k: r[k] for k in keys}, "blas": blas()}
        for name, r in (("billet", found), ("slab", slab))
    ]
    output.csv("mechanical_cases", cases)


def _show_step(output: Output) -> None:
    headings = {"part": "part", "ms": "ms a step", "percent": "share [%]"}
    text = table(output.rows("mechanical_step"), headings, {"ms": ".1f", "percent": ".0f"})
    calls = output.rows("mechanical_calls")
    single = table(calls, {"call": "single calls", "ms": "ms"}, {"ms": ".2f"})
    found, slab = output.rows("mechanical_cases")
    minutes = SLAB_STEPS * (slab["step_s"] + slab["heat_s"]) / 60.0
    output.insert(
        "mechanical step",
        f"{found['cells']} cells, {found['unknowns']} unknowns, {found['points']} points: "
        f"{found['step_s']:.3f} s a step, {found['newton']:.1f} Newton iterations "
        f"({found['blas']}).\n\n{text}\n\n{single}\n\nHalf a slab, {slab['cells']} cells: "
        f"{slab['step_s']:.3f} s a step with {slab['newton']:.1f} Newton iterations, "
        f"{slab['heat_s']:.4f} s for its temperature; {SLAB_STEPS} steps take "
        f"**{minutes:.1f} minutes**.",
    )


def _ranks(output: Output, quick: bool) -> None:
    """One rank and two."""
    output.csv("mechanical_ranks", ranks(1 if quick else 4, 400 if quick else RANKED))


def _show_ranks(output: Output) -> None:
    headings = {
        "ranks": "ranks", "cells": "cells", "step_s": "step [s]", "gain": "gain",
        "factor_s": "factorisation [s]", "solve_s": "substitution [s]",
        "assembly_s": "assembly [s]", "law_s": "law [s]", "memory_mb": "memory, all ranks [MB]",
    }  # fmt: skip
    formats = dict.fromkeys(headings, ".3f") | {
        "ranks": "d", "cells": "d", "gain": ".2f", "memory_mb": ".0f",
    }  # fmt: skip
    output.insert("mechanical ranks", table(output.rows("mechanical_ranks"), headings, formats))


def main(output: Output, quick: bool = False) -> None:
    """Measure everything; tables, CSV and figure."""
    measure(Run(100, steps=1, before=1))  # compiles forms and law
    _step(output, quick)
    rows = scaling(SIZES[:3] if quick else SIZES)
    output.csv("mechanical_cost", rows)
    output.figure("mechanical_cost", draw(rows))
    _ranks(output, quick)
    output.csv(
        "mechanical_solvers", solvers((400,) if quick else (CELLS, RANKED), 1 if quick else 2)
    )
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    _show_step(output)
    rows = output.rows("mechanical_cost")
    headings = {
        "cells": "cells", "unknowns": "unknowns", "newton": "Newton a step", "step_s": "step [s]",
        "newton_s": "iteration [s]", "libraries_percent": "LU and assembly [%]",
        "memory_mb": "memory [MB]", "imports_mb": "of it imports [MB]",
    }  # fmt: skip
    formats = {
        "newton": ".1f", "step_s": ".3f", "newton_s": ".4f", "libraries_percent": ".0f",
        "memory_mb": ".0f", "imports_mb": ".0f",
    }  # fmt: skip
    powers = f"a step as cells^{exponent(rows, 'step_s'):.2f}, an iteration as "
    powers += f"cells^{exponent(rows, 'newton_s'):.2f}"
    output.insert(
        "mechanical scaling", f"{table(rows, headings, formats)}\n\nTime grows: {powers}."
    )
    _show_ranks(output)
    compared = output.rows("mechanical_solvers")
    headings = {"solver": "solver"}
    for cells in (key.partition("_")[2] for key in compared[0] if key.startswith("newton_")):
        headings |= {f"newton_{cells}": f"{cells} cells: iteration [ms]"}
        headings |= {f"petsc_{cells}": "of it solver [ms]"}
    output.insert("mechanical solvers", table(compared, headings, dict.fromkeys(headings, ".1f")))
