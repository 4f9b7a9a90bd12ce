"""Display of running runs: in a terminal, and as a report that a browser reloads at intervals."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError
from castfem.base.shown_units import shown_in
from castfem.base.table import FAILED as RED
from castfem.base.table import Table
from castfem.post.compare.runs import Run, read_runs
from castfem.post.html.page import AtWork, Progress, rendered
from castfem.post.watch.status import (
    COLUMNS,
    FAILED,
    FINISHED,
    KILLED,
    PATIENCE,
    RUNNING,
    WAITING,
    RunStatus,
    SweepStatus,
    SweepWatcher,
    Watcher,
    brief,
    counts,
    ending,
    left,
    line,
    percent,
    results,
    unfinished,
    where,
)
from castfem.runs.output.run_record import RUN_NAME
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import derived
from castfem.runs.results.run_case import units_of_run
from castfem.studies.sweep.plan import shortened
from castfem.studies.sweep.record import SWEEP_NAME

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live


@dataclass(frozen=True, slots=True)
class Viewing:
    """Settings of the display of runs."""

    #: console of the display: live on a terminal, otherwise a line at intervals
    console: Console
    every: float  #: interval between two updates, s
    page: Page | None = None  #: rewritten at each update for which it is due
    wait: bool = False  #: wait for runs that have not started, or that are to be resumed
    sleep: Callable[[float], None] = time.sleep  #: waits for a number of seconds

    def say(self, text: str) -> None:
        """Print a line as it is."""
        self.console.print(text, highlight=False, soft_wrap=True, markup=False)


def watch(folder: Path, viewing: Viewing) -> bool:
    """Show a run, or the runs of a sweep, until they have ended.

    Args:
        folder: Folder of the run or the sweep.
        viewing: Settings of the display.

    Returns:
        Whether the run, or all runs of the sweep, have ended well.
    """
    _until_begun(folder, viewing)
    show = _watch_sweep if (folder / SWEEP_NAME).is_file() else _watch_run
    return show(folder, viewing)


def _until_begun(folder: Path, viewing: Viewing) -> None:
    """Wait for a run or a sweep in a folder, if requested."""
    announced = False
    while not any((folder / name).is_file() for name in (SWEEP_NAME, RUN_NAME)):
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is not a folder")
        if not viewing.wait:
            what = "holds no run of castfem" if folder.is_dir() else "no such folder"
            raise InputError(f"{folder}: {what}; --wait waits for one to begin")
        if not announced:
            viewing.say(f"{folder}: no run has begun there; waiting for one")
        announced = True
        viewing.sleep(viewing.every)


def _watch_run(folder: Path, viewing: Viewing) -> bool:
    watcher, name, console = Watcher(folder), folder.resolve().name, viewing.console
    status = watcher.status()
    stopped = False  # whether the stop has been reported
    with _Screen(console) as screen, shown_in(units_of_run(folder)):
        while True:
            if viewing.page is not None:
                viewing.page.write_run(status)
            if status.has_ended(viewing.wait):
                break
            if status.state == RUNNING or not stopped:
                screen.show(partial(picture, status), line(name, status))
            stopped = _say_stopped(folder, status, stopped, viewing)
            viewing.sleep(viewing.every)
            status = watcher.status()
        screen.show(partial(picture, status), line(name, status))
    viewing.say(ending(folder, status))
    return status.state == FINISHED


def _say_stopped(folder: Path, status: RunStatus, before: bool, viewing: Viewing) -> bool:
    """Report once that an awaited run is not running; return whether it is not."""
    if status.state != RUNNING and not before:
        viewing.say(f"{ending(folder, status)}; waiting for it to be resumed")
    return status.state != RUNNING


def _watch_sweep(folder: Path, viewing: Viewing) -> bool:
    watcher = SweepWatcher(folder, patience=math.inf if viewing.wait else PATIENCE)
    console = viewing.console
    with _Screen(console) as screen:
        while True:
            found = watcher.status()
            first = next((r.name for r in found.rows if r.status.quantities), "")
            with shown_in(units_of_run(folder / first)):
                if viewing.page is not None:
                    viewing.page.write_sweep(found)
                screen.show(
                    partial(overview, found, max(5, console.height - 8)),
                    f"{folder.resolve().name}: {counts(found)}",
                    [line(r.name, r.status) for r in found.rows if r.status.state == RUNNING],
                )
            if found.ended:
                break
            viewing.sleep(viewing.every)
    for text in unfinished(found):
        viewing.say(text)
    return found.count(FINISHED) == len(found.rows)


class _Screen:
    """A display that replaces the previous one on a terminal; lines elsewhere."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live: Live | None = None

    def __enter__(self) -> _Screen:
        if self._console.is_terminal:
            from rich.live import Live

            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def show(
        self, drawn: Callable[[], RenderableType], text: str, further: list[str] | None = None
    ) -> None:
        """Show the display, or the lines where there is no terminal."""
        if self._live is not None:
            self._live.update(drawn(), refresh=True)
            return
        for one in (text, *(further or ())):
            self._console.print(one, highlight=False, soft_wrap=True, markup=False)
        self._console.file.flush()


