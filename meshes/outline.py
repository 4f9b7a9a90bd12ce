"""The outline of a quarter section: straight and circular pieces, each in a named group.

The outline is the exact geometry: it classifies boundary facets, puts the nodes of second order on
the true arcs, and gives the exact area a mesh is checked against. The section lies on the left of
its pieces (counter-clockwise order).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """A straight segment or a circular arc of an outline."""

    group: str  #: name of the boundary group
    start: Point  #: first point (x, y), m
    end: Point  #: last point, m
    #: Centre of the arc; None for a segment. Arcs turn by less than half a circle.
    centre: Point | None = None
    #: how the name splits when the quarter is mirrored: "x" (left and right), "y" (intrados and
    #: extrados), "xy" (both) or "" (the line of symmetry itself)
    mirrors: str = ""

    @property
    def radius(self) -> float:
        """Radius of the arc, m; 0 for a segment."""
        if self.centre is None:
            return 0.0
        return math.dist(self.start, self.centre)

    @property
    def turn(self) -> float:
        """Signed angle from the start to the end of the arc, rad; positive where convex."""
        if self.centre is None:
            return 0.0
        (ax, ay), (bx, by) = self._from_centre(self.start), self._from_centre(self.end)
        return math.atan2(ax * by - ay * bx, ax * bx + ay * by)

    @property
    def length(self) -> float:
        """Length along the piece, m."""
        if self.centre is None:
            return math.dist(self.start, self.end)
        return self.radius * abs(self.turn)

    def _from_centre(self, point: Point) -> Point:
        cx, cy = self.centre or (0.0, 0.0)
        return point[0] - cx, point[1] - cy

    def at(self, distance: np.ndarray) -> np.ndarray:
        """Points (n, 2) at distances (n,) along the piece from its start, m.

        The two ends are returned exactly, so that neighbouring pieces meet in one point.
        """
        s = np.asarray(distance, dtype=float) / self.length
        start, end = np.array(self.start), np.array(self.end)
        if self.centre is None:
            points = start + s[:, None] * (end - start)
        else:
            dx, dy = self._from_centre(self.start)
            angle = math.atan2(dy, dx) + s * self.turn
            points = np.array(self.centre) + self.radius * np.stack(
                [np.cos(angle), np.sin(angle)], axis=1
            )
        points[s <= 0.0], points[s >= 1.0] = start, end
        return points

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) of points (n, 2) from the piece, m."""
        x = np.asarray(points, dtype=float)
        start, end = np.array(self.start), np.array(self.end)
        to_ends = np.minimum(np.hypot(*(x - start).T), np.hypot(*(x - end).T))
        if self.centre is None:
            along = end - start
            s = np.clip((x - start) @ along / (along @ along), 0.0, 1.0)
            return np.hypot(*(x - start - s[:, None] * along).T)
        d, a = x - np.array(self.centre), np.array(self._from_centre(self.start))
        angle = np.arctan2(a[0] * d[:, 1] - a[1] * d[:, 0], d @ a) * math.copysign(1.0, self.turn)
        inside = (angle >= -1e-12) & (angle <= abs(self.turn) + 1e-12)
        return np.where(inside, np.abs(np.hypot(*d.T) - self.radius), to_ends)

    def onto(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 2) moved along the radius onto the arc; unchanged for a segment."""
        if self.centre is None:
            return points
        d = points - np.array(self.centre)
        return np.array(self.centre) + self.radius * d / np.hypot(*d.T)[:, None]


@dataclass(frozen=True, slots=True)
class Outline:
    """Closed outline of the modelled quarter, counter-clockwise."""

    pieces: tuple[Piece, ...]  #: pieces in order; each ends where the next one starts

    @property
    def surface(self) -> tuple[Piece, ...]:
        """The pieces that are not lines of symmetry."""
        return tuple(p for p in self.pieces if not p.group.startswith("symmetry"))

    @property
    def extent(self) -> float:
        """Largest coordinate, the length tolerances refer to, m."""
        return max(abs(c) for p in self.pieces for c in (*p.start, *p.end))

    def area(self) -> float:
        """Exact enclosed area, m2: the polygon of the ends and a circular segment for each arc."""
        total = 0.0
        for p in self.pieces:
            (ax, ay), (bx, by) = p.start, p.end
            total += 0.5 * (ax * by - bx * ay)
            total += 0.5 * p.radius**2 * (p.turn - math.sin(p.turn))
        return total

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) of points (n, 2) from the surface, lines of symmetry left out, m."""
        return np.min([p.distance(points) for p in self.surface], axis=0)

    def classify(self, points: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """Index (f,) of the piece on which each facet (f, 2) lies.

        Raises:
            ValueError: A facet lies on no piece: the mesh does not fill the outline.
        """
        ends = points[facets]
        worst = np.array(
            [np.maximum(p.distance(ends[:, 0]), p.distance(ends[:, 1])) for p in self.pieces]
        )
        found = np.argmin(worst, axis=0)
        lost = worst[found, np.arange(len(facets))] > 1e-7 * self.extent
        if lost.any():
            x, y = ends[lost][0].mean(axis=0)
            raise ValueError(
                f"the boundary facet at ({x:.6g}, {y:.6g}) m lies on no piece of the outline"
            )
        return found


def chain(pieces: Sequence[Piece]) -> Outline:
    """Close pieces into an outline, leaving out those of no length.

    Raises:
        ValueError: A piece does not start where the one before it ends.
    """
    scale = max(abs(c) for p in pieces for c in (*p.start, *p.end))
    kept = tuple(p for p in pieces if math.dist(p.start, p.end) > 1e-9 * scale)
    for before, after in zip(kept, kept[1:] + kept[:1], strict=True):
        if math.dist(before.end, after.start) > 1e-9 * scale:
            raise ValueError(
                f"the outline is open between {before.group} and {after.group}: {before.end} "
                f"is not {after.start}"
            )
    return Outline(kept)


def quarter(surface: Sequence[Piece]) -> Outline:
    """Outline of a quarter: its surface, from (a, 0) to (0, b), and the two lines of symmetry."""
    right, top = surface[0].start, surface[-1].end
    return chain(
        [
            Piece("symmetry_y", (0.0, 0.0), right),
            *surface,
            Piece("symmetry_x", top, (0.0, 0.0)),
        ]
    )
