"""Do derivatives make the fit by which inputs are weighed cheaper? Quadratics through runs of both.

At points of Sobol's sequence in the taper and the four inputs of `optimum_inputs`, as `castfem
optimise` takes them: quadratics through so many runs, and through runs that carry their derivatives
by all five. What either misses is read at further points. Writes a table of docs/mould_design.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.stats import qmc

from benchmarks.optimum_gradients import plain
from benchmarks.report import Output, table
from castfem.api import load
from castfem.design.evaluator import lean, variant
from castfem.design.question import Question, Wanted
from castfem.sensitivity.run import sensitivity
from castfem.values.types import Array

TAPER = 0.4, 0.78  # %/m: about the best one
TRAINING, PLAIN, CARRYING = 32, (24, 32), (4, 8, 12, 16, 24, 32)
TESTS = 16
STRESS, HEAT = "von_mises_max", "heat_removed"
SHOWN = {
    "derivatives": "derivatives",
    "runs": "points",
    "seconds": "processor time, s",
    "stress": "misses the peak stress by, MPa",
    "heat": "misses the heat beyond its bound by, MJ/m",
}


@dataclass(frozen=True, slots=True)
class _Point:
    """Results at a point: stress, MPa, and heat beyond its bound, MJ/m.

    Attributes:
        place: Taper and inputs, from -1 to 1 (5,).
        values: Both results (2,). slopes: Their derivatives by the place (2, 5).
        seconds: Processor time of the run and of that in the idealised mould.
    """

    place: Array
    values: Array
    slopes: Array
    seconds: float


class _Runs:
    """Makes the runs of a question at places of its taper and its inputs."""

    def __init__(self) -> None:
        self.question = Question(load("billet125/optimum_inputs"))
        self._base = lean(self.question.case)
        inputs = self.question.inputs
        ends = [TAPER, *((one.low, one.high) for one in inputs)]
        self._low, self._high = (np.array(side) for side in zip(*ends, strict=True))
        self._keys = [*(a.key for a in self.question.axes), *(one.key for one in inputs)]
        self._relative = [False, *(one.relative for one in inputs)]

    def at(self, place: Array, *, carries: bool) -> _Point:
        """Both results at a place, with their derivatives or without."""
        question, bound = self.question, self.question.bounds[0]
        given = self._low + 0.5 * (place + 1.0) * (self._high - self._low)
        drawn = tuple(float(f"{value:.6g}") for value in given)
        wanted = Wanted(drawn[:1], "coarse", inputs=drawn[1:])
        start = process_time()
        own, slopes = self._run(wanted, drawn, carries)
        ideal, ideal_slopes = self._run(question.ideal(wanted), drawn, carries)
        seconds = process_time() - start
        own[1] -= bound.value * ideal[1]
        slopes[1] -= bound.value * ideal_slopes[1]
        return _Point(place, 1e-6 * own, 1e-6 * slopes, seconds)

    def _run(self, wanted: Wanted, drawn: tuple[float, ...], carries: bool) -> tuple[Array, Array]:
        """Stress and heat, SI, and their derivatives by the place."""
        changes = self.question.changes(wanted)
        case = variant(self._base, changes, wanted.fidelity, ideal=wanted.ideal)
        first = 1 if wanted.ideal else 0  # an idealised mould has no taper
        slopes = np.zeros((2, len(self._keys)))
        if not carries:
            return plain(case, (STRESS, HEAT)), slopes
        found = sensitivity(case, [STRESS, HEAT], self._keys[first:], comm=MPI.COMM_SELF)
        values = np.array([found.quantities[name].value for name in (STRESS, HEAT)])
        for i, p in enumerate(found.parameters, first):
            factor = p.value / drawn[i] if self._relative[i] else 1.0
            half = 0.5 * factor * (self._high[i] - self._low[i])
            slopes[:, i] = [half * found.gradient[name][p.name] for name in (STRESS, HEAT)]
        return values, slopes


def _columns(x: Array) -> Array:
    """Of a quadratic, at places (r, n)."""
    pairs = combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([np.ones(len(x)), *x.T, *(x[:, i] * x[:, j] for i, j in pairs)])


def _slopes(x: Array) -> Array:
    """Derivatives of the columns by the places (r n, columns): exact, for they are quadratic."""
    steps = np.eye(x.shape[1])
    each = [0.5 * (_columns(x + step) - _columns(x - step)) for step in steps]
    return np.stack(each, axis=1).reshape(-1, each[0].shape[1])


def misses(fitted: list[_Point], tests: list[_Point], *, carries: bool) -> Array:
    """By how much a fit misses the tests (2,), root mean square."""
    places, values = _places(fitted)
    columns = _columns(places)
    if carries:
        columns = np.vstack([columns, _slopes(places)])
        values = np.vstack([values, *(point.slopes.T for point in fitted)])
    weights, *_ = np.linalg.lstsq(columns, values, rcond=1e-10)
    there, true = _places(tests)
    return np.asarray(np.sqrt(np.mean((_columns(there) @ weights - true) ** 2, axis=0)))


def _places(points: list[_Point]) -> tuple[Array, Array]:
    return np.array([p.place for p in points]), np.array([p.values for p in points])


def main(output: Output, quick: bool) -> None:
    """Run and write; quick: few points."""
    runs = _Runs()
    training, tests = (4, 2) if quick else (TRAINING, TESTS)
    places = 2.0 * qmc.Sobol(len(runs.question.inputs) + 1, seed=12).random(64) - 1.0
    fitted, plain = [], []
    for number, place in enumerate(places[: training + tests]):
        carries = number < training
        (fitted if carries else plain).append(runs.at(place, carries=carries))
        print(f"  {number + 1} of {training + tests} points", flush=True)
    each = float(np.mean([point.seconds for point in plain]))
    rows: list[dict[str, Any]] = []
    for carries, counts in ((False, PLAIN), (True, CARRYING)):
        for count in (n for n in counts if n <= training):
            stress, heat = misses(fitted[:count], plain, carries=carries)
            spent = sum(point.seconds for point in fitted[:count]) if carries else count * each
            rows.append({
                "derivatives": "yes" if carries else "no", "runs": count, "seconds": spent,
                "stress": float(stress), "heat": float(heat),
            })  # fmt: skip
    output.csv("optimum_fit", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    forms = {"seconds": ".0f", "stress": ".2f", "heat": ".3f"}
    output.insert("optimum fit", table(output.rows("optimum_fit"), SHOWN, forms))
