"""The state of the slices of a strand at an output time, as numbers that ranks can exchange."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from castfem.model.caster import Plant
from castfem.model.caster_slices import Cast


@dataclass(frozen=True, slots=True)
class Look:
    """A slice at an output time."""

    number: int  #: number, from 1 for the oldest
    start: float  #: when it left the meniscus, by the clock, s
    length: float  #: length of strand that it represents, m
    age: float  #: time since it left the meniscus, s
    lasts: float  #: its age when it leaves the machine, s
    position: float  #: below the meniscus, m
    solid: float  #: position at which it became solid, m; NaN before
    closed: float  #: its age at that time, s
    removed: float  #: heat removed from its length, J
    #: change of its enthalpy since the meniscus, J, without the contributions of the mechanics
    gained: float
    row: dict[str, float]  #: its row of the history
    #: pyrometers passed since the previous output: number, age s, temperature K
    passed: list[list[float]]

    @property
    def has_left(self) -> bool:
        """Whether it has reached the end of the machine."""
        return self.age >= self.lasts


def pool_end(
    inside: Sequence[Look],
    closed: Mapping[int, float],
    cast: Cast,
    clock: float,
    length: float,
    has_head: bool = False,
) -> float:
    """Position of the end of the liquid core, m; NaN if it is not in the machine.

    The strand between the lowest slice with liquid and the next one, which is solid, is assumed to
    take as long to solidify as the latter did.

    Args:
        inside: Slices in the machine, the lowest first.
        closed: Age at which each slice became solid, s, by number; NaN if it left with liquid.
        cast: Length cast over time.
        clock: Clock time, s.
        length: Length of the machine, m.
        has_head: Whether the first slice is the head of the strand, where the liquid ends.
    """
    liquid = next((one for one in inside if math.isnan(one.closed)), None)
    if liquid is None:
        return math.nan
    if liquid.number == 1 and has_head:
        return liquid.position
    age = closed.get(liquid.number - 1, math.nan)
    if math.isnan(age):
        return math.nan
    position = cast.length(clock) - cast.length(clock - age)
    below = next((one for one in inside if one.number == liquid.number - 1), None)
    if below is None and position > length:
        return math.nan
    return min(max(position, liquid.position), math.inf if below is None else below.position)


def heat_of(before: tuple[float, float], looks: Iterable[Look]) -> tuple[float, float]:
    """Return heat removed and change of enthalpy, J, after adding some slices."""
    removed, gained = before
    for one in looks:
        removed, gained = removed + one.removed, gained + one.gained
    return removed, gained


def events_between(plant: Plant, after: float, until: float) -> str:
    """Return the events after one time and up to another."""
    pairs = zip(plant.times, plant.events, strict=True)
    return "; ".join(event for at, event in pairs if event and after < at <= until)
