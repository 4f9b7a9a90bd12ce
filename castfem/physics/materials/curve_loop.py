"""The loop of `ThermalCurve.at` over enthalpies, compiled: it runs in each Newton iteration.

The machine code is kept as a shared library, so that a run needs no compiler of its own
(`castfem.base.shared_code`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.shared_code import addresses, loaded
from castfem.base.types import Array, Indices

COLUMNS = 8
"""Columns of a piece: T, H, theta, k, c, c squared, twice the slope of c, slope of k."""


def evaluate(
    enthalpy: Array, pieces: Array, ends: Array, first: Indices, origin: float, per_enthalpy: float
) -> Array:
    """T, dT/dH, theta and dtheta/dH at given enthalpies.

    Args:
        enthalpy: H (n,), J/m3.
        pieces: Values at the start of each piece of the curve, and slopes (pieces, COLUMNS).
        ends: H at the end of each piece (pieces,), increasing; the last is NaN, which no enthalpy
            reaches.
        first: First piece in each cell of an even grid of enthalpies (cells,).
        origin: Enthalpy at which the grid begins, J/m3.
        per_enthalpy: Cells per enthalpy, m3/J.

    Returns:
        The four results (4, n), in K, K m3/J, W/m and m2/s; NaN where the enthalpy is NaN.
    """
    if pieces.shape != (len(ends), COLUMNS) or enthalpy.ndim != 1 or not np.isnan(ends[-1]):
        raise ValueError("arrays of a curve that do not belong together")
    found = np.empty((4, len(enthalpy)))
    places = addresses(enthalpy, pieces, ends) + addresses(first, of=int) + addresses(found)
    _function()(len(enthalpy), len(ends), len(first), origin, per_enthalpy, *places)
    return found


@cache
def _function() -> Callable[..., None]:
    arguments = (*[c_int64] * 3, *[c_double] * 2, *[c_void_p] * 5)
    return loaded("curve", [Path(__file__)], _compiled, arguments)


def _compiled() -> Any:
    """Compile the loop for addresses of its arrays."""
    from numba import carray, cfunc, types

    from castfem.base.compiled import OPTIONS

    real, whole = types.CPointer(types.float64), types.CPointer(types.int64)
    numbers = [types.int64] * 3 + [types.float64] * 2

    def loop(n, m, cells, origin, per_enthalpy, enthalpy, pieces, ends, first, found):  # type: ignore[no-untyped-def]
        given, rows, end = carray(enthalpy, (n,)), carray(pieces, (m, COLUMNS)), carray(ends, (m,))
        start, out = carray(first, (cells,)), carray(found, (4, n))
        for j in range(n):
            h = given[j]
            cell = (h - origin) * per_enthalpy
            if not cell > 0.0:
                cell = 0.0
            elif cell > cells - 1.0:
                cell = cells - 1.0
            i = start[int(cell)]
            while end[i] <= h:
                i += 1
            dh = h - rows[i, 1]
            here = math.sqrt(rows[i, 5] + rows[i, 6] * dh)  # heat capacity, c + dc s
            s = 2.0 * dh / (rows[i, 4] + here)
            slope, dk = 1.0 / here, rows[i, 7] * s
            out[0, j], out[1, j] = rows[i, 0] + s, slope
            out[2, j] = rows[i, 2] + s * (rows[i, 3] + 0.5 * dk)
            out[3, j] = (rows[i, 3] + dk) * slope

    return cfunc(types.void(*numbers, *[real] * 3, whole, real), **OPTIONS)(loop)
