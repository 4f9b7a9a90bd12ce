"""Search for the optimum of one objective: COBYQA, or SLSQP with derivatives from the runs.

A failed run has neither objective nor margins. It gets the worst ones so far, and violates an
additional constraint by the part of the strand that it has not reached, so that the search returns
to where the strand comes through.

COBYQA: [Ragonneau2022]; SLSQP: [Kraft1988] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.studies.optimisation.global_search import explore
from castfem.studies.optimisation.local_model import neighbours, scatter
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.responses import Responses


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Steps, scales and end criteria of the search. Lengths are fractions of the ranges."""

    first: float = 0.1  #: first step
    last: float = 0.002  #: smallest useful step
    largest_last: float = 0.03  #: largest last step, for any noise
    at_end: float = 2.0  #: distance from the end of a range that counts as there, in last steps
    sobol: int = 3  #: 2^3 - 1 points over the ranges are tried if the start fails
    #: factor on the part that a failed run has not reached, in scales of the constraints
    failed: float = 10.0
    unseen: float = 1e-2  #: relative scale of a result that is equal in all runs
    inside: float = 1e-3  #: margin at which SLSQP aims inside a constraint, in its scale
    dear: float = 10.0  #: cost, in its scale, of violating a constraint by its scale
    lost: float = 1e30  #: violation of a failed run: more than that of any finished one
    flat: float = 1e-3  #: change of cost and constraints that ends SLSQP, in their scales
    trials: int = 4  #: failed trials for a step of SLSQP, as at a kink


SEARCH = SearchSettings()

Function = Callable[[Array], Any]


class BudgetExhausted(Exception):
    """The search has used up its runs."""


class _StepsEnd(Exception):
    """Steps of SLSQP have become shorter than the last one, or bring no improvement."""


