"""Do derivatives make the search for a taper faster? COBYQA beside methods that have gradients.

The searches alone, without what `castfem optimise` runs besides (noise, surroundings, check), from
one start, with the least stress that still takes the wanted share of heat: the largest one, which
has kinks, or its smooth twin. COBYQA has plain runs; SLSQP and trust-constr have runs that carry
the derivatives by all variables. All in memory, one after another; processor time. Writes a table
of docs/mould_design.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from benchmarks.report import Output, table
from castfem.api import load
from castfem.base.types import Array
from castfem.model import Case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.registry import columns_of, results_of
from castfem.studies.optimisation.evaluator import lean, variant
from castfem.studies.optimisation.problem import DesignProblem, RunRequest
from castfem.studies.sensitivity.run import sensitivity

LARGEST, SMOOTH = "von_mises_max", "von_mises_smooth"
SEARCHED = (
    ("optimum_single", LARGEST, (1.0,)),
    ("optimum_corner", LARGEST, (-0.4, 0.6)),
    ("optimum_corner", SMOOTH, (-0.4, 0.6)),
    ("optimum_double_corner", SMOOTH, (-0.4, 1.0, 0.5)),
)
"""Cases, what is to be least, and where the searches begin, %/m."""
MOST = 25  # runs with derivatives, after which a search is given up
FIRST, LAST = 0.1, 0.005  # of the ranges: steps of a trust region
CHANGES: dict[str, Any] = {}
"""Of the case, in all runs."""


class _Spent(Exception):
    """The search has had its runs."""


@dataclass(slots=True)
class Runs:
    """Runs of a question: stress and margin of the heat, scaled, with or without derivatives.

    Attributes:
        question: What is asked. base: Its case. bound: What the heat must be, J/m.
        carries: Whether runs carry derivatives. most: How many there may be.
        seen: What they have given, by their values: results (2,) and gradients (2, n).
        seconds: Processor time of all.
    """

    question: DesignProblem
    base: Case
    bound: float
    carries: bool
    most: int
    seen: dict[tuple[float, ...], tuple[Array, Array]] = field(default_factory=dict)
    seconds: float = 0.0

    def at(self, shares: Array) -> tuple[Array, Array]:
        """Results and gradients at shares of the ranges (n,)."""
        wanted = self.question.request(np.asarray(shares))
        if wanted.values not in self.seen:
            if len(self.seen) == self.most:
                raise _Spent
            start = process_time()
            found = _run(self.question, self.base, wanted, self.carries)
            self.seconds += process_time() - start
            scale = np.array([1e6, 0.01 * self.bound])
            values = (found[0] - [0.0, self.bound]) / scale
            self.seen[wanted.values] = values, found[1] / scale[:, None]
        return self.seen[wanted.values]

    def best(self) -> tuple[tuple[float, ...], Array]:
        """The run of least stress of those that keep the heat, to 0.01 %."""
        return min(
            ((at, found) for at, (found, _) in self.seen.items()),
            key=lambda one: (max(-one[1][1] - 0.01, 0.0), one[1][0]),
        )


def _run(
    question: DesignProblem, base: Case, wanted: RunRequest, carries: bool
) -> tuple[Array, Array]:
    """Objective and bounded result of a run, SI, and derivatives by shares of the ranges."""
    case = variant(base, question.changes(wanted), wanted.fidelity, ideal=wanted.ideal)
    names = [question.table.objectives[0][0], question.bounds[0].quantity]
    axes = question.variables
    if carries:
        found = sensitivity(case, names, [a.key for a in axes], comm=MPI.COMM_SELF)
        slopes = [[found.gradient[n][a.key] * (a.high - a.low) for a in axes] for n in names]
        return np.array([found.quantities[n].value for n in names]), np.array(slopes)
    return plain(case, names), np.zeros((2, len(axes)))


def plain(case: Case, names: Sequence[str]) -> Array:
    """Results at the end of a run in memory that carries no derivatives, SI."""
    simulation = build(case, MPI.COMM_SELF)
    sample = TimeLoop(simulation).run()
    having = {d.named(p): (d, p) for d, p in (*columns_of(simulation), *results_of(simulation))}
    values = [float(having[n][0].value(sample, having[n][1]) or 0.0) for n in names]
    simulation.destroy()
    return np.array(values)


def _cobyqa(runs: Runs, start: Array) -> None:
    minimize(
        lambda u: runs.at(u)[0][0], start, method="COBYQA",
        bounds=Bounds(np.zeros(len(start)), np.ones(len(start))),
        constraints=[NonlinearConstraint(lambda u: runs.at(u)[0][1], 0.0, np.inf)],
        options={"initial_tr_radius": FIRST, "final_tr_radius": LAST, "feasibility_tol": 1e-3},
    )  # fmt: skip


def _slsqp(runs: Runs, start: Array) -> None:
    limit: Any = {
        "type": "ineq", "fun": lambda u: runs.at(u)[0][1], "jac": lambda u: runs.at(u)[1][1],
    }  # fmt: skip
    minimize(
        lambda u: runs.at(u)[0][0], start, jac=lambda u: runs.at(u)[1][0], method="SLSQP",
        bounds=[(0.0, 1.0)] * len(start), constraints=[limit], options={"ftol": 1e-3},
    )  # fmt: skip


def _trust_constr(runs: Runs, start: Array) -> None:
    limit = NonlinearConstraint(
        lambda u: runs.at(u)[0][1], 0.0, np.inf, jac=lambda u: runs.at(u)[1][1:]
    )
    minimize(
        lambda u: runs.at(u)[0][0], start, jac=lambda u: runs.at(u)[1][0], method="trust-constr",
        bounds=Bounds(np.zeros(len(start)), np.ones(len(start)), keep_feasible=True),
        constraints=[limit], options={"initial_tr_radius": FIRST, "xtol": LAST},
    )  # fmt: skip


SEARCHES: dict[str, tuple[Callable[[Runs, Array], None], bool]] = {
    "COBYQA": (_cobyqa, False), "SLSQP": (_slsqp, True), "trust-constr": (_trust_constr, True),
}  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Each search of each case; quick: one variable, and the first two runs."""
    rows: list[dict[str, Any]] = []
    for name, stress, values in SEARCHED:
        asked = {"optimise.minimise": stress, "output.smooth": True, **CHANGES}
        question = DesignProblem(load(f"billet125/{name}").with_(asked))
        base, share = lean(question.case), question.bounds[0].value
        start = np.array([a.share(v) for a, v in zip(question.variables, values, strict=True)])
        ideal = _run(question, base, question.ideal(question.request(start)), carries=False)[0]
        make = partial(Runs, question, base, share * float(ideal[1]))
        for words, (search, carries) in SEARCHES.items():
            runs = make(carries, 2 if quick else MOST if carries else 1000)
            ended = True
            try:
                search(runs, start)
            except _Spent:
                ended = False
            at, found = runs.best()
            rows.append({
                "case": name, "least": stress, "search": words, "runs": len(runs.seen),
                "derivatives": "yes" if carries else "no", "seconds": runs.seconds,
                "tapers": " / ".join(f"{value:.2f}" for value in at),
                "stress": float(found[0]), "heat": 100.0 * share * (1.0 + 0.01 * float(found[1])),
                "ended": "yes" if ended else f"given up after {len(runs.seen)} runs",
            })  # fmt: skip
            print(f"  {rows[-1]}", flush=True)
            output.csv("optimum_gradients", rows)
        if quick:
            break
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "case": "case", "least": "least", "search": "search", "derivatives": "derivatives",
        "runs": "runs", "seconds": "processor time, s", "tapers": "tapers, %/m",
        "stress": "stress, MPa", "heat": "heat, % of idealised", "ended": "ended",
    }  # fmt: skip
    forms = {"seconds": ".0f", "stress": ".2f", "heat": ".2f"}
    rows = output.rows("optimum_gradients")
    output.insert("optimum gradients", table(rows, head, forms))
