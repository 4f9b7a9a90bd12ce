"""Progress of a run: a bar on a terminal, lines elsewhere, nothing if quiet.

A step costs two comparisons and one reading of the clock, unless an update is due.
"""

from __future__ import annotations

import logging
import math
import re
import sys
import time
from typing import TYPE_CHECKING

from castfem.base.log import FILE_ONLY

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

_SHARE = 0.05  # fraction of the length between two lines
_LINE = re.compile(r" *\d+ %  [\d.]+ of [\d.]+ [a-z ]+?  .* elapsed [\d:]+  left ([\d:]+)")
_logger = logging.getLogger("castfem.base.progress")


class Progress:
    """Shows how far the slice has come down the strand; for rank 0 only.

    Args:
        verbosity: Negative shows nothing.
        terminal: Whether to draw a bar; by default if stderr is a terminal.
        unit: Unit of the progress; "s" for slices that are followed together.
    """

    def __init__(self, verbosity: int = 0, terminal: bool | None = None, unit: str = "m") -> None:
        self._unit = unit
        self._shown = verbosity >= 0
        self._terminal = sys.stderr.isatty() if terminal is None else terminal
        self._bar: Bar | None = None
        self._task: TaskID | None = None
        self._total = self._from = self._position = 0.0
        self._begun = self._next_picture = self._last_line = 0.0
        self._next_share = _SHARE
        self._steps = self._newton = 0
        self._lined = -1  # steps at the last line
        self._state = (0.0, 0, 0.0, "")
        self._pace: tuple[float, float] | None = None
        self._warned = False

    def start(self, total_length: float, position: float = 0.0) -> None:
        """Begin a run to `total_length` (m) at a position, which is not 0 m for a resumed run."""
        self._total, self._from, self._position = total_length, position, position
        self._begun = self._last_line = time.perf_counter()
        self._next_picture = 0.0
        self._next_share = _mark_after(_share(position, total_length))
        self._steps = self._newton = 0
        self._lined = -1
        self._pace, self._warned = None, False
        if self._shown and self._terminal:
            self._bar = _bar(self._unit)
            self._task = self._bar.add_task("", total=total_length, text="")
            self._bar.update(self._task, completed=position)
            self._bar.start()

    def update(
        self, position: float, time_s: float, newton: int, step: float, note: str = ""
    ) -> None:
        """Update the progress after a step.

        Args:
            position: Position of the slice, m from the meniscus.
            time_s: Time since the meniscus, s.
            newton: Newton iterations of the step; 0 if they are not counted.
            step: Length of the step, s.
            note: A short remark, such as the cooling zone.
        """
        self._position = position
        self._steps += 1
        self._newton += newton
        self._state = (time_s, newton, step, note)
        now = time.perf_counter()
        if not self._warned:
            self._foresee(now)
        if self._bar is not None and now >= self._next_picture:
            self._next_picture = now + 0.1
            self._draw()
        since = now - self._last_line
        if since >= 10.0 or (since >= 1.0 and _share(position, self._total) >= self._next_share):
            self._line(now)

    def _foresee(self, now: float) -> None:
        """Warn, once and early, about a run that takes hours at its present speed.

        The speed is measured between 3 and 10 s, since a run begins with short steps.
        """
        if self._pace is None:
            if now - self._begun >= 3.0:
                self._pace = now, self._position
            return
        since, place = self._pace
        if now - self._begun < 10.0 or not self._position > place:
            return
        self._warned = True
        left = (self._total - self._position) * (now - since) / (self._position - place)
        if left > 3600.0:
            _logger.warning(
                "at this rate the run takes about %.1f more hours; Ctrl-C stops it and --resume "
                "continues it; larger cells, steps and coupling windows (--accuracy coarse) or a "
                "shorter casting.length make it faster",
                left / 3600.0,
            )

    def stop(self) -> None:
        """Stop with the last position shown; may be called twice."""
        if self._total == 0.0:
            return
        if self._bar is not None:
            self._draw()
            self._bar.stop()
            self._bar = None
        if self._lined != self._steps:
            self._line(time.perf_counter())
        self._total = 0.0

    def _draw(self) -> None:
        assert self._bar is not None and self._task is not None
        _, newton, step, note = self._state
        solved = f"Newton {newton}, " if self._newton else ""
        text = f"{solved}step {_duration(step)}  {note}"
        self._bar.update(self._task, completed=self._position, text=text, refresh=True)

    def _line(self, now: float) -> None:
        """Log a line; only to the file while a bar is drawn, or if quiet."""
        share = _share(self._position, self._total)
        self._last_line = now
        self._lined = self._steps
        self._next_share = _mark_after(share)
        time_s, _, step, note = self._state
        elapsed = now - self._begun
        way = self._position - self._from
        left = elapsed * (self._total - self._position) / way if way > 0.0 else 0.0
        solved = f"Newton {self._newton / self._steps:.1f} a step  " if self._newton else ""
        text = (
            f"{100.0 * share:3.0f} %  {self._position:.3f} of {self._total:.3f} {self._unit}  "
            f"t = {time_s:.3f} s  step {_duration(step)}  {self._steps} steps  "
            f"{solved}elapsed {clock(elapsed)}  left {clock(left)}  {note}"
        )
        quiet = self._terminal or not self._shown
        _logger.info("%s", text.rstrip(), extra=FILE_ONLY if quiet else None)


def time_left(text: str) -> float | None:
    """Remaining time, s, from a progress line; None for any other message."""
    found = _LINE.match(text)
    if found is None:
        return None
    seconds = 0.0
    for part in found[1].split(":"):
        seconds = 60.0 * seconds + float(part)
    return seconds


def _share(position: float, total: float) -> float:
    return position / total if total > 0.0 else 0.0


def _mark_after(share: float) -> float:
    """Return the next fraction at which a line is due."""
    return (math.floor(share / _SHARE + 1e-6) + 1) * _SHARE * (1.0 - 1e-9)


def clock(seconds: float) -> str:
    """Return a duration as 0:07 or 1:02:03."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"


def _duration(seconds: float) -> str:
    """Return a step as "50 ms" or "1.2 s"."""
    return f"{seconds:.3g} s" if seconds >= 0.9995 else f"{1e3 * seconds:.3g} ms"


def _bar(unit: str) -> Bar:
    """Return the terminal bar: position, fraction, remaining time, and a text."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    return Bar(
        TextColumn("{task.completed:.3f} of {task.total:.3f} " + unit),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %  left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
        console=Console(stderr=True),
        auto_refresh=False,  # it would need its own thread
    )
