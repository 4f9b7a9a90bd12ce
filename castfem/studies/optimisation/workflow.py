"""Workflow from a problem to its result: search, runs around the optimum, check, spread, front.

The front of two results has the best of one at each level of the other (epsilon-constraint). From
the best run of the first result to that of the second the largest gap between two neighbours is
halved by a search that bounds the second result by the middle, starting from the best run so far
that meets this. A level without a new point closes its gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from castfem.base.errors import InputError
from castfem.base.result_registry import general_label
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.accuracy.sizes import LEVELS
from castfem.studies.optimisation.assemble import Findings, assemble
from castfem.studies.optimisation.check_level import Check, CheckedOptimum
from castfem.studies.optimisation.fidelity import NumericalError, Tilt, next_of
from castfem.studies.optimisation.local_model import Binding, Quadratic, around, intervals
from castfem.studies.optimisation.optimum import Front, FrontPoint, FrontResult, Optimum
from castfem.studies.optimisation.problem import DesignProblem, RunRequest
from castfem.studies.optimisation.responses import KnownRuns, Obtain, Responses, obstacles
from castfem.studies.optimisation.search import SEARCH, Search
from castfem.studies.optimisation.spread import input_spread


@dataclass(frozen=True, slots=True)
class NeighbourSteps:
    """Distances of runs around an optimum."""

    least: float = 0.025  #: smallest distance between them, relative to the ranges
    widest: float = 0.1  #: largest distance
    turns: int = 3  #: iterations of search and runs around its optimum


NEIGHBOURS = NeighbourSteps()


@dataclass(frozen=True, slots=True)
class Workflow:
    """Computes the result of a problem; it waits for each run that it needs."""

    problem: DesignProblem
    runs: KnownRuns  #: their cases and results
    castfem_runs: bool  #: whether the runs are castfem's own, which may compute derivatives
    stage: Callable[[str], None]  #: called with the purpose of the runs that follow

    def run(self, obtain: Obtain) -> Optimum:
        """Return the result; `obtain` makes missing runs."""
        problem, start = self.problem, self._start(obtain)
        responses = Responses(problem, self.runs, obtain)
        search = Search(responses, problem.table.most_runs)
        self.stage("search")
        best = search.run(start)
        if responses.seen[best].failed:
            return assemble(Findings(search, best))
        for _ in range(NEIGHBOURS.turns):
            found = self._about(search, best)
            better = search.better_than(found.best)
            if better is None or search.exhausted:
                break
            best = better
        if (better := search.better_than(found.best)) is not None:
            return assemble(Findings(search, better, converged=False))
        if problem.inputs:
            self.stage("spread by the inputs")
            assert found.model is not None
            derivatives = self.castfem_runs and self._has_derivatives(found.best)
            spread = input_spread(
                responses.apart(), found.best, found.model, derivatives=derivatives
            )
            found = replace(found, spread=spread)
        if problem.table.front is not None:
            self.stage("front of the two objectives")
            found = replace(found, front=FrontSearch(search, start).run(found.best))
        return assemble(found)

    def _start(self, obtain: Obtain) -> Array:
        """Start of the search (n,): tapers from the strand in its idealised mould."""
        problem = self.problem
        if not problem.needs_ideal:
            return problem.start(None)
        request = problem.ideal(problem.request(problem.start(None)))
        if self.runs.find(request) is None:
            obtain([request])
        return problem.start(self.runs.find(request))

    def _has_derivatives(self, best: RunRequest) -> bool:
        """Whether runs with other inputs can compute derivatives."""
        own = replace(best, inputs=tuple(one.value(0.5) for one in self.problem.inputs))
        every = [own, self.problem.ideal(own)] if self.problem.relative else [own]
        return not obstacles(self.problem, {one: self.runs.case(one) for one in every})

    def _about(self, search: Search, best: RunRequest) -> Findings:
        """Make the runs around a best one, and at the other levels."""
        responses = search.responses
        self.stage("cost of a step away from the best run")
        best, model = self._surroundings(search, best)
        search.measure_noise_at(best)
        error = self._numerical_error(search, best, model)
        untilted = replace(error, tilt=None, checked="")
        for _ in range(2):  # wider if the interval is open
            places = intervals(model, search.noise, untilted, *responses.table(best.fidelity))
            ends = np.array([one.open_low or one.open_high for one in places])
            if not np.any(ends & (model.step < NEIGHBOURS.widest)):
                break
            step = np.where(ends, np.minimum(2.0 * model.step, NEIGHBOURS.widest), model.step)
            model = self._model(responses, best, step)
        binding = self._binding(search, best, model, error)
        checked = self._check(search, best, model, error, binding)
        return Findings(search, best, model, error, checked, binding)

    def _surroundings(self, search: Search, best: RunRequest) -> tuple[RunRequest, Quadratic]:
        """Fit the runs around a best one; if another one there is better, continue from it."""
        responses = search.responses
        width = float(np.clip(4.0 * search.radius, NEIGHBOURS.least, NEIGHBOURS.widest))
        step = np.full(len(self.problem.variables), width)
        for _ in range(NEIGHBOURS.turns):
            model = self._model(responses, best, step)
            better = search.best()
            gain = responses.cost(best) - responses.cost(better)
            nearer = search.violation(better) < search.violation(best)
            if better == best or not (nearer or gain > search.noise[0]):
                return best, model
            best = search.again(better)
        best = search.best()
        return best, self._model(responses, best, step)

    def _model(self, responses: Responses, best: RunRequest, step: Array) -> Quadratic:
        centre = self.problem.shares(best)
        responses.fetch([self.problem.request(place) for place in around(centre, step)])
        return Quadratic.fit(centre, step, *responses.table(best.fidelity))

    def _binding(
        self, search: Search, best: RunRequest, model: Quadratic, error: NumericalError
    ) -> Binding:
        """Return the constraints that limit the objective of the best run."""
        here, (_, seen) = search.responses.vector(best), search.responses.table(best.fidelity)
        if search.violation(best) > 0.0:  # if no run meets all constraints, better runs say nothing
            seen = seen[:0]
        off = np.maximum(error.below, error.above)[1:]
        return Binding.of(model, search.noise, here, seen, off)

    def _numerical_error(
        self, search: Search, best: RunRequest, model: Quadratic
    ) -> NumericalError:
        """Error of cost and margins, from the best run at the other levels."""
        responses = search.responses
        every = {word: RunRequest(best.values, word) for word in (*LEVELS, best.fidelity)}
        every = {word: one for word, one in every.items() if self._is_sound(one)}
        others = " and ".join(word for word in every if word != best.fidelity)
        self.stage(f"numerical error: the best run on {others} cells, the last the most expensive")
        responses.fetch(list(every.values()))
        vectors = {word: responses.vector_or_nan(one) for word, one in every.items()}
        error = NumericalError.of(best.fidelity, vectors)
        shares, last = self.problem.shares(best), SEARCH.at_end * search.radius
        fixed = sum(self._binding(search, best, model, error).near)
        fixed += int(np.count_nonzero((shares <= last) | (shares >= 1.0 - last)))
        if fixed >= len(shares):
            return error
        if next_of(best.fidelity) not in error.finished:
            return replace(error, untilted=np.ones(len(shares), dtype=bool))
        return error.with_tilt(best.fidelity, self._tilt(responses, best, model.step))

    def _tilt(self, responses: Responses, best: RunRequest, step: Array) -> Tilt:
        """Change of the cost at the next level relative to its own, around a best run."""
        shares = self.problem.shares(best)
        own = [self.problem.request(at) for at in [shares, *around(shares, step, (1,))]]
        next_level = [replace(one, fidelity=next_of(best.fidelity)) for one in own]
        responses.fetch([*own, *next_level])
        pairs = zip(own, next_level, strict=True)
        cost = responses.vector_or_nan
        change = np.array([cost(b)[0] - cost(a)[0] for a, b in pairs])
        return Tilt.fit(shares, np.array([self.problem.shares(one) for one in own]), change)

    def _check(
        self,
        search: Search,
        best: RunRequest,
        model: Quadratic,
        error: NumericalError,
        binding: Binding,
    ) -> CheckedOptimum | None:
        if not error.checked:
            return None
        self.stage(f"the best with the constraints as {error.checked} cells have them")
        level, near = error.checked, binding.near
        return Check(level, search.responses, model, near, search.radius, search.noise).optimum(
            best
        )

    def _is_sound(self, request: RunRequest) -> bool:
        """Whether a case is valid at a level: larger cells may not fit into its faces."""
        try:
            self.runs.case(request)
        except InputError:
            return False
        return True


class FrontSearch:
    """Finds the front of two results after a first search, from its start, fractions (n,)."""

    def __init__(self, search: Search, start: Array) -> None:
        self._responses, self._start = search.responses, start
        table = self._responses.problem.table
        assert table.front is not None
        self._other = self._responses.other(objective=table.front.objective)
        self._most, self._points = table.most_runs, table.front.points
        self._noise = [float(search.noise[0]), 0.0]
        self._exhausted = False

    def run(self, best: RunRequest) -> Front:
        """Return the front, starting from the best run of the first result."""
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
        """Distance of two neighbours, in spans of the front; 0 if below noise."""
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
        """Both results of a run with the sign for minimisation (2,), SI."""
        return np.array([self._responses.cost(request), self._other.cost(request)])

    def _undominated(self, found: Sequence[RunRequest]) -> list[RunRequest]:
        """Runs that no other run dominates, in order.

        Improvements within noise count as equal.
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
    """The constraint that a result is no worse than a level, SI, according to its sense."""
    sign, side = ("<=", "at_most") if sense > 0.0 else (">=", "at_least")
    text = f"{name} {sign} {level!r} (SI)"
    return Bound(text, repr(level), name, side, level, "", False)  # type: ignore[arg-type]
