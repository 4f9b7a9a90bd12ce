"""All results of a case with some keys changed: run once, in parallel, found again after a kill."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from castfem.base.atomic_files import folder_refused
from castfem.base.closing import Closing
from castfem.base.errors import InputError, RunFailure
from castfem.base.messages import shown
from castfem.base.result_registry import smooth_twins
from castfem.model.load import changed, from_document
from castfem.studies.accuracy.levels import DEFAULT
from castfem.studies.optimisation.fidelity import at_level, idealised
from castfem.studies.optimisation.given import case_of, changes_of, fidelity_of, folder_of, whole
from castfem.studies.optimisation.store import Evaluation, Store
from castfem.studies.sweep.groups import Groups
from castfem.studies.sweep.groups import check as check_groups
from castfem.studies.sweep.local import Team
from castfem.studies.sweep.work import Derivatives, Job, Outcome, work

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.model import Case

_NOISE_NAME = "sweep.log"
_PATIENCE = 3.0, 4.0  # s before each further attempt; runs of a killed command end within five
_LEAN = {"fields": [], "figures": False}


class Watcher(Protocol):
    """What is told of the runs as they go (`castfem.studies.sweep.view.View` is one)."""

    def begun(self, job: Job) -> None:
        """Take note that a run has begun."""

    def ended(self, job: Job, outcome: Outcome) -> None:
        """Take note of how a run has ended."""

    def tick(self) -> None:
        """Look at the runs; called a few times a second."""


class Evaluator(Closing):
    """Runs a case with some keys changed, each change once.

    The folder is one of a sweep: each run has its folder in it, sweep.csv a row a run. A run that
    is there, of this or an earlier call or of `castfem sweep`, is not run again; one that was
    killed goes on from its checkpoint. A run that fails is kept, too, with how far it came.

    Args:
        case: The case, or what `castfem.load` takes; its [optimise] is left out of the runs.
        folder: Where the runs go.
        processes: How many runs at once, each in a process of its own, for which a script needs
            `if __name__ == "__main__":`; 0: in this process, one after the other.
        comm: Ranks that do the runs instead, the others within `serve`: each run is on one of
            them, or with `ranks` on a group of so many, which is worth while for large sections.
        ranks: Of each run; they divide those of `comm`.

    Attributes:
        case: The case that is changed.
        store: The runs.
        runs: How many were done by this object.

    Raises:
        InputError: The folder holds something else, or the ranks cannot be parted so.
    """

    def __init__(
        self,
        case: Case | str | Path,
        folder: Path | str,
        *,
        processes: int = 0,
        comm: MPI.Intracomm | None = None,
        ranks: int = 1,
    ) -> None:
        self.case, target = lean(case_of(case, "Evaluator")), folder_of(folder, "Evaluator")
        self._processes = whole(processes, 0, "Evaluator: processes")
        self._ranks = whole(ranks, 1, "Evaluator: ranks")
        size = 1 if comm is None else getattr(comm, "size", None)
        if not isinstance(size, int):
            raise InputError(f"Evaluator: comm: a communicator of mpi4py is needed, not {comm!r}")
        check_groups(ranks, size, "Evaluator: ranks=")
        self._comm = comm if size > 1 else None  # a rank alone does its runs itself
        self.store, self.runs = Store(target), 0
        self.store.check_is_of(self.case)
        self._team: Team | None = None
        self._groups: Groups | None = None

    def __call__(
        self, changes: Mapping[str, Any] | None = None, fidelity: str = DEFAULT
    ) -> Evaluation:
        """Return what the case gives with some keys changed.

        Args:
            changes: Dotted key and new value, as `Case.with_` takes them.
            fidelity: A word of `castfem.studies.optimisation.fidelity`.

        Raises:
            InputError: The changed case is not sound.
            RunFailure: A file cannot be written. A run that fails raises nothing.
        """
        return self.many([changes_of(changes, "evaluate")], fidelity)[0]

    def many(
        self, changes: Sequence[Mapping[str, Any]], fidelity: str = DEFAULT
    ) -> list[Evaluation]:
        """Return what the case gives with each of some changes; see `__call__`."""
        if not isinstance(changes, Sequence) or isinstance(changes, str):
            raise InputError(f"many: several changes are needed, a list of them, not {changes!r}")
        changes = [changes_of(one, "many") for one in changes]
        word = fidelity_of(fidelity, "evaluate")
        cases = [variant(self.case, one, word) for one in changes]
        given = [{key: shown(value).strip('"') for key, value in one.items()} for one in changes]
        return self.evaluate(cases, given)

    def evaluate(
        self,
        cases: Sequence[Case],
        given: Sequence[Mapping[str, str]],
        watcher: Watcher | None = None,
        derivatives: Sequence[Derivatives | None] = (),
    ) -> list[Evaluation]:
        """Return what cases give, each run once.

        Args:
            cases: The cases.
            given: What is varied in each, key to value, for its folder's name and tables.
            watcher: Told of the runs.
            derivatives: What each is to carry along; a run that was made without is made again.

        Raises:
            RunFailure: A run was hindered by what is none of its case's: another run at work in its
                folder for longer than that of a killed command may be, a full disk, the end of
                its process.
        """
        carried = derivatives or [None] * len(cases)
        jobs = [self.store.job(*one) for one in zip(cases, given, carried, strict=True)]
        every = sorted(jobs, key=lambda job: job.derivatives is not None)  # if a run is there twice
        find = self.store.find
        wanted = {job.name: job for job in every if find(job.case, job.derivatives) is None}
        lost: dict[str, Evaluation] = {}
        hindered: list[tuple[Job, Outcome]] = []

        def ended(job: Job, outcome: Outcome) -> None:
            if outcome.obstacle:  # it says nothing of the case: no search may learn from it
                hindered.append((job, outcome))
                return
            found = self.store.note(job, outcome)
            if found.folder is None:
                lost[job.name] = found
            if watcher is not None:
                watcher.ended(job, outcome)

        if wanted:
            self._make_folder()
            self.runs += len(wanted)
            self._do(list(wanted.values()), ended, watcher)
            for wait in _PATIENCE:
                again = [job for job, outcome in hindered if outcome.obstacle == "in use"]
                if not again:
                    break
                time.sleep(wait)
                hindered[:] = [one for one in hindered if one[0] not in again]
                self._do(again, ended, watcher)
            self.store.write_table()
        if hindered:
            raise RunFailure(
                f"{hindered[0][1].message}; the same command goes on with what has been run"
            )
        return [lost.get(job.name) or self._found(job) for job in jobs]

    def _found(self, job: Job) -> Evaluation:
        found = self.store.find(job.case)
        assert found is not None
        return found

    def _make_folder(self) -> None:
        folder = self.store.folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.store.record.save()
        except (OSError, RunFailure) as error:
            raise InputError(folder_refused(folder, error)) from None

    def _do(self, jobs: list[Job], ended: Any, watcher: Watcher | None) -> None:
        begun, tick = (watcher.begun, watcher.tick) if watcher else (_nothing, _nothing)
        if self._comm is not None and self._ranks > 1:
            self._comm.bcast(self._ranks)
            if self._groups is None:
                self._groups = Groups(self._comm, self._ranks)
            self._groups.run_for_first(jobs, begun, ended)
        elif self._comm is not None:
            from castfem.studies.sweep.ranks import run_on_ranks

            self._comm.bcast(1)
            run_on_ranks(self._comm, jobs, begun, ended, tick)
        elif self._processes:
            if self._team is None:
                self._team = Team(self._processes, self.store.folder / _NOISE_NAME)
            self._team.run(jobs, begun, ended, tick)
        else:
            for job in jobs:
                begun(job)
                ended(job, work(job))

    def close(self) -> None:
        """Let the processes, or the other ranks, go."""
        if self._team is not None:
            self._team.close()
        if self._comm is not None:
            self._comm.bcast(0)
        if self._groups is not None:
            self._groups.close()
        self._team = self._comm = self._groups = None


def serve(comm: MPI.Intracomm) -> None:
    """Do runs for the evaluator on rank 0 until it is closed (on every other rank).

    Args:
        comm: That of the evaluator, which knows how many ranks a run has.
    """
    from castfem.studies.sweep.ranks import run_on_ranks

    groups: Groups | None = None
    while ranks := comm.bcast(0):
        if ranks == 1:
            run_on_ranks(comm, (), _nothing, _nothing, _nothing)
            continue
        if groups is None:
            groups = Groups(comm, ranks)
        groups.run_for_first()
    if groups is not None:
        groups.close()


def variant(
    case: Case, changes: Mapping[str, Any], fidelity: str = DEFAULT, *, ideal: bool = False
) -> Case:
    """Return the case that is run for some changes.

    Args:
        case: The case, from `lean`.
        changes: Dotted key and new value, as `Case.with_` takes them.
        fidelity: A word of `castfem.studies.optimisation.fidelity`.
        ideal: In the idealised mould instead of its own.

    Raises:
        InputError: The changed case is not sound.
    """
    made = changed(case, changes, "changes") if changes else case
    return at_level(lean(idealised(made)) if ideal else made, fidelity)


def lean(case: Case) -> Case:
    """Return a case as it is run here: for its results alone, without fields and figures."""
    tables = case.document()
    tables.pop("optimise", None)
    tables.pop("reference", None)
    tables.setdefault("output", {}).update(_LEAN)
    if case.optimise is not None and case.optimise.names & smooth_twins().keys():
        tables["output"]["smooth"] = True
    return from_document(tables, case.title)


def _nothing(*_: object) -> None:
    """Stand in for what is told to a watcher."""
