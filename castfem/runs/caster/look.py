"""What is seen of the slices of a strand at an instant: numbers alone, which ranks can hand on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from castfem.model.caster import Cast, Plant


@dataclass(frozen=True, slots=True)
class Look:
    """A slice at an instant."""

    number: int  #: from 1, the oldest first
    start: float  #: when it left the meniscus, by the clock, s
    length: float  #: of strand that it stands for, m
    age: float  #: time since it left the meniscus, s
    lasts: float  #: how old it is when it leaves the machine, s
    position: float  #: below the meniscus, m
    solid: float  #: where it became solid, m; NaN while it is not
    closed: float  #: how old it was then, s
    removed: float  #: heat that was removed of its length, J
    #: change of its enthalpy since the meniscus, J, but for what mechanics generate and feed
    gained: float
    row: dict[str, float]  #: columns of its history
    #: pyrometers that it has passed since the instant before: number, age s, K
    passed: list[list[float]]

    @property
    def has_left(self) -> bool:
        """Whether it has come to the end of the machine."""
        return self.age >= self.lasts


def pool_end(
    inside: Sequence[Look],
    closed: Mapping[int, float],
    cast: Cast,
    clock: float,
    length: float,
    has_head: bool = False,
) -> float:
    """Where the liquid ends, m below the meniscus; NaN where it is not within the machine.

    The strand between the lowest slice with liquid and the next, which is solid, takes as long to
    become solid as that one did.

    Args:
        inside: Slices in the machine, the lowest first.
        closed: How old slices were when they became solid, s, by number; NaN of one that has left
            with liquid.
        cast: What has been cast.
        clock: The instant, s.
        length: Of the machine, m.
        has_head: Whether the first slice is the head of the strand: there liquid ends at it.
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
    """Return heat removed and change of enthalpy, J, with those of some slices added."""
    removed, gained = before
    for one in looks:
        removed, gained = removed + one.removed, gained + one.gained
    return removed, gained


def events_between(plant: Plant, after: float, until: float) -> str:
    """Return what happened after an instant, up to another."""
    pairs = zip(plant.times, plant.events, strict=True)
    return "; ".join(event for at, event in pairs if event and after < at <= until)
