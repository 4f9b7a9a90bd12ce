"""What `castfem show` prints about a run, finished or not, and the figures it draws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.base.messages import said_in_a_line
from castfem.base.shown_units import (
    place_said,
    said,
    shown_in,
)
from castfem.base.tolerances import ROUNDING
from castfem.post.report.cautions import cautions
from castfem.post.report.crack_places import crack_places
from castfem.post.report.place_tables import print_along, print_places
from castfem.post.report.printing import empty_table, print_line, print_list, wrapped
from castfem.post.report.remarks import remarks_of
from castfem.post.report.results_table import print_results, result_rows
from castfem.runs.output.chosen_units import units_of_run
from castfem.runs.output.folder import LOG_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import last_quantities
from castfem.runs.results.numbers import (
    duration,
    finely,
)

if TYPE_CHECKING:
    from rich.console import Console

_BRIEF = 0.01  # of the wall time; a stage that takes less is not named
_MUCH, _FELT = 0.25, 5.0  # of the wall time, s; files that take more are told of


def show(
    folder: Path | str,
    console: Console | None = None,
    *,
    figures: bool = True,
    at: Sequence[float] = (),
) -> None:
    """Prints status, results beside references, balances and effort of a run; draws its figures.

    Args:
        folder: Of the run, which may be at work, killed or failed.
        console: Where to print; standard output if None.
        figures: Draw them; a folder that cannot be written costs a line, not the table.
        at: Positions, m; the results there, and nothing else, if some are given.

    Raises:
        InputError: The folder holds no run, or a file in it is damaged.
    """
    from rich.console import Console

    path = Path(folder)
    if not path.is_dir():
        raise InputError(f"{path}: no such folder")
    with shown_in(units_of_run(path)):
        _show(path, console or Console(), figures=figures, at=at)


def _show(path: Path, out: Console, *, figures: bool, at: Sequence[float]) -> None:
    """As `show`, in units that have been chosen."""
    record = RunRecord.load(path)
    summary = Summary.load(path)
    running = record.status == "running" and OutputFolder(path).is_running()
    if summary is not None and summary.title:
        out.print(summary.title, style="bold", highlight=False)
    print_line(out, _status(record, running))
    if at:
        print_places(out, path, at)
        return
    if summary is None or record.status != "finished":
        _print_last_state(out, path, record)
    if summary is not None:
        print_results(out, summary)
        _print_liquid_left(out, summary)
        for line in cautions(path, summary):
            print_line(out, line, style="yellow")
    if summary is not None and not (path / HISTORY_NAME).is_file():
        text = f"{path / HISTORY_NAME} is missing: no figures over time, and nothing to look at"
        print_line(out, text, style="yellow")
    print_along(out, path, summary)
    _print_remarks(out, path, summary)
    _print_cracks(out, path, summary)
    _print_effort(out, record, summary)
    if record.status == "failed":
        print_line(out, f"what happened: {path / LOG_NAME}")
    if figures:
        _print_figures(out, path)


def how_it_ended(record: RunRecord) -> str:
    """One line: how a run that has ended stands."""
    return _status(record, running=False)


def _status(record: RunRecord, running: bool) -> str:
    """One line: how the run stands."""
    how = record.status
    if how == "running" and not running:
        how = "ended without a word (killed or aborted)"
    facts = f"on {record.ranks} rank{'s' if record.ranks > 1 else ''}"
    seconds = sum(record.wall_time.values())
    if seconds:
        facts = f"in {duration(seconds)} {facts}"
    if record.resumed:
        times = "once" if record.resumed == 1 else f"{record.resumed} times"
        facts += f", resumed {times}"
    return f"{how} {facts}" + (f": {record.reason}" if record.reason else "")


def _print_remarks(out: Console, path: Path, summary: Summary | None) -> None:
    """What is worth a look."""
    found = remarks_of(path, summary)
    if not found:
        return
    print_line(out, "What to look at", "bold")
    lines = [
        (remark, finely(remark.value, remark.unit, remark.name, remark.resolution))
        for remark in found
    ]
    what, value = (
        max(len(text) for text in texts)
        for texts in zip(*((remark.what, text) for remark, text in lines), strict=True)
    )
    for remark, text in lines:
        start = f"{remark.what:<{what}}  {text:>{value}}  "
        for line in wrapped(out, remark.where, start):
            print_line(out, line)
    out.print()


def _print_cracks(out: Console, path: Path, summary: Summary | None) -> None:
    """Where the strand may crack, which roll carries most, reheat, end of the pool; with maps."""
    found = crack_places(path, summary)
    if found is None:
        return
    if found.ranking or found.nowhere:
        print_line(out, "Where it may crack", "bold")
        wide = [max((len(row[i]) for row in found.ranking), default=0) for i in range(3)]
        for name, value, less, where in found.ranking:
            start = f"{name:<{wide[0]}}  {value:>{wide[1]}}  {less:>{wide[2]}}  "
            print_list(out, start, [where])
        if found.nowhere:
            print_line(out, found.nowhere)
        out.print()
    if found.others:
        print_line(out, found.title, "bold")
        widest = max(len(what) for what, _ in found.others)
        for what, where in found.others:
            print_list(out, f"{what:<{widest}}  ", [where])
        out.print()


def _print_liquid_left(out: Console, summary: Summary) -> None:
    """Say that a strand that has left its mould is not solid where the run ends."""
    found, end = summary.quantities, summary.quantities.get("position")
    exit_ = summary.mould_exit
    length = found.get("metallurgical_length")
    if end is None or exit_ is None or end.value <= exit_ * (1 + ROUNDING):
        return
    if "solidus" not in found or (length is not None and math.isfinite(length.value)):
        return
    core = found.get("liquid_end")
    ended = core is not None and math.isfinite(core.value)
    from_ = said(core.value, "m", ".4g", "liquid_end") if ended and core else ""
    what = f"no longer liquid from {from_} on, mushy" if from_ else "liquid"
    at = said(end.value, "m", ".4g", "position")
    print_line(out, f"not solid at the end of the run, at {at}: its core is {what}")


def _print_last_state(out: Console, path: Path, record: RunRecord) -> None:
    """The last row of the history and the last checkpoint of a run that has not finished."""
    try:
        table = read_history(path / HISTORY_NAME)
    except InputError:
        print_line(out, "no step has been taken yet")
        return
    if table.empty:
        print_line(out, "no step has been taken yet")
        return
    row = {str(name): float(value) for name, value in table.iloc[-1].items()}
    quantities = last_quantities(row, table.attrs["units"])
    last = empty_table(f"Last of {len(table)} steps", "quantity", "castfem", "unit")
    for label, value, unit, *_ in result_rows(Summary("", record.status, quantities), {}):
        last.add_row(label, value, unit)
    out.print(last, "", highlight=False)
    if "time" in record.reached:
        at = f"t = {record.reached['time']:.6g} s"
        if "position" in record.reached:
            position = place_said(record.reached["position"], beyond=math.inf)
            at += f", {position} below the meniscus"
        print_line(out, f"last checkpoint at {at}; continue from it with --resume")


def _print_effort(out: Console, record: RunRecord, summary: Summary | None) -> None:
    """Steps, wall time by stage, memory."""
    if summary is not None and summary.steps:
        counts = [f"{_step(name)} {number:.6g}" for name, number in summary.steps.items()]
        print_list(out, "steps: ", counts)
    if record.wall_time:
        total = sum(record.wall_time.values())
        long = {k: v for k, v in record.wall_time.items() if v >= _BRIEF * total}
        stages = [
            f"{k.replace('_', ' ')} {v:.2f} s"
            for k, v in sorted(long.items(), key=lambda item: -item[1])
        ]
        rest = total - sum(long.values())
        print_list(out, "wall time: ", [*stages, *([f"the rest {rest:.2f} s"] if rest else [])])
        written = record.wall_time.get("output", 0.0)
        if written > max(_MUCH * total, _FELT):
            print_line(
                out,
                f"{written / total:.0%} of the time went into files: write the fields less often "
                "(output.every), fewer of them (output.fields), checkpoints more seldom "
                "(output.checkpoint_every)",
                style="yellow",
            )
    if record.memory_mb is not None:
        print_line(out, f"memory: {record.memory_mb:.0f} MB")


def _step(name: str) -> str:
    """What is counted, as in "Newton iterations, mechanics", without the comma."""
    return name.replace("_", " ").replace(", ", " of the ")


def _print_figures(out: Console, path: Path) -> None:
    """Draws the figures and says where they are."""
    from castfem.post.plots.figures import draw_figures

    try:
        drawn = draw_figures(path)
    except Exception as error:  # the run is what it is, whatever becomes of its pictures
        print_line(out, f"figures: {said_in_a_line(error)}", style="yellow")
        return
    if drawn:
        print_list(out, f"figures in {drawn[0].parent}: ", [figure.name for figure in drawn])
