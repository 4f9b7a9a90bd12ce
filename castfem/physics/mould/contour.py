"""A contour of segments, and its intersections with rays from the strand's surface."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.physics.mould.crossings import COLUMNS, nearest
from castfem.physics.mould.segments import Segment, Straight
from castfem.physics.mould.wall import GapFunction


class Contour:
    """A wall in one plane: segments counter-clockwise around the cavity.

    Of several intersections of a ray the nearest counts, on either side of the point.

    Args:
        segments: The wall.
        prolonged: Straight continuations of the faces, for points that have left the cavity past a
            corner; used only by rays that meet no segment.

    Attributes:
        segments: Segments of the wall.
        prolonged: Straight continuations of the faces.
    """

    def __init__(self, segments: Sequence[Segment], prolonged: Sequence[Segment] = ()) -> None:
        if not segments:
            raise ValueError("a contour needs at least one segment")
        self.segments = tuple(segments)
        self.prolonged = tuple(prolonged)
        ends = np.array([p for s in self.segments for p in (s.start, s.end)])
        # Overlap of the segments at their joints.
        self._slack = ROUNDING * float(np.abs(ends).max())
        self._walls, self._behind = _gathered(self.segments), _gathered(self.prolonged)

    def gap_function(self, points: Array, normals: Array) -> GapFunction:
        """Return where points (n, 2) meet the contour along their unit normals (n, 2)."""
        p, m = (np.ascontiguousarray(given, dtype=float) for given in (points, normals))
        found = nearest(self._walls, p, m, self._slack)
        missed = np.isinf(found[0])
        if len(self._behind) and missed.any():
            found[:, missed] = nearest(self._behind, p[missed], m[missed], self._slack)
        return GapFunction(found[0], found[1:3].T, found[3])

    def outline(self, fine: int = 33) -> Array:
        """Return points (n, 2) along the contour, closed if it is, m."""
        parts = [s.points(2 if isinstance(s, Straight) else fine) for s in self.segments]
        return np.concatenate(parts)


def _gathered(segments: Sequence[Segment]) -> Array:
    """The segments by kind, as rows (k, COLUMNS): of two at the same distance the first counts."""
    rows = np.zeros((len(segments), COLUMNS))
    for row, numbers in zip(
        rows, sorted((s.numbers() for s in segments), key=itemgetter(0)), strict=True
    ):
        row[: len(numbers)] = numbers
    return rows
