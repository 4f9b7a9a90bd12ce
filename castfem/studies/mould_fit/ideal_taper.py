"""The ideal taper: that of the strand in its idealised mould, where a search for tapers starts.

V.2.1.1 of [Pascon2003] derives the taper of the width (302) and that of the diagonal (303) from the
shape of a strand in a mould that follows it. Here tapers of any kind are fitted to width and
diagonal along the whole mould. A wall that lags behind the diagonal leaves the corner without
contact, while one ahead of the width only presses on a soft face: a single taper for both is
therefore fitted to the diagonal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.runs.output.history import HISTORY_NAME, Columns, read_columns

if TYPE_CHECKING:
    from castfem.physics.mould.mould import Mould

_SIZES = {
    "width": "size_narrow_face", "height": "size_mid_face", "diameter": "size_mid_face",
    "diagonal": "size_corner",
}  # fmt: skip


def fitted_tapers(
    mould_of: Callable[[Array], Mould], start: Array, tapers: Mapping[int, str], folder: Path
) -> Array:
    """Return the variables of a mould (n,) whose tapers are fitted to an idealised strand.

    Args:
        mould_of: Builds the mould from such variables, as fractions of their ranges.
        start: Start values (n,); variables other than tapers keep them.
        tapers: Index and key of each fitted variable.
        folder: Folder of the run in the idealised mould.
    """
    from scipy.optimize import lsq_linear

    history = read_columns(folder / HISTORY_NAME)
    position = np.asarray(history["position"])
    length = mould_of(start).length
    places = np.linspace(0.0, min(length, position[-1]), 25)

    def walls(shares: Array) -> dict[str, Array]:
        mould = mould_of(shares)
        sizes = [mould.dimensions(float(z)) for z in places]
        return {name: np.array([one[name] for one in sizes]) for name in sizes[0]}

    strand = strand_sizes(history, places, {name: size[0] for name, size in walls(start).items()})
    names = _fitted_to(list(strand), list(tapers.values()))
    if not names:
        return start

    def off(shares: Array) -> Array:
        """Difference of the closing of width and diagonal, wall minus strand."""
        wall = walls(shares)
        return np.concatenate([wall[n] - wall[n][0] - strand[n] + strand[n][0] for n in names])

    # Sizes are almost linear in the tapers: two differences and a solve, twice.
    found, numbers = np.array(start, dtype=float), list(tapers)
    for _ in range(2):
        base = off(found)
        slopes = []
        for i in tapers:
            moved = found.copy()
            moved[i] += 0.25 if moved[i] < 0.5 else -0.25
            slopes.append((off(moved) - base) / (moved[i] - found[i]))
        limits = (-found[numbers], 1.0 - found[numbers])
        step = lsq_linear(1e3 * np.column_stack(slopes), -1e3 * base, limits).x
        found[numbers] = np.clip(found[numbers] + step, 0.0, 1.0)
    return found


def _fitted_to(sizes: list[str], keys: list[str]) -> list[str]:
    """Names of the sizes to which the tapers of some keys are fitted.

    A single taper of all faces follows the corner; separate tapers of the faces do not.
    """
    if "diagonal" not in sizes or any(".corner" in key for key in keys):
        return sizes
    alone = any(".narrow_face" in key or ".wide_face" in key for key in keys)
    return [name for name in sizes if (name == "diagonal") != alone]


def strand_sizes(history: Columns, places: Array, cavity: dict[str, float]) -> dict[str, Array]:
    """Sizes of the strand at positions along the mould, m, among those of the cavity.

    The diagonal of a rectangle other than a square uses the motion of its corner, outwards at 45
    degrees, as if it were towards the centre.
    """

    def along(column: str) -> Array:
        values = 1e-3 * np.asarray(history[column])
        return np.asarray(np.interp(places, np.asarray(history["position"]), values))

    columns = {name: _SIZES[name] for name in cavity if _SIZES.get(name) in history}
    found = {name: along(column) for name, column in columns.items()}
    # the web of a beam blank is not a height
    found = {n: v for n, v in found.items() if abs(v[0] / cavity[n] - 1.0) < 0.05}
    if "diagonal" in cavity and "diagonal" not in found and "displacement_corner" in history:
        width, height = cavity["width"], cavity["height"]
        slant = np.hypot(width, height) * np.sqrt(2.0) / (width + height)
        found["diagonal"] = cavity["diagonal"] + 2.0 * slant * along("displacement_corner")
    return found
