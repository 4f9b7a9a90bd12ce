"""A contour of segments, and its intersections with rays from the strand's surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.physics.mould.segments import (
    Circular,
    Circulars,
    Crossing,
    Parabolic,
    Parabolics,
    Segment,
    Straight,
    Straights,
)
from castfem.physics.mould.wall import GapFunction

_Group = Straights | Circulars | Parabolics


class Contour:
    """A wall in one plane: segments counter-clockwise around the cavity.

    Of several intersections of a ray the nearest counts, on either side of the point.

    Args:
        segments: The wall.
        prolonged: Straight continuations of the faces, for points that have left the cavity past a
            corner; used only by rays that meet no segment.

    Attributes:
        segments: As given.
        prolonged: As given.
    """

    def __init__(self, segments: Sequence[Segment], prolonged: Sequence[Segment] = ()) -> None:
        if not segments:
            raise ValueError("a contour needs at least one segment")
        self.segments = tuple(segments)
        self.prolonged = tuple(prolonged)
        ends = np.array([p for s in self.segments for p in (s.start, s.end)])
        # Overlap of the segments at their joints.
        self._slack = ROUNDING * float(np.abs(ends).max())
        self._groups = _gathered(self.segments)
        self._behind = _gathered(self.prolonged)

    def gap_function(self, points: Array, normals: Array) -> GapFunction:
        """Return where points (n, 2) meet the contour along their unit normals (n, 2)."""
        p = np.ascontiguousarray(np.asarray(points, dtype=float).T)
        m = np.ascontiguousarray(np.asarray(normals, dtype=float).T)
        gap, nx, ny, curvature = self._nearest(self._groups, p, m)
        missed = ~np.isfinite(gap)
        if self._behind and missed.any():
            found = self._nearest(self._behind, p[:, missed], m[:, missed])
            gap[missed], nx[missed], ny[missed], curvature[missed] = found
            missed = ~np.isfinite(gap)
        nx[missed], ny[missed], curvature[missed] = m[0, missed], m[1, missed], 0.0
        return GapFunction(gap, np.stack([nx, ny], axis=1), curvature)

    def outline(self, fine: int = 33) -> Array:
        """Return points (n, 2) along the contour, closed if it is, m."""
        parts = [s.points(2 if isinstance(s, Straight) else fine) for s in self.segments]
        return np.concatenate(parts)

    def _nearest(self, groups: Sequence[_Group], p: Array, m: Array) -> Crossing:
        """Return the nearest crossing (n,) among all segments of the groups."""
        with np.errstate(invalid="ignore", over="ignore"):  # for points that are not finite
            crossings = [group.cross(p, m, self._slack) for group in groups]
        d, nx, ny, curvature = (
            np.concatenate(parts) if len(parts) > 1 else parts[0]
            for parts in zip(*crossings, strict=True)
        )
        nearest = np.abs(d).argmin(axis=0), np.arange(d.shape[1])
        return d[nearest], nx[nearest], ny[nearest], curvature[nearest]


def _gathered(segments: Sequence[Segment]) -> list[_Group]:
    """Return the segments by kind, as arrays."""
    groups: list[_Group] = []
    if lines := [s for s in segments if isinstance(s, Straight)]:
        groups.append(Straights.of(lines))
    if arcs := [s for s in segments if isinstance(s, Circular)]:
        groups.append(Circulars.of(arcs))
    if parabolas := [s for s in segments if isinstance(s, Parabolic)]:
        groups.append(Parabolics.of(parabolas))
    return groups
