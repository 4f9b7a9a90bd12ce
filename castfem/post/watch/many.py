"""A look at all runs of a sweep."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from castfem.base.errors import InputError
from castfem.post.watch.run_status import FAILED, FINISHED, RUNNING, Look, Watcher
from castfem.runs.output.run_record import RUN_NAME, RunRecord
from castfem.studies.sweep.plan import brief
from castfem.studies.sweep.record import Entry, Record

WAITING = "waiting"
PATIENCE = 60.0  # s without a run at work, after which a sweep is taken for ended


@dataclass(frozen=True, slots=True)
class Row:
    """A run of a sweep.

    Attributes:
        name: Of its folder.
        label: What it is called by what is varied.
        look: How it stands; its state may be "waiting".
        seconds: How long it took, if it has ended.
    """

    name: str
    label: str
    look: Look
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Overview:
    """A sweep as it stands.

    Attributes:
        rows: Its runs.
        idle: How long no run has been at work, s.
        patience: How long none may be, before nothing more is waited for, s.
    """

    rows: tuple[Row, ...]
    idle: float
    patience: float = PATIENCE

    def count(self, state: str) -> int:
        """Number of runs in a state."""
        return sum(row.look.state == state for row in self.rows)

    @property
    def complete(self) -> bool:
        """Whether all runs have finished or failed."""
        return self.count(FINISHED) + self.count(FAILED) == len(self.rows)

    @property
    def ended(self) -> bool:
        """Whether nothing more is to be seen: all have ended, or none is at work any more."""
        return self.complete or self.idle > self.patience

    @property
    def left(self) -> float:
        """Time the sweep will still take, s, by its runs so far; NaN before one has ended."""
        took = [row.seconds for row in self.rows if row.look.state == FINISHED and row.seconds]
        at_work = [row.look.left for row in self.rows if row.look.state == RUNNING]
        if not took or not at_work:
            return math.nan
        mean = sum(took) / len(took)
        rest = sum(mean if math.isnan(one) else one for one in at_work)
        waiting = len(self.rows) - self.count(FINISHED) - self.count(FAILED) - len(at_work)
        return (rest + mean * waiting) / len(at_work)


class SweepWatcher:
    """Looks at the runs of a sweep again and again.

    Args:
        folder: Of the sweep.
        clock: Seconds that only grow.
        patience: How long no run may be at work, before nothing more is waited for, s.
    """

    def __init__(
        self,
        folder: Path,
        clock: Callable[[], float] = time.monotonic,
        patience: float = PATIENCE,
    ) -> None:
        self.folder, self._clock, self._patience = folder, clock, patience
        self._watchers: dict[str, Watcher] = {}
        self._ended: dict[str, tuple[Entry, Row]] = {}
        self._busy = clock()

    def look(self) -> Overview:
        """How the sweep stands now.

        Raises:
            InputError: Its record is damaged.
        """
        rows = tuple(self._row(name, entry) for name, entry in Record(self.folder).entries.items())
        now = self._clock()
        if any(row.look.state == RUNNING for row in rows):
            self._busy = now
        return Overview(rows, now - self._busy, self._patience)

    def _row(self, name: str, entry: Entry) -> Row:
        """One run; what has been noted as ended is not looked at again."""
        known = self._ended.get(name)
        if known is not None and known[0] == entry:
            return known[1]
        label = entry.label or ", ".join(brief(entry.given)) or name
        row = Row(name, label, self._look(name, entry), entry.seconds)
        if entry.physics or entry.message:
            self._ended[name] = (entry, row)
        return row

    def _look(self, name: str, entry: Entry) -> Look:
        """How a run stands; of what its record and the sweep's say the sweep's holds if noted."""
        folder = self.folder / name
        look = Look(WAITING, "", RunRecord(status=WAITING))
        if (folder / RUN_NAME).is_file():
            watcher = self._watchers.setdefault(name, Watcher(folder, self._clock))
            try:
                look = watcher.look()
            except InputError as error:
                look = replace(look, messages=error.problems)
        if entry.message:
            return replace(look, state=FAILED, record=replace(look.record, reason=entry.message))
        if entry.physics:
            return replace(look, state=FINISHED)
        if look.state == FAILED:  # in an earlier call, or its sweep was ended before it was noted
            return replace(look, state=WAITING)
        return look
