"""Noise of results: how far runs that differ by next to nothing lie apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array

_NEIGHBOURS = 5
_APART = 1e-3  # of the ranges


@dataclass(frozen=True, slots=True)
class Noise:
    """Scatter of results between runs that differ by next to nothing.

    Attributes:
        sigma: Of cost and margins (1 + m,), in SI: standard deviation about straight lines.
        slope: Of cost and margins along each variable (1 + m, n), SI over the range.
        runs: By how many runs it was measured; 0 where they failed.
    """

    sigma: Array
    slope: Array
    runs: int

    @classmethod
    def of(cls, values: Array, slope: Array) -> Noise:
        """The noise of results.

        Args:
            values: Cost and margins at `neighbours` (r, 1 + m); NaN of runs that have failed.
            slope: See above.
        """
        if np.isnan(values).any():
            return cls(np.zeros(values.shape[1]), slope, 0)
        along = _along()
        fit = np.polynomial.polynomial.polyfit(along, values, 1)
        rest = values - np.polynomial.polynomial.polyval(along, fit).T
        return cls(np.sqrt(np.sum(rest**2, axis=0) / (len(along) - 2)), slope, len(along))

    def at_least(self, other: Noise) -> Noise:
        """The larger of two, of each result; not measured where either was not."""
        sigma = np.maximum(self.sigma, other.sigma)
        return Noise(sigma, self.slope, min(self.runs, other.runs))


def neighbours(place: Array) -> list[Array]:
    """Places (n,) on a short line through one, or as near to it as the ranges allow, shares."""
    along = _along()
    middle = np.clip(place, along[-1], 1.0 - along[-1])
    return [np.asarray(middle + step) for step in along]


def slope_of(here: Array, above: Array, below: Array, apart: float) -> Array:
    """Slope of results (1 + m,) over the range; to one side where the other run has failed.

    Args:
        here: Results at a place.
        above: At one further on.
        below: At one before.
        apart: How far these are from it, as a share of the range.
    """
    if np.isnan(above).any():
        return np.asarray((here - below) / apart)
    if np.isnan(below).any():
        return np.asarray((above - here) / apart)
    return np.asarray((above - below) / (2.0 * apart))


def _along() -> Array:
    return np.asarray((np.arange(_NEIGHBOURS) - _NEIGHBOURS // 2) * _APART)
