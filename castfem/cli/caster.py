"""`castfem caster`: the whole caster over time, as slices with what each has met."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base import log
from castfem.base.progress import Progress
from castfem.base.shown_units import shown_in
from castfem.cli import parallel
from castfem.cli.options import Request, chosen, read_from
from castfem.model import load_case, shipped_cases
from castfem.model.shipped_cases import CASE_NAME
from castfem.model.shown_units import units_of
from castfem.runs import existing_run
from castfem.runs.output.folder import CASTER_NAME, SLICES_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from castfem.runs.caster.plant_file import PlantFile


@dataclass(frozen=True, slots=True)
class CasterRequest(Request):
    """What the user asked of `castfem caster`."""

    follow: Path | None = None  #: a plant's history that grows; None for that of the case


def caster_of_case(options: CasterRequest) -> None:
    """Run, print what came out, and draw it."""
    from castfem.runs.caster.plant_file import BEYOND
    from castfem.runs.caster.run import run_caster

    path = shipped_cases.find(options.name)
    log.setup(-1 if options.quiet else 0, 0)
    source = None if options.follow is None else first_rows(options.follow)
    if source is not None:
        # A gap in a file that grows is reported, and no reason to refuse it.
        more = (source.assignment(), f"caster.longest_gap={2.0 * BEYOND!r} s")
        options = replace(options, overrides=(*options.overrides, *more))
    case = options.case(path)
    target = options.target(path, "_caster")
    existing_run.check(target, case, resume=options.resume, overwrite=options.overwrite)
    progress = Progress(-1 if options.quiet else 0, unit="s of slices")
    try:
        with read_from(path):
            run_caster(
                case, target, comm=parallel.communicator(), resume=options.resume,
                progress=progress, source=source,
            )  # fmt: skip
    finally:
        progress.stop()
        log.close()
        gc.collect()
    show_caster(target, options.units, figures=options.figures, quiet=options.quiet)


def first_rows(path: Path) -> PlantFile:
    """Return a history that grows, as soon as it has a row."""
    from castfem.runs.caster.plant_file import PAUSE, PlantFile

    source = PlantFile(path)
    if not path.is_file():
        log.logger.info("%s: is waited for", path)
    while not source.take():
        time.sleep(PAUSE)
    return source


def show_caster(
    folder: Path, units: tuple[str, ...] = (), *, figures: bool = True, quiet: bool = False
) -> None:
    """Print what the files of a caster tell, and draw them."""
    case = load_case(folder / CASE_NAME)
    with chosen(units), shown_in(units_of(case)):
        written = [CASTER_NAME, STRAND_ROWS_NAME, SLICES_NAME]
        if figures:
            from castfem.post.plots.strand_over_time import draw_strand

            drawn = draw_strand(folder, case.title, case.casting.length)
            written.append(str(drawn.relative_to(folder)))
        if not quiet:
            from castfem.base.table import say
            from castfem.post.report.caster import answers

            say(parallel.console(), case.title, "", *answers(folder, case.casting.length))
            print(f"{', '.join(written)} in {folder}")
