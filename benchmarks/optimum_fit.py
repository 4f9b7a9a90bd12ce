"""Do derivatives make the fit by which inputs are weighed cheaper? Polynomials through both runs.

At points of Sobol's sequence in the taper and the four inputs of `optimum_inputs`, as `castfem
optimise` takes them and lays its polynomials: through so many runs, and through runs that carry
their derivatives by all five. What either misses is read at further points, and what they make of
draws of the inputs at the best taper beside runs of these draws. Writes two tables of
docs/mould_design.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.stats import qmc

from benchmarks.optimum_gradients import plain
from benchmarks.report import Output, table
from castfem.api import load
from castfem.base.types import Array
from castfem.studies.optimisation.evaluator import lean, variant
from castfem.studies.optimisation.polynomial_fit import fit
from castfem.studies.optimisation.problem import DesignProblem, RunRequest
from castfem.studies.sensitivity.run import sensitivity

TAPER = 0.34, 0.84  # %/m: about the best one
TRAINING, PLAIN, CARRYING = 32, (32,), (8, 12, 16, 24, 32)
TESTS, DRAWS = 24, 24
FITS = (True, 16), (False, 32)  # with and without derivatives, as `castfem optimise` has them
STRESS, HEAT = "von_mises_max", "heat_removed"
SHOWN = {
    "derivatives": "derivatives",
    "runs": "points",
    "seconds": "processor time, s",
    "stress": "misses the peak stress by, MPa",
    "heat": "misses the heat beyond its bound by, MJ/m",
}
DRAWN = {
    "by": "by",
    "met": "keeps to the heat, % of the draws",
    "heat": "heat beyond its bound, 5 to 95 %, MJ/m",
    "stress": "peak stress, 5 to 95 %, MPa",
    "of_heat": "heat transfer's share of the spread of the heat",
    "of_stress": "flow stress' share of that of the stress",
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
        self.question = DesignProblem(load("billet125/optimum_inputs"))
        self._base = lean(self.question.case)
        inputs = self.question.inputs
        ends = [TAPER, *((one.low, one.high) for one in inputs)]
        self._low, self._high = (np.array(side) for side in zip(*ends, strict=True))
        self._keys = [*(a.key for a in self.question.variables), *(one.key for one in inputs)]
        self._relative = [False, *(one.relative for one in inputs)]

    def at(self, place: Array, *, carries: bool) -> _Point:
        """Both results at a place, with their derivatives or without."""
        question, bound = self.question, self.question.bounds[0]
        given = self._low + 0.5 * (place + 1.0) * (self._high - self._low)
        drawn = tuple(float(f"{value:.6g}") for value in given)
        wanted = RunRequest(drawn[:1], "coarse", inputs=drawn[1:])
        start = process_time()
        own, slopes = self._run(wanted, drawn, carries)
        ideal, ideal_slopes = self._run(question.ideal(wanted), drawn, carries)
        seconds = process_time() - start
        own[1] -= bound.value * ideal[1]
        slopes[1] -= bound.value * ideal_slopes[1]
        return _Point(place, 1e-6 * own, 1e-6 * slopes, seconds)

    def _run(
        self, wanted: RunRequest, drawn: tuple[float, ...], carries: bool
    ) -> tuple[Array, Array]:
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


def laid_through(fitted: list[_Point], *, carries: bool) -> Callable[[Array], Array]:
    """Polynomials through runs, with their derivatives or without."""
    places, values = _places(fitted)
    slopes = np.array([point.slopes for point in fitted]) if carries else None
    return fit(places, values, 1, slopes)[0]


def misses(fitted: list[_Point], tests: list[_Point], *, carries: bool) -> Array:
    """By how much a fit misses the tests (2,), root mean square."""
    there, true = _places(tests)
    off = laid_through(fitted, carries=carries)(there) - true
    return np.asarray(np.sqrt(np.mean(off**2, axis=0)))


def drawn_row(by: str, places: Array, values: Array) -> dict[str, Any]:
    """What inputs do at one taper: shares of the variance by straight lines through the draws.

    Args:
        by: What the values are from.
        places: Taper and inputs of the draws (r, 5).
        values: Stress and heat (r, 2).
    """
    columns = np.column_stack([np.ones(len(places)), places[:, 1:]])
    slopes = np.linalg.lstsq(columns, values, rcond=None)[0][1:]
    shares = slopes**2 / np.sum(slopes**2, axis=0)
    stress, heat = (np.quantile(one, (0.05, 0.95)) for one in values.T)
    return {
        "by": by, "met": 100.0 * float(np.mean(values[:, 1] >= 0.0)),
        "heat_low": heat[0], "heat_high": heat[1], "stress_low": stress[0],
        "stress_high": stress[1], "of_heat": shares[0, 1], "of_stress": shares[3, 0],
    }  # fmt: skip


def _places(points: list[_Point]) -> tuple[Array, Array]:
    return np.array([p.place for p in points]), np.array([p.values for p in points])


def main(output: Output, quick: bool) -> None:
    """Run and write; quick: few points."""
    runs = _Runs()
    training, tests = (4, 2) if quick else (TRAINING, TESTS)
    places = 2.0 * qmc.Sobol(len(runs.question.inputs) + 1, seed=12).random(64) - 1.0
    drawn = 2.0 * qmc.Sobol(len(runs.question.inputs), seed=5).random(32) - 1.0
    drawn = np.hstack([np.zeros((len(drawn), 1)), drawn])[: 4 if quick else DRAWS]
    every = [*places[: training + tests], *drawn]
    made = []
    for number, place in enumerate(every):
        made.append(runs.at(place, carries=number < training))
        print(f"  {number + 1} of {len(every)} points", flush=True)
    fitted, plain = made[:training], made[training : training + tests]
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
    there, true = _places(made[training + tests :])
    rows = [drawn_row(f"runs of {len(there)} draws", there, true)]
    for carries, count in FITS:
        laid = laid_through(fitted[:count], carries=carries)
        with_them = "with derivatives" if carries else "without"
        rows.append(drawn_row(f"fit to {count} {with_them}", there, laid(there)))
    output.csv("optimum_draws", rows)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("optimum_draws")
    for row in rows:
        row["heat"] = f"{row['heat_low']:.3f} to {row['heat_high']:.3f}"
        row["stress"] = f"{row['stress_low']:.1f} to {row['stress_high']:.1f}"
    forms = {"met": ".0f", "of_heat": ".2f", "of_stress": ".2f"}
    output.insert("optimum draws", table(rows, DRAWN, forms))
    forms = {"seconds": ".0f", "stress": ".2f", "heat": ".3f"}
    output.insert("optimum fit", table(output.rows("optimum_fit"), SHOWN, forms))
