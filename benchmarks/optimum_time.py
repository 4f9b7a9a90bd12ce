"""Error of the best taper against the time it takes: grid, COBYQA, gradients, `castfem optimise`.

The single taper of the 125 mm billet, each method by each level of fidelity, from nothing, one run
after the other in one process; processor time. Their reference is the taper that just keeps the
heat on cells and windows finer than those of the finest level, by runs about it. Writes a table and
a figure of docs/mould_design.md.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from time import process_time
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from benchmarks.optimum_gradients import MOST, SEARCHES, Runs, plain
from benchmarks.report import Output, table
from castfem.api import load
from castfem.base.types import Array
from castfem.post.plots.style import look, new_figure
from castfem.studies.optimisation import Evaluator, Study
from castfem.studies.optimisation.evaluator import lean, variant
from castfem.studies.optimisation.fidelity import at_level
from castfem.studies.optimisation.problem import DesignProblem

CASE, START, SHARE = "billet125/optimum_single", 1.0, 0.99
LEVELS = "coarse", "default", "fine"
ABOUT = 0.58, 0.62, 0.66, 0.72  # %/m: runs of the reference
GRID = np.linspace(0.2, 1.0, 9)  # %/m: around what the moulds of docs/billet.md leave
OPTIMISE, EACH = "castfem optimise", "coarse, checked by fine"
_TIMES = 50, 100, 200, 400  # s, of the figure
_OFF = 0.01, 0.02, 0.05  # %/m
CHANGES: dict[str, Any] = {}
"""Of the case, in all runs."""
SHOWN = {
    "method": "method",
    "level": "level",
    "runs": "runs",
    "seconds": "processor time, s",
    "taper": "taper, %/m",
    "off": "error of the taper, %/m",
    "stress": "peak stress, MPa",
    "stress_off": "error of the stress, MPa",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """A best taper.

    Attributes:
        taper: %/m. stress: Peak stress there, MPa.
        runs: How many it took, that in the idealised mould too. seconds: Processor time of all.
    """

    taper: float
    stress: float
    runs: int
    seconds: float


def just_kept(tapers: Sequence[float], left: Sequence[float], stress: Sequence[float]) -> Array:
    """Taper at which a bound is just kept, and the stress there, by monotone cubics (2,)."""
    margin, at = PchipInterpolator(tapers, left), PchipInterpolator(tapers, stress)
    best = brentq(margin, tapers[0], tapers[-1])
    return np.array([best, float(at(best))])


def reference(tapers: Sequence[float] = ABOUT, refined: int = 2) -> Answer:
    """The best taper on cells and windows refined from the case so often by the finest level."""
    start, base = process_time(), lean(load(CASE).with_(CHANGES))

    def run(taper: float, *, ideal: bool = False) -> Array:
        case = variant(base, {"mould.taper": f"{taper} %/m"}, ideal=ideal)
        for _ in range(refined):
            case = at_level(case, "fine")
        return plain(case, ("von_mises_max", "heat_removed"))

    bound = SHARE * run(tapers[0], ideal=True)[1]
    found = np.array([run(taper) for taper in tapers])
    best, stress = just_kept(tapers, list(found[:, 1] - bound), list(1e-6 * found[:, 0]))
    return Answer(float(best), float(stress), 1 + len(tapers), process_time() - start)


def by_search(level: str, words: str) -> Answer:
    """The best taper by one of the searches of `optimum_gradients`."""
    search, carries = SEARCHES[words]
    runs = _runs(level, carries)
    search(runs, np.array([runs.question.variables[0].share(START)]))
    (taper,), values = runs.best()
    return Answer(taper, float(values[0]), 1 + len(runs.seen), runs.seconds)


def by_grid(level: str) -> Answer:
    """The best taper by runs all over, read off monotone cubics through them."""
    runs = _runs(level, carries=False)
    axis = runs.question.variables[0]
    found = np.array([runs.at(np.array([axis.share(taper)]))[0] for taper in GRID])
    best, stress = just_kept(list(GRID), list(found[:, 1]), list(found[:, 0]))
    return Answer(float(best), float(stress), 1 + len(GRID), runs.seconds)


def by_optimise() -> Answer:
    """The best taper by the whole of `castfem optimise`, which states its error, too."""
    case, start = load(CASE).with_(CHANGES), process_time()
    with tempfile.TemporaryDirectory() as folder, Evaluator(case, folder) as evaluator:
        found = Study(case, evaluator=evaluator).solve()
        (value,) = found.values
        assert value.checked is not None and found.by_check is not None
        stress = 1e-6 * found.by_check.objective
        return Answer(value.checked, stress, evaluator.runs, process_time() - start)


def _runs(level: str, carries: bool) -> Runs:
    """Runs of a level, that in the idealised mould done."""
    question = DesignProblem(load(CASE).with_({"optimise.fidelity": level, **CHANGES}))
    base, start = lean(question.case), process_time()
    wanted = question.ideal(question.request(np.array([question.variables[0].share(START)])))
    case = variant(base, question.changes(wanted), wanted.fidelity, ideal=True)
    (heat,) = plain(case, ("heat_removed",))
    bound = question.bounds[0].value * float(heat)
    runs = Runs(question, base, bound, carries, MOST)
    runs.seconds = process_time() - start
    return runs


METHODS: dict[str, Callable[[str], Answer]] = {
    "grid": by_grid,
    "COBYQA": lambda level: by_search(level, "COBYQA"),
    "trust-constr, derivatives": lambda level: by_search(level, "trust-constr"),
}


def main(output: Output, quick: bool) -> None:
    """Run and write, the reference in a process beside; quick: by the coarse level alone."""
    rows: list[dict[str, Any]] = []

    def note(method: str, level: str, found: Answer) -> None:
        rows.append({
            "method": method, "level": level, "runs": found.runs, "seconds": found.seconds,
            "taper": found.taper, "stress": found.stress,
        })  # fmt: skip
        print(f"  {rows[-1]}", flush=True)

    with ProcessPoolExecutor(1, get_context("spawn")) as beside:
        best = beside.submit(reference, refined=1 if quick else 2)
        for level in LEVELS[:1] if quick else LEVELS:
            for method, find in METHODS.items():
                note(method, level, find(level))
        note(OPTIMISE, EACH, by_optimise())
        note("reference", "finer than fine", best.result())
    truth = rows[-1]
    for row in rows:
        row["off"] = row["taper"] - truth["taper"]
        row["stress_off"] = row["stress"] - truth["stress"]
    output.csv("optimum_time", rows)
    show(output)


def show(output: Output) -> None:
    """The table and the figure, from the data."""
    rows = output.rows("optimum_time")
    forms = {"seconds": ".0f", "taper": ".3f", "off": "+.3f", "stress": ".2f", "stress_off": "+.2f"}
    output.insert("optimum time", table(rows, SHOWN, forms))
    if rows:
        _draw(output, [row for row in rows if row["method"] != "reference"])


def _draw(output: Output, rows: list[dict[str, Any]]) -> None:
    """Both errors over the time."""
    colours = "#0072b2", "#d55e00", "#009e73", "#7f7f7f"
    names = list(dict.fromkeys(row["method"] for row in rows))
    with look():
        figure = new_figure(7.2, 3.4)
        for axes, key, label in zip(
            figure.subplots(1, 2), ("off", "stress_off"),
            ("error of the taper [%/m]", "error of the stress [MPa]"), strict=True,
        ):  # fmt: skip
            for name, colour in zip(names, colours, strict=True):
                own = [row for row in rows if row["method"] == name]
                axes.loglog(
                    [row["seconds"] for row in own], [abs(row[key]) for row in own],
                    color=colour, marker="o", ms=4, lw=1.0, label=name,
                )  # fmt: skip
            axes.set_xticks(_TIMES, [str(time) for time in _TIMES])
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter("")
            axes.tick_params(axis="x", which="minor", labelbottom=False)
            axes.set_xlabel("processor time [s]")
            axes.set_ylabel(label)
        figure.axes[0].set_yticks(_OFF)
        figure.axes[0].legend(fontsize=7, loc="lower left")
        output.figure("optimum_time", figure)
