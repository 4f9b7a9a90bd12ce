"""The search of `castfem optimise` with derivatives and without: three tapers, a smooth stress.

The whole answer for `optimum_double_corner` with the smooth twin of the largest stress, once by
COBYQA with plain runs and once by SLSQP with runs that carry derivatives: runs, seconds, what is
found. Writes a table of docs/mould_design.md. The runs stay where `optimum` keeps its own.
"""

from __future__ import annotations

from typing import Any

from benchmarks.optimum import folder
from benchmarks.report import Output, table
from castfem.api import load
from castfem.studies.optimisation import Evaluator, Study
from castfem.studies.optimisation.optimum import Optimum

CASE = "billet125/optimum_double_corner"
METHODS = {"cobyqa": "no", "slsqp": "yes"}
SHOWN = {
    "method": "method",
    "derivatives": "derivatives",
    "runs": "runs of the search and about its optimum",
    "seconds": "their time, s",
    "tapers": "tapers, %/m",
    "stress": "smooth stress, MPa",
    "left": "heat beyond its bound, kJ/m",
}


def answered(method: str) -> tuple[Optimum, list[float]]:
    """The answer by a method, and the seconds of the runs by the level of the search."""
    asked = {"optimise.minimise": "von_mises_smooth", "optimise.method": method}
    case = load(CASE).with_(asked)
    with Evaluator(case, folder(f"methods_{method}"), processes=1) as evaluator:
        found = Study(case, evaluator=evaluator, origin=CASE).solve()
        entries = evaluator.store.record.entries.values()
        return found, [e.seconds for e in entries if e.given.get("fidelity") == found.fidelity]


def row(method: str, found: Optimum, seconds: list[float]) -> dict[str, Any]:
    """What a search has found, and what it took."""
    objective, (kept,) = found.objective, found.constraints
    assert objective is not None
    return {
        "method": method, "derivatives": METHODS[method], "runs": len(seconds),
        "seconds": sum(seconds), "tapers": " / ".join(f"{v.value:.2f}" for v in found.values),
        "stress": 1e-6 * objective.value, "left": 1e-3 * kept.left,
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Both; quick: with derivatives alone."""
    methods = list(METHODS)[1:] if quick else list(METHODS)
    output.csv("optimum_methods", [row(method, *answered(method)) for method in methods])
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    forms = {"seconds": ".0f", "stress": ".2f", "left": ".2f"}
    output.insert("optimum methods", table(output.rows("optimum_methods"), SHOWN, forms))
