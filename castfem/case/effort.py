"""How many steps and states a case asks for: refused where there would be no end to them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from castfem.case.model import Case
from castfem.case.problems import Path, Problem
from castfem.support.messages import grouped
from castfem.values.units import format

_MOST = 1_000_000  # steps; of the cheapest, that is hours
_MOST_STATES = 50_000  # written fields
_MANY, _MANY_STATES = 100_000, 5_000  # told before it is run
# Seconds that a step of each kind takes on an ordinary mesh, for a first estimate.
_THERMAL, _MECHANICAL, _WRITTEN = 0.01, 0.1, 0.01

Demand = tuple[Path, float, str, int, int, float]


def too_many(case: Case) -> Iterator[Problem]:
    """Yield the steps that would be too many to come to an end."""
    for path, length, what, most, _, _ in _demands(case):
        count = _count(case, length)
        if count > most:
            yield Problem(
                path,
                f"({format(length, 's', 's')}) makes {grouped(count)} {what} of the "
                f"{case.casting.duration:.4g} s that are followed; at most {grouped(most)}: "
                "give a longer one",
            )


def many(case: Case) -> Iterator[Problem]:
    """Yield the steps of a sound case that will take long, with a first estimate of how long."""
    for path, length, what, _, much, each in _demands(case):
        count = _count(case, length)
        if count > much:
            yield Problem(
                path,
                f"({format(length, 's', 's')}) makes {grouped(count)} {what}; at some "
                f"{1e3 * each:.0f} ms each that takes {_duration(count * each)}",
            )


def _demands(case: Case) -> Iterator[Demand]:
    """Yield each length of a step: its key, s, of what, most, many, and seconds that one takes.

    Of a faulty case it yields what is sound.
    """
    time = case.thermal.time if case.thermal else None
    steps: tuple[str, int, int, float] = ("thermal steps", _MOST, _MANY, _THERMAL)
    if case.casting is None or None in (case.casting.length, case.casting.speed):
        return
    if math.isinf(case.casting.duration):
        return
    if time is not None and time.step is not None:
        yield ("thermal", "time", "step"), time.step, *steps
    if time is not None and time.adaptive is not None and time.adaptive.largest is not None:
        yield ("thermal", "time", "adaptive", "largest"), time.adaptive.largest, *steps
    if case.mechanics is not None and case.coupling is not None:
        steps = ("intervals", _MOST, _MANY, _MECHANICAL)
        if case.coupling.interval is not None:
            yield ("coupling", "interval"), case.coupling.interval, *steps
        if case.coupling.mechanical_step is not None:
            steps = ("mechanical steps", _MOST, _MANY, _MECHANICAL)
            yield ("coupling", "mechanical_step"), case.coupling.mechanical_step, *steps
    output = case.output
    if output is not None and output.every is not None and output.fields != ():
        states = ("states of the fields", _MOST_STATES, _MANY_STATES, _WRITTEN)
        yield ("output", "every"), output.every, *states


def _count(case: Case, length: float) -> float:
    """Return how many steps of a length (s) the run takes."""
    return case.casting.duration / length


def _duration(seconds: float) -> str:
    """Return a duration as a reader says it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 60.0:.2g} min"
