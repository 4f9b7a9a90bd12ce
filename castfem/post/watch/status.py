"""The status of a running run and of all runs of a sweep, and its wording."""

from __future__ import annotations

import math
import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.progress import clock, time_left
from castfem.base.progress import clock as minutes
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import plain_unit, scale_of
from castfem.model import Case, read_case
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.report.show import how_it_ended
from castfem.post.report.tables import result_rows
from castfem.runs.output.folder import LOG_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, last_row
from castfem.runs.output.run_record import RUN_NAME, RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.labels import last_quantities
from castfem.runs.results.numbers import cells
from castfem.studies.sweep.plan import brief as brief_keys
from castfem.studies.sweep.record import Entry, Record

RUNNING, KILLED, FINISHED, FAILED = "running", "killed", "finished", "failed"
_STAMP = re.compile(r"\d{4}-\d\d-\d\d [\d:,]+ ([A-Z]+) +(.*)")
COLUMNS = {
    "shell_mid_face": "shell",
    "gap_max": "gap",
    "surface_temperature_mid_face": "surface",
    "von_mises_max": "stress",
}
"""Results in the one-line status of a run, and their short names."""
_STARTS = ("shell_", "surface_temperature_", "gap_", "von_mises_max")


@dataclass(frozen=True, slots=True)
class RunStatus:
    """Current status of a run."""

    #: "running", "finished", "failed", "interrupted", or "killed": no longer running, with no
    #: reason recorded
    state: str
    title: str  #: title of its case
    record: RunRecord  #: contents of run.json
    #: position reached, m; NaN before its first row, or if it does not follow a strand
    position: float = math.nan
    length: float = math.nan  #: position where it ends, m; NaN if unknown
    quantities: Mapping[str, Quantity] = field(default_factory=dict)  #: results of its last row
    left: float = math.nan  #: remaining time, s; NaN while unknown
    messages: tuple[str, ...] = ()  #: last messages of its log, without progress lines

    def has_ended(self, wait: bool = False) -> bool:
        """Whether the status will not change any more."""
        return self.state in (FINISHED, FAILED) if wait else self.state != RUNNING

    @property
    def share(self) -> float:
        """Completed fraction of its way, 0 to 1; NaN if unknown."""
        known = self.length > 0.0 and not math.isnan(self.position)
        return min(1.0, self.position / self.length) if known else math.nan


class Watcher:
    """Reads the status of a run repeatedly; it writes nothing and does not contact the run."""

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self.folder, self._clock = folder, clock
        self._way: deque[tuple[float, float]] = deque()
        self._started = ""
        self._title, self._length = "", math.nan
        self._seen: tuple[float, ...] = ()
        self._dead = False

    def status(self) -> RunStatus:
        """Read the current status of the run."""
        if not self.folder.is_dir():
            raise InputError(
                f"{self.folder}: {'is no' if self.folder.exists() else 'no such'} folder"
            )
        record = RunRecord.load(self.folder)
        if record.started + str(record.resumed) != self._started:
            self._begin(record)
        quantities, position = self._last()
        if position == position:
            self._note(position)
        state = record.status
        if state == RUNNING and not self._at_work():
            record = RunRecord.load(self.folder)  # it may have ended since
            state = KILLED if record.status == RUNNING else record.status
        messages, logged = self._log()
        left = self._left(position, logged) if state == RUNNING else math.nan
        return RunStatus(
            state, self._title, record, position, self._length, quantities, left, messages
        )

    def _begin(self, record: RunRecord) -> None:
        """Read the case of a run that is new or was resumed."""
        self._started = record.started + str(record.resumed)
        self._way.clear()
        case = read_case(self.folder / CASE_NAME).sound  # none if of another version, for example
        self._title = "" if case is None else case.title
        self._length = case.casting.length if isinstance(case, Case) else math.nan

    def _last(self) -> tuple[dict[str, Quantity], float]:
        """Results of the last row, and its position."""
        path = self.folder / HISTORY_NAME
        found = last_row(path) if path.is_file() else None
        if found is None:
            return {}, math.nan
        row, names = found
        return last_quantities(row, names), row.get("position", math.nan)

    def _note(self, position: float) -> None:
        """Record the positions of the last minute."""
        now = self._clock()
        if self._way and position < self._way[-1][1]:
            self._way.clear()
        if not self._way or position > self._way[-1][1]:
            self._way.append((now, position))
        while self._way[-1][0] - self._way[0][0] > 60.0:  # s over which the pace is measured
            self._way.popleft()

    def _at_work(self) -> bool:
        """Whether the run is running.

        Its lock is tried only if its files have not changed since the last time, and not again once
        it was found free: whoever resumes the run must find it free.
        """
        paths = (self.folder / name for name in (RUN_NAME, HISTORY_NAME, LOG_NAME))
        seen = tuple(path.stat().st_mtime_ns for path in paths if path.is_file())
        changed, self._seen = seen != self._seen and bool(self._seen), seen
        if changed:
            self._dead = False
        elif not self._dead:
            self._dead = not OutputFolder(self.folder).is_running()
        return not self._dead

    def _log(self) -> tuple[tuple[str, ...], float]:
        """The last messages, and the remaining time by the last progress line."""
        path = self.folder / LOG_NAME
        try:
            with path.open("rb") as file:
                file.seek(max(0, path.stat().st_size - 8192))  # bytes
                lines = file.read().decode(errors="replace").splitlines()
            since = time.time() - path.stat().st_mtime
        except OSError:
            return (), math.nan
        messages, left = [], math.nan
        for found in filter(None, map(_STAMP.fullmatch, lines)):
            progress = time_left(found[2])
            if progress is None:
                word = "" if found[1] == "INFO" else f"{found[1].lower()}: "
                messages.append(word + found[2])
            else:
                left = max(0.0, progress - since)
        return tuple(messages[-5:]), left

    def _left(self, position: float, logged: float) -> float:
        """Remaining time by the pace of the last minute; before that is known, by the log."""
        if len(self._way) < 2 or math.isnan(self._length):
            return logged
        (since, start), (last, _) = self._way[0], self._way[-1]
        pace = (position - start) / max(last - since, 1e-9)
        return max(0.0, (self._length - position) / pace - (self._clock() - last))


