"""Depths of fronts as figures show them: down to where the pool has closed."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array

_JUMP = 0.2  # of the way to the middle: what a front goes at once when the pool closes
_END = 1e-9  # relative
_ROWS = 2  # in which it stays there: one alone may be the first shell


def open_front(depth: Array) -> Array:
    """Return the depths of a front without those of a pool that has closed.

    Where the pool closes, all of the way from a face to the middle is solid at once: the depth
    jumps there to half a section, on the narrow face of a slab from some 100 to 700 mm, which says
    nothing of the shell and hides what does. A front that walks to the middle is kept.

    Args:
        depth: (rows,), of one place from the top down; NaN where there is none.
    """
    known = np.flatnonzero(np.isfinite(depth))
    values = depth[known]
    same = int(np.argmax(values[::-1] < values[-1:] * (1.0 - _END))) if known.size else 0
    if same < _ROWS or values[-same - 1] > (1.0 - _JUMP) * values[-1]:
        return depth
    found = depth.copy()
    found[known[-same:]] = np.nan
    return found
