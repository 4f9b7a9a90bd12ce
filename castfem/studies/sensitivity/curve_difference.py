"""What a parameter does to T(H) and theta(H) of the steel, at enthalpies that are held."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.materials.curve import ThermalCurve


class CurveDifference:
    """T(H) and theta(H) of one steel less those of another.

    Between two steels whose curves are straight lines it is one as well, which is laid once; it
    is looked up once then, and no digits of two large numbers are lost in their difference.

    Args:
        above: Curve that is taken. below: Curve that is taken off.
    """

    def __init__(self, above: ThermalCurve, below: ThermalCurve) -> None:
        self._curves = above, below
        lines = above.lines(), below.lines()
        self._starts: Array = np.zeros(0)
        if lines[0] is None or lines[1] is None:
            return
        both = lines[0], lines[1]
        self._starts = np.union1d(both[0][0], both[1][0])
        met = [_piece(starts, self._starts) for starts, _, _ in both]
        self._at_zero = both[0][1][:, met[0]] - both[1][1][:, met[1]]
        self._slopes = both[0][2][:, met[0]] - both[1][2][:, met[1]]

    def temperature(self, enthalpy: Array) -> Array:
        """Difference of T, K, at `enthalpy` (n,), J/m3."""
        if len(self._starts):
            return self._line(0, enthalpy)
        above, below = (curve.at(enthalpy).temperature for curve in self._curves)
        return np.asarray(above - below)

    def conduction(self, enthalpy: Array) -> Array:
        """Difference of theta, W/m, at `enthalpy` (n,), J/m3."""
        if len(self._starts):
            return self._line(1, enthalpy)
        above, below = (curve.at(enthalpy).conduction for curve in self._curves)
        return np.asarray(above - below)

    def _line(self, row: int, enthalpy: Array) -> Array:
        i = _piece(self._starts, enthalpy)
        return np.asarray(self._at_zero[row].take(i) + self._slopes[row].take(i) * enthalpy)


def _piece(starts: Array, enthalpy: Array) -> npt.NDArray[np.intp]:
    return np.asarray(starts.searchsorted(enthalpy, side="right") - 1)
