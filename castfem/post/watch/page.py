"""The page of runs at work: the report, written anew at intervals, that a browser reads again."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError
from castfem.post.compare.runs import Run, read_runs
from castfem.post.html.page import AtWork, Progress, rendered
from castfem.post.watch.status import (
    FINISHED,
    RUNNING,
    RunStatus,
    SweepStatus,
    brief,
    ending,
    left,
    where,
)
from castfem.runs.output.summary import Summary
from castfem.runs.results.headline import derived


class Page:
    """A file that is written anew until the runs have ended.

    Args:
        folder: Of the run, or of the sweep.
        target: The file.
        every: Time between two versions, s; longer where one takes long to make.
        clock: Seconds that only grow.
        wait: A run that was killed or interrupted is expected to be taken up again.
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
        """Write the page of a sweep: all its runs at its head, those that have finished below."""
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
        """The results of a run that has ended; those of the last row before."""
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
        """Write the page, and note when the next one is due."""
        begun = self._clock()
        write_text(self.target, rendered(runs, head), durable=False)
        now = self._clock()
        self._next = now + max(self._every, 10.0 * (now - begun))


def _progress(label: str, status: RunStatus) -> Progress:
    """How far a run has come, as the page has it."""
    results = ", ".join(f"{word} {text}" for word, text in brief(status).items())
    share = None if math.isnan(status.share) else status.share
    return Progress(label, status.state, share, where(status), results, left(status))
