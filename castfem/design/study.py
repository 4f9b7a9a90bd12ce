"""A search that is driven from outside: ask which runs it needs, tell what they have given.

study = Study("billet125/optimum_single")
while wanted := study.ask():
for one in wanted:
study.tell(one, castfem.run(study.case(one)))
print(study.result().changes())
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.accuracy.levels import DEFAULT, LEVELS
from castfem.api import Result
from castfem.design import vicinity
from castfem.design.binding import Binding
from castfem.design.checked import Checked, best_by
from castfem.design.evaluator import Evaluator, Watcher, lean, variant
from castfem.design.front import Tracer
from castfem.design.given import case_of, folder_of, origin_of, quantities_of, wanted_of
from castfem.design.numerical import Numerical, Tilt, next_of
from castfem.design.optimum import Optimum
from castfem.design.outputs import Needs, Obtain, Outputs
from castfem.design.question import Question, Wanted
from castfem.design.search import AT_END, Done, Search
from castfem.design.spread import spread
from castfem.design.store import Evaluation
from castfem.design.verdict import Findings, verdict
from castfem.errors import InputError
from castfem.output.run_record import RunRecord
from castfem.values.types import Array

if TYPE_CHECKING:
    from castfem.case import Case

_STEP, _WIDEST = 0.025, 0.1  # of the ranges: between the runs about an optimum
_TURNS = 3  # of search and look around


class Study:
    """The search for the best values of a case with [optimise].

    The search has no state of its own: with the same results, from `tell` or from the folder, it
    asks for the same runs.

    Args:
        case: The case, or what `castfem.load` takes.
        folder: Of runs, as `Evaluator` keeps them; None if all results come by `tell`.
        origin: What messages call the case.
        evaluator: Does the runs, instead of one made for the folder.

    Attributes:
        question: What is asked for.
        evaluator: Does runs; None without a folder.

    Raises:
        InputError: The case asks for nothing that could be looked for, or, where runs are done, for
            a result that none of them has.
    """

    def __init__(
        self,
        case: Case | str | Path,
        folder: Path | str | None = None,
        *,
        origin: str = "",
        evaluator: Evaluator | None = None,
    ) -> None:
        sound = case_of(case, "Study")
        if not isinstance(evaluator, Evaluator | None):
            raise InputError(f"Study: evaluator: an Evaluator is needed, not {evaluator!r}")
        self.question = Question(sound, origin or origin_of(case))
        self.evaluator = evaluator
        if folder is not None and evaluator is None:
            self.evaluator = Evaluator(sound, folder_of(folder, "Study"))
        if self.evaluator is not None:
            self.question.check_results()
        self._lean = lean(sound)
        self._told: dict[Wanted, Evaluation] = {}
        self._kept: list[Result] = []
        self._cases: dict[Wanted, Case] = {}
        self._result: Optimum | None = None
        self._done: Done = {}
        self._stage: Callable[[str], None] | None = None

    def ask(self) -> tuple[Wanted, ...]:
        """Return the runs that the search needs next, which may be done at once; () at its end.

        Raises:
            InputError: A run has no result that is asked for.
        """
        try:
            self._result = self._solved(None)
        except Needs as needs:
            return needs.wanted
        return ()

    def solve(
        self,
        watcher: Watcher | None = None,
        obtain: Obtain | None = None,
        stage: Callable[[str], None] | None = None,
    ) -> Optimum:
        """Do all runs that the search needs, and return what it has found.

        Args:
            watcher: Told of the runs.
            obtain: Does runs and hands in their results, instead of the study's evaluator.
            stage: Told what the runs that follow are for.

        Raises:
            InputError: The study has no folder, or a run has no result that is asked for.
            RunFailure: A file cannot be written.
        """

        def run(wanted: Sequence[Wanted]) -> None:
            self.run(wanted, watcher)

        self._stage = stage
        try:
            self._result = self._solved(obtain or run)
        finally:
            self._stage = None
        return self._result

    def _follows(self, what: str) -> None:
        """Tell what the runs that follow are for."""
        if self._stage is not None:
            self._stage(what)

    def case(self, wanted: Wanted | Mapping[str, Any]) -> Case:
        """Return the case of a run that is wanted; see `tell`.

        Raises:
            InputError: It is none, or lies outside of the ranges.
        """
        wanted = wanted_of(self.question, wanted, "case")
        if wanted not in self._cases:
            self._cases[wanted] = variant(
                self._lean, self.question.changes(wanted), wanted.fidelity, ideal=wanted.ideal
            )
        return self._cases[wanted]

    def tell(
        self, wanted: Wanted | Mapping[str, Any], given: Evaluation | Result | Mapping[str, float]
    ) -> None:
        """Hand in the results of a run.

        Args:
            wanted: The run, or the values of all variables by key, with units or in those of their
                ranges.
            given: An evaluation, a result of castfem (that of a run that has failed, too), or
                results by name in SI.

        Raises:
            InputError: It is none of them, lacks a result that is asked for, or the run lies
                outside of the ranges.
        """
        wanted = wanted_of(self.question, wanted, "tell")
        if isinstance(given, Result):
            if wanted.ideal:
                self._kept.append(given)  # tapers begin by its history: a temporary one must stay
            given = _evaluated(given, self.case(wanted).casting.length)
        elif isinstance(given, Mapping):
            given = Evaluation(quantities_of(self.question, wanted, given))
        if not isinstance(given, Evaluation):
            raise InputError(
                "tell: an Evaluation or a Result is needed, or results by name "
                f'{{"heat_removed": 9.1e6}}, not {given!r}'
            )
        self._told[wanted] = given

    def run(
        self,
        wanted: Wanted | Mapping[str, Any] | Sequence[Wanted | Mapping[str, Any]],
        watcher: Watcher | None = None,
    ) -> list[Evaluation]:
        """Do runs that are wanted, or find them in the folder, and hand in their results.

        Args:
            wanted: A run or several; see `tell`.
            watcher: Told of the runs.

        Raises:
            InputError: The study has no folder, or what is wanted is no run.
            RunFailure: A file cannot be written. A run that fails raises nothing.
        """
        if self.evaluator is None:
            raise InputError("a study without a folder runs nothing; give it one")
        several = [wanted] if isinstance(wanted, Wanted | Mapping) else wanted
        if not isinstance(several, Sequence) or isinstance(several, str):
            raise InputError(f"run: runs are needed, such as ask() returns, not {wanted!r}")
        runs = [wanted_of(self.question, one, "run") for one in several]
        cases = [self.case(one) for one in runs]
        found = self.evaluator.evaluate(cases, [self.given(one) for one in runs], watcher)
        for one, evaluation in zip(runs, found, strict=True):
            self.tell(one, evaluation)
        return found

    def given(self, wanted: Wanted) -> dict[str, str]:
        """Key to value of what is varied in a run, for names and tables."""
        own = replace(wanted, inputs=())
        found = {key: str(value) for key, value in self.question.changes(own).items()}
        if wanted.inputs:
            for one, value in zip(self.question.inputs, wanted.inputs, strict=True):
                found[one.key] = f"{value:.6g} {one.unit}".strip()
        if wanted.ideal:
            found["mould"] = "idealised"
        if wanted.fidelity != DEFAULT:
            found["fidelity"] = wanted.fidelity
        return found

    def result(self) -> Optimum:
        """Return what the search has found.

        Raises:
            InputError: It has not come to its end.
        """
        if self._result is None and self.ask():
            raise InputError("the search has not come to its end: ask, run and tell go on")
        assert self._result is not None
        return self._result

    def case_of(self, optimum: Optimum) -> Case:
        """Return the user's case with the values of an optimum.

        Raises:
            InputError: It is none.
        """
        if not isinstance(optimum, Optimum):
            raise InputError(f"case_of: what result() returns is needed, not {optimum!r}")
        return self.question.case.with_(optimum.changes())

    def known(self, wanted: Wanted) -> Evaluation | None:
        """Return what a run has given, None where it has not been done."""
        found = self._told.get(wanted)
        if found is None and self.evaluator is not None:
            found = self.evaluator.store.find(self.case(wanted))
            if found is not None:
                self._told[wanted] = found
        return found

    def _solved(self, obtain: Obtain | None) -> Optimum:
        """The whole search, as far as runs are there.

        Raises:
            Needs: Some are missing, and there is nobody to obtain them.
        """
        question = self.question
        ideal = None
        middle = question.at(question.start(None))
        if question.needs_ideal:
            ideal = self.known(question.ideal(middle))
            if ideal is None and obtain is None:
                raise Needs([question.ideal(middle)])
            if ideal is None and obtain is not None:
                obtain([question.ideal(middle)])
                ideal = self.known(question.ideal(middle))
        outputs = Outputs(question, self.known, obtain=obtain)
        search = Search(outputs, question.table.most_runs, self._done)
        start = question.start(ideal)
        self._follows("search")
        best = search.run(start)
        if outputs.seen[best].failed:
            return verdict(Findings(question, outputs, search, best, None, None, self._told))
        self._follows("what a step away from the best run costs")
        best, model, step = self._surroundings(search, best)
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
        found = Findings(question, outputs, search, best, model, error, self._told, there, binds)
        spread_by = None
        if question.inputs:
            self._follows("spread by the inputs")
            spread_by = spread(Outputs(question, self.known, obtain), best, model)
        front = None
        if question.table.front is not None:
            self._follows("front of the two objectives")
            front = Tracer(search, start, self._done).trace(best)
        return verdict(found, front, spread_by)

    def _surroundings(
        self, search: Search, best: Wanted
    ) -> tuple[Wanted, vicinity.Quadratic, Array]:
        """Look round a best run; where another one there is better, search on from that."""
        outputs = search.outputs
        widths = np.ones(len(self.question.axes))
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
        question = self.question
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
        every = {word: Wanted(best.values, word) for word in LEVELS}
        able = {word: one for word, one in every.items() if self._sound(one)}
        others = " and ".join(word for word in able if word != best.fidelity)
        self._follows(f"numerical error: the best run on {others} cells, the last the dearest")
        search.outputs.fetch(list(able.values()))
        vectors = {word: search.outputs.vector_or_nan(one) for word, one in able.items()}
        found = Numerical.of(best.fidelity, vectors)
        shares, last = self.question.shares(best), AT_END * search.radius
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
        shares = self.question.shares(best)
        own = [self.question.at(at) for at in [shares, *vicinity.around(shares, step, (1,))]]
        there = [replace(one, fidelity=next_of(best.fidelity)) for one in own]
        outputs.fetch([*own, *there])
        pairs = zip(own, there, strict=True)
        change = [outputs.vector_or_nan(b)[0] - outputs.vector_or_nan(a)[0] for a, b in pairs]
        places = np.array([self.question.shares(one) for one in own])
        return Tilt.fit(shares, places, np.array(change))

    def _sound(self, wanted: Wanted) -> bool:
        """Whether a case can be computed so: larger cells may not fit into its faces."""
        try:
            self.case(wanted)
        except InputError:
            return False
        return True


def _evaluated(result: Result, length: float) -> Evaluation:
    """What a run has given, of one that has failed how far of its length (m) it came."""
    summary = result.summary
    if summary.status == "finished":
        return Evaluation(summary.quantities, folder=result.folder)
    record = RunRecord.load(result.folder)
    share = min(record.reached.get("position", 0.0) / length, 1.0)
    return Evaluation({}, share, record.reason or summary.status, folder=result.folder)
