"""How many steps and states a case asks for: refused where there would be no end to them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from castfem.base.messages import grouped
from castfem.base.tables import Table
from castfem.base.units import format
from castfem.model import bounds
from castfem.model.case import Case
from castfem.model.mechanics import Way
from castfem.model.problems import Path, Problem

_MOST = 1_000_000  # steps; of the cheapest, that is hours
_MOST_STATES = 50_000  # written fields
_SLOWEST, _LONGEST = 0.01 / 60.0, 1e4  # m/s, m: what lies beyond is no strand
_MANY, _MANY_WINDOWS, _MANY_STATES = 100_000, 36_000, 5_000  # told before it is run: an hour
_MANY_ROWS = 1_000  # of one table, each of which ends a step
# Seconds that a step of each kind takes on an ordinary mesh, for a first estimate.
_THERMAL, _MECHANICAL, _WRITTEN = 0.01, 0.1, 0.01


class Demand(NamedTuple):
    """Steps of one kind that a case asks for.

    Attributes:
        path: Key of their length.
        length: Of one, s.
        what: What they are.
        most: How many are run.
        much: How many are worth a word.
        each: What one takes, s of work.
    """

    path: Path
    length: float
    what: str
    most: int
    much: int
    each: float

    def number(self, case: Case) -> float:
        """Return how many the run takes."""
        return case.casting.duration / self.length

    def problem(self, count: float, rest: str) -> Problem:
        """Return what is said of them: how many there are, and the rest."""
        length = format(self.length, "s", "s")
        return Problem(self.path, f"({length}) makes {grouped(count)} {self.what}{rest}")


def too_many(case: Case) -> Iterator[Problem]:
    """Yield the steps that would be too many to come to an end.

    Of a strand that is slower or longer than any it yields that, once.
    """
    demands = [(demand, demand.number(case)) for demand in _demands(case)]
    demands = [(demand, count) for demand, count in demands if count > demand.most]
    if demands and (cause := _no_strand(case)) is not None:
        yield cause
        return
    for demand, count in demands:
        rest = (
            f" of the {case.casting.duration:.4g} s that are followed; at most "
            f"{grouped(demand.most)}: give a longer one"
        )
        yield demand.problem(count, rest)


def _no_strand(case: Case) -> Problem | None:
    """Return that a strand is cast more slowly, or followed farther, than any is."""
    length, time = case.casting.length, case.casting.duration
    if length > _LONGEST:
        return Problem(
            ("casting", "length"), f"({length:.4g} m) is no strand's: give a shorter one"
        )
    if length < _SLOWEST * time:
        return Problem(
            ("casting", "speed"),
            f"({60.0 * length / time:.4g} m/min) takes {_duration(time)} for {length:.4g} m: give "
            "a higher one",
        )
    return None


def many(case: Case) -> Iterator[Problem]:
    """Yield the steps of a sound case that will take long, with a first estimate of how long."""
    for demand in _demands(case):
        if (count := demand.number(case)) > demand.much:
            time = _duration(count * demand.each)
            rest = f"; at some {1e3 * demand.each:.0f} ms each that takes {time}"
            yield demand.problem(count, rest)
    yield from _long_tables(case)


def _long_tables(case: Case) -> Iterator[Problem]:
    """Yield tables over time or position of so many rows that their steps take long."""
    what, each = ("steps", _THERMAL)
    if case.mechanics is not None:
        what, each = ("coupling windows", _MECHANICAL)
    for given in bounds.numbers(case):
        table = given.value
        if not isinstance(table, Table) or table.over not in ("time", "position"):
            continue
        if (count := len(table.arguments)) > _MANY_ROWS:
            yield Problem(
                given.path,
                f"has {grouped(count)} rows, each of which ends one of the {what}; at some "
                f"{1e3 * each:.0f} ms each that takes {_duration(count * each)}: fewer rows do",
            )


def _demands(case: Case) -> Iterator[Demand]:
    """Yield each length of a step.

    Of a faulty case it yields what is sound.
    """
    time = case.thermal.time if case.thermal else None
    steps: tuple[str, int, int, float] = ("thermal steps", _MOST, _MANY, _THERMAL)
    if case.casting is None or None in (case.casting.length, case.casting.speed):
        return
    if math.isinf(case.casting.duration):
        return
    if time is not None and time.step is not None:
        yield Demand(("thermal", "time", "step"), time.step, *steps)
    if time is not None and time.adaptive is not None and time.adaptive.largest is not None:
        yield Demand(("thermal", "time", "adaptive", "largest"), time.adaptive.largest, *steps)
    if case.mechanics is not None and case.coupling is not None:
        steps = ("coupling windows", _MOST, _MANY_WINDOWS, _MECHANICAL)
        if case.coupling.interval is not None:
            window = case.coupling.interval
            if isinstance(window, Way):
                window = window.length / case.casting.length * case.casting.duration
            yield Demand(("coupling", "interval"), window, *steps)
        if case.coupling.mechanical_step is not None:
            steps = ("mechanical steps", _MOST, _MANY_WINDOWS, _MECHANICAL)
            yield Demand(("coupling", "mechanical_step"), case.coupling.mechanical_step, *steps)
    output = case.output
    if output is not None and output.every is not None and output.fields != ():
        states = ("states of the fields", _MOST_STATES, _MANY_STATES, _WRITTEN)
        yield Demand(("output", "every"), output.every, *states)


def _duration(seconds: float) -> str:
    """Return a duration as a reader says it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 60.0:.2g} min"
