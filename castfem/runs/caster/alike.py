"""Slices that meet the same, of which one is computed and the others take over its states.

While all that goes by the clock (speed, water, heat of the mould) stays as it was when a slice left
the meniscus, the slice meets what an older one met at the same age.  Where the instants at which it
is looked at come at the same ages, too (their distance is a whole multiple of `every`), both are
one run to the last digit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.types import Array
from castfem.model.caster import DIGITS, slice_of
from castfem.model.heat_law import ScaledLaw

if TYPE_CHECKING:
    from castfem.model import Case

MOST = 2e8
"""Bytes of the states that are kept for others, at most."""

State = tuple[dict[str, Any], dict[str, Array]]
"""What a run goes on from: its description and arrays (`castfem.runs.restart`)."""
Met = tuple[object, ...]
"""What a slice meets as long as nothing changes, and how it is looked at."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What is seen of a slice at an age, for a metre of strand."""

    age: float  #: time since it left the meniscus, s
    position: float  #: below the meniscus, m
    solid: float  #: where it became solid, m; NaN while it is not
    closed: float  #: how old it was then, s
    removed: float  #: heat removed from the modelled part, J/m
    gained: float  #: change of its enthalpy, J/m
    row: dict[str, float]  #: columns of its history
    stops: tuple[float, ...] = ()  #: instants that its steps have ended at, s
    state: State | None = None  #: where it goes on from
    #: pyrometers passed since the age that was seen before: number, age s, K
    passed: list[list[float]] = field(default_factory=list)


class Alike:
    """States of slices for those that come after them.

    Args:
        most: Bytes that are kept, at most.
    """

    def __init__(self, most: float = MOST) -> None:
        self._most, self._size = most, 0
        self._met: dict[int, Met] = {}
        self._until: dict[int, float] = {}
        self._kept: dict[Met, dict[float, Seen]] = {}

    def grow(self, case: Case, starts: Sequence[float], numbers: Iterable[int]) -> None:
        """Find which of some slices, by number, meet the same.

        Args:
            case: Of each slice but for its start (`castfem.model.caster.by_plant`).
            starts: When each slice leaves the meniscus, by the clock, s.
            numbers: The slices that are inside or to come.
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
        """Let go of states that nobody takes over from an instant of the clock (s) on."""
        self._met = {n: key for n, key in self._met.items() if self._until[n] >= clock}
        left = set(self._met.values())
        self._kept = {key: kept for key, kept in self._kept.items() if key in left}
        self._size = sum(_bytes(one) for kept in self._kept.values() for one in kept.values())

    def meets_the_same(self, number: int, clock: float) -> bool:
        """Whether a slice has met until an instant (s) what others have met or will meet."""
        return number in self._met and clock <= self._until[number]

    def find(self, number: int, age: float, stops: tuple[float, ...]) -> Seen | None:
        """What was seen of another at an age (s), if its steps ended at the same instants."""
        seen = self._kept.get(self._met[number], {}).get(round(age, DIGITS))
        return seen if seen is not None and (seen.age, seen.stops) == (age, stops) else None

    def keep(self, number: int, seen: Seen) -> None:
        """Keep what was seen of a slice for others."""
        if self._size < self._most:
            self._kept.setdefault(self._met[number], {})[round(seen.age, DIGITS)] = seen
            self._size += _bytes(seen)


def met(case: Case, starts: Array) -> tuple[list[Met], Array]:
    """What slices meet that leave the meniscus at some times (n,), s, until something changes.

    Args:
        case: Of each slice but for its start (`castfem.model.caster.by_plant`).
        starts: By the clock, s.

    Returns:
        The same for slices that meet the same (n,), and until when nothing but the superheat
        changes, by the clock, s (n,).
    """
    phase = np.round(-starts % case.output_every, DIGITS) % case.output_every
    columns, until = [phase], np.full_like(starts, np.inf)
    for table in case.tables_by_clock():
        times, values = np.array(table.arguments), np.array(table.values)
        here, nxt = np.interp(starts, times, values), times.searchsorted(starts, side="right")
        columns.append(here)
        if table is case.casting.superheat:
            continue
        # Extremes of what is still to come bound the slopes of cooling laws from the beginning.
        for extreme in (np.minimum, np.maximum):
            later = extreme.accumulate(values[::-1])[::-1]
            columns.append(extreme(here, np.append(later, values[-1])[nxt]))
        # Where each row is followed by another value; after the last one nothing changes.
        ends = np.where(np.diff(values, append=values[-1]) != 0.0, times, np.inf)
        ends = np.append(np.minimum.accumulate(ends[::-1])[::-1], np.inf)[nxt]
        sloped = here != np.append(values, values[-1])[nxt]
        until = np.minimum(until, np.where(sloped, starts, ends))
    # A flux that is scaled to a measured total hangs on the mean speed in its zone from the start.
    if scaled := _ends_of_scaled(case):
        left = [slice_of(case, start).casting.travel.time_at(max(scaled)) for start in starts]
        until = np.where(starts + left <= until, until, -np.inf)
    return [tuple(row) for row in np.stack(columns, axis=1)], until


def _ends_of_scaled(case: Case) -> list[float]:
    """Where zones end that have a flux scaled to a measured total, m."""
    return [
        span.end
        for span in case.zones()
        for _, law in span.laws
        if isinstance(law, ScaledLaw) and law.scales
    ]


def _bytes(seen: Seen) -> int:
    return 0 if seen.state is None else sum(values.nbytes for values in seen.state[1].values())
