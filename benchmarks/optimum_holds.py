"""Whether the interval of an optimum contains that of finer cells: moulds of the 125 mm billet.

Each optimum is searched twice: at the coarse level, whose interval is tested, and at the fine one,
whose best value is the reference.
"""

from __future__ import annotations

from typing import Any

from benchmarks.report import ROOT, Columns, Output
from castfem.model.load import load
from castfem.studies.optimisation import Evaluator, Optimum, Study

SCENES: dict[str, tuple[int, dict[str, Any]]] = {
    "least stress, 99 % of the heat": (
        200,
        {"minimise": "von_mises_max", "constraints": ["heat_removed >= 99 % of idealised"]},
    ),
    "least smooth stress on the way, no bound": (
        250, {"minimise": "way_von_mises_smooth", "constraints": []},
    ),
}  # fmt: skip
"""Length of the mould, mm, and target of the optimisation."""
SHOWN: Columns = {
    "scene": "target", "length": ("mould [mm]", ".0f"), "best": ("best, coarse [%/m]", ".2f"),
    "interval": "cannot be distinguished from [%/m]", "reference": ("best, fine [%/m]", ".2f"),
    "within": "in the interval",
}  # fmt: skip


def search(number: int, fidelity: str) -> Optimum:
    """Return the optimum of a target at an accuracy level."""
    length, target = list(SCENES.values())[number]
    variable = [{"key": "mould.taper", "range": ["-1 %/m", "4 %/m"]}]
    case = load("billet125/optimum_single").with_({
        "casting.length": f"{length} mm", "mould.length": f"{length} mm",
        "optimise": {**target, "variable": variable, "fidelity": fidelity},
    })  # fmt: skip
    runs = ROOT / "results" / "optimum_holds" / f"{number}_{fidelity}"
    with Evaluator(case, runs, processes=1) as evaluator:
        return Study(case, evaluator=evaluator).solve()


def main(output: Output, quick: bool) -> None:
    """Search each optimum at both levels; quick: only the first one."""
    rows = []
    for number, (scene, (length, _)) in enumerate(SCENES.items()):
        (value,), (finer,) = search(number, "coarse").values, search(number, "fine").values
        more = " or more" if value.open_high else ""
        less = " or less" if value.open_low else ""
        rows.append({
            "scene": scene, "length": length, "best": value.value, "reference": finer.value,
            "interval": f"{value.low:.2f}{less} to {value.high:.2f}{more}",
            "within": "yes" if value.low <= finer.value <= value.high else "no",
        })  # fmt: skip
        print(f"  {rows[-1]}", flush=True)
        output.csv("optimum_holds", rows)
        if quick:
            break
    show(output)


def show(output: Output) -> None:
    """Write the table from the data."""
    output.table("optimum holds", output.rows("optimum_holds"), SHOWN)
