"""Intersections of rays with segments of a wall, (268)-(273) of the thesis, compiled.

A contour runs counter-clockwise: the cavity is on the left of a segment, its outward normal (into
the mould) on the right. A ray p + d m through a point p of the strand, along its outward normal m,
may meet a segment twice; only where it leaves the cavity (outward normal . m > 0) does it meet the
wall from inside. A straight line, a circle or a parabola has at most one such intersection, whose
root is given in a form without cancellation, so that no iteration is needed. The distance d is
negative where the point has penetrated the wall.

The machine code is kept as a shared library (`castfem.base.shared_code`).

Equation numbers are those of [Pascon2003] (docs/references.md).
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
from castfem.base.types import Array

GRAZING = 0.02
"""Cosine between ray and wall normal below which a ray is parallel to the wall (89 degrees)."""
STRAIGHT, CIRCULAR, PARABOLIC = range(3)
COLUMNS = 8
"""Columns of a segment: its kind, and up to seven numbers from its method `numbers`."""


def nearest(segments: Array, points: Array, rays: Array, slack: float) -> Array:
    """The nearest intersection of each ray, on either side of its point.

    Args:
        segments: Segments (k, COLUMNS), SI.
        points: Starting points of the rays (n, 2), m.
        rays: Unit vectors (n, 2).
        slack: Overlap of the segments at their joints, m.

    Returns:
        Distance along the ray, the two components of the wall's unit normal, and its curvature
        (4, n), m and 1/m; where a ray misses all segments infinity, the ray itself, and 0.
    """
    if segments.shape[1:] != (COLUMNS,) or not points.shape == rays.shape == (len(points), 2):
        raise ValueError("arrays of a wall that do not belong together")
    found = np.empty((4, len(points)))
    _function()(len(segments), len(points), slack, *addresses(segments, points, rays, found))
    return found


@cache
def _function() -> Callable[..., None]:
    arguments = (*[c_int64] * 2, c_double, *[c_void_p] * 4)
    return loaded("crossings", [Path(__file__)], _compiled, arguments)


def _compiled() -> Any:
    """Compile the loop for addresses of its arrays.

    The functions of the kinds of segments take their numbers, a point and a ray, and return
    distance, normal and curvature. What is not a number fails every comparison and meets nothing.
    """
    from numba import carray, cfunc, types

    from castfem.base.compiled import OPTIONS, compiled

    @compiled
    def straight(s, px, py, mx, my, slack):  # type: ignore[no-untyped-def]
        """Start, unit tangent, length."""
        nx, ny = s[4], -s[3]
        cosine = nx * mx + ny * my
        if not cosine > GRAZING:
            return np.inf, mx, my, 0.0
        wx, wy = s[1] - px, s[2] - py
        d = (nx * wx + ny * wy) / cosine
        along = (d * mx - wx) * s[3] + (d * my - wy) * s[4]
        if not -slack <= along <= s[5] + slack:
            return np.inf, mx, my, 0.0
        return d, nx, ny, 0.0

    @compiled
    def circular(s, px, py, mx, my, slack):  # type: ignore[no-untyped-def]
        """Centre, radius, bend, unit vector along the chord, half of its length."""
        radius, bend = s[3], s[4]
        qx, qy = px - s[1], py - s[2]
        along, aside = qx * mx + qy * my, qx * my - qy * mx
        # The root of d^2 + 2 along d + |q|^2 - radius^2 = 0 with bend (along + d) > 0.
        root = math.sqrt(max(radius * radius - aside * aside, 0.0))
        if not root > GRAZING * radius:
            return np.inf, mx, my, 0.0
        if along * bend > 0.0:
            size = math.hypot(qx, qy)
            d = -(size - radius) * (size + radius) / (along + bend * root)
        else:
            d = bend * root - along
        nx, ny = bend * (qx + d * mx) / radius, bend * (qy + d * my) / radius
        # On the arc: beyond the chord seen from the centre, and between its ends.
        beyond = s[5] * ny - s[6] * nx < 0.0
        if not (beyond and abs(s[5] * nx + s[6] * ny) * radius <= s[7] + slack):
            return np.inf, mx, my, 0.0
        return d, nx, ny, bend / radius

    @compiled
    def parabolic(s, px, py, mx, my, slack):  # type: ignore[no-untyped-def]
        """The coefficients of xi^2, xi and 1 (271), each by component."""
        ax, ay, bx, by = s[1], s[2], s[3], s[4]
        wx, wy = s[5] - px, s[6] - py
        a, b, c = ax * my - ay * mx, bx * my - by * mx, wx * my - wy * mx
        # The root of a xi^2 + b xi + c = 0 with slope 2 a xi + b < 0, where the ray leaves (272).
        slope = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
        if b < 0.0:
            xi = 2.0 * c / (slope - b)
        elif a != 0.0:
            xi = -(b + slope) / (2.0 * a)
        else:
            return np.inf, mx, my, 0.0
        if not abs(xi) <= 1.0 + slack / math.hypot(bx, by):
            return np.inf, mx, my, 0.0
        tx, ty = 2.0 * ax * xi + bx, 2.0 * ay * xi + by
        scale = 1.0 / math.hypot(tx, ty)
        if not slope * scale > GRAZING:  # normal . ray = slope over |(tx, ty)|
            return np.inf, mx, my, 0.0
        d = ((ax * xi + bx) * xi + wx) * mx + ((ay * xi + by) * xi + wy) * my
        return d, ty * scale, -tx * scale, 2.0 * (tx * ay - ty * ax) * scale**3

    real = types.CPointer(types.float64)

    def loop(k, n, slack, segments, points, rays, found):  # type: ignore[no-untyped-def]
        wall, p, m = carray(segments, (k, COLUMNS)), carray(points, (n, 2)), carray(rays, (n, 2))
        out = carray(found, (4, n))
        for j in range(n):
            px, py, mx, my = p[j, 0], p[j, 1], m[j, 0], m[j, 1]
            out[0, j], out[1, j], out[2, j], out[3, j] = np.inf, mx, my, 0.0
            for i in range(k):
                s = wall[i]
                if s[0] == STRAIGHT:
                    d, nx, ny, turn = straight(s, px, py, mx, my, slack)
                elif s[0] == CIRCULAR:
                    d, nx, ny, turn = circular(s, px, py, mx, my, slack)
                else:
                    d, nx, ny, turn = parabolic(s, px, py, mx, my, slack)
                if abs(d) < abs(out[0, j]):
                    out[0, j], out[1, j], out[2, j], out[3, j] = d, nx, ny, turn

    return cfunc(types.void(types.int64, types.int64, types.float64, *[real] * 4), **OPTIONS)(loop)
