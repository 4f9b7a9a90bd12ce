"""The machine as the slice passes through it: position over time, and local quantities."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from castfem.base.tables import Constant, Table, as_function
from castfem.physics.machine.travel import Steady, Travel

if TYPE_CHECKING:
    from castfem.physics.machine.line import Face


GRAVITY = 9.81  # m/s2
STANDING = 10.0  # longest duration of a window of given length, in multiples of that at full speed


class Line(Protocol):
    """The line that the strand follows."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Positions at which the slope of the curvature changes, m."""

    def height(self, position: float) -> float:
        """Height of the liquid above the middle of the strand at a position, m."""

    def curvature(self, position: float, face: Face | None = None) -> float:
        """Curvature 1/R of a face there, 1/m; by default of the face to which the radii refer."""

    def inclination(self, position: float) -> float:
        """Angle to the vertical there, rad."""


@dataclass(frozen=True, slots=True)
class Vertical:
    """A straight vertical strand."""

    @property
    def knots(self) -> tuple[float, ...]:
        """See `Line`."""
        return ()

    def height(self, position: float) -> float:
        """See `Line`."""
        return position

    def curvature(self, position: float, face: Face | None = None) -> float:
        """See `Line`."""
        return 0.0

    def inclination(self, position: float) -> float:
        """See `Line`."""
        return 0.0


@dataclass(frozen=True, slots=True)
class Machine:
    """Converts time to position, and position to local quantities of the machine.

    Positions are lengths along the strand from the meniscus, m; times are those of the slice, s,
    which is at the meniscus at time 0.
    """

    travel: Travel  #: position of the slice over time
    line: Line = Vertical()  #: the line it follows
    #: length from the meniscus to the end of the mould, m; None without one
    mould_length: float | None = None

    @property
    def kinks(self) -> tuple[float, ...]:
        """Times at which the casting speed begins or ends to change, s."""
        return self.travel.kinks

    @property
    def bends(self) -> tuple[float, ...]:
        """Positions at which the slope of the curvature changes, m."""
        return self.line.knots

    def position(self, time: float) -> float:
        """Position of the slice at `time` (s), m."""
        return self.travel.position(time)

    def time_at(self, position: float) -> float:
        """Time at which the slice first reaches `position` (m), s; inf if it never does."""
        return self.travel.time_at(position)

    def speed(self, time: float) -> float:
        """Casting speed at `time` (s), m/s."""
        return self.travel.speed(time)

    def speed_between(self, first: float, last: float) -> float:
        """Mean casting speed between two positions (m), m/s; the slice must pass the first.

        If it stops for good before the second, this is the mean until it stops.
        """
        if isinstance(self.travel, Steady):
            return self.travel.speed(0.0)
        start, end = self.time_at(first), self.time_near(last)
        return (self.position(end) - first) / (end - start)

    def time_near(self, position: float) -> float:
        """Time at which the slice reaches `position` (m), or stops for good before it, s."""
        time = self.time_at(position)
        return time if time < math.inf else self.kinks[-1]

    def mean_speed(self, time: float) -> float:
        """Mean casting speed from the meniscus to `time` (s), m/s."""
        return self.travel.mean_speed(time)

    def window_time(self, length: float) -> float:
        """Shortest time of the slice for a length (m), s."""
        return length / self.travel.fastest

    def window(self, time: float, length: float) -> float:
        """Time of the slice from `time` (s) for a length (m), s.

        Where the strand is slow or stands, at most ten times the shortest time, since the slice
        also cools there.
        """
        needed = self.time_at(self.position(time) + length) - time
        return min(needed, STANDING * self.window_time(length))

    def height(self, position: float) -> float:
        """Height of the liquid above the middle of the strand at `position` (m), m.

        This is the integral of cos(inclination) along the strand.
        """
        return self.line.height(position)

    def curvature(self, position: float, face: Face | None = None) -> float:
        """Curvature 1/R of a face at `position` (m), 1/m; by default of the radii's face."""
        return self.line.curvature(position, face)

    def inclination(self, position: float) -> float:
        """Angle of the strand to the vertical at `position` (m), rad."""
        return self.line.inclination(position)

    def head(self, density: float, gravity: float = GRAVITY) -> Callable[[float], float]:
        """Ferrostatic pressure rho g D over time, Pa, of liquid of a density, kg/m3."""
        if isinstance(self.line, Vertical) and isinstance(self.travel, Steady):
            rise = density * gravity * self.travel.speed(0.0)  # Pa/s: linear in time
            return lambda time: rise * time
        return lambda time: density * gravity * self.height(self.position(time))


@dataclass(frozen=True, slots=True)
class OverTime:
    """A table over position or casting speed as a function of the slice's time."""

    table: Table  #: table over one of the two
    machine: Machine  #: gives both over time

    def __call__(self, time: float) -> float:
        """Value at the position, or speed, of the slice at `time` (s)."""
        met = self.machine.speed if self.table.over == "speed" else self.machine.position
        return self.table(met(time))

    @property
    def kinks(self) -> tuple[float, ...]:
        """Times at which the slice reaches rows of the table, s."""
        if self.table.over == "speed":
            return tuple(_speeds_met(self.table.arguments, self.machine))
        times = (self.machine.time_at(position) for position in self.table.arguments)
        return tuple(time for time in times if time < math.inf)


def over_time(value: float | Table, machine: Machine) -> Constant | Table | OverTime:
    """Convert a number, or a table over time, position or speed, to a function of time, s."""
    if isinstance(value, Table) and value.over in ("position", "speed"):
        return OverTime(value, machine)
    return as_function(value)


def _speeds_met(speeds: tuple[float, ...], machine: Machine) -> list[float]:
    """Times at which the casting speed reaches given values, m/s, up to its last kink."""
    times, found = (0.0, *machine.kinks), []
    for before, after in itertools.pairwise(times):
        begun, ended = machine.speed(before), machine.speed(after)
        if begun == ended:
            continue
        shares = ((speed - begun) / (ended - begun) for speed in speeds)
        found += [before + s * (after - before) for s in shares if 0.0 < s < 1.0]
    return found
