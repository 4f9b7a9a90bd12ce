"""The slices of a caster: start at the meniscus, time for which each is followed, and case.

A slice is the case with the columns of the plant's history in the place of its own keys, and with
its own start by that clock (`casting.start.time`), so that it can be run by itself as well.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from castfem.base.constants import ROUNDING
from castfem.model.caster import DIGITS, Plant
from castfem.model.casting import Start
from castfem.model.checks.caster import mould_laws, sprays
from castfem.model.load import changed
from castfem.model.mechanics import Way
from castfem.physics.machine.travel import Changing

if TYPE_CHECKING:
    from castfem.model.case import Case


class Cast:
    """Length of strand cast over the clock of the plant; before the first row its values hold.

    Args:
        plant: The plant record.
        before: How long before the first row the length is needed, s.
    """

    def __init__(self, plant: Plant, before: float) -> None:
        speed = plant.table("speed")
        self._origin = plant.times[0] - before
        self._travel = Changing([t - self._origin for t in speed.arguments], speed.values)

    def length(self, clock: float) -> float:
        """Length cast until a clock time, m."""
        return self._travel.position(clock - self._origin)

    def when(self, length: float) -> float:
        """Clock time at which a length (m) has been cast, s."""
        return self._travel.time_at(length) + self._origin


def cast_of(case: Case) -> Cast:
    """Return the length cast, from before the oldest slice of the caster leaves the meniscus."""
    assert case.caster is not None
    plant = case.caster.plant
    if case.caster.cast_from is not None:
        return Cast(plant, 0.0)
    early = max(plant.times[0] - case.caster.window[0], 0.0)
    # One slice beyond the end of the machine, so that the end of the liquid core is bracketed.
    return Cast(plant, 2.01 * case.casting.length / plant.values["speed"][0] + early + 1.0)


def starts_of(case: Case) -> list[float]:
    """Times at which slices leave the meniscus, by the clock, s: the oldest first.

    The first one is the head of the strand, or has just left the machine at the first output; the
    last one is the tail if casting ends.
    """
    caster = case.caster
    assert caster is not None
    cast, instants, spacing = cast_of(case), caster.instants, caster.spacing
    began, until, speed = caster.cast_from, caster.cast_until, caster.plant.table("speed")
    first = instants[0] if began is None else began
    last = instants[-1] if until is None else min(instants[-1], until)
    here = cast.length(first)
    by_way = isinstance(spacing, Way)
    apart = spacing.length if isinstance(spacing, Way) else spacing
    above = cast.length(last) - here if by_way else last - first
    numbers = range(math.floor(above / apart * (1.0 + ROUNDING)) + 1)
    if began is None:
        length = case.casting.length
        below = length if by_way else first - cast.when(here - length)
        numbers = range(-math.floor(below / apart * (1.0 - ROUNDING)) - 1, numbers.stop)
    found = [cast.when(here + k * apart) if by_way else first + k * apart for k in numbers]
    if not by_way:
        found = [start for start in found if speed(start) > 0.0]
    if began is not None:  # the strand may stand for a while before withdrawal
        found = [began, *(start for start in found if start > began)]
    if until == last and cast.length(until) > cast.length(found[-1]) * (1.0 + ROUNDING):
        found.append(until)
    return [round(start, DIGITS) for start in found]


def ends_with_tail(case: Case) -> bool:
    """Whether the last slice is the tail of the strand."""
    assert case.caster is not None
    until = case.caster.cast_until
    return until is not None and until <= case.caster.instants[-1]


def followed(case: Case) -> list[float]:
    """Time for which each slice is followed, s: to the end of the machine or computed time."""
    assert case.caster is not None
    cast, last, length = cast_of(case), case.caster.instants[-1], case.casting.length
    starts = starts_of(case)
    ends = [cast.when(cast.length(start) + length) for start in starts]
    return [max(min(last, end) - start, 0.0) for start, end in zip(starts, ends, strict=True)]


def by_plant(case: Case) -> Case:
    """Return the case with the plant record in place of its own keys (see `slice_of`)."""
    caster = case.caster
    assert caster is not None
    plant = caster.plant
    changes: dict[str, Any] = {"output.every": f"{caster.every!r} s", "output.by_clock": True}
    for name in (name for name in ("speed", "superheat") if name in plant.values):
        changes[f"casting.{name}"] = plant.told(name)
    if "mould_heat" in plant.values:
        changes |= {f"{key}.factor": plant.told("mould_heat") for key in mould_laws(case)}
    changes |= {f"{sprays(case)[name]}.flow": plant.told(name) for name in plant.water}
    changes["title"] = case.title
    found = changed(case, changes, "caster.plant")
    return found.model_copy(update={"caster": None, "reference": (), "optimise": None})


def slice_of(case: Case, start: float) -> Case:
    """Return the case of one slice from that of all (`by_plant`) and its start on the clock, s."""
    own = case.casting.start or Start.model_validate({})
    casting = case.casting.model_copy(update={"start": own.model_copy(update={"time": start})})
    return case.model_copy(update={"casting": casting})
