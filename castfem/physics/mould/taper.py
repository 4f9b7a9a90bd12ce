"""Taper: closing of the wall along the mould.

Taper is the relative change of a linear dimension w of the cavity per metre, relative to the outlet
(300):

    t = (w_in - w_out) / (w_out h),    positive where the mould closes downwards.

For a taper in several zones (300) is applied to each zone with its own inlet, outlet and height, as
in (303). Within a zone the dimension is linear in the position, or a parabola whose local taper -w'
/ w_out is linear from one value to another; their mean is then t of (300).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from castfem.base.constants import ROUNDING
from castfem.base.tables import Table


@dataclass(frozen=True, slots=True)
class TaperSegment:
    """A segment of the mould with one taper."""

    end: float | None  #: end of the segment, from the meniscus, m; None for the end of the mould
    top: float  #: taper (300) at its upper end, 1/m
    bottom: float  #: taper at its lower end, 1/m; equal to that at the top if linear

    @property
    def mean(self) -> float:
        """Taper (300) from its inlet to its outlet, 1/m."""
        return 0.5 * (self.top + self.bottom)


class TaperProfile(Protocol):
    """A linear dimension of the cavity as a function of the position below the meniscus."""

    def half(self, position: float, start: float) -> float:
        """Return half the dimension at a position, m, which is `start` at the meniscus."""

    def knots(self) -> tuple[float, ...]:
        """Return the positions at which its slope jumps, from the meniscus to the end, m."""


@dataclass(frozen=True, slots=True)
class Taper:
    """Taper in segments: one for a single taper, two for a double one, and so on."""

    #: segments in casting order, each with its end; the last one ends with the mould
    segments: tuple[TaperSegment, ...]

    def __post_init__(self) -> None:
        """Refuse segments that are out of order, or that close the mould completely."""
        top = 0.0
        for number, segment in enumerate(self.segments, start=1):
            if segment.end is None or not segment.end > top:
                raise ValueError(
                    f"segment {number} of the taper must end beyond the one before ({top:g} m)"
                )
            if not 1.0 + segment.mean * (segment.end - top) > 0.0:
                raise ValueError(
                    f"a taper of {100.0 * segment.mean:g} %/m over {segment.end - top:g} m has no "
                    "outlet: by (300) it must be above -100 % over its length"
                )
            top = segment.end
        if not self.segments:
            raise ValueError("a taper needs at least one segment")

    @classmethod
    def single(cls, taper: float, length: float) -> Taper:
        """Return one taper (1/m) from the meniscus to `length` (m)."""
        return cls((TaperSegment(length, taper, taper),))

    def half(self, position: float, start: float) -> float:
        """Return half the dimension at a position, m; see `TaperProfile`."""
        size, top = start, 0.0
        for segment in self.segments:
            assert segment.end is not None
            height = segment.end - top
            outlet = size / (1.0 + segment.mean * height)
            if position < segment.end:
                down = max(position - top, 0.0)
                local = segment.top + 0.5 * (segment.bottom - segment.top) * down / height
                return size - outlet * local * down
            size, top = outlet, segment.end
        return size

    def knots(self) -> tuple[float, ...]:
        """Return the ends of the segments with the meniscus; see `TaperProfile`."""
        return (0.0, *(float(s.end or 0.0) for s in self.segments))


@dataclass(frozen=True, slots=True)
class Displaced:
    """A wall displaced by a table: a measured profile, or a step."""

    #: displacement of the wall into the cavity, m, over the position below the meniscus
    closing: Table

    def half(self, position: float, start: float) -> float:
        """Return half the dimension at a position, m; see `TaperProfile`.

        The table gives the displacement since the meniscus: its value there is subtracted.
        """
        return start - (self.closing(position) - self.closing(0.0))

    def knots(self) -> tuple[float, ...]:
        """Return its positions from the meniscus on; see `TaperProfile`."""
        return (0.0, *(p for p in self.closing.kinks if p > 0.0))


def taper_between(inlet: float, outlet: float, height: float) -> float:
    """Return the taper (300) of a dimension, 1/m."""
    return (inlet - outlet) / (outlet * height)


def segment_ends(profiles: Sequence[TaperProfile], length: float) -> list[float]:
    """Return the ends of all segments between the meniscus and the end of the mould, m."""
    ends = [0.0]
    for knot in sorted({k for profile in profiles for k in profile.knots()} | {length}):
        if ends[-1] + ROUNDING * length < knot <= length * (1.0 - ROUNDING) or knot == length:
            ends.append(knot)
    return ends
