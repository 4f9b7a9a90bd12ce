"""Position of a slice over time: the casting speed and its integral."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import Protocol

from castfem.base.constants import EXACT


class Travel(Protocol):
    """Position over time of a slice that is at the meniscus at time 0."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """Times at which the acceleration changes, s."""

    @property
    def fastest(self) -> float:
        """Largest casting speed, m/s."""

    @property
    def slowest(self) -> float:
        """Smallest casting speed, m/s; 0 if the strand stands for a while."""

    def position(self, time: float) -> float:
        """Position below the meniscus at `time` (s), m."""

    def time_at(self, position: float) -> float:
        """Time at which the slice first reaches `position` (m), s; inf if it never does."""

    def speed(self, time: float) -> float:
        """Casting speed at `time` (s), m/s."""

    def mean_speed(self, time: float) -> float:
        """Mean casting speed from the meniscus to `time` (s), m/s."""


class Steady:
    """A constant casting speed.

    Args:
        speed: Casting speed, m/s, positive.

    Raises:
        ValueError: The speed is not positive.
    """

    kinks: tuple[float, ...] = ()

    def __init__(self, speed: float) -> None:
        if not 0.0 < speed < math.inf:
            raise ValueError(f"the casting speed must be positive, not {speed:g} m/s")
        self._speed = self.fastest = self.slowest = speed

    def position(self, time: float) -> float:
        """See `Travel`."""
        return self._speed * time

    def time_at(self, position: float) -> float:
        """See `Travel`."""
        return position / self._speed

    def speed(self, time: float) -> float:
        """See `Travel`."""
        return self._speed

    def mean_speed(self, time: float) -> float:
        """See `Travel`."""
        return self._speed


class Changing:
    """A casting speed that is linear between given times and constant outside them.

    The position is its exact integral: a parabola between two times.

    Args:
        times: Increasing times, s; the slice is at the meniscus at time 0.
        speeds: Speeds at these times, m/s; not negative, 0 where the strand stands.

    Raises:
        ValueError: Times or speeds are invalid.
    """

    def __init__(self, times: Sequence[float], speeds: Sequence[float]) -> None:
        if len(times) != len(speeds) or not len(times):
            raise ValueError("a casting speed that changes needs as many speeds as times")
        if any(not later > before for before, later in itertools.pairwise(times)):
            raise ValueError("the times of the casting speed must increase")
        if any(not 0.0 <= speed < math.inf for speed in speeds):
            raise ValueError("the casting speed must not be negative: no strand goes back up")
        later = [i for i, time in enumerate(times) if time > 0.0]
        self._times = [0.0, *(times[i] for i in later)]
        self._speeds = [_between(times, speeds, 0.0), *(speeds[i] for i in later)]
        self._positions = [0.0]
        for i in range(1, len(self._times)):
            step, mean = self._times[i] - self._times[i - 1], self._speeds[i - 1] + self._speeds[i]
            self._positions.append(self._positions[-1] + 0.5 * mean * step)

    @property
    def kinks(self) -> tuple[float, ...]:
        """See `Travel`."""
        return tuple(self._times[1:])

    @property
    def fastest(self) -> float:
        """See `Travel`."""
        return max(self._speeds)

    @property
    def slowest(self) -> float:
        """See `Travel`."""
        return min(self._speeds)

    def position(self, time: float) -> float:
        """See `Travel`."""
        i = max(bisect_right(self._times, time) - 1, 0)
        elapsed = time - self._times[i]
        return self._positions[i] + elapsed * (
            self._speeds[i] + 0.5 * self._acceleration(i) * elapsed
        )

    def time_at(self, position: float) -> float:
        """See `Travel`."""
        hair = EXACT * abs(position)
        # Near a stop the parabola is flat: rounding of the position would give a time just before
        # the stop.
        i = bisect_left(self._positions, position - hair)
        if i < len(self._positions) and self._positions[i] <= position + hair:
            return self._times[i]
        i = max(i - 1, 0)
        left, speed = position - self._positions[i], self._speeds[i]
        root = math.sqrt(max(speed**2 + 2.0 * self._acceleration(i) * left, 0.0))
        return self._times[i] + (2.0 * left / (speed + root) if speed + root > 0.0 else math.inf)

    def speed(self, time: float) -> float:
        """See `Travel`."""
        return _between(self._times, self._speeds, time)

    def mean_speed(self, time: float) -> float:
        """See `Travel`."""
        return self.position(time) / time if time > 0.0 else self._speeds[0]

    def _acceleration(self, i: int) -> float:
        """Acceleration in the segment that begins at a time, m/s2; 0 after the last."""
        if i + 1 >= len(self._times):
            return 0.0
        return (self._speeds[i + 1] - self._speeds[i]) / (self._times[i + 1] - self._times[i])


def _between(times: Sequence[float], speeds: Sequence[float], time: float) -> float:
    """Speed at a time: linear between the given times, constant outside."""
    i = bisect_right(times, time)
    if i == 0 or i == len(times):
        return speeds[min(i, len(times) - 1)]
    share = (time - times[i - 1]) / (times[i] - times[i - 1])
    return speeds[i - 1] + share * (speeds[i] - speeds[i - 1])
