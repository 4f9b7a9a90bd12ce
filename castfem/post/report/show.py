"""`castfem show`: the printed report of a run, finished or not, and its figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError, said_in_a_line
from castfem.base.shown_units import place_said, said, shown_in
from castfem.base.table import Table, listed, pairs, say
from castfem.post.report.cautions import cautions
from castfem.post.report.cracks import crack_places
from castfem.post.report.remarks import remarks_of
from castfem.post.report.tables import balance_tables, result_tables, table_along, table_at
from castfem.runs.output.folder import LOG_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.labels import last_quantities
from castfem.runs.results.numbers import duration, finely
from castfem.runs.results.run_case import units_of_run

if TYPE_CHECKING:
    from rich.console import Console


def show(
    folder: Path | str,
    console: Console | None = None,
    *,
    figures: bool = True,
    at: Sequence[float] = (),
) -> bool:
    """Print status, results beside references, balances and cost of a run; draw its figures.

    Args:
        folder: Folder of the run, which may be running, killed or failed.
        console: Console to print on; standard output if None.
        figures: Draw them; an unwritable folder costs a line, not the table.
        at: Positions, m; if given, print only the results there.

    Returns:
        Whether the files of the run are in order, as far as the figures need them.
    """
    from rich.console import Console

    path = Path(folder)
    if not path.is_dir():
        raise InputError(f"{path}: no such folder")
    with shown_in(units_of_run(path)):
        return _show(path, console or Console(), figures=figures, at=at)


def _show(path: Path, out: Console, *, figures: bool, at: Sequence[float]) -> bool:
    """Like `show`, with the units already chosen."""
    record, summary = RunRecord.load(path), Summary.load(path)
    running = record.status == "running" and OutputFolder(path).is_running()
    if summary is not None and summary.title:
        say(out, summary.title, style="bold")
    say(out, _status(record, running))
    if at:
        say(out, table_at(path, at))
        return True
    if summary is None or record.status != "finished":
        say(out, *_last_state(path, record))
    if summary is not None:
        say(out, *result_tables(summary), "")
        for table in balance_tables(summary):
            say(out, table, "")
        say(out, *_liquid_left(summary))
        warnings = cautions(path, summary)
        say(out, *warnings, *([""] if warnings else []), style="yellow")
        if not (path / HISTORY_NAME).is_file():
            text = "is missing: no figures over time and no remarks"
            say(out, f"{path / HISTORY_NAME} {text}", style="yellow")
    if (along := table_along(path, summary)) is not None:
        say(out, along, "")
    say(out, *_remarks(path, summary), *_cracks(path, summary), *_effort(record, summary))
    if warning := slow_output(record):
        say(out, warning, style="yellow")
    if record.memory_mb is not None:
        say(out, f"memory: {record.memory_mb:.0f} MB")
    if record.status == "failed":
        say(out, f"what happened: {path / LOG_NAME}")
    return not figures or draw(path, out)


def how_it_ended(record: RunRecord) -> str:
    """One line on how a run has ended."""
    return _status(record, running=False)


def _status(record: RunRecord, running: bool) -> str:
    how = record.status
    if how == "running" and not running:
        how = "killed or aborted"
    facts = f"on {record.ranks} rank{'s' if record.ranks > 1 else ''}"
    seconds = sum(record.wall_time.values())
    if seconds:
        facts = f"in {duration(seconds)} {facts}"
    if record.resumed:
        times = "once" if record.resumed == 1 else f"{record.resumed} times"
        facts += f", resumed {times}"
    return f"{how} {facts}" + (f": {record.reason}" if record.reason else "")


def _remarks(path: Path, summary: Summary | None) -> Iterator[Table | str]:
    rows = [
        (one.what, finely(one.value, one.unit, one.name, one.resolution), one.where)
        for one in remarks_of(path, summary)
    ]
    if rows:
        yield from (Table((), rows, "Remarks", words=(0, 2)), "")


def _cracks(path: Path, summary: Summary | None) -> Iterator[Table | str]:
    """Crack risk, largest roll load, reheating, solidification end; needs maps."""
    found = crack_places(path, summary)
    if found is None:
        return
    if found.ranking:
        yield from (Table((), found.ranking, "Crack risk", words=(0, 3)), "")
    elif found.nowhere:
        yield from (pairs([("", found.nowhere)], "Crack risk"), "")
    if found.others:
        yield from (pairs(found.others, found.title), "")


def _liquid_left(summary: Summary) -> Iterator[str]:
    """Report a strand that leaves its mould and is not solid at the end of the run."""
    found = summary.quantities
    length = found.get("metallurgical_length")
    if not summary.ends_below_mould:
        return
    if "solidus" not in found or (length is not None and math.isfinite(length.value)):
        return
    what, core = "liquid", found.get("liquid_end")
    if core is not None and math.isfinite(core.value):
        from_ = said(core.value, "m", ".4g", "liquid_end")
        what = f"no longer liquid from {from_} on, mushy"
    at = said(found["position"].value, "m", ".4g", "position")
    yield f"at the end of the run, at {at}, the strand is not solid: its core is {what}"


def _last_state(path: Path, record: RunRecord) -> Iterator[Table | str]:
    """The last row of the history and the last checkpoint of an unfinished run."""
    try:
        table = read_columns(path / HISTORY_NAME)
    except InputError:
        table = None
    if table is None or not len(table):
        yield "no step has been taken yet"
        return
    row = {name: float(table[name][-1]) for name in table}
    last = Summary("", record.status, last_quantities(row, table.attrs["units"]))
    yield from result_tables(last, f"Last of {len(table)} steps")
    if "time" in record.reached:
        at = f"t = {record.reached['time']:.6g} s"
        if "position" in record.reached:
            position = place_said(record.reached["position"], beyond=math.inf)
            at += f", {position} below the meniscus"
        yield f"last checkpoint at {at}; continue from it with --resume"


def _effort(record: RunRecord, summary: Summary | None) -> Iterator[Table]:
    if summary is not None and summary.steps:
        # "Newton iterations, mechanics" is one entry
        names = {n: n.replace("_", " ").replace(", ", " of the ") for n in summary.steps}
        yield listed("steps:", [f"{names[n]} {count:.6g}" for n, count in summary.steps.items()])
    if record.wall_time:
        total = sum(record.wall_time.values())
        stages = sorted(record.wall_time.items(), key=lambda item: -item[1])
        long = {name: value for name, value in stages if value >= 0.01 * total}
        entries = [f"{name.replace('_', ' ')} {value:.2f} s" for name, value in long.items()]
        rest = total - sum(long.values())
        yield listed("wall time:", [*entries, *([f"the rest {rest:.2f} s"] if rest else [])])


def slow_output(record: RunRecord) -> str:
    """A warning if writing files has taken much of the time; "" otherwise."""
    total, written = sum(record.wall_time.values()), record.wall_time.get("output", 0.0)
    if written <= max(0.25 * total, 5.0):
        return ""
    return (
        f"{written / total:.0%} of the time went into files: write the fields less often "
        "(output.every), fewer of them (output.fields), checkpoints less often "
        "(output.checkpoint_every)"
    )


def draw(path: Path, out: Console | None = None) -> bool:
    """Draw the figures of a run; print their names or the error, if there is a console.

    Returns:
        Whether the files of the run could be read.
    """
    from castfem.post.plots.figures import draw_figures

    try:
        drawn = draw_figures(path)
    except Exception as error:  # reason: a failed figure does not affect the finished run
        if out is not None:
            say(out, f"figures: {said_in_a_line(error)}", style="yellow")
        return not isinstance(error, InputError)
    if drawn and out is not None:
        say(out, listed(f"figures in {drawn[0].parent}:", [figure.name for figure in drawn]))
    return True
