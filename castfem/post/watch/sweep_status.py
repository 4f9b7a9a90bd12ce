"""The status of all runs of a sweep, and words on it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.progress import clock as minutes
from castfem.post.watch.run_status import FAILED, FINISHED, KILLED, RUNNING, RunStatus, Watcher
from castfem.runs.output.run_record import RUN_NAME, RunRecord
from castfem.studies.sweep.plan import brief
from castfem.studies.sweep.record import Entry, Record

WAITING = "waiting"
_STOPPED = {KILLED: "killed or aborted", "interrupted": "interrupted", WAITING: "waiting"}
PATIENCE = 60.0  # s without a run at work, after which a sweep is taken for ended


@dataclass(frozen=True, slots=True)
class Row:
    """A run of a sweep."""

    name: str  #: of its folder
    label: str  #: what it is called by what is varied
    status: RunStatus  #: how it stands; its state may be "waiting"
    seconds: float = 0.0  #: how long it took, if it has ended


@dataclass(frozen=True, slots=True)
class SweepStatus:
    """A sweep as it stands."""

    rows: tuple[Row, ...]  #: its runs
    idle: float  #: how long no run has been at work, s
    patience: float = PATIENCE  #: how long none may be, before nothing more is waited for, s

    def count(self, state: str) -> int:
        """Number of runs in a state."""
        return sum(row.status.state == state for row in self.rows)

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
        took = [row.seconds for row in self.rows if row.status.state == FINISHED and row.seconds]
        at_work = [row.status.left for row in self.rows if row.status.state == RUNNING]
        if not took or not at_work:
            return math.nan
        mean = sum(took) / len(took)
        rest = sum(mean if math.isnan(one) else one for one in at_work)
        waiting = len(self.rows) - self.count(FINISHED) - self.count(FAILED) - len(at_work)
        return (rest + mean * waiting) / len(at_work)


class SweepWatcher:
    """Reads the status of the runs of a sweep again and again."""

    def __init__(
        self, folder: Path, clock: Callable[[], float] = time.monotonic, patience: float = PATIENCE
    ) -> None:
        self.folder, self._clock, self._patience = folder, clock, patience
        self._watchers: dict[str, Watcher] = {}
        self._ended: dict[str, tuple[Entry, Row]] = {}
        self._busy = clock()

    def status(self) -> SweepStatus:
        """How the sweep stands now."""
        rows = tuple(self._row(name, entry) for name, entry in Record(self.folder).entries.items())
        now = self._clock()
        if any(row.status.state == RUNNING for row in rows):
            self._busy = now
        return SweepStatus(rows, now - self._busy, self._patience)

    def _row(self, name: str, entry: Entry) -> Row:
        """One run; what has been noted as ended is not read again."""
        known = self._ended.get(name)
        if known is not None and known[0] == entry:
            return known[1]
        label = entry.label or ", ".join(brief(entry.given)) or name
        row = Row(name, label, self._status(name, entry), entry.seconds)
        if entry.physics or entry.message:
            self._ended[name] = (entry, row)
        return row

    def _status(self, name: str, entry: Entry) -> RunStatus:
        """How a run stands; of what its record and the sweep's say the sweep's holds if noted."""
        folder = self.folder / name
        status = RunStatus(WAITING, "", RunRecord(status=WAITING))
        if (folder / RUN_NAME).is_file():
            watcher = self._watchers.setdefault(name, Watcher(folder, self._clock))
            try:
                status = watcher.status()
            except InputError as error:
                status = replace(status, messages=error.problems)
        if entry.message:
            return replace(
                status, state=FAILED, record=replace(status.record, reason=entry.message)
            )
        if entry.physics:
            return replace(status, state=FINISHED)
        if status.state == FAILED:  # in an earlier call, or its sweep was ended before it was noted
            return replace(status, state=WAITING)
        return status


def counts(found: SweepStatus) -> str:
    """How many runs of a sweep have finished, are at work, wait, have failed."""
    states = dict.fromkeys((FINISHED, RUNNING, WAITING, *(r.status.state for r in found.rows)))
    parts = [f"{found.count(state)} {state}" for state in states]
    end = "" if found.left != found.left else f", left {minutes(found.left)}"
    if found.idle >= 5.0 and not found.complete:  # s; between two runs there are fewer
        end = f"; none at work for {minutes(found.idle)}"
    return f"{len(found.rows)} runs: {', '.join(parts)}{end}"


def unfinished(found: SweepStatus) -> Iterator[str]:
    """What is to be said of the runs of a sweep that have not ended well, a line each."""
    for state, why in _STOPPED.items():
        names = [row.name for row in found.rows if row.status.state == state]
        if names:
            listed = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
            yield f"{len(names)} {why}: {listed}"
    if not found.complete:
        yield (
            f"no run has been at work for {minutes(found.idle)}: the sweep was stopped, or the "
            "rest waits for its turn; the command of the sweep goes on with it (--resume: from the "
            "checkpoints), castfem watch --wait waits until it does"
        )
    for row in found.rows:
        if row.status.state == FAILED:
            yield f"{row.name}: failed: {row.status.record.reason}"
