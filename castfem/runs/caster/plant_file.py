"""A history of the plant that is being written: a CSV file that grows by a row from time to time.

A line counts once its end is there. One that cannot be read, or whose time does not exceed that of
the row before, is reported and left out.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from dataclasses import replace
from pathlib import Path

from castfem.base import log
from castfem.base.csv_files import CsvFile, parse_csv
from castfem.base.errors import InputError
from castfem.model.caster import Plant, PlantTable, plant_of

PAUSE = 0.2
"""s between two looks at a file."""
BEYOND = 86400.0
"""s, how much longer the last row holds than a history goes: a strand at rest goes on after that.
"""


class PlantFile:
    """The rows of a file so far.

    Args:
        path: Of the file, which need not be there yet.
        longest_gap: Time between two rows beyond which a gap is reported, s; None for any.

    Attributes:
        left_out: How many rows could not be used.
    """

    def __init__(self, path: Path, longest_gap: float | None = None) -> None:
        self.path, self.longest_gap, self.left_out = path, longest_gap, 0
        self._offset = self._line = 0
        self._head = ""
        self._times: list[float] = []
        self._values: dict[str, list[float]] = {}
        self._events: list[str] = []
        self._read, self._told_late = time.monotonic(), False

    def __len__(self) -> int:
        """Number of rows that are used."""
        return len(self._times)

    @property
    def last(self) -> float:
        """Time of the last row, s; -inf before the first."""
        return self._times[-1] if self._times else -math.inf

    def plant(self) -> Plant:
        """The history so far, whose last row holds; a strand at rest goes on much later."""
        end, values = self.last + BEYOND, self._values
        after = {name: (cells[-1],) * 2 for name, cells in values.items()}
        if not after["speed"][-1] > 0.0:
            after["speed"] = (0.0, next(v for v in reversed(values["speed"]) if v > 0.0))
        return Plant(
            (*self._times, end, end + 1.0),
            {name: (*cells, *after[name]) for name, cells in values.items()},
            (*self._events, "", ""),
        )

    def assignment(self) -> str:
        """The same in place of the plant of a case, as `--set` takes it."""
        columns = PlantTable().write(self.plant())
        cells = (f"{json.dumps(name)} = {json.dumps(cells)}" for name, cells in columns.items())
        return f"caster.plant={{{', '.join(cells)}}}"

    def digest(self, count: int) -> str:
        """A hash of the first rows."""
        rows = [self._times[:count], {n: v[:count] for n, v in self._values.items()}]
        return hashlib.sha256(repr([*rows, self._events[:count]]).encode()).hexdigest()

    def expect(self, count: int, digest: str) -> None:
        """Refuse a file that does not begin with the rows that were followed before.

        Raises:
            InputError: It does not.
        """
        if len(self) < count or self.digest(count) != digest:
            raise InputError(
                f"{self.path}: its first {count} rows are not those that were followed before; "
                "run again without --resume"
            )

    def drop_last(self, reason: str) -> None:
        """Leave the last row out again."""
        self._report(f"the row of {self._times.pop():g} s: {reason}; the row is left out")
        self._events.pop()
        for values in self._values.values():
            values.pop()

    def take(self) -> int:
        """Take in the lines that have been added; returns how many of them can be used."""
        before = len(self)
        for number, line in self._added():
            try:
                self._add(parse_csv([self._head, line]), number)
            except ValueError as error:
                where = "" if str(error).startswith(f"line {number}") else f"line {number}: "
                self._report(f"{where}{error}; the row is left out")
        if len(self) > before:
            self._read, self._told_late = time.monotonic(), False
        elif self.longest_gap is not None and not self._told_late:
            waited = time.monotonic() - self._read
            if waited > self.longest_gap:
                self._told_late = True
                self._report(f"no row for {waited:.0f} s; the last is of {self.last:g} s", 0)
        return len(self) - before

    def check(self) -> None:
        """Refuse a header that no row can do with.

        Raises:
            InputError: Its columns cannot be used.
        """
        names = [heading.name for heading in parse_csv([self._head]).headings]
        missing = [name for name in ("time", "speed") if name not in names]
        if missing or len({*names}) < len(names):
            fault = f"needs the column '{missing[0]}'" if missing else "has a column twice"
            raise InputError(f"{self.path}: {fault}: time [s], speed [m/min], event")

    def _added(self) -> list[tuple[int, str]]:
        """Whole lines below the header that have been added, with their numbers."""
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
        """Add a row, the only one of a file.

        Raises:
            ValueError: It cannot be used.
        """
        if not file.rows:
            return
        row, at = replace(file.rows[0], line=number), [h.name for h in file.headings].index("time")
        later = (*row.cells[:at], "1e12 s", *row.cells[at + 1 :])  # a history has two rows
        one = plant_of(replace(file, rows=(row, replace(row, cells=later))))
        now, last = one.times[0], self.last
        if not now > last:
            raise ValueError(f"time ({now:g} s) does not exceed that of the row before, {last:g} s")
        if not self._times and not one.values["speed"][0] > 0.0:
            raise ValueError("the strand is at rest; the caster begins with steady casting")
        if self._times and self.longest_gap is not None and now - last > self.longest_gap:
            self._report(f"line {number}: no row between {last:g} s and {now:g} s", 0)
        self._times.append(now)
        self._events.append(one.events[0])
        for name, values in one.values.items():
            self._values.setdefault(name, []).append(values[0])

    def _report(self, text: str, left_out: int = 1) -> None:
        self.left_out += left_out
        log.logger.warning("%s: %s", self.path, text)
