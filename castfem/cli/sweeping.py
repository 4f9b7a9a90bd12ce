"""`castfem sweep`: plans, runs in parallel, prints the table; also in parts, or by SLURM."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_units import shown_in
from castfem.base.table import say
from castfem.cli import many_runs, parallel
from castfem.cli.options import DEFAULT, Request, chosen
from castfem.model import shipped_cases
from castfem.model.checks.shared_heat import shared_heat
from castfem.post.compare.study_tables import sweep_table
from castfem.post.report.cautions import cautions_of_all
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.run_case import units_of_run
from castfem.studies.sweep.plan import Variant, plan
from castfem.studies.sweep.record import (
    TABLE_NAME,
    Record,
    check_folder,
    check_own,
    prepare,
    rows,
    write_table,
)
from castfem.studies.sweep.work import Job, Outcome

if TYPE_CHECKING:
    from mpi4py import MPI


_SOONEST = 2.0  # shortest time between two updates of the table, s


@dataclass(frozen=True, slots=True)
class Options(Request):
    """Arguments of the command."""

    assignments: tuple[str, ...] = ()  #: assignments of --set, with one or several values each
    table: Path | None = None  #: CSV file with the runs
    part: str = ""  #: share of the runs to make, `3/20`; "" for all
    #: make no runs; print the table of those finished in parts or elsewhere
    collect: bool = False
    script: Path | None = None  #: script to write that makes the sweep in parts; no runs are made


@dataclass(frozen=True, slots=True)
class _Sweep:
    """A valid sweep: its runs, and those to be made here."""

    record: Record  #: record of all its runs, including other parts
    variants: tuple[Variant, ...]  #: the runs of this part, or all
    jobs: tuple[Job, ...]  #: the runs still to be made
    whole: bool = True  #: whether this is the whole sweep

    @property
    def names(self) -> list[str]:
        """Names of the runs of this part."""
        return [one.name for one in self.variants]


def sweep_case(options: Options) -> int:
    """Make a sweep; return the exit status: 2 if a run failed, otherwise 0 (collective)."""
    if options.script is not None or options.collect:
        return _alone(options) if parallel.rank_and_size()[0] == 0 else 0
    return many_runs.on_root(partial(_prepared, options))


def _planned(options: Options) -> tuple[tuple[Variant, ...], Path]:
    path = shipped_cases.find(options.name)
    variants = plan(options.case(path), options.assignments, options.table)
    target = options.target(path, "_sweep")
    check_folder(target)
    for line in shared_heat(one.case for one in variants):
        print(f"castfem: {line}", file=sys.stderr)
    options.check_reached(max((one.case.casting.length for one in variants), default=0.0))
    return variants, target


def _prepared(options: Options, ranks: bool) -> many_runs.Work:
    many_runs.check_processes(options.processes, ranks, options.ranks)
    everything, target = _planned(options)
    share = Share.read(options.part) if options.part else Share(1, 1)
    variants = tuple(share.of(everything))
    check_own(target, (TABLE_NAME,))
    record, jobs = prepare(
        target, everything, variants, resume=options.resume, overwrite=options.overwrite,
        after=_draw if options.figures else None,
    )  # fmt: skip
    return partial(_done, _Sweep(record, variants, jobs, share.count == 1), options)


def _draw(folder: Path) -> None:
    """Draw the figures of a finished run, in the process that has run it."""
    from castfem.post.plots.figures import draw_figures

    draw_figures(folder)


def _alone(options: Options) -> int:
    """Write the table of finished runs, or the script; return the exit status."""
    variants, target = _planned(options)
    if options.script is not None:
        words = [options.name, "-o", str(target)]
        words += [word for given in options.assignments for word in ("--set", given)]
        words += ["--table", str(options.table)] if options.table is not None else []
        words += ["--accuracy", options.accuracy] if options.accuracy != DEFAULT else []
        words += ["--figures"] if options.figures else []
        parts = Share.read(options.part).count if options.part else None
        count = write_script(options.script, words, target, len(variants), parts, options.ranks)
        target.mkdir(parents=True, exist_ok=True)  # SLURM makes no folder for its own output
        print(f"wrote {options.script}: {len(variants)} runs in {count} tasks; nothing submitted")
        return 0
    record = Record(target)
    if not record.entries and not target.is_dir():
        raise InputError(f"{target}: no such folder; nothing of this sweep has been run there")
    with record.shared():
        record.find(variants)
    return _report(_Sweep(record, variants, ()), options)


def _done(sweep: _Sweep, options: Options, comm: MPI.Intracomm | None) -> int:
    """Make the runs (on rank 0), print the table; return the exit status."""
    before = len(sweep.variants) - len(sweep.jobs)
    if before and not options.quiet:
        print(f"{before} of {len(sweep.variants)} runs are finished already", file=sys.stderr)
    target = sweep.record.folder
    written = 0.0

    def noted(job: Job, outcome: Outcome) -> None:
        nonlocal written
        if sweep.whole and time.monotonic() - written > _SOONEST:  # it is written again at the end
            write_table(target / TABLE_NAME, rows(sweep.names, sweep.record))
            written = time.monotonic()

    many_runs.run_all(
        sweep.jobs, before, sweep.record, comm,
        processes=options.processes, quiet=options.quiet, noted=noted, ranks=options.ranks,
    )  # fmt: skip
    return _report(sweep, options)


def _report(sweep: _Sweep, options: Options) -> int:
    """Print and write the table of results; return the exit status.

    One part of several writes no table, since the others have rows for it, too.
    """
    table = rows(sweep.names, sweep.record, options.at)
    target = sweep.record.folder
    if sweep.whole:
        write_table(target / TABLE_NAME, table)
    if not options.quiet:
        out = parallel.console()
        first = next((row.name for row in table if row.quantities), "")
        with chosen(options.units), shown_in(units_of_run(target / first)):
            if table:
                say(out, sweep_table(table, out.width))
            finished = {
                row.label or row.name: (target / row.name, Summary.load(target / row.name))
                for row in table
                if row.quantities
            }
            say(out, *cautions_of_all(finished))
        where = f"table in {target / TABLE_NAME}, runs in {target}"
        after = "their table: --collect, when all parts have ended"
        print(where if sweep.whole else f"runs in {target}; {after}")
    failed = sum(row.status == "failed" for row in table)
    waiting = sum(row.status == "waiting" for row in table)
    if failed or waiting:
        parallel.pass_on()
    if failed:
        print(f"castfem: {failed} of {len(table)} runs failed", file=sys.stderr)
    if waiting:
        print(f"castfem: {waiting} of {len(table)} runs have not finished", file=sys.stderr)
    return RunFailure.exit_status if failed or waiting else 0


MOST = 20  # default number of parts, at most
Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class Share:
    """Every n-th row, from the i-th on: neighbouring rows often take equally long."""

    number: int  #: number of this share, from 1
    count: int  #: number of shares

    @classmethod
    def read(cls, text: str) -> Share:
        """Read `3/20`."""
        number, _, count = text.partition("/")
        try:
            share = cls(int(number), int(count))
        except ValueError:
            raise InputError(f"--part {text}: write it as 3/20, the third of 20 parts") from None
        if not 1 <= share.number <= share.count:
            raise InputError(f"--part {text}: the parts are 1/{share.count} to {count}/{count}")
        return share

    def of(self, rows: Sequence[Row]) -> Sequence[Row]:
        """Return the rows of this share; none if there are more shares than rows."""
        return rows[self.number - 1 :: self.count]


def write_script(
    path: Path, words: Sequence[str], folder: Path, rows: int, parts: int | None, ranks: int
) -> int:
    """Write an array script: one task per part, then the command that makes the table.

    Args:
        path: The script.
        words: Command line of the sweep, without --part and its like.
        folder: Folder of the sweep.
        rows: Number of its runs.
        parts: Number of tasks; None for one per run, but not more than 20.
        ranks: Ranks of each run.

    Returns:
        The number of parts.
    """
    if path.exists():
        raise InputError(f"{path}: exists already; choose another name for the script")
    parts = min(rows, MOST) if parts is None else parts
    command = " ".join(["castfem", "sweep", *map(shlex.quote, words)])
    launch = f"mpirun -n {ranks} " if ranks > 1 else ""  # srun may not know this MPI
    each = f" --ranks {ranks}" if ranks > 1 else " -j 1"
    lines = [
        "#!/bin/bash",
        f"# {rows} runs in {parts} tasks of one array. Set what your cluster asks for, then, from",
        "# the folder in which castfem wrote this:",
        f"#   sbatch {shlex.quote(str(path))}",
        "# A killed task continues when it is submitted again. When all have ended:",
        f"#   {command} --collect",
        "#SBATCH --job-name=castfem",
        f"#SBATCH --array=1-{parts}",
        f"#SBATCH --ntasks={ranks}",
        "#SBATCH --cpus-per-task=1",
        "#SBATCH --mem-per-cpu=2G",
        "#SBATCH --time=04:00:00",
        f"#SBATCH --output={shlex.quote(str(folder / 'slurm-%a.log'))}",
        "#SBATCH --requeue",
        "#SBATCH --signal=B:USR1@60",  # mpirun kills its ranks on SIGTERM, but passes this on
        "set -eu",
        "export OMP_NUM_THREADS=1",
        f'exec {launch}{command} --part "$SLURM_ARRAY_TASK_ID/{parts}" --resume --quiet{each}',
        "",
    ]
    write_text(path, "\n".join(lines), durable=False)
    return parts
