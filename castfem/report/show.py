"""What `castfem show` prints about a run, finished or not, and the figures it draws."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.errors import CastfemError, InputError
from castfem.output.chosen_units import units_of_run
from castfem.output.folder import LOG_NAME, MAPS_NAME, ROWS_NAME, OutputFolder
from castfem.output.history import HISTORY_NAME, read_history
from castfem.output.run_record import RunRecord
from castfem.output.summary import SIGNS, Comparison, Quantity, Summary, from_si, unit_of_difference
from castfem.report.headline import ENDS
from castfem.report.numbers import (
    cells,
    duration,
    finely,
    rounded,
    shown,
    unit_shown,
    with_error,
)
from castfem.report.place_tables import print_along, print_places
from castfem.report.remarks import remarks_of
from castfem.report.wide_gap import wide_gap
from castfem.results.labels import last_quantities
from castfem.values.same_place import ROUNDING
from castfem.values.shown_units import (
    Scale,
    difference_of,
    label_shown,
    place_said,
    plain_unit,
    said,
    scale_of,
    shown_in,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_NARROW, _WIDE = "_narrow_face", "_mid_face"  # ends of names
_BRIEF = 0.01  # of the wall time; a stage that takes less is not named
_MUCH, _FELT = 0.25, 5.0  # of the wall time, s; files that take more are told of
_LEAST, _INDENT = 42, 11  # characters to leave behind a start; else the next lines begin here
UNCHANGED = "of the unchanged case"
"""What stands in place of a difference where the case is not that of the reference any more."""


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
    _print(out, _status(record, running))
    if at:
        print_places(out, path, at)
        return
    if summary is None or record.status != "finished":
        _print_last_state(out, path, record)
    if summary is not None:
        _print_summary(out, summary)
        _print_liquid_left(out, summary)
        if told := wide_gap(path, summary):
            _print(out, told, style="yellow")
    if summary is not None and not (path / HISTORY_NAME).is_file():
        text = f"{path / HISTORY_NAME} is missing: no figures over time, and nothing to look at"
        _print(out, text, style="yellow")
    print_along(out, path, summary)
    _print_remarks(out, path, summary)
    _print_cracks(out, path, summary)
    _print_effort(out, record, summary)
    if record.status == "failed":
        _print(out, f"what happened: {path / LOG_NAME}")
    if figures:
        _print_figures(out, path)


def _print(out: Console, text: str, style: str = "") -> None:
    """A line that is neither wrapped nor coloured by its content: paths stay whole."""
    out.print(text, style=style or None, highlight=False, soft_wrap=True, markup=False)


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


def _table(title: str, *columns: str) -> Table:
    """An empty table; the first and the last column are words, the others numbers."""
    from rich import box
    from rich.table import Table

    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for number, name in enumerate(columns):
        words = number == 0 or name in ("unit", "")
        table.add_column(name, justify="left" if words else "right", no_wrap=number > 0)
    return table


def _print_summary(out: Console, summary: Summary) -> None:
    """The results, each with what others have found, and the balances."""
    sources: dict[str, str] = {}
    rows = _rows(summary, sources)
    others = ("reference", "difference", "") if summary.references else ()
    table = _table("Results", "quantity", "castfem", "unit", *others)
    for row in rows:
        table.add_row(*row[: 3 + len(others)])
    if rows:
        out.print(table, highlight=False)
    for source, mark in sources.items():
        for line in _wrapped(out, source, f"{mark} "):
            _print(out, line)
    keys = dict.fromkeys(k for c in summary.references for k in c.reference.changed)
    if keys:
        text = f"the case of these references had other values of {', '.join(keys)}"
        for line in _wrapped(out, text, f"{UNCHANGED}: "):
            _print(out, line)
    for line in summary.unchecked:
        for part in _wrapped(out, line, "from memory, not compared with its source: "):
            _print(out, part)
    out.print()
    for name, terms in summary.balances.items():
        table = _table(f"Balance of {name.replace('_', ' ')}", "term", "value", "unit")
        for quantity in terms.values():
            table.add_row(label_shown(quantity.label), *cells("", quantity))
        out.print(table, "", highlight=False)


def _print_remarks(out: Console, path: Path, summary: Summary | None) -> None:
    """What is worth a look."""
    found = remarks_of(path, summary)
    if not found:
        return
    _print(out, "What to look at", "bold")
    lines = [(remark, finely(remark.value, remark.unit, remark.name)) for remark in found]
    what, value = (
        max(len(text) for text in texts)
        for texts in zip(*((remark.what, text) for remark, text in lines), strict=True)
    )
    for remark, text in lines:
        start = f"{remark.what:<{what}}  {text:>{value}}  "
        for line in _wrapped(out, remark.where, start):
            _print(out, line)
    out.print()


def _print_cracks(out: Console, path: Path, summary: Summary | None) -> None:
    """Where the strand may crack, what reheats, and where its pool ends; of a run with maps."""
    if not any((path / name).is_file() for name in (MAPS_NAME, ROWS_NAME)):
        return
    from castfem.output.surface_maps import SurfaceMaps
    from castfem.report.cracks import CrackReport, pool_end

    report = CrackReport.of(SurfaceMaps(path))
    ranking = list(report.ranking())
    if ranking:
        _print(out, "Where it may crack", "bold")
        wide = [max(len(row[i]) for row in ranking) for i in range(3)]
        for name, value, less, where in ranking:
            start = f"{name:<{wide[0]}}  {value:>{wide[1]}}  {less:>{wide[2]}}  "
            _print_list(out, start, [where])
        out.print()
    lines = [*report.reheats(), *([] if summary is None else pool_end(summary, report.stations))]
    if lines:
        _print(out, "Reheat and end of the pool", "bold")
        widest = max(len(what) for what, _ in lines)
        for what, where in lines:
            _print_list(out, f"{what:<{widest}}  ", [where])
        out.print()


def _wrapped(out: Console, text: str, start: str) -> list[str]:
    """A text behind its start, its further lines below; in one line unless it is for a screen."""
    if not out.is_terminal:
        return [start + text]
    indent = len(start) if out.width - len(start) >= _LEAST else _INDENT
    lines = textwrap.wrap(
        text,
        out.width,
        initial_indent=start,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines or [start]


def _rows(summary: Summary, sources: dict[str, str]) -> list[tuple[str, ...]]:
    """Label, ours, unit, theirs, difference, source; one row a reference or a lone quantity.

    `sources` is filled with the mark of each source and its note.
    """
    rows: list[tuple[str, ...]] = []
    referred = {c.reference.quantity for c in summary.references}
    for name, quantity in _ends_first(summary.quantities):
        twin = summary.quantities.get(name.replace(_NARROW, _WIDE))
        if name.endswith(_NARROW) and name not in referred and _same(name, quantity, twin):
            continue
        label, twin = quantity.label, summary.quantities.get(name.replace(_WIDE, _NARROW))
        if name.endswith(_WIDE) and name.replace(_WIDE, _NARROW) not in referred:
            same = _same(name, quantity, twin)
            label = label.replace("mid-face", "both faces") if same else label
        mine = [c for c in summary.references if c.reference.quantity == name and not c.missing]
        if all(c.reference.at is not None for c in mine):
            rows.append((label_shown(label), *cells(name, quantity), "", "", ""))
        rows.extend(_comparison_row(c, label, sources, quantity) for c in mine)
    for comparison in summary.references:
        if comparison.missing:
            label = f"{comparison.reference.quantity} ({comparison.missing})"
            rows.append(_comparison_row(comparison, label, sources))
    return rows


def _ends_first(quantities: Mapping[str, Quantity]) -> list[tuple[str, Quantity]]:
    """The results, ends of the pool first where the strand has come to them."""
    first = [n for n in ENDS if n in quantities and math.isfinite(quantities[n].value)]
    return [(n, quantities[n]) for n in dict.fromkeys((*first, *quantities))]


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
    _print(out, f"not solid at the end of the run, at {at}: its core is {what}")


def _same(name: str, one: Quantity, other: Quantity | None) -> bool:
    """Whether two quantities would be printed alike, as those of the faces of a square."""
    return other is not None and cells(name, one) == cells(name, other)


def _comparison_row(
    comparison: Comparison, label: str, sources: dict[str, str], quantity: Quantity | None = None
) -> tuple[str, ...]:
    """A row in the unit of the reference; at the end of the run with the error of the quantity."""
    reference = comparison.reference
    scale, usual = scale_of(reference.shown_unit, reference.quantity), reference.shown_unit
    unit = scale.unit
    if reference.at is not None:
        label += f", at {1e3 * reference.at:.6g} mm"
    theirs = shown(scale(from_si(reference.value, usual)), unit)
    difference = "met" if comparison.met else _difference(comparison, theirs, scale)
    source = reference.source + (f": {reference.note}" if reference.note else "")
    mark = sources.setdefault(source, f"[{len(sources) + 1}]")
    ours = shown(scale(from_si(comparison.ours, usual)), unit)
    if quantity is not None and quantity.error is not None and reference.at is None:
        error = from_si(quantity.error, unit_of_difference(usual))
        ours = with_error(ours, scale.factor * error)
    return (
        label_shown(label),
        ours,
        unit_shown(unit),
        SIGNS[reference.kind] + theirs,
        difference,
        mark,
    )


def _difference(comparison: Comparison, theirs: str, scale: Scale) -> str:
    """How far ours is from theirs, to the digits of theirs; how far a bound is missed."""
    if comparison.reference.changed:
        return UNCHANGED
    value, relative = scale.factor * comparison.shown_difference, 100 * comparison.relative
    if not math.isfinite(value):
        return ""
    digits = len(theirs.partition(".")[2])
    sign, before = "+", ""
    if comparison.met is False:
        sign, before, value, relative = "", "missed by ", abs(value), abs(relative)
    text = f"{value:{sign}.4g}" if "e" in theirs else f"{rounded(value, digits):{sign}.{digits}f}"
    if difference_of(scale.unit) != scale.unit:
        text += f" {plain_unit(difference_of(scale.unit))}"
    if math.isfinite(relative):
        text += f" ({relative:{sign}.1f} %)"
    return before + text


def _print_last_state(out: Console, path: Path, record: RunRecord) -> None:
    """The last row of the history and the last checkpoint of a run that has not finished."""
    try:
        table = read_history(path / HISTORY_NAME)
    except InputError:
        _print(out, "no step has been taken yet")
        return
    if table.empty:
        _print(out, "no step has been taken yet")
        return
    row = {str(name): float(value) for name, value in table.iloc[-1].items()}
    quantities = last_quantities(row, table.attrs["units"])
    last = _table(f"Last of {len(table)} steps", "quantity", "castfem", "unit")
    for label, value, unit, *_ in _rows(Summary("", record.status, quantities), {}):
        last.add_row(label, value, unit)
    out.print(last, "", highlight=False)
    if "time" in record.reached:
        at = f"t = {record.reached['time']:.6g} s"
        if "position" in record.reached:
            position = place_said(record.reached["position"], beyond=math.inf)
            at += f", {position} below the meniscus"
        _print(out, f"last checkpoint at {at}; continue from it with --resume")


def _print_effort(out: Console, record: RunRecord, summary: Summary | None) -> None:
    """Steps, wall time by stage, memory."""
    if summary is not None and summary.steps:
        counts = [f"{_step(name)} {number:.6g}" for name, number in summary.steps.items()]
        _print_list(out, "steps: ", counts)
    if record.wall_time:
        total = sum(record.wall_time.values())
        long = {k: v for k, v in record.wall_time.items() if v >= _BRIEF * total}
        stages = [
            f"{k.replace('_', ' ')} {v:.2f} s"
            for k, v in sorted(long.items(), key=lambda item: -item[1])
        ]
        rest = total - sum(long.values())
        _print_list(out, "wall time: ", [*stages, *([f"the rest {rest:.2f} s"] if rest else [])])
        written = record.wall_time.get("output", 0.0)
        if written > max(_MUCH * total, _FELT):
            _print(
                out,
                f"{written / total:.0%} of the time went into files: write the fields less often "
                "(output.every), fewer of them (output.fields), checkpoints more seldom "
                "(output.checkpoint_every)",
                style="yellow",
            )
    if record.memory_mb is not None:
        _print(out, f"memory: {record.memory_mb:.0f} MB")


def _step(name: str) -> str:
    """What is counted, as in "Newton iterations, mechanics", without the comma."""
    return name.replace("_", " ").replace(", ", " of the ")


def _print_list(out: Console, start: str, entries: Sequence[str]) -> None:
    """Entries with commas between them, none of them torn by the end of a line."""
    glued = ", ".join(entry.replace(" ", "\N{NO-BREAK SPACE}") for entry in entries)
    for line in _wrapped(out, glued, start):
        _print(out, line.replace("\N{NO-BREAK SPACE}", " "))


def _print_figures(out: Console, path: Path) -> None:
    """Draws the figures and says where they are."""
    from castfem.plots.figures import draw_figures

    try:
        drawn = draw_figures(path)
    except CastfemError as error:
        _print(out, f"figures: {error}", style="yellow")
        return
    if drawn:
        _print_list(out, f"figures in {drawn[0].parent}: ", [figure.name for figure in drawn])
