"""Side view of a strand between its rolls, and positions of its slices in space."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.physics.machine.line import INWARD
from castfem.physics.machine.rolls import Rolls


class Side:
    """Side view of the strand: points of its faces by position.

    Points are distance from the mould, towards the horizontal part, and height from the meniscus,
    m.

    Args:
        rolls: The rolls.
        thickness: Thickness of the section, m.
        least: Smallest position of its end, m.

    Attributes:
        s: Positions (n,), m. extrados, intrados: Points of the faces there (n, 2), m.
        inward: Unit vectors from the extrados to the intrados there (n, 2).
    """

    def __init__(self, rolls: Rolls, thickness: float, least: float) -> None:
        self.rolls, self.line = rolls, rolls.line(thickness)
        end = max(rolls.pairs[-1].position + 0.5, least)
        self.s = np.linspace(0.0, end, max(2, round(end / 5e-3)) + 1)
        angle = np.array([self.line.inclination(float(s)) for s in self.s])
        self.inward = np.column_stack([np.cos(angle), np.sin(angle)])
        along = np.column_stack([np.sin(angle), -np.cos(angle)])
        steps = 0.5 * (along[1:] + along[:-1]) * np.diff(self.s)[:, None]
        way = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        thick = np.array([self.line.thickness(float(s)) for s in self.s])[:, None]
        self.extrados = way - INWARD[self.line.face] * thick * self.inward
        self.intrados = self.extrados + thick * self.inward

    def at(self, points: Array, position: float) -> Array:
        """Point (2,) of a line at a position, m."""
        return np.array([np.interp(position, self.s, column) for column in points.T])

    def across(self, position: float, beyond: float) -> Array:
        """Ends (2, 2) of a line across the strand and some distance beyond its faces, m."""
        out, inside = self.at(self.extrados, position), self.at(self.intrados, position)
        normal = self.at(self.inward, position)
        return np.array([out - beyond * normal, inside + beyond * normal])

    def part(self, start: float, end: float) -> Array:
        """Outline (n, 2) of the strand between two positions, m."""
        s = np.concatenate([[start], self.s[(self.s > start) & (self.s < end)], [end]])
        faces = [
            np.column_stack([np.interp(s, self.s, column) for column in face.T])
            for face in (self.extrados, self.intrados)
        ]
        return np.concatenate([faces[0], faces[1][::-1]])

    def inward_at(self, position: Array) -> Array:
        """Unit vectors towards the intrados at positions (rows, 2)."""
        found = np.column_stack([np.interp(position, self.s, c) for c in self.inward.T])
        return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])

    def placed(self, position: Array, place: Array) -> Array:
        """Points of slices in space.

        Args:
            position: Positions of the slices (rows,), m.
            place: x and y of the points in the section (n, 2), m.

        Returns:
            (rows, n, 3), m: distance from the mould, across the strand, upwards.
        """
        middle = 0.5 * (self.extrados + self.intrados)
        centre = np.column_stack([np.interp(position, self.s, column) for column in middle.T])
        flat = centre[:, None] + place[None, :, 1, None] * self.inward_at(position)[:, None]
        across = np.broadcast_to(place[:, 0], flat.shape[:2])
        return np.stack([flat[..., 0], across, flat[..., 1]], axis=-1)
