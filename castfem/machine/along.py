"""What is tabulated along the machine, over the time of a slice that passes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from castfem.machine.machine import Machine
from castfem.values.tables import Table


@dataclass(frozen=True, slots=True)
class OverTime:
    """What is tabulated along the machine, as the slice meets it.

    Attributes:
        table: Over position.
        machine: Has the slice's position over time.
    """

    table: Table
    machine: Machine

    def __call__(self, time: float) -> float:
        """The value where the slice is at `time` (s)."""
        return self.table(self.machine.position(time))

    @property
    def kinks(self) -> tuple[float, ...]:
        """When the slice comes to the rows of the table, s; rows it never comes to left out."""
        times = (self.machine.time_at(position) for position in self.table.arguments)
        return tuple(time for time in times if time < math.inf)
