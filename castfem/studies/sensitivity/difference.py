"""Difference quotients of what may have a kink or a jump between its two ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from castfem.base.compiled import compiled, outermost
from castfem.base.types import Array

WARMER = 1e-4  # K: to either side, in differences by temperature
UNEVEN = 0.1  # of a difference: its halves are farther apart where there is a kink, not a bend


@compiled
def _slope(above, here, below, by):  # type: ignore[no-untyped-def]
    """Derivative by both halves, or by the one that is less where there is a kink between them.

    One half alone is off by half the bend of the curve over the distance, so it is taken nowhere
    else: the weight of a phase whose blend is narrow bends from 0 to all it has within kelvins.
    """
    up, down = (above - here) / by, (here - below) / by
    if abs(up - down) <= UNEVEN * max(abs(up), abs(down)):
        return 0.5 * (up + down)
    return up if abs(up) < abs(down) else down


@outermost
def _slopes(above, here, below, by, found, sources=None):  # type: ignore[no-untyped-def]
    """Write those of all values (n,)."""
    for i in range(len(found)):
        found[i] = _slope(above[i], here[i], below[i], by)


@outermost
def _by_temperature(tables, warming, found, sources=None):  # type: ignore[no-untyped-def]
    """See `by_temperature`."""
    for i in range(found.shape[1]):
        for m in range(found.shape[2]):
            here = tables[0, i, m]
            first = _slope(tables[1, i, m], here, tables[2, i, m], WARMER)
            last = _slope(tables[3, i, m], here, tables[4, i, m], WARMER)
            for j in range(found.shape[0]):
                found[j, i, m] = first * warming[0, j, i] + last * warming[1, j, i]


def slope(above: Array, here: Array, below: Array, by: float) -> Array:
    """Derivative of what has these values at and on both sides of a place, `by` apart.

    Where there is a kink or a jump between them, it is that of the half which is less.
    """
    found = np.empty(np.shape(here))
    every = (np.broadcast_to(one, found.shape) for one in (above, here, below))
    flat = (np.ascontiguousarray(one, dtype=np.float64).ravel() for one in every)
    _slopes(*flat, by, found.reshape(-1))
    return found


def slope_by_temperature(curve: Callable[[Array], Array], temperature: Array, here: Array) -> Array:
    """Derivative of a curve at temperatures (K), where it has the values `here`."""
    return slope(curve(temperature + WARMER), here, curve(temperature - WARMER), WARMER)


def by_temperature(tables: Array, warming: Array) -> Array:
    """Changes of what hangs on the temperatures at the start and the end of a step.

    Args:
        tables: Of it (5, n, columns): as it is, `WARMER` and colder by as much at the start, and so
            at the end.
        warming: Changes of both temperatures (2, k, n), K.

    Returns:
        (k, n, columns).
    """
    found = np.empty((warming.shape[1], *tables.shape[1:]))
    _by_temperature(tables, warming, found)
    return found
