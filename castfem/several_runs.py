"""Studies of several runs, for scripts: the commands' results in SI, as tables and objects.

    castfem.sweep(case, {"casting.speed": ["3 m/min", "4 m/min"]}, "folder")    # castfem sweep
    castfem.comparison(["results/one", "results/other"])    # castfem compare
    castfem.error_table("billet125/thermal")                # castfem error
    castfem.optimise("billet125/optimum_single")            # castfem optimise
    castfem.find_section("billet125/idealised")             # castfem section
    castfem.mould_at_work("billet125/hot")                  # castfem mould --hot, --coupled

Nothing is printed or drawn. Large modules are imported by the functions that need them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.errors import InputError
from castfem.model.load import as_case

if TYPE_CHECKING:
    from mpi4py import MPI

    import pandas

    from castfem.model import Case
    from castfem.physics.mould.displaced import WallDisplacement
    from castfem.physics.mould.mould import Mould
    from castfem.studies.mould_fit.coupled import Turn
    from castfem.studies.mould_fit.meniscus_outline import Attempt, Outline
    from castfem.studies.optimisation import Optimum
    from castfem.studies.sweep.record import Record
    from castfem.studies.sweep.work import Job
    from castfem.studies.sweep.workers import CallExecutor


_COLUMNS = "name", "at", "label", "unit"


def comparison(
    folders: Path | str | Sequence[Path | str],
    base: Path | str | None = None,
    *,
    everything: bool = False,
    at: float | str | Sequence[float | str] | None = None,
) -> pandas.DataFrame:
    """Compare finished runs, like `castfem compare`.

    Args:
        folders: Folders of runs; the folder of a sweep stands for all its finished runs.
        base: Label or folder of the run to which the heat of the others is related; by default
            "idealised", or the first.
        everything: All results instead of the headline ones.
        at: One or more positions, "300 mm" or numbers in m, for results there instead of at the
            end.

    Returns:
        One row for each result and place, by the name of the result ("heat_removed_share": relative
        to the base run); columns `at` (m below the meniscus, NaN: the end of the run), `label`,
        `unit`, one for each run under its label, and "LABEL: error", "LABEL: reference",
        "LABEL: bound" where they exist. SI.

    Raises:
        InputError: A folder has no finished run, there are fewer than two runs, none has reached a
            position, or a run has the name of another column.
    """
    from castfem.post.compare.runs import base_of, read_runs
    from castfem.post.compare.table import in_si, lines
    from castfem.runs.results.labels import read_number

    several: Any = [folders] if isinstance(folders, str | Path) else folders
    if not isinstance(several, Sequence) or not all(isinstance(f, str | Path) for f in several):
        raise InputError(f"comparison: folders of runs are needed, not {folders!r}")
    if base is not None and not isinstance(base, str | Path):
        raise InputError(f"comparison: base must be the label or folder of a run, not {base!r}")
    runs = read_runs([Path(folder) for folder in several])
    for run in runs:
        if run.label in _COLUMNS:
            raise InputError(f"{run.label}: a column of the table has that name; rename the folder")
    given: list[Any] = [at]
    if isinstance(at, Iterable) and not isinstance(at, str):
        given = list(at)
    places = [place for one in given if (place := read_number("at", one, "m")) is not None]
    found = lines(
        runs, base_of(runs, None if base is None else str(base)), everything=everything, at=places
    )
    if not found:
        raise InputError(f"at {at}: no run has reached this position")
    return in_si(runs, found)


def sweep(
    case: Case | str | Path,
    values: Mapping[str, Sequence[Any]] | None = None,
    folder: Path | str | None = None,
    *,
    table: Path | str | None = None,
    processes: int = 0,
    executor: CallExecutor | None = None,
    overwrite: bool = False,
) -> pandas.DataFrame:
    """Run a case with several values of its keys, like `castfem sweep`.

    Args:
        case: A case, or its path or name as for `load`.
        values: Values by key, written as in a case file; each combination is a run.
        folder: Folder of the runs, as for `castfem sweep -o`; finished runs in it are not repeated,
            and interrupted ones continue. None for a temporary folder, which is removed.
        table: CSV file with one row per run, as for `--table`.
        processes: Number of simultaneous runs, each in its own process, for which a script needs
            `if __name__ == "__main__":`; 0: one after the other in this process.
        executor: Makes the runs instead: an object with `submit(function, *arguments)`, such as
            those of `concurrent.futures`, `mpi4py.futures`, executorlib and submitit. Its processes
            must see the folder; it is not closed. A process makes one run at a time, even with
            several threads.
        overwrite: Repeat all runs, also over runs of other cases.

    Returns:
        One row per run, by its name: the varied values, as written; `status` ("finished" or
        "failed"), the results in SI by name, `seconds`, and the `message` of a failed run.

    Raises:
        InputError: Keys, values or folder cannot be used; no run has been made.
        RunFailure: A file cannot be written. A failing run raises nothing.
    """
    from castfem.base.errors import written
    from castfem.post.compare.study_tables import sweep_in_si
    from castfem.studies.sweep.plan import plan
    from castfem.studies.sweep.record import TABLE_NAME, check_own, prepare, rows, write_table

    sound = as_case(case, "sweep")
    given = {} if values is None else values
    lists = given.values() if isinstance(given, Mapping) else [""]
    if any(isinstance(one, str) or not isinstance(one, Sequence) for one in lists):
        sample = '{"casting.speed": ["3 m/min"]}'
        raise InputError(f"sweep: values must be keys with lists of values, {sample}: {values!r}")
    assignments = [f"{key}={','.join(map(written, several))}" for key, several in given.items()]
    variants = plan(sound, assignments, None if table is None else Path(table))
    with _target(folder, "sweep", executor) as target:
        check_own(target, (TABLE_NAME,))
        record, missing = prepare(target, variants, resume=not overwrite, overwrite=overwrite)
        _make(missing, record, processes, executor)
        found = rows([v.name for v in variants], record)
        write_table(target / TABLE_NAME, found)
    return sweep_in_si(found)


@contextmanager
def _target(
    folder: Path | str | None, caller: str, executor: CallExecutor | None
) -> Iterator[Path]:
    """Folder of several runs; a temporary one for None.

    Raises:
        InputError: It cannot be used, or there are several ranks without an executor.
    """
    from mpi4py import MPI

    from castfem.studies.sweep.record import check_folder

    if MPI.COMM_WORLD.size > 1 and executor is None:
        command = caller.partition("_")[0]
        raise InputError(f"{caller}: runs on one rank; under mpirun use castfem {command}")
    if folder is None:
        with tempfile.TemporaryDirectory() as made:
            yield Path(made)
    else:
        yield check_folder(folder, caller)


def _make(
    jobs: Sequence[Job], record: Record, processes: int, executor: CallExecutor | None
) -> None:
    """Make runs, and record how each has ended."""
    from castfem.studies.sweep.workers import LOG_NAME, Workers

    noise = record.folder / LOG_NAME
    with Workers(noise, processes=processes, executor=executor) as workers:
        workers.run(jobs, ended=record.note)


def error_table(
    case: Case | str | Path,
    folder: Path | str | None = None,
    *,
    processes: int = 0,
    executor: CallExecutor | None = None,
    overwrite: bool = False,
) -> pandas.DataFrame:
    """Compute the error of each result of a case, from runs with other cells, steps and windows.

    Args:
        case: A case, or its path or name as for `load`.
        folder: Folder of the runs, as for `castfem error -o`; finished runs in it are not repeated.
            None for a temporary folder, which is removed.
        processes: Number of simultaneous runs, each in its own process, for which a script needs
            `if __name__ == "__main__":`; 0: one after the other in this process.
        executor: Makes the runs instead, as for `sweep`.
        overwrite: Repeat all runs, also over runs of other cases.

    Returns:
        One row per result, by its name; columns `label`, `unit`, `value`, `error`, and the parts of
        the error from the cells (`mesh`), the `step` and the `coupling` windows; SI, NaN where
        unknown. `table.attrs["not run"]` has the reasons of failed runs, by name.

    Raises:
        InputError: Case or folder cannot be used, or there are several ranks.
        RunFailure: The run of the case itself failed.
    """
    from castfem.post.compare.study_tables import errors_in_si
    from castfem.studies.accuracy.ladder import BASE, levels, prepare
    from castfem.studies.accuracy.table import attach

    sound = as_case(case, "error_table")
    with _target(folder, "error_table", executor) as target:
        ladder = prepare(levels(sound), target, overwrite=overwrite)
        _make(ladder.jobs, ladder.record, processes, executor)
        table = ladder.table()
        table.write(target)
        attach(table, target / BASE)
        return errors_in_si(table)


def optimise(
    case: Case | str | Path,
    folder: Path | str | None = None,
    *,
    processes: int = 0,
    executor: CallExecutor | None = None,
    comm: MPI.Intracomm | None = None,
    ranks: int = 1,
) -> Optimum:
    """Find the optimal values of a case's keys, as its table [optimise] asks (collective).

    `castfem.studies.optimisation.Study` yields the same runs one by one, so that they can be made
    anywhere.

    Args:
        case: A case, or its path or name as for `load`.
        folder: Folder of the runs, as for `castfem optimise -o`; runs in it are not repeated. None
            for a temporary folder, which is removed.
        processes: Number of simultaneous runs, each in its own process, for which a script needs
            `if __name__ == "__main__":`; 0: one after the other in this process.
        executor: Makes the runs instead, as for `sweep`; the call is then not collective.
        comm: Ranks that make the runs; None for all.
        ranks: Ranks of each run, if there are several.

    Returns:
        The optimal values with their intervals, the results there and the active bounds, on all
        ranks; its `status` says whether the constraints are met. `case.with_(best.changes())`
        applies it.

    Raises:
        InputError: Case or folder cannot be used, or the case has no [optimise].
        RunFailure: A file cannot be written. A failing run raises nothing.
    """
    from mpi4py import MPI

    from castfem.fem.rank_zero import raise_together
    from castfem.studies.optimisation import Evaluator, Study, serve
    from castfem.studies.optimisation.argument_checks import origin_of

    alone = MPI.COMM_SELF if executor is not None else MPI.COMM_WORLD
    comm = alone if comm is None else comm
    found: Optimum | None = None
    error: Exception | None = None
    if comm.rank:
        serve(comm)
    else:
        with ExitStack() as held:
            try:
                sound = as_case(case, "optimise")
                if comm.size > 1 and processes:
                    raise InputError("optimise: processes: under mpirun the ranks do the work")
                target = folder or held.enter_context(tempfile.TemporaryDirectory())
                team = Evaluator(
                    sound, target, processes=processes, comm=comm, ranks=ranks, executor=executor
                )
            except Exception as raised:
                error = raised
                if comm.size > 1:
                    comm.bcast(0)  # 0 means for the other ranks that there are no runs
            else:
                try:
                    with team:
                        origin = origin_of(case)
                        found = Study(sound, evaluator=team, origin=origin).solve()
                except Exception as raised:
                    error = raised
    raise_together(comm, error)
    found = comm.bcast(found)
    assert found is not None
    return found


@dataclass(frozen=True, slots=True, eq=False)
class FoundSection:
    """Outline at the meniscus with which the strand has the wanted section further down."""

    outline: Outline  #: outline at the meniscus: length along a quarter, offset from rectangle, m
    wall: WallDisplacement  #: wall that follows the strand all round and along the mould
    attempts: tuple[Attempt, ...]  #: the runs, each with the deviation of its section (`worst`), m

    def changes(self, *, wall: bool = False) -> dict[str, Any]:
        """Return the changes for `case.with_` to use the outline; with `wall` also that wall."""
        from castfem.model.wall_shape import WallShape

        ways, offsets = self.outline.ways.tolist(), self.outline.offset.tolist()
        bulge = {"way": ways, "way_unit": "m", "value": offsets, "unit": "m"}
        found: dict[str, Any] = {"section.bulge": bulge}
        return found | ({"mould.displacement": WallShape().write(self.wall)} if wall else {})


def find_section(
    case: Case | str | Path, at: float | str | None = None, *, comm: MPI.Intracomm | None = None
) -> FoundSection:
    """Find the outline at the meniscus with which the strand has the case's section further down.

    Like `castfem section` (collective).

    Args:
        case: A case with mechanics and without a mould, or its path or name as for `load`.
        at: Position of the wanted section, "800 mm" or a number in m; by default the end of the
            mould.
        comm: Ranks of the runs; None for all.

    Raises:
        InputError: The case cannot be used.
        RunFailure: A run fails, or the runs do not converge.
    """
    from mpi4py import MPI

    from castfem.runs.results.labels import read_number
    from castfem.studies.mould_fit import meniscus_outline as section

    sound = as_case(case, "find_section")
    place = read_number("at", at, "m")
    comm = MPI.COMM_WORLD if comm is None else comm
    attempts = section.find_section(sound, comm, "find_section", place)
    sides = section.sides_of_section(sound.section)  # type: ignore[arg-type]
    last = attempts[-1]
    return FoundSection(last.start, section.natural_wall(last, sides), tuple(attempts))


@dataclass(frozen=True, slots=True, eq=False)
class MouldAtWork:
    """A mould in the cold and in the working condition."""

    cold: Mould  #: the cold mould; `cold.dimensions(z)` has its sizes at z, m
    hot: Mould  #: the working mould; `hot.dimensions(z)` has its sizes at z, m
    displacement: WallDisplacement | None
    """From the case's sizes and taper to the working wall; None if the case gives that."""
    iterations: tuple[Turn, ...]
    """Strand and tube by iteration; the last `wall` has temperatures (K) and copper stress."""

    def changes(self) -> dict[str, Any]:
        """Return the changes for `case.with_` to run in the working wall; none if it is given."""
        from castfem.model.wall_shape import WallShape

        if self.displacement is None:
            return {}
        return {"mould.displacement": WallShape().write(self.displacement)}


def mould_at_work(
    case: Case | str | Path, *, coupled: bool = False, comm: MPI.Intracomm | None = None
) -> MouldAtWork:
    """Compute how heat distorts a mould's copper tube, like `castfem mould --hot` (collective).

    Args:
        case: A case with [mould.tube], or its path or name as for `load`.
        coupled: Iterate strand and tube until they agree.
        comm: Ranks of runs and tube; None for all.

    Raises:
        InputError: The case has no tube.
        RunFailure: A run of the strand or a solver fails.
    """
    from mpi4py import MPI

    from castfem.model.mould_from_case import nominal_mould
    from castfem.studies.mould_fit.coupled import AGREEMENT, drawing, hot_mould_of, table_of

    sound = as_case(case, "mould_at_work")
    table = table_of(sound, "mould_at_work")
    comm = MPI.COMM_WORLD if comm is None else comm
    turns = hot_mould_of(sound, comm, "mould_at_work", AGREEMENT.most if coupled else 1)
    found = drawing(table, nominal_mould(table, sound.section), turns[-1].wall)
    return MouldAtWork(found.cold, found.hot, found.displacement, tuple(turns))
