"""Draw the section at the meniscus whose strand has the wanted one in the end (Fig. 121).

Figures are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.physics.mould.cavity import Sides
from castfem.physics.mould.perimeter import Places
from castfem.post.plots.style import head, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.studies.mould_fit.section import Attempt, Outline

_TIMES = 20.0
"""How much larger than life the outlines stand off the rectangle."""


def draw(
    attempts: Sequence[Attempt], sides: Sides, path: str | os.PathLike[str], title: str = ""
) -> None:
    """Draw the found section, and how it was come by, to a picture file."""
    last = attempts[-1]
    with look():
        figure = new_figure(12.6, 4.9)
        left, right, steps = figure.subplots(1, 3, width_ratios=(4.0, 4.0, 3.6))
        head(figure, title)
        _outline(left, last.start, sides, f"at the meniscus, x {_TIMES:g}", "#0072b2")
        _outline(right, last.end, sides, f"at the end, x {_TIMES:g}", "#d55e00")
        number = np.arange(1, len(attempts) + 1)
        steps.semilogy(number, [1e6 * one.worst for one in attempts], "o-", color="#009e73")
        steps.set_xticks(number)
        steps.set_xlabel("run")
        steps.set_ylabel("largest deviation [um]")
        steps.set_title("deviation from the wanted section")
        figure.savefig(path, dpi=130)


def _outline(ax: Axes, outline: Outline, sides: Sides, title: str, colour: str) -> None:
    """The rectangle, and an outline beside it."""
    places = Places.spread(sides, 60, 30, order=1)
    points, normals = places.on(sides)
    offset = np.interp(places.ways(sides), outline.ways, outline.offset)
    shifted = points + _TIMES * offset[:, None] * normals
    for shape, look_of_it, label in (
        (points, {"color": "#7f7f7f", "linewidth": 0.8}, "wanted"),
        (shifted, {"color": colour}, "section"),
    ):
        x, y = 1e3 * shape.T
        signs = ((1, 1, 1), (-1, 1, -1), (-1, -1, 1), (1, -1, -1))
        whole = [np.stack([sx * x, sy * y], 1)[::way] for sx, sy, way in signs]
        closed = np.concatenate([*whole, whole[0][:1]])
        ax.plot(*closed.T, **look_of_it, label=label)  # type: ignore[arg-type]
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(title)
    ax.legend(loc="center")
