"""`castfem error`: errors of the results, from runs with other meshes, steps and windows."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.shown_units import shown_in
from castfem.base.table import say
from castfem.cli import many_runs, parallel
from castfem.cli.options import Request, chosen, read_from
from castfem.model import shipped_cases
from castfem.post.compare.study_tables import error_tables, main_names, quantity_of, without_error
from castfem.runs.output.folder import ERROR_ENDING, ERROR_NAME
from castfem.runs.output.run_record import RUN_NAME
from castfem.runs.results.headline import plain_label
from castfem.runs.results.numbers import duration
from castfem.runs.results.run_case import units_of_run
from castfem.studies.accuracy.ladder import BASE, Ladder, levels, prepare, propose, read_share
from castfem.studies.accuracy.sizes import cell_count, changes
from castfem.studies.accuracy.table import ErrorTable, attach
from castfem.studies.sweep.record import check_folder
from castfem.studies.sweep.work import Job, Outcome

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, slots=True)
class Options(Request):
    """Arguments of the command."""

    to: str = ""  #: error for which sizes are proposed, "1%"; "" for none


def error_of_case(options: Options) -> int:
    """Make the runs, print and write the table, add the errors to the results (collective)."""
    return many_runs.on_root(partial(_prepared, options))


def _prepared(options: Options, ranks: bool) -> many_runs.Work:
    many_runs.check_processes(options.processes, ranks)
    if options.to:
        read_share(options.to)
    alone = _alone(options)
    named = alone.resolve() if alone.name in ("", "..") else alone
    folder = options.folder or named.with_name(named.name + ERROR_ENDING)
    check_folder(folder)
    path = shipped_cases.find(options.name)
    case = options.case(path)
    options.check_reached(case.casting.length)
    with read_from(path):
        cell_count(case)  # a case that cannot be meshed is refused here, not by each of its runs
    ladder = prepare(levels(case), folder, overwrite=options.overwrite, at=options.at)
    return partial(_done, ladder, options)


def _alone(options: Options) -> Path:
    """Return the folder of a run of the case."""
    given = Path(options.name)
    home = given if given.is_dir() else given.parent
    if given.exists() and (home / RUN_NAME).is_file():
        return home
    return shipped_cases.default_folder(options.name, shipped_cases.find(options.name))


def _done(ladder: Ladder, options: Options, comm: MPI.Intracomm | None) -> int:
    """Make the runs (on rank 0) and print the errors."""
    before = len(ladder.runnable) - len(ladder.jobs)
    if before and not options.quiet:
        print(f"{before} of {len(ladder.runnable)} runs are finished already", file=sys.stderr)
    target = ladder.record.folder

    def noted(job: Job, outcome: Outcome) -> None:
        """Write the errors known so far, before the expensive runs have ended."""
        entry = ladder.record.entries.get(BASE)
        if entry is not None and entry.physics:
            ladder.table().write(target)

    many_runs.run_all(
        ladder.jobs, before, ladder.record, comm,
        processes=options.processes, quiet=options.quiet, noted=noted,
    )  # fmt: skip
    table = ladder.table()
    path = table.write(target)
    written = [p for p in dict.fromkeys((target / BASE, _alone(options))) if attach(table, p)]
    if not options.quiet:
        with chosen(options.units), shown_in(units_of_run(target / BASE)):
            print_table(table)
            print(f"errors in {path} and with the results in {', '.join(map(str, written))}")
    if options.to:
        _propose(table, options)
    return 0


def _propose(table: ErrorTable, options: Options) -> None:
    """Print the mesh sizes for an error, how long a run with them takes, and its command."""
    found = propose(table, main_names(table.quantities), read_share(options.to))
    path = shipped_cases.find(options.name)
    case = options.case(path)
    words = ", ".join(f"{axis} x {factor:.3g}" for axis, factor in found.factors.items())
    took = f"about {duration(found.seconds)} instead of {duration(found.now)}"
    print(f"errors of {options.to}: {words}; {took}")
    sizes = dict(one.split("=", 1) for one in options.sizes(path))
    sizes.pop("title", None)
    sizes |= changes(case, found.factors)
    given = [*options.overrides, *(f"{key}={value}" for key, value in sizes.items())]
    settings = " ".join(f"--set {shlex.quote(text)}" for text in given)
    print(f"castfem run {shlex.quote(options.name)} {settings} -o FOLDER")
    for name, left in found.unreached.items():
        label = plain_label(quantity_of(table.quantities[name]))
        print(f"not reachable by these sizes: {label}, {100 * left:.2g} %", file=sys.stderr)


def show_errors(folder: Path) -> None:
    """Print the errors in a folder of `castfem error`."""
    table = ErrorTable.load(folder / ERROR_NAME)
    print(table.title)
    with shown_in(units_of_run(folder / BASE)):
        print_table(table)


def print_table(table: ErrorTable) -> None:
    """Print errors, and runs that failed."""
    for one in error_tables(table):
        say(parallel.console(), one, "")
    for line in without_error(table):
        print(line, file=sys.stderr)
