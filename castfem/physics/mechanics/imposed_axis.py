"""A neutral axis that is imposed: on one face in bending, on another in straightening.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass

UNCHANGED = 1e-9  # of a curvature: how much it changes by rounding alone


@dataclass(frozen=True)
class ImposedAxis:
    """Where the thickness of the slice stays as it is, from one instant to the next (42).

    Attributes:
        times: From which on each place holds (n,), s; the first holds before, too.
        places: y1 (n,), m.
        thicknesses: Of the slice there (n,).
    """

    times: tuple[float, ...]
    places: tuple[float, ...]
    thicknesses: tuple[float, ...]

    @classmethod
    def alternating(
        cls,
        curvature: Callable[[float], float],
        times: Sequence[float],
        bending: float,
        straightening: float,
    ) -> ImposedAxis:
        """One place where the curvature grows, another where it decreases.

        Where it stays, the place stays. The slice goes on as thick as it is when the place changes,
        and it is 1 thick at the first.

        Args:
            curvature: k of the strand's middle over time, 1/m.
            times: Between which it is monotonic, increasing, s.
            bending: y1 where it grows, m.
            straightening: y1 where it decreases, m.
        """
        found = [(times[0], bending, 1.0)]
        for start, end in itertools.pairwise(times):
            before, after = abs(curvature(start)), abs(curvature(end))
            if abs(after - before) <= UNCHANGED * max(before, after):
                continue
            place = bending if after > before else straightening
            _, last, thickness = found[-1]
            if place != last:
                k = curvature(start)
                found.append((start, place, thickness * (1.0 - k * place) / (1.0 - k * last)))
        parts = tuple(zip(*found, strict=True))
        return cls(*parts)

    def at(self, time: float) -> tuple[float, float]:
        """The place y1, m, and the thickness of the slice there, at `time` (s)."""
        i = max(bisect_right(self.times, time) - 1, 0)
        return self.places[i], self.thicknesses[i]
