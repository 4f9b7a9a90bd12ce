"""`castfem caster`: the whole caster over time, as slices with their own histories."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base import log
from castfem.base.errors import InputError
from castfem.base.progress import Progress
from castfem.base.shown_units import shown_in
from castfem.cli import parallel
from castfem.cli.options import Request, chosen, read_from
from castfem.model import Case, load_case, shipped_cases
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs import existing_run
from castfem.runs.output.folder import CASTER_NAME, SLICES_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.runs.caster.plant_file import PlantFile


@dataclass(frozen=True, slots=True)
class CasterRequest(Request):
    """Arguments of the command."""

    follow: Path | None = None  #: growing plant record; None for that of the case


def caster_of_case(options: CasterRequest) -> None:
    """Run on all ranks; on the first print the results, and draw them."""
    from castfem.runs.caster.run import run_caster

    comm = parallel.communicator()
    rank = parallel.rank_of(comm)
    log.setup(-1 if options.quiet else 0, rank)
    progress = Progress(-1 if options.quiet else 0, unit="s of slices") if rank == 0 else None
    try:
        with parallel.together(comm):
            options, source = _following(options)
            path, case, target = _agreed(comm, options)
            with read_from(path):
                run_caster(
                    case, target, comm=comm, resume=options.resume, progress=progress,
                    source=source,
                )  # fmt: skip
    finally:
        if progress is not None:
            progress.stop()
        log.close()
        gc.collect()
    if rank == 0:
        show_caster(target, options.units, figures=options.figures, quiet=options.quiet)


def _agreed(comm: MPI.Intracomm | None, options: Request) -> tuple[Path, Case, Path]:
    """Return the file, the case and its folder; errors are raised on all ranks."""
    problems: tuple[str, ...] = ()
    try:
        path = shipped_cases.find(options.name)
        case, target = options.case(path), options.target(path, "_caster")
        if parallel.rank_of(comm) == 0:
            existing_run.check(target, case, resume=options.resume, overwrite=options.overwrite)
    except InputError as error:
        problems = error.problems
    if found := parallel.agree(comm, tuple(problems)):
        raise InputError(found)
    return path, case, target


def _following(options: CasterRequest) -> tuple[CasterRequest, PlantFile | None]:
    """Return a growing plant record, once it has a row, and the request with it as the plant."""
    from castfem.runs.caster.plant_file import BEYOND, PAUSE, PlantFile

    if options.follow is None:
        return options, None
    source = PlantFile(options.follow)
    if not options.follow.is_file():
        log.logger.info("waiting for %s", options.follow)
    while not source.take():
        time.sleep(PAUSE)
    # A gap in a growing file is reported, but not refused.
    more = (source.assignment(), f"caster.longest_gap={2.0 * BEYOND!r} s")
    return replace(options, overrides=(*options.overrides, *more)), source


def show_caster(
    folder: Path, units: tuple[str, ...] = (), *, figures: bool = True, quiet: bool = False
) -> None:
    """Print and draw the results of a caster."""
    case = load_case(folder / CASE_NAME)
    with chosen(units), shown_in(case.shown_units):
        written = [CASTER_NAME, STRAND_ROWS_NAME, SLICES_NAME]
        if figures:
            from castfem.post.plots.caster_figures import draw_caster

            written += [str(path.relative_to(folder)) for path in draw_caster(folder, case)]
        if not quiet:
            from castfem.base.table import say
            from castfem.post.report.caster import answers

            say(parallel.console(), case.title, "", *answers(folder, case))
            print(f"{', '.join(written)} in {folder}")
