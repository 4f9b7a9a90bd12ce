"""The search for the best values: COBYQA behind the runs that are there, stopped by their noise.

Nothing is run here. A search looks at runs; where one is missing it stops, says which it needs and
begins anew when they are there: it always takes the same way, so that it goes on after a kill, and
whoever does the runs, in whatever order, gets the same answer.

A run that fails has neither objective nor margins. It gets the worst of those seen so far, and
violates a constraint of its own by what is left of its way, so that the search goes back to where
the strand comes through.

COBYQA: [Ragonneau2022] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from castfem.base.types import Array
from castfem.studies.optimisation.noise import Noise, neighbours, slope_of
from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Wanted

FIRST, LAST = 0.1, 0.002  # of the ranges: first step, and the smallest worth taking
_WIDE = 3  # 2^3 - 1 places over the ranges where the start fails
AT_END = 2.0  # last steps from the end of a range
_LARGEST_LAST = 0.03  # of the ranges: of the last step, however large the noise
_FAILED = 10.0  # of a failed run's missing way, in scales of the other constraints
_UNSEEN = 1e-2  # of a result: its scale where no two runs have shown one
_INSIDE = 1e-3  # of the scale of a constraint: how far inside of it derivatives aim
_DEAR = 10.0  # scales of the cost that a scale of a missed constraint is worth
_LOST = 1e30  # violation of a failed run: more than that of any that came to its end
ROUNDING = 1e-9  # of a bound: what misses it by less has met it


Done = dict[tuple[object, ...], tuple[Wanted, ...]]
"""Parts of a search, by start, first step and aim: which runs each has looked at, in order."""


class Spent(Exception):
    """The search has had its runs."""


class _Untold(Exception):
    """A run that was to carry derivatives tells none."""


class _Through(Exception):
    """A run has come to its end."""

    def __init__(self, wanted: Wanted) -> None:
        super().__init__()
        self.wanted = wanted


class Search:
    """A search with one objective.

    Args:
        outputs: What runs mean.
        most: How many runs it may look at.
        done: Parts of the search that have come to their end, kept for the next time it is begun.

    Attributes:
        noise: Of the results; None before it is measured.
        radius: Of the last step, as a share of the ranges.
        spent: Whether it ended for it had no more runs.
        looked_at: Number of runs that there were when `run` ended.
    """

    def __init__(self, outputs: Outputs, most: int, done: Done | None = None) -> None:
        self.outputs, self.question, self._most = outputs, outputs.question, most
        self._done: Done = {} if done is None else done
        self._order: list[Wanted] = []
        self.noise: Noise | None = None
        self.radius, self.spent, self.looked_at = LAST, False, 0
        self._scale, self._scaled = np.ones(1 + outputs.count), True
        self._moved: Array = np.full((1 + outputs.count, len(outputs.question.axes)), np.inf)
        self._given: dict[Wanted, Array] = {}
        self._worst = np.zeros(1 + outputs.count)

    def run(self, start: Array) -> Wanted:
        """Return the best run that is found from a start (n,), shares of the ranges.

        Raises:
            Needs: Runs are missing.
        """
        try:
            begin = self._settle(start)
            for valley in self._valleys(begin):
                self._downhill(valley, FIRST)
            best = self.best()
            if self.violation(best) > 0.0:  # nothing meets all: what comes nearest?
                self._cobyqa(self.question.shares(best), FIRST, self._worst_violation)
        except Spent:
            self.spent = True
        self.looked_at = len(self.outputs.seen)
        return self.best()

    def again(self, begin: Wanted) -> Wanted:
        """Search on from a run with small steps, and return the best one.

        Raises:
            Needs: Runs are missing.
        """
        try:
            steps = min(max(4.0 * self.radius, 2.0 * LAST), FIRST)
            self._cobyqa(self.question.shares(begin), steps, self._cost)
        except Spent:
            self.spent = True
        return self.best()

    def towards(self, start: Array, begin: Wanted, first: float = FIRST) -> Wanted:
        """Search from a run that is known, and return the best one.

        Args:
            start: Of the first search of these runs, about which noise was measured (n,).
            begin: Where this one begins.
            first: Its first step, as a share of the ranges.

        Raises:
            Needs: Runs are missing.
        """
        try:
            self._settle(start)
            self._downhill(self.question.shares(begin), max(first, 2.0 * LAST))
        except Spent:
            self.spent = True
        return self.best()

    def measure_at(self, best: Wanted) -> None:
        """Measure the noise about a best run, too, where its windows are cut for their error.

        Those of its neighbours may be cut elsewhere, if not those of the runs about the start.

        Raises:
            Needs: Runs are missing.
        """
        if self.noise is None or not self.outputs.seen[best].cut:
            return
        runs = [self.question.at(u) for u in neighbours(self.question.shares(best))]
        self.outputs.fetch(runs)
        values = np.array([self.outputs.vector(run) for run in runs])
        self.noise = self.noise.at_least(Noise.of(values, self.noise.slope))

    def best_known(self, start: Array) -> Wanted:
        """Return the best run of those that were made for other aims; see `towards`.

        Raises:
            Needs: Runs are missing.
        """
        self._settle(start)
        return self.best()

    def _valleys(self, begin: Array) -> list[Array]:
        """Where to search from: the start, or what Optuna has found all over the ranges."""
        if self.question.table.method != "optuna":
            return [begin]
        from castfem.studies.optimisation.valleys import explore

        def given(places: Sequence[Array]) -> list[list[float]]:
            runs = [self.question.at(place) for place in places]
            self._fetch(runs)
            return [[float(value) for value in self.given(run)] for run in runs]

        count = (self._most - len(self.outputs.seen)) // 2
        return explore(given, begin, count) if count > 1 else [begin]

    def _settle(self, start: Array, among_failures: bool = False) -> Array:
        """Measure noise, scales and the last step about the start; return the start.

        Where none of the runs about it comes through, that is done about the first one that does.
        """
        begin = np.clip(start, 0.0, 1.0)
        inner = np.clip(begin, FIRST, 1.0 - FIRST)
        cross = [inner, *(inner + s * FIRST * e for e in np.eye(len(begin)) for s in (1.0, -1.0))]
        line = neighbours(inner)
        runs = list(dict.fromkeys(self.question.at(u) for u in [begin, *cross, *line]))
        self._fetch(runs)
        values = np.array([self.outputs.vector(self.question.at(u)) for u in cross])
        self._scaled = bool(np.any(~np.isnan(values[:, 0])))
        if not self._scaled and not among_failures:
            through = self._through(begin)
            if through is not None:
                return self._settle(self.question.shares(through), among_failures=True)
        sides = [(values[1 + 2 * i], values[2 + 2 * i]) for i in range(len(begin))]
        slope = np.array([slope_of(values[0], *pair, apart=FIRST) for pair in sides]).T
        off = [np.fmax(abs(a - values[0]), abs(b - values[0])) for a, b in sides]
        self._moved = np.array(off).T
        along = np.array([self.outputs.vector(self.question.at(u)) for u in line])
        self.noise = Noise.of(along, slope)
        sigma, count = self.noise.sigma, self.noise.runs
        spread = np.nanmax(np.abs(values - values[0]), axis=0, initial=0.0, where=~np.isnan(values))
        size = np.array([1.0, *(abs(b) for b in self._bounds(runs))])
        widest = np.maximum(np.nan_to_num(spread), np.maximum(10.0 * sigma, 1e-6 * size))
        self._scale = np.asarray(np.where(widest > 0.0, widest, 1.0))
        finished = [w for w, given in self.outputs.seen.items() if not given.failed]
        if finished:
            scaled = np.array([self.outputs.vector(w) for w in finished]) / self._scale
            self._worst = np.array([scaled[:, 0].max(), *scaled[:, 1:].min(axis=0)])
        steepest = np.nanmax(np.abs(np.nan_to_num(slope)), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(steepest > 0.0, 2.0 * sigma / steepest, np.inf)
        if count:
            self.radius = float(np.clip(np.min(steps), LAST, _LARGEST_LAST))
        return begin

    def _through(self, begin: Array) -> Wanted | None:
        """The first run found that comes to its end, from a start where they fail; None if none.

        First at places all over the ranges: how far runs come may tell nothing from afar.
        """
        from scipy.optimize import Bounds, minimize
        from scipy.stats import qmc

        def missing(u: Array) -> float:
            wanted = self.question.at(u)
            self._fetch([wanted])
            if not self.outputs.seen[wanted].failed:
                raise _Through(wanted)
            return 1.0 - self.outputs.seen[wanted].share

        options = {"initial_tr_radius": FIRST, "final_tr_radius": LAST, "maxfev": 4 * self._most}
        box = Bounds(np.zeros(len(begin)), np.ones(len(begin)))
        over = qmc.Sobol(len(begin), scramble=False).random_base2(_WIDE)[
            1:
        ]  # the first is a corner
        try:
            for place in over:
                missing(np.asarray(place))
            minimize(missing, begin, method="COBYQA", bounds=box, options=options)
        except _Through as found:
            return found.wanted
        return None

    def _bounds(self, runs: Sequence[Wanted]) -> list[float]:
        for run in runs:
            if not self.outputs.seen[run].failed:
                return [margin.bound for margin in self.outputs.margins(run)]
        return [1.0] * self.outputs.count

    def _fetch(self, wanted: Sequence[Wanted]) -> None:
        new = [one for one in wanted if one not in self.outputs.seen]
        if len(self.outputs.seen) + len(new) > self._most and len(new) == 1:
            raise Spent
        self.outputs.fetch(wanted)

    def given(self, wanted: Wanted) -> Array:
        """Scaled cost, margins and how far it came, of a run that may have failed (2 + m,)."""
        if wanted not in self._given:
            self._fetch([wanted])
            self._order.append(wanted)
            evaluation, vector = self.outputs.seen[wanted], self.outputs.vector(wanted)
            if evaluation.failed:
                left = _FAILED * (evaluation.share - 1.0) - 1.0 / _FAILED
                self._given[wanted] = np.array([*self._worst, left])
            else:
                if not self._scaled:  # none has come through yet
                    self._scaled, bounds = True, self._bounds([wanted])
                    sizes: Array = np.abs(np.array([vector[0], *bounds]))
                    self._scale = np.asarray(np.where(sizes > 0.0, _UNSEEN * sizes, 1.0))
                scaled = vector / self._scale
                self._worst[0] = max(self._worst[0], scaled[0])
                self._worst[1:] = np.minimum(self._worst[1:], scaled[1:])
                self._given[wanted] = np.array([*scaled, 1.0])
        return self._given[wanted]

    def _cost(self, u: Array) -> float:
        return float(self.given(self.question.at(u))[0])

    def _worst_violation(self, u: Array) -> float:
        return float(max(0.0, -np.min(self.given(self.question.at(u))[1:])))

    def _downhill(self, begin: Array, first: float) -> None:
        """Search from a start by the method that is asked for."""
        if self.question.table.method == "slsqp":
            try:
                self._by_derivatives(begin, first)
            except _Untold:
                self._cobyqa(begin, first, self._cost)
        else:
            self._cobyqa(begin, first, self._cost)

    def _by_derivatives(self, begin: Array, first: float) -> None:
        """Search from a start with runs that carry derivatives; COBYQA mends what misses a bound.

        Raises:
            _Untold: A run tells none.
        """
        from castfem.studies.optimisation.descent import descend

        count, inside = len(begin), np.full(self.outputs.count, _INSIDE)

        def at(u: Array) -> Wanted:
            return replace(self.question.at(u), carries=True)

        def given(u: Array) -> Array:
            return self.given(at(u)) - np.array([0.0, *inside, 0.0])

        def slopes(u: Array) -> Array:
            wanted, found = at(u), np.zeros((2 + self.outputs.count, count))
            self._fetch([wanted])
            if not self.outputs.seen[wanted].failed:
                told = self.outputs.slopes(wanted)
                if told is None:
                    raise _Untold
                found[:-1] = np.nan_to_num(told[:, :count]) / self._scale[:, None]
            return found

        last = min(self.radius, 0.5 * first)
        part = (*(float(u) for u in begin), first, last, "slopes", self.outputs.aim)
        with self._part(part) as new:
            if new:
                descend(begin, given, slopes, first, last, self._most)
        end = min(self._done[part], key=self._merit, default=self.best())
        if self.violation(end) > 0.0:  # a bound is bent more than its derivatives tell
            self._cobyqa(self.question.shares(end), max(4.0 * last, 2.0 * LAST), self._cost)

    def _merit(self, wanted: Wanted) -> float:
        """What a run is worth that may miss a bound by a little."""
        return float(self.given(wanted)[0]) + _DEAR * self.violation(wanted)

    @contextmanager
    def _part(self, part: tuple[object, ...]) -> Iterator[bool]:
        """A part of the search; false where it has come to its end before: its runs are looked at.

        Args:
            part: What makes it another one.
        """
        if part in self._done:
            for wanted in self._done[part]:
                self.given(wanted)
            yield False
            return
        before = len(self._order)
        yield True
        self._done[part] = tuple(self._order[before:])

    def _cobyqa(self, begin: Array, first: float, objective: object) -> None:
        """Search from a start; what was seen is in `outputs`."""
        last = min(self.radius, 0.5 * first)
        aim = objective == self._cost
        part = (*(float(u) for u in begin), first, last, aim, self.outputs.aim)
        with self._part(part) as new:
            if new:
                self._minimise(begin, first, last, objective, aim)

    def _minimise(self, begin: Array, first: float, last: float, objective: Any, aim: bool) -> None:
        """One call of COBYQA, with the constraints where the cost is the aim."""
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        limits = []
        if aim:
            tolerated = np.array([*self._tolerance() / self._scale[1:], 0.0])
            limits = [NonlinearConstraint(
                lambda u: self.given(self.question.at(u))[1:], -tolerated, np.inf
            )]  # fmt: skip
        minimize(
            objective,
            begin,
            method="COBYQA",
            bounds=Bounds(np.zeros(len(begin)), np.ones(len(begin))),
            constraints=limits,
            options={
                "initial_tr_radius": first,
                "final_tr_radius": last,
                "maxfev": 4 * self._most,
                "feasibility_tol": 1e-6,
            },
        )

    def _tolerance(self) -> Array:
        """What a constraint may be missed by: its own noise (m,), SI."""
        sigma = np.zeros(1 + self.outputs.count) if self.noise is None else self.noise.sigma
        return np.asarray(sigma[1:])

    def violation(self, wanted: Wanted) -> float:
        """By how much a run misses what must hold, in scales of its constraints; 0: it does not."""
        evaluation = self.outputs.seen[wanted]
        if evaluation.failed:
            return float(_LOST * (2.0 - evaluation.share))
        if not self.outputs.count:
            return 0.0
        margins = self.outputs.margins(wanted)
        left = np.array([m.left for m in margins])
        allowed = self._tolerance() + ROUNDING * np.array([abs(m.bound) for m in margins])
        short = np.where(left >= -allowed, 0.0, -left)
        return float(np.max(short / self._scale[1:]))

    def better_than(self, wanted: Wanted) -> Wanted | None:
        """The best run seen where it is better than one by more than their noise, else None."""
        best = self.best()
        nearer = self.violation(best) < self.violation(wanted) - ROUNDING
        if best == wanted or self.outputs.seen[best].failed:
            return None
        cost = 0.0 if self.outputs.seen[wanted].failed else self.outputs.cost(wanted)
        gain = cost - self.outputs.cost(best)
        noise = 0.0 if self.noise is None else float(self.noise.sigma[0])
        return best if nearer or gain > max(noise, ROUNDING * abs(cost)) else None

    def without_effect(self) -> tuple[str, ...]:
        """Keys of the variables that change no result by more than rounding; see `towards`.

        All of them, where no two runs differ in any result.
        """
        own = [w for w in self.outputs.seen if w.fidelity == self.question.table.fidelity]
        values = [self.outputs.vector(w) for w in own if not self.outputs.seen[w].failed]
        if self.noise is None or len(values) < 2:
            return ()
        largest = np.max(np.abs(values), axis=0)
        keys = [axis.key for axis in self.question.axes]
        if np.all(np.ptp(values, axis=0) <= ROUNDING * largest):
            return tuple(keys)
        idle = np.all(self._moved <= ROUNDING * largest[:, None], axis=0)
        found = tuple(key for key, one in zip(keys, idle, strict=True) if one)
        return found if len(found) < len(keys) else ()  # runs differ: not all of them are idle

    def best(self) -> Wanted:
        """The best run seen: the one with the least violation, and of those the least cost."""
        level = self.question.table.fidelity
        own = [w for w in self.outputs.seen if w.fidelity == level and not w.ideal]

        def order(wanted: Wanted) -> tuple[float, float]:
            failed = self.outputs.seen[wanted].failed
            return self.violation(wanted), np.inf if failed else self.outputs.cost(wanted)

        return min(own, key=order)