class Search:
    """A search with one objective.

    Args:
        responses: Responses of the runs.
        most: Largest number of runs that it may use.

    Attributes:
        noise: Noise of cost and margins (1 + m,), SI: scatter of nearly equal runs.
        noise_known: Whether it was measured; otherwise it is 0.
        radius: Size of the last step, as a fraction of the ranges.
        exhausted: Whether it ended because its runs were used up.
        looked_at: Number of runs used when `run` ended.
    """

    def __init__(self, responses: Responses, most: int) -> None:
        self.responses, self.problem, self._most = responses, responses.problem, most
        count, n = 1 + responses.count, len(responses.problem.variables)
        self.noise: Array = np.zeros(count)
        self.noise_known = False
        self.radius, self.exhausted, self.looked_at = SEARCH.last, False, 0
        self._scale: Array = np.ones(count)
        self._scaled = True
        self._moved: Array = np.full((count, n), np.inf)
        self._vectors: dict[RunRequest, Array] = {}
        self._worst = np.zeros(count)

    def run(self, start: Array) -> RunRequest:
        """Return the best run found from a start (n,), fractions of the ranges."""

        def whole() -> None:
            for place in self._starts(self._measure(start)):
                self._descend(place, SEARCH.first)
            best = self.best()
            if self.violation(best) > 0.0:  # no run meets all constraints: find the least violation
                self._cobyqa(
                    self.problem.shares(best), SEARCH.first, self._worst_violation, free=True
                )

        best = self._within_budget(whole)
        self.looked_at = len(self.responses.seen)
        return best

    def again(self, begin: RunRequest) -> RunRequest:
        """Continue the search from a run with small steps; return the best one."""
        step = min(max(4.0 * self.radius, 2.0 * SEARCH.last), SEARCH.first)
        return self._within_budget(lambda: self._cobyqa(self.problem.shares(begin), step))

    def towards(self, start: Array, begin: RunRequest, first: float = SEARCH.first) -> RunRequest:
        """Search from a run that was made for another objective; return the best one.

        Args:
            start: Start of the first search of these runs, where noise was measured (n,).
            begin: Start of this search.
            first: Its first step, as a fraction of the ranges.
        """

        def whole() -> None:
            self._measure(start)
            self._descend(self.problem.shares(begin), max(first, 2.0 * SEARCH.last))

        return self._within_budget(whole)

    def best_known(self, start: Array) -> RunRequest:
        """Return the best of the runs made for other objectives; see `towards`."""
        return self._within_budget(lambda: self._measure(start))

    def measure_noise_at(self, best: RunRequest) -> None:
        """Measure the noise at a best run, too, if its coupling windows are shortened.

        The steps of its neighbours may be shortened elsewhere, even if not those of the runs around
        the start.
        """
        if not self.responses.seen[best].cut:
            return
        line = [self.problem.request(u) for u in neighbours(self.problem.shares(best))]
        self.responses.fetch(line)
        noise = scatter(np.array([self.responses.vector(run) for run in line]))
        self.noise_known &= noise is not None
        self.noise = self.noise if noise is None else np.maximum(self.noise, noise)

    def _within_budget(self, search: Callable[[], object]) -> RunRequest:
        try:
            search()
        except BudgetExhausted:
            self.exhausted = True
        return self.best()

    def _fetch(self, requests: Sequence[RunRequest]) -> None:
        new = [one for one in requests if one not in self.responses.seen]
        if len(new) == 1 and len(self.responses.seen) >= self._most:
            raise BudgetExhausted
        self.responses.fetch(requests)

    def _starts(self, begin: Array) -> list[Array]:
        """Starts of the search: the given one, or the local optima of a global search."""
        count = (self._most - len(self.responses.seen)) // 2
        if self.problem.table.method != "optuna" or count < 2:
            return [begin]

        def evaluate(places: Sequence[Array]) -> list[list[float]]:
            runs = [self.problem.request(place) for place in places]
            self._fetch(runs)
            return [[float(value) for value in self._vector(run)] for run in runs]

        return explore(evaluate, begin, count)

    def _measure(self, start: Array, among_failures: bool = False) -> Array:
        """Measure noise, scales and last step around the start; return the start.

        If all runs around it fail, this is done around the first run found that does not.
        """
        vector, request = self.responses.vector, self.problem.request
        begin = np.clip(start, 0.0, 1.0)
        inner = np.clip(begin, SEARCH.first, 1.0 - SEARCH.first)
        cross = [
            inner,
            *(inner + s * SEARCH.first * e for e in np.eye(len(begin)) for s in (1.0, -1.0)),
        ]
        line = neighbours(inner)
        runs = list(dict.fromkeys(request(u) for u in [begin, *cross, *line]))
        self._fetch(runs)
        values = np.array([vector(request(u)) for u in cross])
        self._scaled = bool(np.any(~np.isnan(values[:, 0])))
        if not self._scaled and not among_failures:
            finished = self._first_that_finishes(begin)
            if finished is not None:
                return self._measure(self.problem.shares(finished), among_failures=True)
        here, above, below = values[0], values[1::2], values[2::2]
        self._moved = np.fmax(abs(above - here), abs(below - here)).T
        noise = scatter(np.array([vector(request(u)) for u in line]))
        self.noise_known = noise is not None
        self.noise = np.zeros(len(here)) if noise is None else noise
        widest = np.nan_to_num(np.fmax.reduce(abs(values - here)))
        size = np.array([1.0, *self._bounds(runs)])
        widest = np.maximum(widest, np.maximum(10.0 * self.noise, 1e-6 * size))
        self._scale = np.where(widest > 0.0, widest, 1.0)
        finished_runs = [w for w, run in self.responses.seen.items() if not run.failed]
        if finished_runs:
            scaled = np.array([vector(w) for w in finished_runs]) / self._scale
            self._worst = np.array([scaled[:, 0].max(), *scaled[:, 1:].min(axis=0)])
        if self.noise_known:
            # To one side if the other run has failed.
            slope = (above - below) / (2.0 * SEARCH.first)
            slope = np.where(np.isnan(above), (here - below) / SEARCH.first, slope)
            slope = np.where(np.isnan(below), (above - here) / SEARCH.first, slope)
            steepest = np.max(np.abs(np.nan_to_num(slope)), axis=0)
            with np.errstate(divide="ignore", invalid="ignore"):
                steps = np.where(steepest > 0.0, 2.0 * self.noise / steepest, np.inf)
            self.radius = float(np.clip(np.min(steps), SEARCH.last, SEARCH.largest_last))
        return begin

    def _first_that_finishes(self, begin: Array) -> RunRequest | None:
        """The first finishing run found from a start where all fail; None if there is none.

        First at points over the whole ranges: far away, the length reached may be no guide.
        """
        from scipy.stats import qmc

        finished: list[RunRequest] = []

        def missing(u: Array) -> float:
            request = self.problem.request(u)
            self._fetch([request])
            if not self.responses.seen[request].failed:
                finished.append(request)
                return -1.0
            return 1.0 - self.responses.seen[request].share

        _, *places = qmc.Sobol(len(begin), scramble=False).random_base2(SEARCH.sobol)
        if not any(missing(np.asarray(place)) < 0.0 for place in places):
            self._minimise(missing, begin, SEARCH.first, SEARCH.last, target=-1.0)
        return finished[0] if finished else None

    def _bounds(self, runs: Sequence[RunRequest]) -> Array:
        """Magnitudes of the bounds (m,), from the first finished run."""
        for run in runs:
            if not self.responses.seen[run].failed:
                return np.abs(self.responses.margins(run)[1])
        return np.ones(self.responses.count)

    def _vector(self, request: RunRequest) -> Array:
        """Scaled cost and margins, and a margin for finishing (2 + m,), failed or not."""
        if request not in self._vectors:
            self._fetch([request])
            run, vector = self.responses.seen[request], self.responses.vector(request)
            if run.failed:
                left = SEARCH.failed * (run.share - 1.0) - 1.0 / SEARCH.failed
                self._vectors[request] = np.array([*self._worst, left])
            else:
                if not self._scaled:  # the first finished run
                    self._scaled = True
                    sizes = np.array([abs(vector[0]), *self._bounds([request])])
                    self._scale = np.where(sizes > 0.0, SEARCH.unseen * sizes, 1.0)
                scaled = vector / self._scale
                self._worst[0] = max(self._worst[0], scaled[0])
                self._worst[1:] = np.minimum(self._worst[1:], scaled[1:])
                self._vectors[request] = np.array([*scaled, 1.0])
        return self._vectors[request]

    def _at(self, u: Array) -> Array:
        return self._vector(self.problem.request(u))

    def _worst_violation(self, u: Array) -> float:
        return float(max(0.0, -np.min(self._at(u)[1:])))

    def _descend(self, begin: Array, first: float) -> None:
        if self.problem.table.method != "slsqp" or not self._slsqp(begin, first):
            self._cobyqa(begin, first)

    def _cobyqa(
        self, begin: Array, first: float, objective: Function | None = None, *, free: bool = False
    ) -> None:
        from scipy.optimize import NonlinearConstraint

        tolerated = np.array([*self.noise[1:] / self._scale[1:], 0.0])
        limits = NonlinearConstraint(lambda u: self._at(u)[1:], -tolerated, np.inf)
        cost = objective or (lambda u: float(self._at(u)[0]))
        last = min(self.radius, 0.5 * first)
        self._minimise(cost, begin, first, last, () if free else limits)

    def _minimise(
        self, objective: Function, begin: Array, first: float, last: float, limits: Any = (),
        target: float = -np.inf,
    ) -> None:  # fmt: skip
        from scipy.optimize import Bounds, minimize

        options = {
            "initial_tr_radius": first, "final_tr_radius": last, "maxfev": 4 * self._most,
            "feasibility_tol": 1e-6, "f_target": target,
        }  # fmt: skip
        box = Bounds(np.zeros(len(begin)), np.ones(len(begin)))
        minimize(objective, begin, method="COBYQA", bounds=box, constraints=limits, options=options)

    def _slsqp(self, begin: Array, first: float) -> bool:
        """Search by SLSQP; COBYQA continues if it violates a bound.

        Returns:
            Whether the runs have derivatives.
        """
        from scipy.optimize import minimize

        known, last = len(self._vectors), min(self.radius, 0.5 * first)
        before, trials, complete = np.array(begin), 0, True
        inside = np.array([0.0, *np.full(self.responses.count, SEARCH.inside), 0.0])

        def at(x: Array) -> RunRequest:
            """The run at steps of `first`, so that a unit slope of the cost gives one step."""
            return replace(self.problem.request(first * x), derivatives=True)

        def values(x: Array) -> Array:
            return np.asarray(self._vector(at(x)) - inside)

        def cost(x: Array) -> float:
            nonlocal trials
            trials += 1
            if trials > SEARCH.trials:
                raise _StepsEnd
            return float(values(x)[0])

        def slopes(x: Array) -> Array:
            nonlocal complete
            request, found = at(x), np.zeros((2 + self.responses.count, len(begin)))
            self._fetch([request])
            if not self.responses.seen[request].failed:
                computed = self.responses.slopes(request)
                if computed is None:
                    complete = False
                    raise _StepsEnd
                by_share = np.nan_to_num(computed[:, : len(begin)])
                found[:-1] = by_share / self._scale[:, None]
            return first * found

        def stepped(x: Array) -> None:
            nonlocal before, trials
            far, before, trials = np.max(np.abs(first * x - before)), first * np.array(x), 0
            if far < last:
                raise _StepsEnd

        limits = {"type": "ineq", "fun": lambda x: values(x)[1:], "jac": lambda x: slopes(x)[1:]}
        with suppress(_StepsEnd):
            minimize(
                cost, before / first, jac=lambda x: slopes(x)[0], method="SLSQP",
                bounds=[(0.0, 1.0 / first)] * len(begin), constraints=limits, callback=stepped,
                options={"ftol": SEARCH.flat, "maxiter": self._most},
            )  # fmt: skip
        if complete:
            end = min(list(self._vectors)[known:], key=self._merit, default=self.best())
            if self.violation(end) > 0.0:  # a bound is more curved than its derivatives say
                self._cobyqa(self.problem.shares(end), max(4.0 * last, 2.0 * SEARCH.last))
        return complete

    def _merit(self, request: RunRequest) -> float:
        """Cost of a run, with a penalty for small violations."""
        return float(self._vector(request)[0]) + SEARCH.dear * self.violation(request)

    def violation(self, request: RunRequest) -> float:
        """Violation of constraints beyond noise, in their scales; 0 if all are met."""
        run = self.responses.seen[request]
        if run.failed:
            return float(SEARCH.lost * (2.0 - run.share))
        if not self.responses.count:
            return 0.0
        left, bounds = self.responses.margins(request)
        allowed = self.noise[1:] + ROUNDING * np.abs(bounds)
        return float(np.max(np.where(left >= -allowed, 0.0, -left) / self._scale[1:]))

    def best(self) -> RunRequest:
        """The best run so far: the smallest violation, and of those the smallest cost."""

        def order(request: RunRequest) -> tuple[float, float]:
            failed = self.responses.seen[request].failed
            return self.violation(request), np.inf if failed else self.responses.cost(request)

        return min(self.responses.of_level(self.problem.table.fidelity), key=order)

    def better_than(self, request: RunRequest) -> RunRequest | None:
        """The best run so far if it is better than `request` by more than noise, else None."""
        best, seen = self.best(), self.responses.seen
        if best == request or seen[best].failed:
            return None
        nearer = self.violation(best) < self.violation(request) - ROUNDING
        cost = 0.0 if seen[request].failed else self.responses.cost(request)
        gain = cost - self.responses.cost(best)
        return best if nearer or gain > max(float(self.noise[0]), ROUNDING * abs(cost)) else None

    def without_effect(self) -> tuple[str, ...]:
        """Keys of the variables that change no result by more than rounding.

        All of them, if no two runs differ in any result.
        """
        own = self.responses.of_level(self.problem.table.fidelity)
        values = [self.responses.vector(w) for w in own if not self.responses.seen[w].failed]
        if len(values) < 2 or np.all(np.isinf(self._moved)):
            return ()
        largest = np.max(np.abs(values), axis=0)
        keys = tuple(one.key for one in self.problem.variables)
        if np.all(np.ptp(values, axis=0) <= ROUNDING * largest):
            return keys
        idle = np.all(self._moved <= ROUNDING * largest[:, None], axis=0)
        found = tuple(key for key, one in zip(keys, idle, strict=True) if one)
        return () if found == keys else found
