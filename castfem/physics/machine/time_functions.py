"""What is tabulated along the machine, or over its speed, over the time of a slice that passes."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from castfem.base.tables import Constant, Table, as_function
from castfem.physics.machine.machine import Machine


@dataclass(frozen=True, slots=True)
class OverTime:
    """What is tabulated over position or casting speed, as the slice meets it.

    Attributes:
        table: Over one of the two.
        machine: Has both over time.
    """

    table: Table
    machine: Machine

    def __call__(self, time: float) -> float:
        """The value where the slice is, or at the speed that it has, at `time` (s)."""
        met = self.machine.speed if self.table.over == "speed" else self.machine.position
        return self.table(met(time))

    @property
    def kinks(self) -> tuple[float, ...]:
        """When the slice comes to the rows of the table, s; rows it never comes to left out."""
        if self.table.over == "speed":
            return tuple(_speeds_met(self.table.arguments, self.machine))
        times = (self.machine.time_at(position) for position in self.table.arguments)
        return tuple(time for time in times if time < math.inf)


def over_time(value: float | Table, machine: Machine) -> Constant | Table | OverTime:
    """Return a number, or a table over time, position or casting speed, over the time in s."""
    if isinstance(value, Table) and value.over in ("position", "speed"):
        return OverTime(value, machine)
    return as_function(value)


def _speeds_met(speeds: tuple[float, ...], machine: Machine) -> list[float]:
    """Instants at which the casting speed comes to given ones, m/s, up to its last kink."""
    times, found = (0.0, *machine.kinks), []
    for before, after in itertools.pairwise(times):
        begun, ended = machine.speed(before), machine.speed(after)
        if begun == ended:
            continue
        shares = ((speed - begun) / (ended - begun) for speed in speeds)
        found += [before + s * (after - before) for s in shares if 0.0 < s < 1.0]
    return found
