"""`castfem sweep`: plan, look at what is finished, run the rest in parallel, print the table."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.case import load_case, shipped_cases
from castfem.cli import many_runs, parallel
from castfem.errors import InputError, RunFailure
from castfem.output.folder import OutputFolder
from castfem.sweep.plan import Variant, plan
from castfem.sweep.record import Record
from castfem.sweep.results import TABLE_NAME, printed, rows, write_table
from castfem.sweep.work import Job, Outcome
from castfem.time_loop import existing_run

if TYPE_CHECKING:
    from mpi4py import MPI

_SOONEST = 2.0  # s between two versions of the table


@dataclass(frozen=True, slots=True)
class Options:
    """What the user asked for.

    Attributes:
        name: Case file or name of a shipped case.
        folder: Where the folders of the runs go, None for the default.
        assignments: Those of --set, with one or several values each.
        table: CSV file of runs.
        processes: How many runs at once; None for one a core.
        resume: Let runs that were not finished go on from their checkpoints.
        overwrite: Run all anew, also over runs of other cases.
        figures: Draw the figures of each run.
        quiet: Print nothing but errors.
    """

    name: str
    folder: Path | None
    assignments: tuple[str, ...]
    table: Path | None
    processes: int | None
    resume: bool
    overwrite: bool
    figures: bool
    quiet: bool


@dataclass(frozen=True, slots=True)
class _Sweep:
    """A sweep that is sound: its runs, and those of them that are still to be done."""

    record: Record
    variants: tuple[Variant, ...]
    jobs: tuple[Job, ...]


def sweep_case(options: Options) -> int:
    """Do a sweep and return the exit status: 2 if a run failed, else 0 (collective).

    Raises:
        InputError: Something the user wrote cannot be used; nothing has been run.
        RunFailure: The record of the sweep cannot be written.
    """
    return many_runs.on_root(
        lambda ranks: _prepared(options, ranks), lambda sweep, comm: _done(sweep, options, comm)
    )


def _prepared(options: Options, ranks: bool) -> _Sweep:
    """Plan the sweep and look at its folder.

    Raises:
        InputError: As `sweep_case`.
    """
    many_runs.check_processes(options.processes, ranks)
    path = shipped_cases.find(options.name)
    variants = plan(load_case(path), options.assignments, options.table)
    target = options.folder or _default_folder(options.name, path)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: is a file, a folder is needed; choose another with -o")
    record = Record(target)
    jobs: list[Job] = []
    problems: list[str] = []
    for variant in variants:
        place = target / variant.name
        job = Job(variant.name, place, variant.case, options.resume, options.figures)
        if not options.overwrite and record.is_finished(job):
            continue
        try:
            existing_run.check(place, variant.case, resume=False, overwrite=options.overwrite)
            if place.is_dir() and OutputFolder(place).is_running():
                raise InputError(f"{place}: a run is at work there; wait for it")
        except InputError as error:
            problems += error.problems
        jobs.append(job)
    if problems:
        raise InputError(problems)
    record.expect(variants)
    try:
        target.mkdir(parents=True, exist_ok=True)
        record.save()
    except (OSError, RunFailure) as error:
        raise InputError(f"{target}: cannot be written ({error}); choose another with -o") from None
    return _Sweep(record, variants, tuple(jobs))


def _default_folder(name: str, path: Path) -> Path:
    """Return where a sweep goes without -o: beside a run of the case, results/.../NAME_sweep."""
    alone = shipped_cases.default_folder(name, path)
    return alone.with_name(f"{alone.name}_sweep")


def _done(sweep: _Sweep, options: Options, comm: MPI.Intracomm | None) -> int:
    """Run what is to be run (on rank 0), print the table, and return the exit status."""
    before = len(sweep.variants) - len(sweep.jobs)
    if before and not options.quiet:
        print(f"{before} of {len(sweep.variants)} runs are finished already", file=sys.stderr)
    target = sweep.record.folder
    written = 0.0

    def noted(job: Job, outcome: Outcome) -> None:
        nonlocal written
        if time.monotonic() - written > _SOONEST:  # it is written again at the end
            write_table(target / TABLE_NAME, rows(sweep.variants, sweep.record))
            written = time.monotonic()

    many_runs.run_all(
        sweep.jobs, before, sweep.record, comm,
        processes=options.processes, quiet=options.quiet, noted=noted,
    )  # fmt: skip
    return _report(sweep, options.quiet)


def _report(sweep: _Sweep, quiet: bool) -> int:
    """Print and write the table of results; return the exit status."""
    table = rows(sweep.variants, sweep.record)
    target = sweep.record.folder
    write_table(target / TABLE_NAME, table)
    if not quiet:
        out = parallel.console()
        out.print(printed(table, out.width), highlight=False)
        print(f"table in {target / TABLE_NAME}, runs in {target}")
    failed = [row for row in table if row.status != "finished"]
    if failed:
        print(f"castfem: {len(failed)} of {len(table)} runs failed", file=sys.stderr)
        return RunFailure.exit_status
    return 0
