"""The line of the strand between its rolls: curvature, inclination, height of the liquid."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from castfem.base.types import Array

Face = Literal["extrados", "centreline", "intrados"]
"""Line on which a radius is measured: outer face of the strand, its middle, inner face."""
FACES: tuple[Face, ...] = get_args(Face)
INWARD: dict[Face, float] = {"extrados": 0.0, "centreline": 0.5, "intrados": 1.0}
"""Distance of each from the extrados towards the centre of curvature, over the thickness."""
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)


class Bent:
    """A strand whose curvature 1/R is linear between the rolls (thesis III.1.2).

    It is vertical at the meniscus. Above the first and below the last roll the curvature is
    constant.

    Args:
        positions: Positions of the pairs of rolls, increasing, m from the meniscus along `face`.
        radii: R of that face there, m; inf where the strand is straight, negative if bent the other
            way.
        thickness: Thickness of the strand there, m.
        face: Face to which the radii refer, and along which positions and speed are measured.

    Raises:
        ValueError: The numbers of entries differ, positions do not increase, or a radius is zero.
    """

    def __init__(
        self,
        positions: Sequence[float],
        radii: Sequence[float],
        thickness: Sequence[float],
        face: Face = "extrados",
    ) -> None:
        if not len(positions) == len(radii) == len(thickness) or not len(positions):
            raise ValueError("as many radii and thicknesses as positions of rolls are needed")
        if any(not later > before for before, later in itertools.pairwise(positions)):
            raise ValueError("positions of rolls must increase")
        if not positions[0] >= 0.0:
            raise ValueError("positions of rolls are measured from the meniscus on")
        if any(not abs(radius) > 0.0 for radius in radii):
            raise ValueError("a radius of curvature must not be zero")
        self.face = face
        self._rolls = np.asarray(positions, float)
        self._curvatures = 1.0 / np.asarray(radii, float)
        self._thickness = np.asarray(thickness, float)
        self._ends = self._pieces()
        chi = np.interp(self._ends, self._rolls, self._curvatures)
        lengths = np.diff(self._ends)
        turns = 0.5 * (chi[1:] + chi[:-1]) * lengths
        self._chi, self._slopes = chi, np.append(np.diff(chi) / lengths, 0.0)
        self._angles = np.concatenate([[0.0], np.cumsum(turns)])
        falls = [self._fall(i, length) for i, length in enumerate(lengths)]
        self._heights = np.concatenate([[0.0], np.cumsum(falls)])

    def _pieces(self) -> Array:
        """Ends of pieces from the meniscus on, within which the strand turns little."""
        rolls = self._rolls
        ends = rolls if rolls[0] == 0.0 else np.concatenate([[0.0], rolls])
        found = [ends[:1]]
        for before, after in itertools.pairwise(ends):
            chi = np.interp((before, after), rolls, self._curvatures)
            turn = 0.5 * float(np.abs(chi).sum()) * (after - before)
            count = max(1, int(np.ceil(turn / 0.25)))  # rad, within a piece of the integral
            found.append(np.linspace(before, after, count + 1)[1:])
        return np.concatenate(found)

    @property
    def knots(self) -> tuple[float, ...]:
        """Rolls at which the slope of the curvature changes, m."""
        slopes = np.diff(self._curvatures) / np.diff(self._rolls)
        slopes = np.concatenate([[0.0], slopes, [0.0]])
        # Radii and positions of a table are rounded: changes within rounding do not count.
        changes = np.abs(np.diff(slopes)) > 1e-4 * max(float(np.abs(slopes).max()), 1e-300)
        return tuple(float(position) for position in self._rolls[changes])

    def thickness(self, position: float) -> float:
        """Thickness of the strand at `position` (m), m: linear between the rolls."""
        return float(np.interp(position, self._rolls, self._thickness))

    def curvature(self, position: float, face: Face | None = None) -> float:
        """See `Line`."""
        chi = float(np.interp(position, self._rolls, self._curvatures))
        if face is None or face == self.face:
            return chi
        inward = (INWARD[face] - INWARD[self.face]) * self.thickness(position)
        return chi / (1.0 - chi * inward)

    def inclination(self, position: float) -> float:
        """See `Line`."""
        i, along = self._piece(position)
        return float(self._angle(i, along))

    def height(self, position: float) -> float:
        """See `Line`."""
        i, along = self._piece(position)
        # The middle is beside the line of reference, towards the centre of curvature.
        beside = (INWARD["centreline"] - INWARD[self.face]) * self.thickness(position)
        line = self._heights[i] + self._fall(i, along)
        return float(line - beside * np.sin(self._angle(i, along)))

    def _piece(self, position: float) -> tuple[int, float]:
        """The piece that contains a position, and the distance from its start, m."""
        i = max(bisect_right(self._ends, position) - 1, 0)
        return i, position - float(self._ends[i])

    def _angle(self, i: int, along: float | Array) -> float | Array:
        """Inclination at some length from the start of a piece, rad."""
        return self._angles[i] + along * (self._chi[i] + 0.5 * self._slopes[i] * along)

    def _fall(self, i: int, length: float) -> float:
        """Fall of the line of reference over a length from the start of a piece, m."""
        chi = float(self._chi[i])
        if i == len(self._ends) - 1 and chi != 0.0:  # below the last roll
            return float(np.sin(self._angles[i] + chi * length) - np.sin(self._angles[i])) / chi
        along = 0.5 * length * (_POINTS + 1.0)
        return float(0.5 * length * _WEIGHTS @ np.cos(self._angle(i, along)))
