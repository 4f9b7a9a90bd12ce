"""Slices with the same history: one is computed, and the others take over its states.

While everything that depends on the clock (speed, water, mould heat) stays as it was when a slice
left the meniscus, the slice has the same history as an older one at the same age. If their output
times are at the same ages, too (the starts differ by a multiple of `every`), the two runs agree to
the last digit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.types import Array
from castfem.model.caster import DIGITS
from castfem.model.caster_slices import slice_of
from castfem.model.heat_law import ScaledLaw

if TYPE_CHECKING:
    from castfem.model import Case

MOST = 2e8
"""Largest size of the kept states, bytes."""

State = tuple[dict[str, Any], dict[str, Array]]
"""The state from which a run continues: description and arrays (`castfem.runs.restart`)."""
Met = tuple[object, ...]
"""Conditions of a slice while nothing changes, and its output times."""


@dataclass(frozen=True, slots=True)
class Seen:
    """A slice at an age, per metre of strand."""

    age: float  #: time since it left the meniscus, s
    position: float  #: position below the meniscus, m
    solid: float  #: position at which it became solid, m; NaN before
    closed: float  #: its age at that time, s
    removed: float  #: heat removed from the modelled part of the section, J/m
    gained: float  #: change of its enthalpy, J/m
    row: dict[str, float]  #: its row of the history
    stops: tuple[float, ...] = ()  #: times at which its steps have ended, s
    state: State | None = None  #: state from which it continues
    #: pyrometers passed since the previous output: number, age s, temperature K
    passed: list[list[float]] = field(default_factory=list)


class Alike:
    """States of slices, kept for slices with the same history.

    Args:
        most: Largest size of the kept states, bytes.
    """

    def __init__(self, most: float = MOST) -> None:
        self._most, self._size = most, 0
        self._met: dict[int, Met] = {}
        self._until: dict[int, float] = {}
        self._kept: dict[Met, dict[float, Seen]] = {}

    def grow(self, case: Case, starts: Sequence[float], numbers: Iterable[int]) -> None:
        """Determine which of some slices have the same history.

        Args:
            case: Case of every slice, except for its start (`castfem.model.caster.by_plant`).
            starts: When each slice leaves the meniscus, by the clock, s.
            numbers: Numbers of the slices in the machine or still to come.
        """
        numbers = list(numbers)
        given = np.array([starts[n - 1] for n in numbers])
        keys, until = met(case, given)
        count = Counter(keys)
        found = [row for row in zip(numbers, keys, until, strict=True) if count[row[1]] > 1]
        self._met = {n: key for n, key, _ in found}
        self._until = {n: float(last) for n, _, last in found}
        self.forget(float(given.min(initial=np.inf)))

    def forget(self, clock: float) -> None:
        """Drop the states that no slice takes over after a clock time, s."""
        self._met = {n: key for n, key in self._met.items() if self._until[n] >= clock}
        left = set(self._met.values())
        self._kept = {key: kept for key, kept in self._kept.items() if key in left}
        self._size = sum(_bytes(one) for kept in self._kept.values() for one in kept.values())

    def meets_the_same(self, number: int, clock: float) -> bool:
        """Whether the history of a slice until a clock time (s) is that of other slices, too."""
        return number in self._met and clock <= self._until[number]

    def find(self, number: int, age: float, stops: tuple[float, ...]) -> Seen | None:
        """Return a kept state at an age (s) whose steps ended at the same times, or None."""
        seen = self._kept.get(self._met[number], {}).get(round(age, DIGITS))
        return seen if seen is not None and (seen.age, seen.stops) == (age, stops) else None

    def keep(self, number: int, seen: Seen) -> None:
        """Keep the state of a slice for others."""
        if self._size < self._most:
            self._kept.setdefault(self._met[number], {})[round(seen.age, DIGITS)] = seen
            self._size += _bytes(seen)


def met(case: Case, starts: Array) -> tuple[list[Met], Array]:
    """Conditions met by slices starting at some times (n,), s, until the conditions change.

    Args:
        case: Case of every slice, except for its start (`castfem.model.caster.by_plant`).
        starts: Starting times by the clock, s.

    Returns:
        Equal values for slices that meet the same conditions (n,), and the clock times until
        which only the superheat changes, s (n,).
    """
    phase = np.round(-starts % case.output_every, DIGITS) % case.output_every
    columns, until = [phase], np.full_like(starts, np.inf)
    for table in case.tables_by_clock():
        times, values = np.array(table.arguments), np.array(table.values)
        here, nxt = np.interp(starts, times, values), times.searchsorted(starts, side="right")
        columns.append(here)
        if table is case.casting.superheat:
            continue
        # Extremes of the future record bound the slopes of cooling laws from the beginning.
        for extreme in (np.minimum, np.maximum):
            later = extreme.accumulate(values[::-1])[::-1]
            columns.append(extreme(here, np.append(later, values[-1])[nxt]))
        # Rows followed by another value; after the last row nothing changes.
        ends = np.where(np.diff(values, append=values[-1]) != 0.0, times, np.inf)
        ends = np.append(np.minimum.accumulate(ends[::-1])[::-1], np.inf)[nxt]
        sloped = here != np.append(values, values[-1])[nxt]
        until = np.minimum(until, np.where(sloped, starts, ends))
    # A flux scaled to a measured total depends from the start on the mean speed in its zone.
    if scaled := _ends_of_scaled(case):
        left = [slice_of(case, start).casting.travel.time_at(max(scaled)) for start in starts]
        until = np.where(starts + left <= until, until, -np.inf)
    return [tuple(row) for row in np.stack(columns, axis=1)], until


def _ends_of_scaled(case: Case) -> list[float]:
    """Ends of the zones with a flux scaled to a measured total, m."""
    return [
        span.end
        for span in case.zones()
        for _, law in span.laws
        if isinstance(law, ScaledLaw) and law.scales
    ]


def _bytes(seen: Seen) -> int:
    return 0 if seen.state is None else sum(values.nbytes for values in seen.state[1].values())