def picture(status: RunStatus) -> RenderableType:
    """One run: its progress, results of its last row, and the last messages of its log."""
    from rich.console import Group
    from rich.progress_bar import ProgressBar
    from rich.table import Table as Grid
    from rich.text import Text

    head = Grid.grid(padding=(0, 2, 0, 0))
    remaining = f"  left {left(status)}" if left(status) else ""
    share = 0.0 if math.isnan(status.share) else status.share
    bar = ProgressBar(1.0, share, width=30)
    head.add_row(status.state, bar, f"{where(status)}  {percent(status)}{remaining}")
    rows = results(status)
    found = Table((), rows, words=(0, 2)).lines() if rows else []
    messages = (
        Text(message, style="dim", overflow="ellipsis", no_wrap=True) for message in status.messages
    )
    return Group(Text(status.title, style="bold"), head, *map(Text, found), *messages)


def overview(found: SweepStatus, most: int) -> RenderableType:
    """The runs of a sweep, one line each; if they are too many, running ones first."""
    from rich.console import Group
    from rich.text import Text

    order = {RUNNING: 0, KILLED: 1, "interrupted": 1, FAILED: 2, FINISHED: 3, WAITING: 4}
    shown = found.rows
    if len(shown) > most:
        shown = tuple(sorted(shown, key=lambda row: order[row.status.state])[:most])
    rows = []
    for row in shown:
        status, values = row.status, brief(row.status)
        columns = [values.get(word, "") for word in COLUMNS.values()]
        rows.append((shortened(row.label), status.state, percent(status), *columns, left(status)))
    marks = {(i, -1): RED for i, row in enumerate(shown) if row.status.state in (FAILED, KILLED)}
    rest = len(found.rows) - len(shown)
    notes = [f"... and {rest} more"] if rest else []
    heads = ("run", "", "way", *COLUMNS.values(), "left")
    table = Table(heads, rows, words=(0, 1), notes=notes, marks=marks)
    lines = (Text(text, style=style, no_wrap=True) for text, style in table.styled())
    return Group(*lines, Text(counts(found), style="bold"))


class Page:
    """A file that is rewritten until the runs have ended.

    Args:
        folder: Folder of the run or the sweep.
        target: The file.
        every: Interval between two versions, s; longer if writing takes long.
        clock: Monotonic time, s.
        wait: Whether a killed or interrupted run is expected to be resumed.
    """

    def __init__(
        self,
        folder: Path,
        target: Path,
        every: float,
        clock: Callable[[], float] = time.monotonic,
        wait: bool = False,
    ) -> None:
        self.folder, self.target, self._every, self._wait = folder, target, every, wait
        self._clock, self._next = clock, -math.inf

    def write_run(self, status: RunStatus) -> None:
        """Write the page of one run if it is due, or if the run has ended."""
        ended = status.has_ended(self._wait)
        if not ended and self._clock() < self._next:
            return
        state = RUNNING if status.state == RUNNING else ending(self.folder, status)
        run = Run(self.folder, self.folder.resolve().name, self._summary(status))
        head = self._head(status.title, state, ended, (_progress("", status),), status.messages)
        self._write([run], None if status.state == FINISHED else head)

    def write_sweep(self, found: SweepStatus) -> None:
        """Write the page of a sweep: all runs at the top, finished ones below."""
        if not found.ended and self._clock() < self._next:
            return
        try:
            runs = read_runs([self.folder])
        except InputError:  # fewer than two have finished
            runs = []
        title = f"{self.folder.resolve().name}: {len(found.rows)} runs"
        states = dict.fromkeys(row.status.state for row in found.rows)
        status = ", ".join(f"{found.count(state)} {state}" for state in states)
        progress = tuple(_progress(row.label, row.status) for row in found.rows)
        head = self._head(title, status, found.ended, progress)
        self._write(runs, None if runs and found.count(FINISHED) == len(found.rows) else head)

    def _summary(self, status: RunStatus) -> Summary:
        """The results of an ended run; before that, those of its last row."""
        summary = None if status.state == RUNNING else Summary.load(self.folder)
        found = summary or Summary(status.title, status.state, status.quantities)
        more = derived(self.folder, found)
        return replace(found, quantities={**found.quantities, **more})

    def _head(
        self,
        title: str,
        status: str,
        ended: bool,
        runs: tuple[Progress, ...],
        messages: tuple[str, ...] = (),
    ) -> AtWork:
        now = datetime.now().isoformat(sep=" ", timespec="seconds")
        again = 0 if ended else max(1, round(self._every))
        return AtWork(title, status, now, again, runs, messages)

    def _write(self, runs: list[Run], head: AtWork | None) -> None:
        """Write the page and schedule the next one."""
        begun = self._clock()
        write_text(self.target, rendered(runs, head), durable=False)
        now = self._clock()
        self._next = now + max(self._every, 10.0 * (now - begun))


def _progress(label: str, status: RunStatus) -> Progress:
    """Progress of a run for the page."""
    results = ", ".join(f"{word} {text}" for word, text in brief(status).items())
    share = None if math.isnan(status.share) else status.share
    return Progress(label, status.state, share, where(status), results, left(status))
