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

from castfem.base.errors import InputError
from castfem.runs.output.run_record import RunRecord
from castfem.runs.result import RunResult
from castfem.studies.accuracy.levels import DEFAULT
from castfem.studies.optimisation.carried import hindrances, of_run
from castfem.studies.optimisation.evaluator import Evaluator, Watcher, lean, variant
from castfem.studies.optimisation.given import (
    case_of,
    folder_of,
    origin_of,
    quantities_of,
    wanted_of,
)
from castfem.studies.optimisation.inquiry import Inquiry
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.outputs import Needs, Obtain
from castfem.studies.optimisation.question import Question, Wanted
from castfem.studies.optimisation.search import Done
from castfem.studies.optimisation.store import Evaluation

if TYPE_CHECKING:
    from castfem.model import Case


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
        self._carried: set[Wanted] = set()  # that were told as runs that carry derivatives
        self._kept: list[RunResult] = []
        self._cases: dict[Wanted, Case] = {}
        self._result: Optimum | None = None
        self._done: Done = {}
        if self.question.table.method == "slsqp":
            self._check_derivatives()

    def ask(self) -> tuple[Wanted, ...]:
        """Return the runs that the search needs next, which may be done at once; () at its end.

        Raises:
            InputError: A run has no result that is asked for.
        """
        try:
            self._result = self._inquiry().answer(None, own=self.evaluator is not None)
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

        self._result = self._inquiry(stage).answer(obtain or run, own=obtain is None)
        return self._result

    def _inquiry(self, stage: Callable[[str], None] | None = None) -> Inquiry:
        """The way to the answer, by the runs that are there."""
        return Inquiry(self.question, self.known, self.case, self._told, self._done, stage)

    def _check_derivatives(self) -> None:
        """Refuse a search by derivatives of runs that have none.

        Raises:
            InputError: Saying why they have none.
        """
        where, mend = f"{self.question.origin}: optimise.method", 'or take method = "cobyqa"'
        if self.evaluator is None:
            raise InputError(
                f"{where}: slsqp needs the derivatives that castfem's own runs carry along: give "
                f"the study a folder, {mend}"
            )
        middle = self.question.at(np.full(len(self.question.axes), 0.5))
        every = [middle]
        if any(bound.relative for bound in self.question.bounds):
            every.append(self.question.ideal(middle))
        found = hindrances(self.question, {one: self.case(one) for one in every})
        if found:
            raise InputError(
                [f"{where}: slsqp needs derivatives: {problem}; {mend}" for problem in found]
            )

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
        self,
        wanted: Wanted | Mapping[str, Any],
        given: Evaluation | RunResult | Mapping[str, float],
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
        if isinstance(given, RunResult):
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
        self._note(wanted, given)

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
        given = [self.given(one) for one in runs]
        carried = [of_run(self.question, one) if one.carries else None for one in runs]
        found = self.evaluator.evaluate(cases, given, watcher, carried)
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
        if wanted.carries and wanted not in self._carried:
            found = None  # it was made without derivatives
        if found is None and self.evaluator is not None:
            carried = of_run(self.question, wanted) if wanted.carries else None
            found = self.evaluator.store.find(self.case(wanted), carried)
            if found is not None:
                self._note(wanted, found)
        return found

    def _note(self, wanted: Wanted, given: Evaluation) -> None:
        """Keep what a run has given."""
        self._told[wanted] = given
        if wanted.carries:
            self._carried.add(wanted)


def _evaluated(result: RunResult, length: float) -> Evaluation:
    """What a run has given, of one that has failed how far of its length (m) it came."""
    summary = result.summary
    if summary.status == "finished":
        return Evaluation.of(summary, 0.0, result.folder)
    record = RunRecord.load(result.folder)
    share = min(record.reached.get("position", 0.0) / length, 1.0)
    return Evaluation({}, share, record.reason or summary.status, folder=result.folder)
