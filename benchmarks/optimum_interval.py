"""How sure the best single taper of the 125 mm billet is, and what the last of the heat costs.

The optimum as an interval: noise, numerical error and spread by the inputs, each by itself and all
together; the front of stress and heat; the mould at the optimum.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.optimum import folder
from benchmarks.report import Columns, Output
from castfem.model.load import load
from castfem.post.compare.optimum_tables import mould_table
from castfem.post.plots.studies import front_figure, indices_figure, mould_figure
from castfem.post.plots.style import save
from castfem.studies.optimisation import Evaluator, Optimum, RunRequest, Study

INPUTS = {
    "cooling.mould.surface.0.coefficient [times]": "heat transfer, ± 10 %",
    "steel.conductivity [times]": "conductivity, ± 10 %",
    "steel.overrides.solidus.value [degC]": "solidus, ± 10 K",
    "mechanics.law.strength [times]": "flow stress, ± 20 %",
}
PARTS: Columns = {
    "part": "what is taken into account", "low": ("from [%/m]", ".2f"), "high": ("to [%/m]", ".2f"),
}  # fmt: skip
FRONT: Columns = {
    "taper": ("taper [%/m]", ".3f"), "heat": ("heat [% of idealised]", ".2f"),
    "stress": ("peak stress [MPa]", ".2f"), "price": ("a percent of heat costs [MPa]", ".2f"),
}  # fmt: skip


def study_of(name: str, runs: Path) -> tuple[Study, Optimum]:
    """The answer of a shipped case, its runs in a folder of any runs."""
    case = load(f"billet125/{name}")
    with Evaluator(case, runs, processes=1) as evaluator:
        study = Study(case, evaluator=evaluator, origin=f"billet125/{name}")
        return study, study.solve()


def ideal_heat(study: Study, found: Optimum) -> float:
    """Heat that the idealised mould takes by the level of the search, J/m."""
    wanted = RunRequest(tuple(v.value for v in found.values), found.fidelity)
    (ideal,) = study.run([study.problem.ideal(wanted)])
    return ideal["heat_removed"]


def inputs(output: Output) -> None:
    """The optimum as an interval, and which input makes it."""
    runs = folder("inputs")
    _, alone = study_of("optimum_single", runs)
    study, found = study_of("optimum_inputs", runs)
    (value,), (before,) = found.values, alone.values
    assert found.spread is not None and value.drawn is not None
    rows: list[dict[str, Any]] = [
        {"part": "noise, last step, numerical error", "low": before.low, "high": before.high},
        {"part": "inputs, 5 to 95 % of the draws", "low": value.drawn[0], "high": value.drawn[1]},
        {"part": "all together", "low": value.low, "high": value.high},
        {"part": "best, by the level of the search", "low": value.value, "high": value.value},
        {"part": "best, by the finest level", "low": value.checked, "high": value.checked},
        {"part": "keeps to the heat in 95 % of the draws", "low": value.safe, "high": value.safe},
    ]
    output.csv("optimum_interval", rows)
    rows = []
    for row in found.spread.rows:
        rows.append({
            "result": row.name, "unit": row.unit, "low": row.change[0], "high": row.change[1],
            "error": row.error, "met": None if row.met is None else 100.0 * row.met,
            **{f"first_{i}": first for i, first in enumerate(row.first)},
            **{f"total_{i}": total for i, total in enumerate(row.total)},
            "runs": found.spread.runs, "failed": found.spread.failed,
        })  # fmt: skip
    output.csv("optimum_inputs", rows)
    figures = output.folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    save(indices_figure(found.spread), figures / "optimum_inputs.png")
    mould = mould_table(study.case_of(found))
    save(mould_figure(*mould, runs / found.best), figures / "optimum_mould.png")


def front(output: Output) -> None:
    """What the last of the heat costs."""
    study, found = study_of("optimum_front", folder("front"))
    assert found.front is not None
    percent = 0.01 * ideal_heat(study, found)
    rows = [
        {
            "point": number,
            "taper": point.values[0],
            "heat": point.second / percent,
            "stress": 1e-6 * point.first,
            "price": None if point.price is None else 1e-6 * point.price * percent,
            "runs": found.front.runs,
        }
        for number, point in enumerate(found.front.points, 1)
    ]
    output.csv("optimum_front", rows)
    save(front_figure(found.front), output.folder / "figures" / "optimum_front.png")


def main(output: Output, quick: bool) -> None:
    """Both; quick or not, for nothing of it is any use with less."""
    inputs(output)
    front(output)
    show(output)


def show(output: Output) -> None:
    """Tables from the data."""
    rows = output.rows("optimum_interval")
    for row in rows:
        if row["low"] == row["high"]:
            row["high"] = None
    output.table("optimum interval", rows, PARTS)
    rows = output.rows("optimum_inputs")
    for row in rows:
        unit = f" {row['unit']}" if row["unit"] else ""
        row["change"] = f"{row['low']:+.2g} to {row['high']:+.2g}{unit}"
        for i in range(len(INPUTS)):
            row[f"index_{i}"] = f"{row[f'first_{i}']:.2f} / {row[f'total_{i}']:.2f}"
    shown: Columns = {
        "result": "result", "change": "5 to 95 % of the draws",
        "error": ("error of the fit", ".2g"),
        "met": ("met [% of draws]", ".0f"),
        **{f"index_{i}": name for i, name in enumerate(INPUTS.values())},
    }  # fmt: skip
    output.table("optimum inputs", rows, shown)
    output.table("optimum front", output.rows("optimum_front"), FRONT)