def results(status: RunStatus) -> list[tuple[str, ...]]:
    """Label, value and unit of shell, surface, gap and largest stress."""
    chosen = {
        name: quantity
        for start in _STARTS
        for name, quantity in status.quantities.items()
        if name.startswith(start)
    }
    return [row[:3] for row in result_rows(Summary("", status.state, chosen), {})]


def brief(status: RunStatus) -> dict[str, str]:
    """Shell, gap, surface and stress of a run for one line, if it has them."""
    return {
        word: " ".join(cells(name, status.quantities[name]))
        for name, word in COLUMNS.items()
        if name in status.quantities
    }


def where(status: RunStatus) -> str:
    """The position a run has reached, in words."""
    if math.isnan(status.position):  # of a strand before its first step, a caster, a tensile test
        time = status.record.reached.get("time")
        return "no step has been taken yet" if time is None else f"t = {time:.6g} s"
    scale = scale_of("m", "position")
    digits = ".3f" if scale.unit == "m" else ".5g"
    here = f"{scale(status.position):{digits}}"
    if math.isnan(status.length):
        return f"{here} {plain_unit(scale.unit)}"
    return f"{here} of {scale(status.length):{digits}} {plain_unit(scale.unit)}"


def percent(status: RunStatus) -> str:
    """Completed percentage; empty if unknown."""
    return "" if math.isnan(status.share) else f"{100.0 * status.share:.0f} %"


def left(status: RunStatus) -> str:
    """The remaining time, as 0:07; empty if unknown."""
    return "" if math.isnan(status.left) else clock(status.left)


def line(name: str, status: RunStatus) -> str:
    """A run in one line."""
    parts = [
        f"{name}:",
        status.state if status.state != RUNNING else "",
        percent(status),
        where(status),
    ]
    parts += [f"{word} {text}" for word, text in brief(status).items()]
    parts += [f"left {left(status)}"] if left(status) else []
    return "  ".join(part for part in parts if part)


def ending(folder: Path, status: RunStatus) -> str:
    """Ending of a run with its reason and the next command, in one line."""
    how = how_it_ended(status.record)
    if status.state == KILLED:
        return f"{how}; castfem run --resume {folder} continues from its last checkpoint"
    if status.state == "interrupted":
        return f"{how}; castfem run --resume {folder} continues it"
    if status.state == "failed":
        return f"{how}; what happened: {folder / LOG_NAME}"
    return f"{how}; its results: castfem show {folder}"


WAITING = "waiting"
_STOPPED = {KILLED: "killed or aborted", "interrupted": "interrupted", WAITING: "waiting"}
PATIENCE = 60.0  # s without a running run after which a sweep counts as ended


