"""The best tapers of the 125 mm billet by castfem optimise, with one to three variables."""

from __future__ import annotations

import os
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.report import Columns, Output
from castfem.model.load import load
from castfem.post.compare.optimum_tables import mould_table
from castfem.post.plots.studies import optimum_figure
from castfem.post.plots.style import save
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.studies.optimisation import Evaluator, Optimum, RunRequest, Study

CASES = ("single", "corner", "double", "parabolic", "double_corner")
OFF = 1e-3  # mm: a gap that counts
SHOWN: Columns = {
    "mould": "mould",
    "best": "best [%/m]",
    "checked": "with the heat of the finest level [%/m]",
    "interval": "cannot be distinguished from [%/m]",
    "stress": ("peak stress [MPa]", ".2f"),
    "noise": ("its noise", ".1g"),
    "numerical": ("its numerical error", ".2g"),
    "left": ("heat beyond the bound [% of ideal]", ".1g"),
    "runs": "runs of the search",
    "all": "runs in all",
    "seconds": ("wall time [s]", ".0f"),
}
ORDERED: Columns = {
    "mould": "mould",
    "taper": "ordered [%/m]",
    "level": "run by",
    "stress": ("peak stress [MPa]", ".2f"),
    "left": ("heat beyond the bound [% of ideal]", ".1g"),
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
    less = max((a for a in found.neighbours if a.value < value.value), key=lambda a: a.value)
    more = min((a for a in found.neighbours if a.value > value.value), key=lambda a: a.value)
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
    """All searches; quick: the single taper alone."""
    answers, orders, working = [], [], []
    for name in ("single",) if quick else CASES:
        study, found, seconds = search(name)
        answers.append(answer(name, found, seconds))
        orders.append(ordered(name, study, found))
        working.append(at_work(name, found))
        print(f"  {answers[-1]}\n  {orders[-1]}", flush=True)
        output.csv("optimum", answers)
        output.csv("optimum_ordered", orders)
        output.csv("optimum_at_work", working)
        if name == "single":
            output.csv("optimum_single", [best_single(found)])
            figures = output.folder / "figures"
            figures.mkdir(parents=True, exist_ok=True)
            save(optimum_figure(found), figures / "optimum_single.png")
    show(output)


def show(output: Output) -> None:
    """Tables from the data."""
    output.table("optimum answers", output.rows("optimum"), SHOWN)
    output.table("optimum ordered", output.rows("optimum_ordered"), ORDERED)
