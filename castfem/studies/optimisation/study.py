"""A search with an ask-and-tell interface: it requests runs and receives their results.

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
from castfem.model.load import as_case
from castfem.runs.output.run_record import RunRecord
from castfem.runs.run_result import RunResult
from castfem.studies.accuracy.sizes import DEFAULT
from castfem.studies.optimisation import argument_checks as check
from castfem.studies.optimisation.evaluator import Ended, Evaluator
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.problem import DesignProblem, RunRequest
from castfem.studies.optimisation.responses import KnownRuns, Obtain, obstacles, of_run
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.workflow import Workflow
from castfem.studies.sweep.record import check_folder
from castfem.studies.sweep.workers import nothing

if TYPE_CHECKING:
    from castfem.model import Case

Requests = tuple[RunRequest, ...]


class Study:
    """The search for the optimum of a case with [optimise].

    With the same results, from `tell` or from the folder, it requests the same runs, so a new study
    continues where another one ended.

    Args:
        case: The case, or its path or name as for `castfem.load`.
        folder: Folder of runs, as kept by `Evaluator`; None if all results come by `tell`.
        origin: Name of the case in messages.
        evaluator: Makes the runs, instead of one made for the folder.

    Attributes:
        problem: The optimisation problem.
        evaluator: Makes runs; None without a folder.

    Raises:
        InputError: The case has no [optimise], a key cannot be varied, or, if runs are made here,
            no run has one of the results.
    """

    def __init__(
        self,
        case: Case | str | Path,
        folder: Path | str | None = None,
        *,
        origin: str = "",
        evaluator: Evaluator | None = None,
    ) -> None:
        loaded = as_case(case, "Study")
        self.problem = DesignProblem(loaded, origin or check.origin_of(case))
        if evaluator is not None and not isinstance(evaluator, Evaluator):
            raise InputError(f"Study: evaluator must be an Evaluator, got {evaluator!r}")
        self.evaluator = evaluator
        if folder is not None and evaluator is None:
            self.evaluator = Evaluator(loaded, check_folder(folder, "Study"))
        if self.evaluator is not None:
            self.problem.check_results()
        self._runs = KnownRuns(self.problem, self.evaluator)
        self._ideal_runs: list[RunResult] = []
        self._result: Optimum | None = None
        if self.problem.table.method == "slsqp":
            self._check_derivatives()

    def ask(self) -> tuple[RunRequest, ...]:
        """Return the runs that the search needs next, which may be made in parallel; () at its end.

        Raises:
            InputError: A run lacks a required result.
        """
        if self._result is not None:
            return ()
        try:
            self._result = self._workflow(self.evaluator is not None).run(self._expect)
        except _RunsMissing as missing:
            return missing.requests
        return ()

    def _expect(self, requests: Sequence[RunRequest]) -> None:
        """Leave the workflow if runs have not been made.

        It is repeated from its beginning at each `ask`: it has no state but the results, and no
        minimiser is left waiting (SciPy allows one COBYQA at a time in a process).
        """
        lost = tuple(one for one in requests if self._runs.find(one) is None)
        if lost:
            raise _RunsMissing(lost)

    def solve(
        self,
        ended: Ended = nothing,
        obtain: Obtain | None = None,
        stage: Callable[[str], None] | None = None,
    ) -> Optimum:
        """Make all runs that the search needs; return its result.

        Args:
            ended: Called with each run and its outcome.
            obtain: Makes runs and passes their results to `tell`, instead of the study's evaluator.
            stage: Called with the purpose of the runs that follow.

        Raises:
            InputError: The study has no folder, or a run lacks a required result.
            RunFailure: A file cannot be written.
        """

        def run(requests: Sequence[RunRequest]) -> None:
            if obtain is None:
                self.run(requests, ended)
                return
            obtain(requests)
            lost = sum(self._runs.find(one) is None for one in requests)
            if lost:
                raise InputError(
                    f"solve: obtain gave no results for {lost} of {len(requests)} runs; call "
                    "tell(run, results) for each"
                )

        self._result = self._workflow(obtain is None, stage).run(run)
        return self._result

    def _workflow(self, own: bool, stage: Callable[[str], None] | None = None) -> Workflow:
        return Workflow(self.problem, self._runs, own, stage or nothing)

    def _check_derivatives(self) -> None:
        """Refuse a search with derivatives if runs have none."""
        where, fix = f"{self.problem.origin}: optimise.method", 'or take method = "cobyqa"'
        if self.evaluator is None:
            raise InputError(
                f"{where}: slsqp needs the derivatives that castfem's own runs compute: give the "
                f"study a folder, {fix}"
            )
        middle = self.problem.request(np.full(len(self.problem.variables), 0.5))
        every = [middle, self.problem.ideal(middle)] if self.problem.relative else [middle]
        found = obstacles(self.problem, {one: self.case(one) for one in every})
        if found:
            raise InputError([f"{where}: slsqp needs derivatives: {one}; {fix}" for one in found])

    def case(self, request: RunRequest | Mapping[str, Any]) -> Case:
        """Return the case of a run; see `tell`.

        Raises:
            InputError: It is not a run, or is outside the ranges.
        """
        return self._runs.case(check.check_request(self.problem, request, "case"))

    def tell(
        self,
        request: RunRequest | Mapping[str, Any],
        results: Evaluation | RunResult | Mapping[str, float],
    ) -> None:
        """Provide the results of a run.

        Args:
            request: The run, or the values of all variables by key, with units or in those of their
                ranges.
            results: An evaluation, a result of castfem (also of a failed run), or results by name
                in SI.

        Raises:
            InputError: They cannot be used, lack a required result, or the run is outside the
                ranges.
        """
        request = check.check_request(self.problem, request, "tell")
        if isinstance(results, RunResult):
            if request.ideal:
                self._ideal_runs.append(results)  # start of tapers from its history
            results = _evaluation(results, self._runs.case(request).casting.length)
        elif isinstance(results, Mapping):
            results = Evaluation(check.quantities_of(self.problem, request, results))
        if not isinstance(results, Evaluation):
            raise InputError(
                "tell: results must be an Evaluation, a Result or results by name, "
                f'{{"heat_removed": 9.1e6}}, got {results!r}'
            )
        self._runs.note(request, results)
        self._result = None

    def run(
        self,
        requests: RunRequest | Mapping[str, Any] | Sequence[RunRequest | Mapping[str, Any]],
        ended: Ended = nothing,
    ) -> list[Evaluation]:
        """Make runs, or find them in the folder, and pass their results to `tell`.

        Args:
            requests: One or several runs; see `tell`.
            ended: Called with each run and its outcome.

        Raises:
            InputError: The study has no folder, or there is no such run.
            RunFailure: A file cannot be written. A failing run raises nothing.
        """
        if self.evaluator is None:
            raise InputError("a study without a folder runs nothing; give it one")
        several = [requests] if isinstance(requests, RunRequest | Mapping) else requests
        runs = [check.check_request(self.problem, one, "run") for one in several]
        cases = [self._runs.case(one) for one in runs]
        varied = [self._varied(one) for one in runs]
        derivatives = [of_run(self.problem, one) if one.derivatives else None for one in runs]
        found = self.evaluator.evaluate(cases, varied, ended, derivatives)
        for one, evaluation in zip(runs, found, strict=True):
            self._runs.note(one, evaluation)
        return found

    def _varied(self, request: RunRequest) -> dict[str, str]:
        """Varied keys and values of a run, for names and tables."""
        own = self.problem.changes(replace(request, inputs=()))
        found = {key: str(value) for key, value in own.items()}
        for one, value in zip(self.problem.inputs, request.inputs, strict=False):
            found[one.key] = f"{value:.6g} {one.unit}".strip()
        if request.ideal:
            found["mould"] = "idealised"
        if request.fidelity != DEFAULT:
            found["fidelity"] = request.fidelity
        return found

    def result(self) -> Optimum:
        """Return the result of the search.

        Raises:
            InputError: The search has not finished.
        """
        if self.ask() or self._result is None:
            raise InputError("the search has not ended: continue with ask, run and tell")
        return self._result

    def case_of(self, optimum: Optimum) -> Case:
        """Return the user's case with the values of an optimum.

        Raises:
            InputError: It is not an optimum.
        """
        if not isinstance(optimum, Optimum):
            raise InputError(f"case_of: must be what result() returns, got {optimum!r}")
        return self.problem.case.with_(optimum.changes())


class _RunsMissing(Exception):
    """The workflow needs runs that have not been made."""

    def __init__(self, requests: Requests) -> None:
        super().__init__(requests)
        self.requests = requests


def _evaluation(result: RunResult, length: float) -> Evaluation:
    """The results of a run, or how far of its length (m) it came if it has failed."""
    if result.summary.status == "finished":
        return Evaluation.of(result.summary, 0.0, result.folder)
    return Evaluation.of_failed(result.folder, RunRecord.load(result.folder), length)
