"""Runs at work in a terminal: a picture that is drawn anew, or a line at intervals elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.support.progress import clock
from castfem.sweep.record import SWEEP_NAME
from castfem.watch.look import RUNNING, Look, Watcher
from castfem.watch.many import FAILED, FINISHED, WAITING, Overview, SweepWatcher
from castfem.watch.words import COLUMNS, brief, ending, left, line, percent, results, where

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live

    from castfem.watch.page import Page

_STYLES = {FAILED: "red", "killed": "red", "interrupted": "yellow", WAITING: "dim", RUNNING: "bold"}
_FEWEST = 5  # rows of a sweep that are shown, however low the terminal is
_AROUND = 8  # lines about them


def watch(
    folder: Path,
    console: Console,
    every: float,
    page: Page | None = None,
    sleep: Callable[[float], None] = time.sleep,
) -> bool:
    """Show a run, or the runs of a sweep, until they have ended.

    Args:
        folder: Of the run, or of the sweep.
        console: Where to show them: a picture on a terminal, a line at intervals elsewhere.
        every: Time between two looks, s.
        page: Written anew at each look that is due for it.
        sleep: Waits so many seconds.

    Returns:
        Whether the run, or all runs of the sweep, have ended well.

    Raises:
        InputError: The folder holds no run, or a file of it is damaged.
        RunFailure: The page cannot be written.
    """
    show = _watch_sweep if (folder / SWEEP_NAME).is_file() else _watch_run
    return show(folder, console, every, page, sleep)


def _watch_run(
    folder: Path,
    console: Console,
    every: float,
    page: Page | None,
    sleep: Callable[[float], None],
) -> bool:
    """Show one run."""
    watcher, name = Watcher(folder), folder.resolve().name
    look = watcher.look()
    with _Screen(console) as screen:
        while True:
            if page is not None:
                page.write_run(look)
            if look.state != RUNNING:
                break
            screen.show(partial(picture, look), line(name, look))
            sleep(every)
            look = watcher.look()
        screen.show(partial(picture, look), line(name, look))
    console.print(ending(folder, look), highlight=False, soft_wrap=True, markup=False)
    return look.state == FINISHED


def _watch_sweep(
    folder: Path,
    console: Console,
    every: float,
    page: Page | None,
    sleep: Callable[[float], None],
) -> bool:
    """Show all runs of a sweep."""
    watcher = SweepWatcher(folder)
    with _Screen(console) as screen:
        while True:
            found = watcher.look()
            if page is not None:
                page.write_sweep(found)
            screen.show(
                partial(overview, found, max(_FEWEST, console.height - _AROUND)),
                f"{folder.resolve().name}: {counts(found)}",
                [line(r.name, r.look) for r in found.rows if r.look.state == RUNNING],
            )
            if found.ended:
                break
            sleep(every)
    if not found.complete:
        console.print(
            "no run is at work: the rest waits for its turn, or the sweep was stopped; "
            "the same command again goes on with it",
            highlight=False,
        )
    for row in found.rows:
        if row.look.state == FAILED:
            text = f"{row.name}: failed: {row.look.record.reason}"
            console.print(text, highlight=False, soft_wrap=True, markup=False)
    return found.count(FINISHED) == len(found.rows)


class _Screen:
    """A picture that replaces the one before on a terminal; lines elsewhere."""

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
        """Show the picture, or the lines where there is no terminal."""
        if self._live is not None:
            self._live.update(drawn(), refresh=True)
            return
        for one in (text, *(further or ())):
            self._console.print(one, highlight=False, soft_wrap=True, markup=False)
        self._console.file.flush()


def picture(look: Look) -> RenderableType:
    """One run: its way, results of its last row, and the last messages of its log."""
    from rich.console import Group
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    head = Table.grid(padding=(0, 2, 0, 0))
    way = f"{where(look)}  {percent(look)}" + (f"  left {left(look)}" if left(look) else "")
    share = 0.0 if look.share != look.share else look.share
    head.add_row(look.state, ProgressBar(1.0, share, width=30), way)
    body = Table.grid(padding=(0, 2, 0, 0))
    body.add_column()
    body.add_column(justify="right")
    for label, value, unit in results(look):
        body.add_row(Text(label), value, unit)
    return Group(
        Text(look.title, style="bold"),
        head,
        body,
        *(
            Text(message, style="dim", overflow="ellipsis", no_wrap=True)
            for message in look.messages
        ),
    )


def counts(found: Overview) -> str:
    """How many runs of a sweep have finished, are at work, wait, have failed."""
    states = dict.fromkeys((FINISHED, RUNNING, WAITING, *(r.look.state for r in found.rows)))
    parts = [f"{found.count(state)} {state}" for state in states]
    end = "" if found.left != found.left else f", left {clock(found.left)}"
    return f"{len(found.rows)} runs: {', '.join(parts)}{end}"


def overview(found: Overview, most: int) -> RenderableType:
    """The runs of a sweep, a line each; where they are too many, those first that are at work."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    order = {RUNNING: 0, "killed": 1, "interrupted": 1, FAILED: 2, FINISHED: 3, WAITING: 4}
    shown = found.rows
    if len(shown) > most:
        shown = tuple(sorted(shown, key=lambda row: order[row.look.state])[:most])
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("run", overflow="ellipsis", no_wrap=True)
    table.add_column("")
    for name in ("way", *COLUMNS.values(), "left"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in shown:
        look, told = row.look, brief(row.look)
        table.add_row(
            Text(row.label),
            Text(look.state, style=_STYLES.get(look.state, "")),
            percent(look),
            *(told.get(word, "") for word in COLUMNS.values()),
            left(look),
        )
    rest = [Text(f"... and {len(found.rows) - len(shown)} more")] * (len(shown) < len(found.rows))
    return Group(table, *rest, Text(counts(found), style="bold"))
