"""The ideal taper: that of the strand in its idealised mould, in the family that is asked for.

V.2.1.1 of [Pascon2003] reads the taper of the width (302) and that of the diagonal, here a double
one (303), off the shape that a strand takes in a mould that follows it. Here a family of tapers,
whatever its segments, is fitted to width and diagonal all along the mould. A wall that
falls behind the diagonal leaves the corner without contact, while one that goes ahead of the width
presses on a soft face: where one taper has to serve both, the diagonal is fitted.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.case.build_mould import build_mould
from castfem.output.history import HISTORY_NAME, read_history
from castfem.values.types import Array

if TYPE_CHECKING:
    from castfem.design.question import Question

_POINTS = 25  # along the mould
_SIZES = {"width": "size_mid_face", "height": "size_narrow_face", "diagonal": "size_corner"}


def fitted(question: Question, start: Array, free: list[int], folder: Path) -> Array:
    """Return where a search begins, its free tapers fitted to an idealised strand.

    Args:
        question: What is asked for.
        start: Shares of the ranges (n,), of which those that are not free stay.
        free: Which variables are tapers to be fitted.
        folder: Of the run in the idealised mould.

    Returns:
        Shares of the ranges (n,).
    """
    from scipy.optimize import lsq_linear

    history = read_history(folder / HISTORY_NAME)
    position = history["position"].to_numpy()
    length = question.case.mould.length if question.case.mould is not None else 0.0
    places = np.linspace(0.0, min(length, position[-1]), _POINTS)
    columns = {name: column for name, column in _SIZES.items() if column in history}
    strand = {
        name: np.interp(places, position, 1e-3 * history[column].to_numpy())
        for name, column in columns.items()
    }

    def walls(shares: Array) -> dict[str, Array]:
        wanted = question.at(shares)
        case = question.case.with_(question.changes(wanted))
        assert case.mould is not None
        mould = build_mould(case.mould, case.section)
        sizes = [mould.dimensions(float(z)) for z in places]
        return {name: np.array([one[name] for one in sizes]) for name in sizes[0]}

    names = [name for name in walls(start) if name in strand]
    together = not any(".corner" in question.axes[i].key for i in free)
    names = [n for n in names if n == "diagonal"] if together and "diagonal" in names else names
    if not names:
        return start

    def off(shares: Array) -> Array:
        """Width and diagonal as far as they close in, wall less strand."""
        wall = walls(shares)
        return np.concatenate([wall[n] - wall[n][0] - strand[n] + strand[n][0] for n in names])

    # Sizes go with tapers all but linearly: two differences and a solve, twice.
    found = np.array(start, dtype=float)
    for _ in range(2):
        base = off(found)
        slopes = []
        for i in free:
            moved = found.copy()
            moved[i] += 0.25 if moved[i] < 0.5 else -0.25
            slopes.append((off(moved) - base) / (moved[i] - found[i]))
        limits = (-found[free], 1.0 - found[free])
        step = lsq_linear(1e3 * np.column_stack(slopes), -1e3 * base, limits).x
        found[free] = np.clip(found[free] + step, 0.0, 1.0)
    return found
