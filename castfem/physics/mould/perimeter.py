"""Places around a quarter of a mould's wall that keep their identity along the mould.

A quarter runs counter-clockwise from the middle of the right-hand face over the corner to the
middle of the upper face: three pieces, of which a round has only the corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array, Indices
from castfem.physics.mould.cavity import Cavity, RectangleCavity, RoundCavity, Sides, Tapers

RIGHT, CORNER, UPPER = range(3)
"""Pieces of a quarter."""


def sides_of(cavity: Cavity, tapers: Tapers, position: float) -> Sides:
    """Return the sizes of a cavity at a position; for a round all are its radius.

    Raises:
        ValueError: A wall of this shape cannot be offset to a tube.
    """
    if isinstance(cavity, RectangleCavity):
        return cavity.sides(tapers, position, 1.0)
    if isinstance(cavity, RoundCavity):
        radius = 0.5 * cavity.dimensions(tapers, position, 1.0)["diameter"]
        return Sides((radius, radius), (radius, radius), radius)
    raise ValueError("only a rectangle or a round has a wall in three pieces, not a beam blank")


def lengths(sides: Sides) -> tuple[float, float, float]:
    """Return the lengths of the pieces, m; for a parabolic face that of its chord."""
    (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
    return math.hypot(p - a, q - r), 0.5 * math.pi * r, math.hypot(q - b, p - r)


def corner_of(sides: Sides, ways: Array) -> int | None:
    """Return the index of the place in the middle of the corner of a quarter; None for a round."""
    right, arc, upper = lengths(sides)
    if right == upper == 0.0:
        return None
    return int(np.argmin(np.abs(ways - right - 0.5 * arc)))


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Places on a quarter of the wall."""

    piece: Indices  #: piece of each place (n,)
    share: Array  #: relative position on the piece from its start (n,), 0 to 1

    @classmethod
    def spread(cls, sides: Sides, face_cells: int, corner_cells: int, order: int = 2) -> Places:
        """Return the nodes of cells around a quarter, denser on the faces towards the corner.

        Args:
            sides: Sizes of the section.
            face_cells: Number of cells on half a face.
            corner_cells: Number of cells on the corner.
            order: Order of the cells: 2 adds a place in the middle of each.
        """
        # Cells on a face grow from the corner to the middle.
        towards = 1.0 - (1.0 - np.linspace(0.0, 1.0, face_cells + 1)) ** 1.5
        ends = {
            RIGHT: towards,
            CORNER: np.linspace(0.0, 1.0, corner_cells + 1),
            UPPER: 1.0 - towards[::-1],
        }
        size = max(sides.middle)
        kept = [i for i, length in enumerate(lengths(sides)) if length > ROUNDING * size]
        piece: list[int] = []
        share: list[float] = []
        for i in kept:
            nodes = ends[i]
            if order == 2:
                between = 0.5 * (nodes[1:] + nodes[:-1])
                nodes = np.sort(np.concatenate([nodes, between]))
            nodes = nodes if i == kept[-1] else nodes[:-1]
            piece += [i] * len(nodes)
            share += [float(node) for node in nodes]
        return cls(np.array(piece), np.array(share))

    @classmethod
    def at_ways(cls, sides: Sides, ways: Array) -> Places:
        """Return the places at lengths of the wall from the middle of the right-hand face, m."""
        found = np.array(lengths(sides))
        starts = np.concatenate([[0.0], np.cumsum(found)])
        piece = np.clip(np.searchsorted(starts, np.asarray(ways), side="right") - 1, 0, 2)
        while (empty := found[piece] <= ROUNDING * max(sides.middle)).any():
            piece = np.where(empty, np.where(piece == UPPER, CORNER, piece + 1), piece)
        share = (np.asarray(ways) - starts[piece]) / found[piece]
        return cls(piece, np.clip(share, 0.0, 1.0))

    def ways(self, sides: Sides) -> Array:
        """Return the length of wall (n,) from the middle of the right-hand face, m."""
        found = np.array(lengths(sides))
        starts = np.concatenate([[0.0], np.cumsum(found)])[:-1]
        return np.asarray(starts[self.piece] + self.share * found[self.piece])

    def on(self, sides: Sides) -> tuple[Array, Array]:
        """Return the points (n, 2), m, and the unit normals (n, 2) out of the cavity.

        At the ends of the corner the normal is that of the arc.
        """
        (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
        t, points = self.share, np.zeros((len(self.share), 2))
        normals = np.zeros_like(points)
        for here, middle, end, reach, flip in (
            (self.piece == RIGHT, a, p, q, False),
            (self.piece == UPPER, b, q, p, True),
        ):
            s = 1.0 - t[here] if flip else t[here]
            along, out = (reach - r) * s, middle + (end - middle) * s**2
            slope = 2.0 * (end - middle) * s / (reach - r) if reach > r else np.zeros_like(s)
            unit = np.stack([np.ones_like(s), -slope], 1) / np.hypot(1.0, slope)[:, None]
            place = np.stack([out, along], 1)
            points[here], normals[here] = (place[:, ::-1], unit[:, ::-1]) if flip else (place, unit)
        arc = self.piece == CORNER
        angle = 0.5 * np.pi * t[arc]
        unit = np.stack([np.cos(angle), np.sin(angle)], 1)
        points[arc], normals[arc] = np.array([p - r, q - r]) + r * unit, unit
        start = np.flatnonzero((self.piece == UPPER) & (t == 0.0))
        if r > 0.0 and start.size:
            normals[start] = (0.0, 1.0)
        return points, normals
