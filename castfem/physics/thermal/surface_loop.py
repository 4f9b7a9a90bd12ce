"""The compiled loop over the terms of the heat through the surface, called in each iteration.

Its formulas are those of `Convection`, `Radiation` and `CoefficientTable` for a single vertex. The
machine code is kept as a shared library (`castfem.base.shared_code`).
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.shared_code import addresses, loaded
from castfem.base.types import Array, Indices

FIXED, CURVE, RADIATION, SPRAY = range(4)
"""Kinds: a fixed coefficient, one over temperature, radiation (32), the table of a spray."""
COLUMNS = 6
"""Columns of a term: kind, factor (m), ambient (K), number, scale, curve or start of its table."""


def add_up(
    vertex: Indices, terms: Array, temperature: Array, curves: Array, tables: Array
) -> Array:
    """Heat that leaves each vertex, W/m, and its derivative by the temperature, W/(m K).

    Args:
        vertex: Vertex of each term (m,).
        terms: Terms (m, COLUMNS).
        temperature: Temperatures of the vertices (n,), K.
        curves: Coefficients or emissivities at these temperatures, and derivatives (c, 2, n).
        tables: Contents of all tables, see `packed` (any length).

    Returns:
        Heat and derivative (2, n).
    """
    n, count = len(temperature), len(curves)
    if terms.shape != (len(vertex), COLUMNS) or curves.shape != (count, 2, n):
        raise ValueError("arrays of a surface that do not belong together")
    found = np.zeros((2, n))
    places = addresses(vertex, of=int) + addresses(terms, temperature, curves, tables, found)
    _function()(len(vertex), n, count, len(tables), *places)
    return found


def packed(temperatures: Array, water: Array, values: Array) -> Array:
    """A table of coefficients (t, w) with both of its arguments as one array, for `add_up`."""
    return np.concatenate([[len(temperatures), len(water)], temperatures, water, values.ravel()])


@cache
def _function() -> Callable[..., None]:
    arguments = (*[c_int64] * 4, *[c_void_p] * 6)
    return loaded("surface", [Path(__file__)], _compiled, arguments)


def _compiled() -> Any:
    """Compile the loop for addresses of its arrays."""
    from numba import carray, cfunc, types

    from castfem.base.compiled import OPTIONS, compiled

    @compiled
    def interval(table, begin, count, at):  # type: ignore[no-untyped-def]
        """Interval of a value between the arguments of a table, and its place there, 0 to 1."""
        i = 0
        while i < count - 2 and table[begin + i + 1] <= at:
            i += 1
        low, high = table[begin + i], table[begin + i + 1]
        return i, min(max((at - low) / (high - low), 0.0), 1.0)

    @compiled
    def coefficient(table, start, water, surface):  # type: ignore[no-untyped-def]
        """Coefficient of a table and its derivative, as `CoefficientTable.with_slope`."""
        rows, columns = int(table[start]), int(table[start + 1])
        begin, flows = start + 2, start + 2 + rows
        i, right = interval(table, begin, rows, surface)
        j, up = interval(table, flows, columns, water)
        at = flows + columns + i * columns + j
        low = table[at] + up * (table[at + 1] - table[at])
        at += columns
        rise = table[at] + up * (table[at + 1] - table[at]) - low
        first, last = table[begin], table[begin + rows - 1]
        slope = 0.0
        if first <= surface < last:
            slope = rise / (table[begin + i + 1] - table[begin + i])
        return low + right * rise, slope

    real, whole = types.CPointer(types.float64), types.CPointer(types.int64)

    def loop(m, n, count, size, vertex, terms, temperature, curves, tables, found):  # type: ignore[no-untyped-def]
        places, rows = carray(vertex, (m,)), carray(terms, (m, COLUMNS))
        surface, curve = carray(temperature, (n,)), carray(curves, (count, 2, n))
        table, out = carray(tables, (size,)), carray(found, (2, n))
        for k in range(m):
            v, kind, factor, ambient = places[k], rows[k, 0], rows[k, 1], rows[k, 2]
            t, number, which = surface[v], rows[k, 3], int(rows[k, 5])
            if kind == RADIATION:
                strand, rise = curve[which, 0, v], curve[which, 1, v]
                less = 1.0 + number * strand
                per_emissivity = rows[k, 4] / less
                cube = abs(t) * abs(t) * abs(t)
                excess = t * cube - ambient * ambient * ambient * ambient
                flux = per_emissivity * strand * excess
                slope = per_emissivity * (4.0 * strand * cube + rise / less * excess)
            else:
                h, dh = number, 0.0
                if kind == CURVE:
                    h, dh = curve[which, 0, v], curve[which, 1, v]
                elif kind == SPRAY:
                    h, dh = coefficient(table, which, number, t)
                flux, slope = h * (t - ambient), h + dh * (t - ambient)
            out[0, v] += factor * flux
            out[1, v] += factor * slope

    numbers = [types.int64] * 4
    return cfunc(types.void(*numbers, whole, *[real] * 5), **OPTIONS)(loop)
