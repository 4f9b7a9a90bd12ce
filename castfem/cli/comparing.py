"""`castfem compare`: the table of several runs, and their histories laid over one another."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.shown_units import shown_in
from castfem.cli import parallel
from castfem.post.compare.remarks import remarks
from castfem.post.compare.runs import Run, base_of, read_runs
from castfem.post.compare.table import CSV_NAME, Line, lines, printed, write_csv
from castfem.post.report import error_pages
from castfem.runs.output.chosen_units import units_of_run


def compare_runs(
    folders: Sequence[Path],
    output: Path | None,
    base: str | None = None,
    *,
    everything: bool = False,
    figures: bool = True,
    at: Sequence[float] = (),
) -> None:
    """Print the table of some runs, write it as CSV, and draw their figures.

    Args:
        folders: Of runs, or of sweeps.
        output: Where table and figures go; by default `compare` beside the runs.
        base: Label or folder of the run the others are measured by.
        everything: All quantities, not only those of the headline.
        figures: Draw them.
        at: Positions, m; the results there instead of those at the end.

    Raises:
        InputError: A run cannot be used, or the folder for the results is not castfem's.
        RunFailure: A file cannot be written.
    """
    runs = read_runs(folders)
    measure = base_of(runs, base)
    target = output or _beside(runs)
    _take(target)
    with shown_in(units_of_run(measure.folder)):
        table = lines(runs, measure, everything=everything, at=at)
        _print(runs, measure, table)
    written = write_csv(target, runs, table)
    print(f"table in {written}")
    if figures:
        from castfem.post.compare.drawing import draw

        with shown_in(units_of_run(measure.folder)):
            drawn = draw(target, runs, measure)
        if drawn:
            print(f"figures in {target}: {', '.join(path.name for path in drawn)}")


def _print(runs: Sequence[Run], measure: Run, table: Sequence[Line]) -> None:
    """Print the table and what stands below it."""
    out = parallel.console()
    for block in printed(runs, table, out.width):
        out.print(block, "", highlight=False)
    errors = error_pages.lines({run.label: run.folder for run in runs})
    for remark in [*remarks(runs, measure, table), *errors]:
        out.print(remark, highlight=False, soft_wrap=True)


def _beside(runs: Sequence[Run]) -> Path:
    """Return the folder `compare` beside the runs, if they all lie in one folder."""
    parents = {run.folder.resolve().parent for run in runs}
    if len(parents) != 1:
        return Path("results") / "compare"
    return Path(os.path.relpath(parents.pop())) / "compare"


def _take(target: Path) -> None:
    """Make the folder, unless it holds what castfem has not written.

    Raises:
        InputError: It does, or it cannot be made.
    """
    try:
        target.mkdir(parents=True, exist_ok=True)
        if any(target.iterdir()) and not (target / CSV_NAME).is_file():
            raise InputError(f"{target}: holds other files; choose another folder with -o")
    except OSError as error:
        raise InputError(
            f"{target}: cannot be used ({error.strerror}); choose another with -o"
        ) from None
