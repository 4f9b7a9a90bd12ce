"""Difference quotients of what may have a kink or a jump between its two ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from castfem.values.types import Array

WARMER = 1e-3  # K: to either side, in differences by temperature
UNEVEN = 1e-3  # of a difference: how far its two halves may be apart


def slope(above: Array, here: Array, below: Array, by: float) -> Array:
    """Derivative of what has these values at and on both sides of a place, `by` apart.

    Where there is a kink or a jump between them, it is that of the half which is less.
    """
    up, down = (above - here) / by, (here - below) / by
    sizes = np.abs(up), np.abs(down)
    less = np.where(sizes[0] < sizes[1], up, down)
    even = np.abs(up - down) <= UNEVEN * np.maximum(*sizes)
    return np.asarray(np.where(even, 0.5 * (up + down), less))


def slope_by_temperature(curve: Callable[[Array], Array], temperature: Array, here: Array) -> Array:
    """Derivative of a curve at temperatures (K), where it has the values `here`."""
    return slope(curve(temperature + WARMER), here, curve(temperature - WARMER), WARMER)
