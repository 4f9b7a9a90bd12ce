"""How many steps and states a case asks for: refused where there would be no end to them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from castfem.base.messages import dotted, grouped
from castfem.base.tables import Table
from castfem.base.units import format
from castfem.model.bounds import impossible, numbers
from castfem.model.case import Case
from castfem.model.checks import Faults, caution, check
from castfem.model.mechanics import Way

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
        key: Of their length.
        length: Of one, s.
        what: What they are.
        most: How many are run.
        much: How many are worth a word.
        each: What one takes, s of work.
    """

    key: str
    length: float
    what: str
    most: int
    much: int
    each: float

    def number(self, case: Case) -> float:
        """Return how many the run takes."""
        return case.casting.duration / self.length

    def fault(self, count: float, rest: str) -> tuple[str, str]:
        """Return what is said of them: how many there are, and the rest."""
        return (
            self.key,
            f"({format(self.length, 's', 's')}) makes {grouped(count)} {self.what}{rest}",
        )


@check()
def too_many(case: Case, _: object) -> Faults:
    """Yield the steps that would be too many to come to an end.

    Of a strand that is slower or longer than any it yields that, once.
    """
    demands = [(demand, demand.number(case)) for demand in _demands(case)]
    demands = [(demand, count) for demand, count in demands if count > demand.most]
    length, time = case.casting.length, case.casting.duration
    found = []
    if demands and length > _LONGEST:
        found = [("casting.length", f"({length:.4g} m) is no strand's: give a shorter one")]
    elif demands and length < _SLOWEST * time:
        speed = f"({60.0 * length / time:.4g} m/min) takes {_duration(time)} for {length:.4g} m"
        found = [("casting.speed", f"{speed}: give a higher one")]
    for demand, count in demands if not found else ():
        most = f"at most {grouped(demand.most)}: give a longer one"
        found.append(demand.fault(count, f" of the {time:.4g} s that are followed; {most}"))
    known = {key for key, _ in impossible(case, case)}
    yield from (fault for fault in found if fault[0] not in known)


@caution()
def many(case: Case, _: object) -> Faults:
    """Yield the steps of a sound case that will take long, with a first estimate of how long."""
    for demand in _demands(case):
        if (count := demand.number(case)) > demand.much:
            time = _duration(count * demand.each)
            yield demand.fault(
                count, f"; at some {1e3 * demand.each:.0f} ms each that takes {time}"
            )


@caution()
def _long_tables(case: Case, _: object) -> Faults:
    """Yield tables over time or position of so many rows that their steps take long."""
    what, each = ("steps", _THERMAL)
    if case.mechanics is not None:
        what, each = ("coupling windows", _MECHANICAL)
    for given in numbers(case):
        table = given.value
        if not isinstance(table, Table) or table.over not in ("time", "position"):
            continue
        if (count := len(table.arguments)) > _MANY_ROWS:
            yield (
                dotted(given.path),
                f"has {grouped(count)} rows, each of which ends one of the {what}; at some "
                f"{1e3 * each:.0f} ms each that takes {_duration(count * each)}: fewer rows do",
            )


def _demands(case: Case) -> Iterator[Demand]:
    """Yield each length of a step that is given and sound."""
    if math.isinf(case.casting.duration):
        return
    time, coupling, output = case.thermal.time, case.coupling, case.output
    steps = ("thermal steps", _MOST, _MANY, _THERMAL)
    found: list[tuple[str, Any, tuple[str, int, int, float]]] = [
        ("thermal.time.step", time.step, steps),
        ("thermal.time.adaptive.largest", time.adaptive and time.adaptive.largest, steps),
    ]
    if case.mechanics is not None:
        window = coupling.interval
        if isinstance(window, Way):
            window = window.length / case.casting.length * case.casting.duration
        steps = ("coupling windows", _MOST, _MANY_WINDOWS, _MECHANICAL)
        found.append(("coupling.interval", window, steps))
        steps = ("mechanical steps", _MOST, _MANY_WINDOWS, _MECHANICAL)
        found.append(("coupling.mechanical_step", coupling.mechanical_step, steps))
    if output.fields != ():
        states = ("states of the fields", _MOST_STATES, _MANY_STATES, _WRITTEN)
        found.append(("output.every", output.every, states))
    yield from (Demand(key, length, *of) for key, length, of in found if isinstance(length, float))


def _duration(seconds: float) -> str:
    """Return a duration as a reader says it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 60.0:.2g} min"
