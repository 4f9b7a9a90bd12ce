"""Evaluates a case with changed keys: each run is made once, in parallel, and reused later."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.atomic_files import Closing
from castfem.base.errors import RunFailure, shown
from castfem.base.result_registry import smooth_twins
from castfem.model.load import as_case, changed, from_document
from castfem.studies.accuracy.sizes import DEFAULT
from castfem.studies.optimisation import argument_checks as check
from castfem.studies.optimisation.fidelity import at_level, idealised
from castfem.studies.optimisation.store import Evaluation, Store
from castfem.studies.sweep.record import check_folder
from castfem.studies.sweep.work import Derivatives, Job, Outcome
from castfem.studies.sweep.workers import LOG_NAME, CallExecutor, Workers, check_groups, nothing

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.model import Case

_PATIENCE = 3.0, 4.0  # s before further attempts; runs of a killed command end within five
_LEAN = {"fields": [], "figures": False}


Ended = Callable[[Job, Outcome], None]
"""Called with a run and its outcome."""


class Evaluator(Closing):
    """Runs a case with changed keys, each variant once.

    The folder is like that of a sweep: each run has its own folder in it, sweep.csv one row per
    run. A run that exists, from this or an earlier call or from `castfem sweep`, is not repeated; a
    killed one continues from its checkpoint. A failed run is recorded, too, with the position it
    reached.

    Args:
        case: The case, or its path or name as for `castfem.load`; its [optimise] is left out of the
            runs.
        folder: Folder of the runs.
        processes: Number of simultaneous runs, each in its own process, for which a script needs
            `if __name__ == "__main__":`; 0: one after the other in this process.
        comm: Ranks that make the runs instead, the others within `serve`: each run on one of them,
            or on a group of `ranks`, for large sections.
        ranks: Ranks of each run; they divide those of `comm`.
        executor: Makes the runs instead, as for `castfem.sweep`; it is not closed.

    Attributes:
        case: The case.
        store: The runs.
        runs: Number of runs made by this object.

    Raises:
        InputError: The folder holds something else, or the ranks cannot be split into such groups.
    """

    def __init__(
        self,
        case: Case | str | Path,
        folder: Path | str,
        *,
        processes: int = 0,
        comm: MPI.Intracomm | None = None,
        ranks: int = 1,
        executor: CallExecutor | None = None,
    ) -> None:
        self.case = lean(as_case(case, "Evaluator"))
        target = check_folder(folder, "Evaluator")
        check.check_integer(processes, 0, "Evaluator: processes")
        check.check_integer(ranks, 1, "Evaluator: ranks")
        check_groups(ranks, 1 if comm is None else comm.size, "Evaluator: ranks=")
        self.store, self.runs = Store(target), 0
        self.store.check_is_of(self.case)
        self._workers = Workers(
            target / LOG_NAME, processes=processes, comm=comm, ranks=ranks, executor=executor
        )

    def __call__(
        self, changes: Mapping[str, Any] | None = None, fidelity: str = DEFAULT
    ) -> Evaluation:
        """Return the results of the case with some keys changed.

        Args:
            changes: New values by dotted key, as for `Case.with_`.
            fidelity: A level of `castfem.studies.optimisation.fidelity`.

        Raises:
            InputError: The changed case is invalid.
            RunFailure: A file cannot be written. A failing run raises nothing.
        """
        return self.many([check.check_changes(changes)], fidelity)[0]

    def many(
        self, changes: Sequence[Mapping[str, Any]], fidelity: str = DEFAULT
    ) -> list[Evaluation]:
        """Return the results with each of several changes; see `__call__`."""
        several = [check.check_changes(one) for one in changes]
        cases = [variant(self.case, one, fidelity) for one in several]
        given = [{key: shown(value).strip('"') for key, value in one.items()} for one in several]
        return self.evaluate(cases, given)

    def evaluate(
        self,
        cases: Sequence[Case],
        given: Sequence[Mapping[str, str]],
        ended: Ended = nothing,
        derivatives: Sequence[Derivatives | None] = (),
    ) -> list[Evaluation]:
        """Return the results of cases, each run once.

        Args:
            cases: The cases.
            given: Varied keys of each case with their values, for its folder's name and tables.
            ended: Called for each run that is made.
            derivatives: Derivatives to be computed by each; a run made without them is repeated.

        Raises:
            RunFailure: A run was stopped by something other than its case: another active run in
                its folder, for longer than that of a killed command would be, a full disk, the end
                of its process.
        """
        asked = derivatives or [None] * len(cases)
        jobs = [self.store.job(*one) for one in zip(cases, given, asked, strict=True)]
        every = sorted(jobs, key=lambda job: job.derivatives is not None)  # if a run occurs twice
        find = self.store.find
        missing = {job.name: job for job in every if find(job.case, job.derivatives) is None}
        lost: dict[str, Evaluation] = {}
        stopped: list[tuple[Job, Outcome]] = []

        def note(job: Job, outcome: Outcome) -> None:
            if outcome.obstacle:  # unrelated to the case
                stopped.append((job, outcome))
                return
            found = self.store.note(job, outcome)
            if found.folder is None:
                lost[job.name] = found
            ended(job, outcome)

        if missing:
            self.store.record.begin()
            self.runs += len(missing)
            self._workers.run(list(missing.values()), ended=note)
            for wait in _PATIENCE:
                again = [job for job, outcome in stopped if outcome.obstacle == "in use"]
                if not again:
                    break
                time.sleep(wait)
                stopped[:] = [one for one in stopped if one[0] not in again]
                self._workers.run(again, ended=note)
            self.store.write_table()
        if stopped:
            raise RunFailure(f"{stopped[0][1].message}; the same command continues")
        found = [lost.get(job.name) or find(job.case) for job in jobs]
        return [one for one in found if one is not None]

    def close(self) -> None:
        """Release the processes, or the other ranks."""
        self._workers.close()


def variant(
    case: Case, changes: Mapping[str, Any], fidelity: str = DEFAULT, *, ideal: bool = False
) -> Case:
    """Return a case from `lean` with changes, at a level, optionally in its idealised mould."""
    made = changed(case, changes, "changes") if changes else case
    return at_level(lean(idealised(made)) if ideal else made, fidelity)


def lean(case: Case) -> Case:
    """Return a case as it is run here: only for its results, without fields and figures."""
    tables = case.document()
    tables.pop("optimise", None)
    tables.pop("reference", None)
    tables.setdefault("output", {}).update(_LEAN)
    if case.optimise is not None and case.optimise.names & smooth_twins().keys():
        tables["output"]["smooth"] = True
    return from_document(tables, case.title)
