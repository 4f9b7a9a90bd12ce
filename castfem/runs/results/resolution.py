"""How exactly the cells of a run resolve the depth of an isotherm."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

from castfem.base.shown_quantity import Quantity

STAIR = 1.0 / 6.0
"""Of the cell in which the solidus lies: how far the curve of the shell is off."""
_DEPTH = re.compile(r"(?:shell|liquidus_depth|fs[1-9]\d?)_(\w+)")


def resolved(
    quantities: dict[str, Quantity], cell: Callable[[str], float | None]
) -> dict[str, Quantity]:
    """Return results, depths of isotherms among them with what their cells resolve.

    Args:
        quantities: By name.
        cell: Size of the cell in which the solidus lies, by the name of a probe, m; NaN or None
            where there is none. The other isotherms lie deeper, in cells that are no smaller.
    """
    found = {}
    for name, one in quantities.items():
        depth = _DEPTH.fullmatch(name)
        size = None if depth is None else cell(depth[1])
        known = size is not None and math.isfinite(size)
        found[name] = replace(one, resolution=STAIR * size) if size and known else one
    return found
