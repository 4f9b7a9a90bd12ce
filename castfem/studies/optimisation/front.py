"""The front of two results: the best of one at each level of the other (epsilon-constraint).

From the best run of the first result to that of the second: the largest gap between two neighbours
is halved by a search that holds the second result to its middle, from the best run so far that
meets this. A level that gives nothing new closes its gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from castfem.base.result_registry import general_label
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.optimisation.optimum import Front, FrontPoint, FrontResult
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.responses import Responses
from castfem.studies.optimisation.search import SEARCH, Search


class FrontSearch:
    """Finds the front of two results after a first search, from where that began, shares (n,)."""

    def __init__(self, search: Search, start: Array) -> None:
        self._responses, self._start = search.responses, start
        table = self._responses.problem.table
        assert table.front is not None
        self._other = self._responses.other(objective=table.front.objective)
        self._most, self._points = table.most_runs, table.front.points
        self._noise = [float(search.noise[0]), 0.0]
        self._exhausted = False

    def run(self, best: RunRequest) -> Front:
        """Return the front from the best run of the first result on."""
        before = len(self._responses.seen)
        search = self._search(self._other)
        far = search.towards(self._start, best)
        self._exhausted |= search.exhausted
        self._noise[1] = float(search.noise[0])
        ends = [best] if self._responses.seen[far].failed else [best, far]
        found, closed = self._undominated(ends), set[tuple[RunRequest, RunRequest]]()
        while len(found) < self._points:
            gaps = [pair for pair in pairwise(found) if pair not in closed]
            sizes = [self._distance(*pair, found) for pair in gaps]
            if not sizes or max(sizes) <= 0.0:
                break
            pair = gaps[int(np.argmax(sizes))]
            closed.add(pair)
            found = self._undominated([*found, self._between(*pair)])
        return self._front(found, len(self._responses.seen) - before)

    def _search(self, responses: Responses) -> Search:
        return Search(responses, len(responses.seen) + self._most)

    def _distance(self, one: RunRequest, other: RunRequest, found: Sequence[RunRequest]) -> float:
        """How far two neighbours are apart, in spans of the front; 0 if noise hides it."""
        span = np.abs(self._pair(found[-1]) - self._pair(found[0]))
        step = np.abs(self._pair(one) - self._pair(other))
        if np.any(step <= 2.0 * np.array(self._noise)):  # nearer results count as equal
            return 0.0
        return float(np.max(step / np.maximum(span, 1e-300)))

    def _between(self, one: RunRequest, other: RunRequest) -> RunRequest:
        """The best run of the first result whose second is half-way between those of two."""
        level = 0.5 * (self._other.value(one) + self._other.value(other))
        bound = _bound(self._other.objective, self._other.sense, level)
        search = self._search(self._responses.other(extra=(bound,)))
        ends = [self._responses.problem.shares(w) for w in (one, other)]
        first = float(np.clip(0.25 * np.max(np.abs(ends[1] - ends[0])), 0.0, SEARCH.first))
        found = search.towards(self._start, search.best_known(self._start), first)
        self._exhausted |= search.exhausted
        return found

    def _pair(self, request: RunRequest) -> Array:
        """Both results of a run, less is better (2,), SI."""
        return np.array([self._responses.cost(request), self._other.cost(request)])

    def _undominated(self, found: Sequence[RunRequest]) -> list[RunRequest]:
        """Runs than which no other is better in one and no worse in both, in order.

        What is better by no more than noise counts as equal.
        """
        kept: list[RunRequest] = []
        for run in sorted(dict.fromkeys(found), key=lambda w: tuple(self._pair(w))):
            if not kept or self._pair(run)[1] < self._pair(kept[-1])[1] - self._noise[1]:
                kept.append(run)
        return kept

    def _front(self, found: Sequence[RunRequest], runs: int) -> Front:
        points: list[FrontPoint] = []
        for request in found:
            first, second = self._responses.value(request), self._other.value(request)
            price = None
            if points:
                price = (first - points[-1].first) / (second - points[-1].second)
            folder = self._responses.seen[request].folder
            name = "" if folder is None else folder.name
            points.append(FrontPoint(request.values, first, second, price, name))
        results = [
            _result(responses, found[0], noise)
            for responses, noise in zip((self._responses, self._other), self._noise, strict=True)
        ]
        keys = tuple(one.label for one in self._responses.problem.variables)
        return Front(keys, results[0], results[1], tuple(points), runs, self._exhausted)


def _result(responses: Responses, request: RunRequest, noise: float) -> FrontResult:
    name = responses.objective
    quantity = responses.seen[request].quantities[name]
    label = general_label(name, quantity.label)
    return FrontResult(name, label, quantity.shown_unit, responses.sense, noise)


def _bound(name: str, sense: float, level: float) -> Bound:
    """The constraint that a result, small or large by its sense, is no worse than a level, SI."""
    sign, side = ("<=", "at_most") if sense > 0.0 else (">=", "at_least")
    text = f"{name} {sign} {level!r} (SI)"
    return Bound(text, repr(level), name, side, level, "", False)  # type: ignore[arg-type]
