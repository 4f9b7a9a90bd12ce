"""The way from a question to its answer: search, surroundings, check, spread, front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.studies.accuracy.levels import LEVELS
from castfem.studies.optimisation import vicinity
from castfem.studies.optimisation.binding import Binding
from castfem.studies.optimisation.carried import hindrances
from castfem.studies.optimisation.checked import Checked, best_by
from castfem.studies.optimisation.front import Tracer
from castfem.studies.optimisation.numerical import Numerical, Tilt, next_of
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.outputs import Look, Needs, Obtain, Outputs
from castfem.studies.optimisation.question import Question, Wanted
from castfem.studies.optimisation.search import AT_END, Done, Search
from castfem.studies.optimisation.spread import spread
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.verdict import Findings, verdict

if TYPE_CHECKING:
    from castfem.model import Case

_STEP, _WIDEST = 0.025, 0.1  # of the ranges: between the runs about an optimum
_TURNS = 3  # of search and look around


class Inquiry:
    """Looks for the answer to a question, by runs that others make.

    Args:
        question: What is asked.
        known: Gives what a run has given, None where it has not been done.
        case: Gives the case of a run.
        told: All that is known of runs.
        done: Parts of the search that have come to their end, kept for the next time.
        stage: Told what the runs that follow are for.
    """

    def __init__(
        self,
        question: Question,
        known: Look,
        case: Callable[[Wanted], Case],
        told: dict[Wanted, Evaluation],
        done: Done,
        stage: Callable[[str], None] | None = None,
    ) -> None:
        self._question, self._known, self._case = question, known, case
        self._told, self._done, self._stage = told, done, stage

    def _follows(self, what: str) -> None:
        """Tell what the runs that follow are for."""
        if self._stage is not None:
            self._stage(what)

    def answer(self, obtain: Obtain | None, *, own: bool) -> Optimum:
        """Return the answer, as far as runs are there.

        Args:
            obtain: Does those that are missing; None where there is nobody to.
            own: Whether they are castfem's, and may carry derivatives.

        Raises:
            Needs: Some are missing, and there is nobody to obtain them.
        """
        question, start = self._question, self._start(obtain)
        outputs = Outputs(question, self._known, obtain=obtain)
        search = Search(outputs, question.table.most_runs, self._done)
        self._follows("search")
        best = search.run(start)
        if outputs.seen[best].failed:
            return verdict(Findings(question, outputs, search, best, None, None, self._told))
        for _ in range(_TURNS):
            found = self._about(search, best)
            best = found.best
            better = search.better_than(best)
            if better is None or search.spent:
                break
            best = better
        best = found.best
        if (better := search.better_than(best)) is not None:
            found = Findings(question, outputs, search, better, None, None, self._told, ended=False)
            return verdict(found)
        model = found.model
        assert model is not None
        spread_by = None
        if question.inputs:
            self._follows("spread by the inputs")
            drawn, carries = Outputs(question, self._known, obtain), own and self._can_carry(best)
            spread_by = spread(drawn, best, model, carries=carries)
        front = None
        if question.table.front is not None:
            self._follows("front of the two objectives")
            front = Tracer(search, start, self._done).trace(best)
        return verdict(found, front, spread_by)

    def _about(self, search: Search, best: Wanted) -> Findings:
        """Look at what lies about a best run, and by the other levels."""
        outputs = search.outputs
        self._follows("what a step away from the best run costs")
        best, model, step = self._surroundings(search, best)
        search.measure_at(best)
        error = self._numerical(search, best, model)
        untilted = replace(error, tilt=None, checked="")
        for _ in range(2):
            assert search.noise is not None
            runs = outputs.runs_of(best.fidelity)
            places = vicinity.intervals(model, search.noise.sigma, untilted, *runs)
            ends = np.array([i.open_low or i.open_high for i in places])
            if not np.any(ends & (step < _WIDEST)):
                break
            step = np.where(ends, np.minimum(2.0 * step, _WIDEST), step)
            model = self._model(outputs, best, step)
        binds = self._binding(search, best, model, error)
        there = self._checked(search, best, model, error, binds)
        return Findings(
            self._question, outputs, search, best, model, error, self._told, there, binds
        )

    def _start(self, obtain: Obtain | None) -> Array:
        """Where the search begins (n,): tapers by what a strand does in its idealised mould."""
        question, ideal = self._question, None
        if question.needs_ideal:
            wanted = question.ideal(question.at(question.start(None)))
            ideal = self._known(wanted)
            if ideal is None and obtain is None:
                raise Needs([wanted])
            if ideal is None and obtain is not None:
                obtain([wanted])
                ideal = self._known(wanted)
        return question.start(ideal)

    def _can_carry(self, best: Wanted) -> bool:
        """Whether runs with other inputs may carry derivatives along."""
        own = replace(best, inputs=tuple(one.value(0.5) for one in self._question.inputs))
        relative = any(bound.relative for bound in self._question.bounds)
        every = [own, self._question.ideal(own)] if relative else [own]
        return not hindrances(self._question, {one: self._case(one) for one in every})

    def _surroundings(
        self, search: Search, best: Wanted
    ) -> tuple[Wanted, vicinity.Quadratic, Array]:
        """Look round a best run; where another one there is better, search on from that."""
        outputs = search.outputs
        widths = np.ones(len(self._question.axes))
        step = float(np.clip(4.0 * search.radius, _STEP, _WIDEST)) * widths
        for _ in range(_TURNS):
            model = self._model(outputs, best, step)
            better = search.best()
            gain = outputs.cost(best) - outputs.cost(better)
            nearer = search.violation(better) < search.violation(best)
            assert search.noise is not None
            if better == best or not (nearer or gain > search.noise.sigma[0]):
                break
            best = search.again(better)
        else:
            best = search.best()
            model = self._model(outputs, best, step)
        return best, model, step

    def _model(self, outputs: Outputs, best: Wanted, step: Array) -> vicinity.Quadratic:
        """Quadratics through the runs about a best one, those that it takes to fit them."""
        question = self._question
        centre = question.shares(best)
        outputs.fetch([question.at(place) for place in vicinity.around(centre, step)])
        return vicinity.Quadratic.fit(centre, step, *outputs.runs_of(best.fidelity))

    def _binding(
        self, search: Search, best: Wanted, model: vicinity.Quadratic, error: Numerical
    ) -> Binding:
        """Which constraints keep the objective of a best run from being better."""
        assert search.noise is not None
        outputs = search.outputs
        here, (_, seen) = outputs.vector(best), outputs.runs_of(best.fidelity)
        if search.violation(best) > 0.0:  # better than what nothing meets is no evidence
            seen = seen[:0]
        off = np.maximum(error.below, error.above)[1:]
        return Binding.of(model, search.noise.sigma, here, seen, off)

    def _numerical(self, search: Search, best: Wanted, model: vicinity.Quadratic) -> Numerical:
        """The error of cost and margins, by the best run at the other levels."""
        every = {word: Wanted(best.values, word) for word in (*LEVELS, best.fidelity)}
        able = {word: one for word, one in every.items() if self._sound(one)}
        others = " and ".join(word for word in able if word != best.fidelity)
        self._follows(f"numerical error: the best run on {others} cells, the last the dearest")
        search.outputs.fetch(list(able.values()))
        vectors = {word: search.outputs.vector_or_nan(one) for word, one in able.items()}
        found = Numerical.of(best.fidelity, vectors)
        shares, last = self._question.shares(best), AT_END * search.radius
        held = sum(self._binding(search, best, model, found).near)
        held += int(np.count_nonzero((shares <= last) | (shares >= 1.0 - last)))
        if held >= len(shares):
            return found
        if next_of(best.fidelity) not in found.through:
            return replace(found, untilted=np.ones(len(shares), dtype=bool))
        return found.with_tilt(best.fidelity, self._tilt(search.outputs, best, model.step))

    def _checked(
        self,
        search: Search,
        best: Wanted,
        model: vicinity.Quadratic,
        error: Numerical,
        binds: Binding,
    ) -> Checked | None:
        """The optimum by the level of the check."""
        assert search.noise is not None
        if not error.checked:
            return None
        self._follows(f"the best with the constraints as {error.checked} cells have them")
        radius, scatter = search.radius, search.noise.sigma
        return best_by(error.checked, search.outputs, best, model, binds.near, radius, scatter)

    def _tilt(self, outputs: Outputs, best: Wanted, step: Array) -> Tilt:
        """How the cost by the next level, less its own, changes about a best run."""
        shares = self._question.shares(best)
        own = [self._question.at(at) for at in [shares, *vicinity.around(shares, step, (1,))]]
        there = [replace(one, fidelity=next_of(best.fidelity)) for one in own]
        outputs.fetch([*own, *there])
        pairs = zip(own, there, strict=True)
        change = [outputs.vector_or_nan(b)[0] - outputs.vector_or_nan(a)[0] for a, b in pairs]
        places = np.array([self._question.shares(one) for one in own])
        return Tilt.fit(shares, places, np.array(change))

    def _sound(self, wanted: Wanted) -> bool:
        """Whether a case can be computed so: larger cells may not fit into its faces."""
        try:
            self._case(wanted)
        except InputError:
            return False
        return True
