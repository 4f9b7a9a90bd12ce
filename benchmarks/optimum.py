"""The best tapers of the 125 mm billet by castfem optimise, beside a grid of runs.

The grid is what one would do without an optimiser: the objective where the constraint holds, read
off monotone cubics through its runs, along one variable after the other.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from benchmarks.report import Output, table
from castfem.api import load
from castfem.post.plots.optimisation import optimum_figure
from castfem.post.plots.style import save
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.studies.optimisation import Evaluator, Optimum, RunRequest, Study
from castfem.studies.optimisation.mould_table import mould_table

CASES = ("single", "corner", "double", "parabolic", "double_corner")
# Ends [%/m] and runs along each variable, narrowed by hand: of one variable to where the six moulds
# of docs/billet.md leave the best, of two to where the stress is below that of the single taper.
_GRID = {
    "single": ((0.2, 1.0, 9),),
    "corner": ((0.4, 2.8, 5), (0.4, 0.8, 5)),
    "double": ((0.4, 2.0, 5), (0.2, 0.8, 5)),
}
_QUICK = {"single": ((0.2, 1.0, 5),)}
OFF = 1e-3  # mm: a gap that counts
_FINE = 801  # places along each variable between the runs of a grid
SHOWN = {
    "mould": "mould",
    "best": "best [%/m]",
    "checked": "with the heat of the finest level [%/m]",
    "interval": "cannot be told from [%/m]",
    "stress": "peak stress [MPa]",
    "noise": "its noise",
    "numerical": "its numerical error",
    "left": "heat beyond the bound [% of ideal]",
    "runs": "runs of the search",
    "all": "runs in all",
    "seconds": "wall time [s]",
}
GRID = {
    "mould": "mould",
    "grid": "best by the grid [%/m]",
    "grid_stress": "peak stress [MPa]",
    "grid_runs": "runs of the grid",
    "search": "best by the search [%/m]",
    "stress": "its peak stress [MPa]",
    "runs": "its runs",
    "within": "grid in the interval",
}
ORDERED = {
    "mould": "mould",
    "taper": "ordered [%/m]",
    "level": "run by",
    "stress": "peak stress [MPa]",
    "left": "heat beyond the bound [% of ideal]",
    "start": "width, diagonal at the meniscus [mm]",
    "end": "at the exit [mm]",
}


def folder(name: str) -> Path:
    """Where the runs of a case are kept."""
    root = os.environ.get("CASTFEM_RUNS", "results/optimum")
    return Path(root) / name


def search(name: str) -> tuple[Study, Optimum, float | None]:
    """The search of a shipped case, and its wall time, s; None where runs had been kept."""
    case, begun, new = load(f"billet125/optimum_{name}"), perf_counter(), not folder(name).exists()
    with Evaluator(case, folder(name), processes=2) as evaluator:
        study = Study(case, evaluator=evaluator, origin=f"billet125/optimum_{name}")
        found = study.solve()
    return study, found, perf_counter() - begun if new else None


def answer(name: str, found: Optimum, seconds: float | None) -> dict[str, Any]:
    """A row of the table of answers; with the wall time of the search."""
    objective, (kept,) = found.objective, found.constraints
    assert objective is not None
    ideal = kept.bound / 0.99
    checked = [v.checked for v in found.values]
    less, more = ("", " or less"), ("", " or more")
    ends = [
        f"{v.low:.2f}{less[v.open_low]} to {v.high:.2f}{more[v.open_high]}" for v in found.values
    ]
    return {
        "mould": name,
        "best": ", ".join(f"{v.value:.2f}" for v in found.values),
        "checked": ", ".join("?" if c is None else f"{c:.2f}" for c in checked),
        "interval": ", ".join(ends),
        "stress": 1e-6 * objective.value,
        "noise": 1e-6 * objective.noise,
        "numerical": 1e-6 * objective.numerical,
        "left": 100.0 * kept.left / ideal,
        "runs": found.runs["search"],
        "all": found.runs["all"],
        "seconds": seconds,
    }


def best_single(found: Optimum) -> dict[str, Any]:
    """What the page says of the errors of the best single taper, and of steps away from it.

    Heat in MJ/m and per cent of the idealised mould's, stress in MPa.
    """
    (kept,), (value,) = found.constraints, found.values
    less = max((a for a in found.away if a.value < value.value), key=lambda a: a.value)
    more = min((a for a in found.away if a.value > value.value), key=lambda a: a.value)
    lost = kept.left - less.left[0]
    assert found.objective is not None
    return {
        "mould": "single",
        "short": -1e-6 * kept.checked,
        "error": 1e-6 * kept.error,
        "step_less": value.value - less.value,
        "heat_less": 1e-6 * lost,
        "share_less": 100.0 * lost / (kept.bound / 0.99),
        "step_more": more.value - value.value,
        "stress_more": 1e-6 * more.objective,
    }


def at_work(name: str, found: Optimum) -> dict[str, Any]:
    """The best run of a search in its mould, by the level of the search.

    Stress and pressure in MPa, places and gaps in mm, temperature in degC, contact in per cent of
    the surface, tapers in %/m. `hollow` is by how much a face lies behind its ends, by width and
    diagonal.
    """
    table = read_history(folder(name) / found.best / HISTORY_NAME)
    columns = {key: table[key].to_numpy() for key in table}
    place, stress, gap = 1e3 * columns["position"], columns["von_mises_max"], columns["gap_corner"]
    off, worst = place[gap > OFF], int(stress.argmax())
    middle, across = columns["size_mid_face"], columns["size_corner"]
    tapers = {f"taper_{i}": v.value for i, v in enumerate(found.values, 1)}
    tapers |= {f"checked_{i}": v.checked for i, v in enumerate(found.values, 1)}
    return {
        "mould": name,
        **dict.fromkeys(f"{what}_{i}" for what in ("taper", "checked") for i in (1, 2, 3)),
        **tapers,
        "opens": float(off[0]) if len(off) else None,
        "gap_most": float(gap.max()),
        "gap_exit": float(gap[-1]),
        "pressure_exit": float(columns["mean_contact_pressure_max"][-1]),
        "contact_exit": float(columns["contact_share"][-1]),
        "corner_exit": float(columns["surface_temperature_corner"][-1]),
        "hollow_exit": 0.5 * float(across[-1] * middle[0] / across[0] - middle[-1]),
        "way_stress": float(stress[worst]),
        "way_place": float(place[worst]),
    }


def grid(
    name: str, study: Study, found: Optimum, sizes: Sequence[tuple[float, float, int]]
) -> dict[str, Any]:
    """A grid of runs between tapers, %/m, and the best that is read off it."""
    axes = study.problem.variables
    ticks = [np.linspace(*size) for size in sizes]
    places = itertools.product(*ticks)
    wanted = [
        study.problem.request(np.array([a.share(v) for a, v in zip(axes, place, strict=True)]))
        for place in places
    ]
    with Evaluator(study.problem.case, folder(name), processes=2) as evaluator:
        runs = Study(study.problem.case, evaluator=evaluator).run(wanted)
    (kept,) = found.constraints
    shape = [len(values) for values in ticks]
    stress = np.reshape([1e-6 * r["von_mises_max"] for r in runs], shape)
    left = np.reshape([r["heat_removed"] - kept.bound for r in runs], shape)
    finer = [np.linspace(values[0], values[-1], _FINE) for values in ticks]
    for axis, (values, places_between) in enumerate(zip(ticks, finer, strict=True)):
        stress = PchipInterpolator(values, stress, axis=axis)(places_between)
        left = PchipInterpolator(values, left, axis=axis)(places_between)
    allowed = np.where(left >= 0.0, stress, np.inf)
    where = np.unravel_index(int(np.argmin(allowed)), allowed.shape)
    best = [float(values[i]) for values, i in zip(finer, where, strict=True)]
    inside = [v.low <= b <= v.high for v, b in zip(found.values, best, strict=True)]
    objective = found.objective
    assert objective is not None
    return {
        "mould": name,
        "grid": ", ".join(f"{b:.2f}" for b in best),
        "grid_stress": float(np.min(allowed)),
        "grid_runs": len(runs),
        "search": ", ".join(f"{v.value:.2f}" for v in found.values),
        "stress": 1e-6 * objective.value,
        "runs": found.runs["search"],
        "within": "yes" if all(inside) else "no",
    }


def ordered(name: str, study: Study, found: Optimum) -> dict[str, Any]:
    """The mould that the check asks for, its tapers rounded, run by the level of the check."""
    tapers = [v.value if v.checked is None else v.checked for v in found.values]
    level = found.checked or found.fidelity
    wanted = RunRequest(tuple(round(taper, 2) for taper in tapers), level)
    case = study.problem.case
    with Evaluator(case, folder(name), processes=2) as evaluator:
        run, ideal = Study(case, evaluator=evaluator).run([wanted, study.problem.ideal(wanted)])
    _, sizes = mould_table(case.with_(study.problem.changes(wanted)))
    share = run["heat_removed"] / ideal["heat_removed"]
    return {
        "mould": name,
        "taper": ", ".join(f"{v:.2f}" for v in wanted.values),
        "level": wanted.fidelity,
        "stress": 1e-6 * run["von_mises_max"],
        "left": 100.0 * (share - 0.99),
        "start": ", ".join(f"{size:.2f}" for size in sizes[0][1:]),
        "end": ", ".join(f"{size:.2f}" for size in sizes[-1][1:]),
    }


def main(output: Output, quick: bool) -> None:
    """Search and grid; quick: the single taper alone, on a grid of five."""
    sizes = _QUICK if quick else _GRID
    answers, grids, orders, working = [], [], [], []
    for name in ("single",) if quick else CASES:
        study, found, seconds = search(name)
        answers.append(answer(name, found, seconds))
        print(f"  {answers[-1]}", flush=True)
        output.csv("optimum", answers)
        orders.append(ordered(name, study, found))
        print(f"  {orders[-1]}", flush=True)
        output.csv("optimum_ordered", orders)
        working.append(at_work(name, found))
        output.csv("optimum_at_work", working)
        if name == "single":
            output.csv("optimum_single", [best_single(found)])
            figures = output.folder / "figures"
            figures.mkdir(parents=True, exist_ok=True)
            save(optimum_figure(found), figures / "optimum_single.png")
        if name in sizes:
            grids.append(grid(name, study, found, sizes[name]))
            print(f"  {grids[-1]}", flush=True)
            output.csv("optimum_grid", grids)
    show(output)


def show(output: Output) -> None:
    """Tables from the data."""
    forms = {
        "stress": ".2f", "noise": ".1g", "numerical": ".2g", "left": ".1g",
        "grid_stress": ".2f", "seconds": ".0f",
    }  # fmt: skip
    output.insert("optimum answers", table(output.rows("optimum"), SHOWN, forms))
    output.insert("optimum ordered", table(output.rows("optimum_ordered"), ORDERED, forms))
    output.insert("optimum grid", table(output.rows("optimum_grid"), GRID, forms))
