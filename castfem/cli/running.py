"""`castfem run`: validates, checks the folder, runs, and ends all ranks in order."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base import log
from castfem.base.errors import CastfemError, InputError
from castfem.base.progress import Progress
from castfem.cli import parallel
from castfem.cli.checking import problems_of
from castfem.cli.options import DEFAULT, Request, read_from
from castfem.model import AnyCase, TensileCase, shipped_cases
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs import existing_run
from castfem.runs.output.folder import ERROR_ENDING, ERROR_NAME
from castfem.runs.output.run_record import RUN_NAME
from castfem.runs.results.run_case import error_lines

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, slots=True)
class Options(Request):
    """Arguments of the command."""

    profile: bool = False  #: print the time spent in each part
    verbosity: int = 0  #: -1 quiet, 0 normal, 1 and more verbose


def run_case(options: Options) -> None:
    """Run a case on all ranks."""
    comm = parallel.communicator()
    rank = parallel.rank_of(comm)
    log.setup(options.verbosity, rank)
    try:
        with parallel.together(comm):
            case, target = _validated(comm, options)
            try:
                with read_from(_place(options)[0]):
                    _run_case(case, target, comm, options)
            except Exception as error:
                # in run.log, with the traceback of an unexpected error
                known = isinstance(error, CastfemError)
                text = str(error) if known else "".join(traceback.format_exception(error))
                log.logger.error("%s", text, extra=log.FILE_ONLY)
                raise
    finally:
        log.close()


def _validated(comm: MPI.Intracomm | None, options: Options) -> tuple[AnyCase, Path]:
    """Return the case and its folder, which rank 0 has checked.

    Every rank reads and validates; if any finds a problem, all raise the same InputError.
    """
    case, target = None, Path()
    problems: list[str] = []
    try:
        path, target = _place(options)
        resumed = options.resume and (path.parent / RUN_NAME).is_file()
        if options.accuracy != DEFAULT and resumed:
            raise InputError("--resume continues with the sizes of the run: leave out --accuracy")
        case, _, problems = problems_of(path, options.overrides, options.sizes(path))
    except InputError as error:
        problems = list(error.problems)
    found = parallel.agree(comm, tuple(problems))
    if not found and case is not None and parallel.rank_of(comm) == 0:
        try:
            existing_run.check(target, case, resume=options.resume, overwrite=options.overwrite)
        except InputError as error:
            problems = list(error.problems)
    found = found or parallel.agree(comm, tuple(problems))
    if found or case is None:
        raise InputError(found)
    return case, target


def _place(options: Options) -> tuple[Path, Path]:
    """Return the case file and the folder to write into."""
    given = Path(options.name)
    home = given if given.is_dir() else given.parent
    is_run = (home / RUN_NAME).is_file() and (given == home or given.name == CASE_NAME)
    if is_run and options.resume:
        return home / CASE_NAME, options.folder or home
    path = shipped_cases.find(options.name)
    if options.folder is None and path.parent == given:
        raise InputError(
            f"{given}: is the folder of a run: `castfem run --resume {given}` continues it, "
            f"`castfem run {given} -o FOLDER` repeats it elsewhere"
        )
    return path, options.folder or shipped_cases.default_folder(options.name, path)


def _run_case(case: AnyCase, target: Path, comm: MPI.Intracomm | None, options: Options) -> None:
    """Run the case; on rank 0 print the table of the run and draw its figures."""
    run: Callable[..., Any]
    if isinstance(case, TensileCase):
        from castfem.runs.tensile.tensile_test import run
    else:
        from castfem.runs.loop import run

    root = parallel.rank_of(comm) == 0
    progress = Progress(options.verbosity) if root else None
    try:
        run(
            case,
            target,
            comm=comm,
            resume=options.resume,
            profile=options.profile,
            progress=progress,
        )
    finally:
        if progress is not None:
            progress.stop()
    if root:
        _take_errors(target)
        _show(target, options.verbosity < 0, figures=case.output.figures)


def _take_errors(target: Path) -> None:
    """Add known errors of the case to the results of its run."""
    whole = target.resolve()  # "." has no name
    path = whole.with_name(whole.name + ERROR_ENDING) / ERROR_NAME
    if not path.is_file():
        return
    from castfem.studies.accuracy.table import ErrorTable, attach

    try:
        attach(ErrorTable.load(path), target)
    except CastfemError as error:
        log.logger.warning("%s", error)


def _show(target: Path, quiet: bool, *, figures: bool) -> None:
    if quiet:
        if figures:
            from castfem.post.report.show import draw

            draw(target)
        return
    from castfem.post.report.show import show

    show(target, parallel.console(), figures=figures)
    for line in error_lines({"": target}):
        print(line)
    print(f"results in {target}")
