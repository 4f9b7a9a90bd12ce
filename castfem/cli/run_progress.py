"""The progress of all runs of a sweep in one view: bars on a terminal, a line a run elsewhere.

How far a run has come is read from its history, whichever process writes it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.runs.output.history import HISTORY_NAME, last_row
from castfem.studies.sweep.work import Job, Outcome

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID


class View:
    """Tells of the runs as they go.

    Args:
        count: Number of runs in all.
        done: How many of them were finished before.
        quiet: Show nothing but runs that fail.
        terminal: Whether to draw bars; by default if stderr is a terminal.
    """

    def __init__(
        self, count: int, done: int, quiet: bool = False, terminal: bool | None = None
    ) -> None:
        self._count, self._done, self._failed, self._quiet = count, done, 0, quiet
        self._since = time.time()
        self._tasks: dict[str, tuple[Job, TaskID]] = {}
        self._bars: Bars | None = None
        bars = sys.stderr.isatty() if terminal is None else terminal
        if bars and not quiet:
            self._bars = _bars()
            self._all = self._bars.add_task("all runs", total=count, completed=done, text="")
            self._bars.start()

    def begun(self, job: Job) -> None:
        """Tell that a run has begun."""
        if self._bars is not None:
            task = self._bars.add_task(job.name, total=job.case.casting.length, text="")
            self._tasks[job.name] = (job, task)

    def ended(self, job: Job, outcome: Outcome) -> None:
        """Tell how a run has ended."""
        self._done += 1
        self._failed += outcome.failed
        how = f"failed: {outcome.message}" if outcome.failed else "finished"
        line = f"{job.name}: {how} in {outcome.seconds:.1f} s ({self._done} of {self._count})"
        if self._bars is None:
            if not self._quiet or outcome.failed:
                print(line, file=sys.stderr, flush=True)
            return
        _, task = self._tasks.pop(job.name)
        self._bars.remove_task(task)
        if outcome.failed:
            self._bars.console.print(line, style="red", markup=False, highlight=False)
        text = f"{self._failed} failed" if self._failed else ""
        self._bars.update(self._all, completed=self._done, text=text)

    def tick(self) -> None:
        """Look how far the runs have come."""
        if self._bars is None:
            return
        part = 0.0
        for job, task in self._tasks.values():
            length = job.case.casting.length
            position = min(reached(job.folder, self._since), length)
            part += position / length
            self._bars.update(task, completed=position, text=f"{position:.3f} of {length:.3f} m")
        self._bars.update(self._all, completed=self._done + part)
        self._bars.refresh()

    def stop(self) -> None:
        """End the view; may be called twice."""
        if self._bars is not None:
            self._bars.stop()


def reached(folder: Path, since: float = 0.0) -> float:
    """How far the run in a folder has come, m; a history older than `since` is another run's."""
    path = folder / HISTORY_NAME
    try:
        found = None if path.stat().st_mtime < since else last_row(path)
    except (OSError, InputError):
        return 0.0  # not yet there
    return 0.0 if found is None else found[0].get("position", 0.0)


def _bars() -> Bars:
    """Return one bar a run, with the name in front and the time left behind."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    return Bars(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
        console=Console(stderr=True),
        auto_refresh=False,
    )
