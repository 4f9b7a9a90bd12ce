"""One-dimensional grading: geometric progressions of cell sizes between named lengths.

The size at a distance `u` from the fine end is a piecewise linear function

    h(u) = fine                            for u <= keep
    h(u) = min(fine + slope (u - keep), coarse)    beyond.

Cells that equidistribute `du / h` follow a geometric progression of ratio exp(slope) where h is
linear, so the ratio of neighbours never exceeds exp(slope), and cutting every size by two cuts
every cell by two: a family of meshes for a convergence study needs no other parameter changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

LARGEST_GROWTH = 1.3
"""Largest ratio of neighbouring cell sizes a grading law asks for."""

_LARGEST_SLOPE = math.log(LARGEST_GROWTH)


@dataclass(frozen=True, slots=True)
class SizeLaw:
    """Cell size against the distance from the fine end."""

    fine: float  #: size of the first cell, m
    coarse: float  #: largest size, m; not below `fine`
    keep: float = 0.0  #: distance over which the fine size is kept, m
    #: growth of the size per unit distance; the ratio of neighbours is exp(slope)
    slope: float = 0.0
    #: size at the very end where a narrow feature asks for less than `fine`; it grows to the law
    #: with the ratio `LARGEST_GROWTH`. 0 for none
    lead: float = 0.0

    def _segments(self) -> list[tuple[float, float, float, float]]:
        """Segments of the piecewise linear size: start, end (the last at inf), size, slope."""
        coarse, g = max(self.coarse, self.fine), self.slope
        start = self.fine
        if self.keep <= 0.0 and g > 1e-12:
            start *= g / math.expm1(g)  # makes the first whole cell exactly `fine` long
        knots = [(0.0, start, 0.0)]
        if g > 1e-12:
            reach = self.keep + (coarse - start) / g
            knots += [(self.keep, start, g), (reach, coarse, 0.0)]
        if 0.0 < self.lead < start:
            steep = _LARGEST_SLOPE
            first = self.lead * steep / math.expm1(steep)
            ends = [k[0] for k in knots[1:]] + [math.inf]
            meet = min(_crossing(first, steep, k, v) for k, v in zip(knots, ends, strict=True))
            rest = [k for k in knots if k[0] > meet]
            before = [k for k in knots if k[0] <= meet][-1]
            knots = [(0.0, first, steep), (meet, first + steep * meet, before[2]), *rest]
        ends = [k[0] for k in knots[1:]] + [math.inf]
        return [(u, v, h, s) for (u, h, s), v in zip(knots, ends, strict=True) if v > u]

    def size(self, distance: np.ndarray) -> np.ndarray:
        """Size wanted at each distance (n,) from the fine end, m."""
        sizes: np.ndarray = np.zeros_like(np.asarray(distance, dtype=float))
        for u, _, h, g in self._segments():
            sizes = np.where(distance >= u, h + g * (distance - u), sizes)
        return sizes

    def count(self, length: float) -> float:
        """Cells (a real number) that fill a length."""
        total = 0.0
        for u, v, h, g in self._segments():
            if length <= u:
                break
            d = min(v, length) - u
            total += d / h if g * d < 1e-12 * h else math.log1p(g * d / h) / g
        return total

    def cells(self, length: float) -> int:
        """Smallest number of cells, at least one, none of them larger than the law allows."""
        return max(1, math.ceil(self.count(length) - 1e-9))

    def nodes(self, length: float, cells: int | None = None) -> np.ndarray:
        """Nodes from 0 (fine end) to `length` (coarse end).

        Args:
            length: Length to fill, m.
            cells: Number of cells; by default the smallest that respects the sizes.

        Returns:
            Array (cells + 1,): all sizes are the law's, shrunk by about one common factor.
        """
        n = self.cells(length) if cells is None else cells
        wanted = self.count(length) * np.arange(n + 1) / n
        nodes: np.ndarray = np.zeros(n + 1)
        done = 0.0
        for u, v, h, g in self._segments():
            if u >= length:
                break
            here = np.maximum(wanted - done, 0.0)
            grown = h * here if g < 1e-12 else h * np.expm1(np.minimum(g * here, 700.0)) / g
            nodes = np.where(wanted >= done, u + grown, nodes)
            done = self.count(v) if math.isfinite(v) else math.inf
        nodes[0], nodes[-1] = 0.0, length
        return nodes

    def fitted(self, length: float, cells: int) -> SizeLaw:
        """The same law with the slope that makes it fill `length` with `cells` cells.

        The fine size and the length over which it is kept stay. Where there are more cells than
        the fine size alone needs, the size is constant and below it; where the coarse size would
        leave cells short, it is exceeded.
        """
        flat = replace(self, slope=0.0, coarse=max(self.coarse, self.fine))
        if cells == 1 or flat.count(length) <= cells:
            return flat
        keep = min(self.keep, 0.5 * self.fine * (cells - 1))
        trial = replace(flat, keep=keep)
        low, high = 0.0, 2.0
        if replace(trial, slope=high).count(length) > cells:
            trial, high = replace(trial, coarse=math.inf), 50.0
        for _ in range(44):
            middle = 0.5 * (low + high)
            if replace(trial, slope=middle).count(length) > cells:
                low = middle
            else:
                high = middle
        return replace(trial, slope=high)


def size_law(fine: float, coarse: float, keep: float, reach: float) -> SizeLaw:
    """Law that keeps `fine` up to `keep` and has grown to `coarse` at the distance `reach`.

    The growth is limited to `LARGEST_GROWTH`, so `coarse` may be met later, or not at all.
    """
    span = max(reach - keep, 1e-300)
    slope = min(max(coarse - fine, 0.0) / span, _LARGEST_SLOPE)
    return SizeLaw(fine=fine, coarse=max(coarse, fine), keep=keep, slope=slope)


def _crossing(first: float, steep: float, knot: tuple[float, float, float], end: float) -> float:
    """Distance at which `first + steep u` meets the segment of a law; inf if it does not."""
    start, size, slope = knot
    if steep - slope < 1e-9:
        return math.inf
    meet = (size - slope * start - first) / (steep - slope)
    return meet if start <= meet <= end else math.inf


def two_sided(length: float, first: SizeLaw, last: SizeLaw, cells: int | None = None) -> np.ndarray:
    """Nodes (cells + 1,) from 0 to `length`, graded from both ends.

    Args:
        length: Length to fill, m.
        first: Law of the distance from 0.
        last: Law of the distance from the other end; the smaller size of the two holds.
        cells: Number of cells; by default the smallest that respects the sizes. A given number is
            met by the slope of the laws, the sizes at the two ends are kept if they can be.
    """
    u = np.linspace(0.0, length, 4001)

    def counted(slope: float | None = None, cap: bool = True) -> np.ndarray:
        laws = [law if slope is None else replace(law, slope=slope) for law in (first, last)]
        if not cap:
            laws = [replace(law, coarse=math.inf) for law in laws]
        density = 1.0 / np.minimum(laws[0].size(u), laws[1].size(length - u))
        return np.r_[0.0, np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(u))]

    total = counted()
    if cells is None:
        cells = max(1, math.ceil(float(total[-1]) - 1e-6))
    else:
        cap = bool(counted(_LARGEST_SLOPE)[-1] <= cells)
        low, high = 0.0, _LARGEST_SLOPE if cap else 2.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if counted(middle, cap)[-1] > cells else (low, middle)
        total = counted(high, cap)
    nodes = np.interp(total[-1] * np.arange(cells + 1) / cells, total, u)
    nodes[0], nodes[-1] = 0.0, length
    return nodes
