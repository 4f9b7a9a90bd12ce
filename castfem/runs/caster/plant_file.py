"""A plant record that is still being written: a CSV file to which rows are added.

A line counts once it is complete. A line that cannot be read, or whose time does not exceed that of
the previous row, is reported and ignored.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
from bisect import bisect_right
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import log
from castfem.base.csv_files import CsvFile, Heading, parse_csv
from castfem.base.errors import InputError
from castfem.model.caster import EVENT, Plant, PlantTable

if TYPE_CHECKING:
    from castfem.model import Case

PAUSE = 0.2
"""Interval between two checks of the file, s."""
_NUMBER = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?")
LATE, ROWS = 3.0, 20
"""A row is late after this multiple of the usual interval, the median over the last rows."""
REST, BEYOND, ONWARD = 600.0, 1e6, 1.0 / 60.0
"""Assumed continuation of a strand at rest: time after the last row at which it moves again, s; how
long, s; and its speed if it has not moved yet, m/s. Nothing is computed beyond the last row."""


class PlantFile:
    """The rows of a plant file so far.

    Args:
        path: Path of the file, which need not exist yet.

    Attributes:
        left_out: Number of ignored rows.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.left_out = path, 0
        self._offset = self._line = 0
        self._head = ""
        self._times: list[float] = []
        self._values: dict[str, list[float]] = {}
        self._events: list[str] = []
        self._read, self._reported_late = time.monotonic(), False

    def __len__(self) -> int:
        """Number of rows in use."""
        return len(self._times)

    @property
    def _long(self) -> float:
        """Interval after which a row is reported as late, s."""
        apart = np.diff(self._times[-ROWS:])
        return LATE * float(np.median(apart)) if apart.size else math.inf

    @property
    def last(self) -> float:
        """Time of the last row, s; -inf before the first."""
        return self._times[-1] if self._times else -math.inf

    def plant(self) -> Plant:
        """The record so far; its last row is held, and a strand at rest moves again later."""
        last, values = self.last, self._values
        after = {name: (cells[-1],) * 3 for name, cells in values.items()}
        speed = next((v for v in reversed(values["speed"]) if v > 0.0), ONWARD)
        after["speed"] = (values["speed"][-1], speed, speed)
        return Plant(
            (*self._times, last + REST, last + REST + 1.0, last + BEYOND),
            {name: (*cells, *after[name]) for name, cells in values.items()},
            (*self._events, "", "", ""),
        )

    def assignment(self) -> str:
        """The record as an assignment to the plant of a case, as for `--set`."""
        columns = PlantTable().write(self.plant())
        cells = (f"{json.dumps(name)} = {json.dumps(cells)}" for name, cells in columns.items())
        return f"caster.plant={{{', '.join(cells)}}}"

    def digest(self, count: int) -> str:
        """Hash of the first `count` rows."""
        rows = [self._times[:count], {n: v[:count] for n, v in self._values.items()}]
        return hashlib.sha256(repr([*rows, self._events[:count]]).encode()).hexdigest()

    def expect(self, count: int, digest: str) -> None:
        """Refuse a file that does not begin with the rows followed before.

        Raises:
            InputError: The rows differ.
        """
        if len(self) < count or self.digest(count) != digest:
            raise InputError(
                f"{self.path}: its first {count} rows are not those that were followed before; "
                "run again without --resume"
            )

    def drop_last(self, reason: str) -> None:
        """Drop the last row."""
        self._report(f"the row of {self._times.pop():g} s: {reason}; the row is left out")
        self._events.pop()
        for values in self._values.values():
            values.pop()

    def take(self) -> int:
        """Read the lines that have been added; return the number of valid ones."""
        before = len(self)
        for number, line in self._added():
            try:
                self._add(parse_csv([self._head, line]), number)
            except ValueError as error:
                reason = str(error).removeprefix("row 1: ")
                self._report(f"line {number}: {reason}; the row is left out")
        if len(self) > before:
            self._read, self._reported_late = time.monotonic(), False
        elif not self._reported_late and time.monotonic() - self._read > self._long:
            self._reported_late = True
            self._report(f"no row since that of {self.last:g} s, longer than usual", 0)
        return len(self) - before

    def check(self) -> None:
        """Refuse a header with which no row could be used.

        Raises:
            InputError: Its columns cannot be used.
        """
        names = [heading.name for heading in parse_csv([self._head]).headings]
        missing = [name for name in ("time", "speed") if name not in names]
        if missing or len({*names}) < len(names):
            fault = f"needs the column '{missing[0]}'" if missing else "has a column twice"
            raise InputError(f"{self.path}: {fault}: time [s], speed [m/min], event")

    def _added(self) -> list[tuple[int, str]]:
        """Complete lines added below the header, with their numbers."""
        try:
            with open(self.path, "rb") as file:
                if file.seek(0, 2) < self._offset:
                    self._report("is shorter than before: read from its beginning", 0)
                    self._offset, self._line, self._head = 0, 0, ""
                file.seek(self._offset)
                content = file.read()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror})") from None
        whole = content[: content.rfind(b"\n") + 1]
        self._offset += len(whole)
        found = []
        text = whole.decode("utf-8" if self._line else "utf-8-sig", errors="replace")
        for line in text.split("\n")[:-1]:
            self._line += 1
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            if self._head:
                found.append((self._line, line.rstrip("\r")))
            else:
                self._head = line.rstrip("\r")
                self.check()
        return found

    def _add(self, file: CsvFile, number: int) -> None:
        """Add the row of a file that has no other.

        Raises:
            ValueError: The row cannot be used.
        """
        if not file.rows:
            return
        cells = [*file.rows[0].cells, *("",) * len(file.headings)]
        if len(file.rows[0].cells) > len(file.headings):
            raise ValueError(f"{len(file.rows[0].cells)} cells, not {len(file.headings)}")
        # A record has at least two rows: the second repeats the first at a much later time.
        columns = {h.name: [_full(c, h)] * 2 for h, c in zip(file.headings, cells, strict=False)}
        columns["time"][1] = "1e12 s"
        one = PlantTable().read(columns)
        now, last = one.times[0], self.last
        if not now > last:
            raise ValueError(
                f"time ({now:g} s) does not exceed that of the previous row, {last:g} s"
            )
        if now - last > self._long:
            self._report(f"line {number}: no row between {last:g} s and {now:g} s", 0)
        self._times.append(now)
        self._events.append(one.events[0])
        for name, values in one.values.items():
            self._values.setdefault(name, []).append(values[0])

    def _report(self, text: str, left_out: int = 1) -> None:
        self.left_out += left_out
        log.logger.warning("%s: %s", self.path, text)


def _full(cell: str, heading: Heading) -> str:
    """Return a cell with the unit of its column if it is a plain number."""
    bare = heading.unit and heading.name != EVENT and _NUMBER.fullmatch(cell)
    return f"{cell} {heading.unit}" if bare else cell


def recent(case: Case, since: float) -> Case:
    """Return the case of a caster with only the rows that matter to a slice begun at a time, s.

    Otherwise each slice would read the record of days at each of its rows.
    """
    assert case.caster is not None
    plant = case.caster.plant
    first = bisect_right(plant.times, since) - 1
    while first > 0 and not plant.values["speed"][first] > 0.0:
        first -= 1  # a record begins with a moving strand
    if first <= 0:
        return case
    kept = Plant(
        plant.times[first:],
        {name: cells[first:] for name, cells in plant.values.items()},
        plant.events[first:],
    )
    rest = {"plant": kept, "start": None, "cast_from": None, "moments": ()}
    return case.model_copy(update={"caster": case.caster.model_copy(update=rest)})
