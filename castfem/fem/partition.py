"""Which rank gets which cell: straight cuts that give every rank its share of the rim.

Where deep liquid is left out of the equations, the work is that of the cells near the surface.  A
graph partitioner gives all ranks as many cells, but one of two ranks the narrow face of half a slab
and with it half as many cells of the rim again as the other.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Flags, Indices

DIRECTIONS = np.array([(0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (1.0, -1.0)])
LAYERS = 6  # cells of a shell's thickness: so much work hangs on a cell of the rim
_ROUNDED = 9  # decimals, m: cells of one row stand at the same place


def straight_cuts(points: Array, cells: Indices, rim: Flags, ranks: int) -> npt.NDArray[np.int32]:
    """Rank of each cell (m,): the section is cut in two, each part again, until all have one.

    Of some directions each cut takes that which leaves the rim the most even, and few nodes on both
    sides.

    Args:
        points: (n, 2), m.
        cells: Nodes of each cell (m, k).
        rim: Whether a cell is at the surface (m,).
        ranks: How many.
    """
    found = np.zeros(len(cells), np.int32)
    middles = points[cells].mean(axis=1)
    waiting: list[tuple[Indices, range]] = [(np.arange(len(cells)), range(ranks))]
    while waiting:
        some, those = waiting.pop()
        if len(those) == 1:
            found[some] = those[0]
            continue
        half = len(those) // 2
        share = half / len(those)
        cuts = [_cut(middles[some] @ direction, share) for direction in DIRECTIONS]
        one = min(cuts, key=lambda cut: _cost(cells[some], rim[some], cut, share))
        waiting += [(some[one], those[:half]), (some[~one], those[half:])]
    return found


def _cut(places: Array, share: float) -> Flags:
    """Flags of the first cells, a share of all, in the order of their places."""
    first = np.zeros(len(places), bool)
    order = np.argsort(np.round(places, _ROUNDED), kind="stable")
    first[order[: round(share * len(places))]] = True
    return first


def _cost(cells: Indices, rim: Flags, first: Flags, share: float) -> float:
    """What speaks against a cut, in cells: an uneven rim, and nodes that are on both sides."""
    uneven = abs(int(rim[first].sum()) - share * int(rim.sum()))
    return LAYERS * uneven + len(np.intersect1d(cells[first], cells[~first]))