@dataclass(frozen=True, slots=True)
class Row:
    """A run of a sweep."""

    name: str  #: name of its folder
    label: str  #: label from the varied parameters
    status: RunStatus  #: its status; the state may be "waiting"
    seconds: float = 0.0  #: duration, if it has ended


@dataclass(frozen=True, slots=True)
class SweepStatus:
    """Current status of a sweep."""

    rows: tuple[Row, ...]  #: its runs
    idle: float  #: time since a run was last running, s
    patience: float = PATIENCE  #: value of `idle` from which the sweep counts as ended, s

    def count(self, state: str) -> int:
        """Number of runs in a state."""
        return sum(row.status.state == state for row in self.rows)

    @property
    def complete(self) -> bool:
        """Whether all runs have finished or failed."""
        return self.count(FINISHED) + self.count(FAILED) == len(self.rows)

    @property
    def ended(self) -> bool:
        """Whether the status will not change any more: all have ended, or none is running."""
        return self.complete or self.idle > self.patience

    @property
    def left(self) -> float:
        """Remaining time of the sweep, s, by its runs so far; NaN before one has ended."""
        took = [row.seconds for row in self.rows if row.status.state == FINISHED and row.seconds]
        at_work = [row.status.left for row in self.rows if row.status.state == RUNNING]
        if not took or not at_work:
            return math.nan
        mean = sum(took) / len(took)
        rest = sum(mean if math.isnan(one) else one for one in at_work)
        waiting = len(self.rows) - self.count(FINISHED) - self.count(FAILED) - len(at_work)
        return (rest + mean * waiting) / len(at_work)


class SweepWatcher:
    """Reads the status of the runs of a sweep repeatedly."""

    def __init__(
        self, folder: Path, clock: Callable[[], float] = time.monotonic, patience: float = PATIENCE
    ) -> None:
        self.folder, self._clock, self._patience = folder, clock, patience
        self._watchers: dict[str, Watcher] = {}
        self._ended: dict[str, tuple[Entry, Row]] = {}
        self._busy = clock()

    def status(self) -> SweepStatus:
        """Read the current status of the sweep."""
        rows = tuple(self._row(name, entry) for name, entry in Record(self.folder).entries.items())
        now = self._clock()
        if any(row.status.state == RUNNING for row in rows):
            self._busy = now
        return SweepStatus(rows, now - self._busy, self._patience)

    def _row(self, name: str, entry: Entry) -> Row:
        """Status of one run; a run recorded as ended is not read again."""
        known = self._ended.get(name)
        if known is not None and known[0] == entry:
            return known[1]
        label = entry.label or ", ".join(brief_keys(entry.given)) or name
        row = Row(name, label, self._status(name, entry), entry.seconds)
        if entry.physics or entry.message:
            self._ended[name] = (entry, row)
        return row

    def _status(self, name: str, entry: Entry) -> RunStatus:
        """Status of a run, from its record, or from the sweep's record if noted there."""
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
        # failed in an earlier call, or its sweep ended before it was noted
        if status.state == FAILED:
            return replace(status, state=WAITING)
        return status


def counts(found: SweepStatus) -> str:
    """Numbers of runs of a sweep that have finished, are running, wait, have failed."""
    states = dict.fromkeys((FINISHED, RUNNING, WAITING, *(r.status.state for r in found.rows)))
    parts = [f"{found.count(state)} {state}" for state in states]
    end = "" if found.left != found.left else f", left {minutes(found.left)}"
    if found.idle >= 5.0 and not found.complete:  # s; shorter pauses occur between two runs
        end = f"; none at work for {minutes(found.idle)}"
    return f"{len(found.rows)} runs: {', '.join(parts)}{end}"


def unfinished(found: SweepStatus) -> Iterator[str]:
    """Yield messages about runs of a sweep that have not ended well, one line each."""
    for state, why in _STOPPED.items():
        names = [row.name for row in found.rows if row.status.state == state]
        if names:
            listed = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
            yield f"{len(names)} {why}: {listed}"
    if not found.complete:
        yield (
            f"no run has been running for {minutes(found.idle)}: the sweep was stopped, or its "
            "other runs are queued; its command continues it (--resume: from the checkpoints), "
            "castfem watch --wait waits until it does"
        )
    for row in found.rows:
        if row.status.state == FAILED:
            yield f"{row.name}: failed: {row.status.record.reason}"
