"""Draws the sketch of docs/model.md: the strand in its caster, and the slice that castfem follows.

Run it by `.castfem/bin/python docs/model_sketch.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.post.plots.style import look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.base.types import Array

TARGET = Path(__file__).parent / "figures" / "model.png"
LIQUID, SHELL, COPPER, ROLL, WATER = "#f4a261", "#7f8c8d", "#b5651d", "#bdc3c7", "#56b4e9"
RADIUS, THICK, UPRIGHT, LEVEL = 6.0, 1.0, 4.0, 3.2  # of the drawing
SOLID_AT = 0.72  # of the way: where the pool ends
HERE = 0.36  # where the slice is


def strand(way: Array, off: float | Array) -> tuple[Array, Array]:
    """Points at shares of the way down, so far off the middle towards the intrados."""
    arc = 0.5 * np.pi * RADIUS
    total = UPRIGHT + arc + LEVEL
    s = way * total
    angle = np.clip((s - UPRIGHT) / RADIUS, 0.0, 0.5 * np.pi)
    x = np.where(s < UPRIGHT, 0.0, RADIUS * (1.0 - np.cos(angle)))
    y = np.where(s < UPRIGHT, -s, -UPRIGHT - RADIUS * np.sin(angle))
    x = x + np.maximum(s - UPRIGHT - arc, 0.0)
    return x + off * np.cos(angle), y + off * np.sin(angle)


def band(axes: Axes, way: Array, low: Array, high: Array, colour: str) -> None:
    """A part of the strand between two distances from its middle."""
    one, other = strand(way, low), strand(way, high)
    axes.fill(np.r_[one[0], other[0][::-1]], np.r_[one[1], other[1][::-1]], color=colour, lw=0)


def caster(axes: Axes) -> None:
    """The strand from the side: pool and shell, mould, rolls, water, the slice."""
    way = np.linspace(0.0, 1.0, 400)
    half = np.full_like(way, 0.5 * THICK)
    band(axes, way, -half, half, SHELL)
    pool = 0.5 * THICK * (1.0 - np.sqrt(np.clip(way / SOLID_AT, 0.0, 1.0)))
    band(axes, way, -pool, pool, LIQUID)
    for side in (-1.0, 1.0):
        axes.fill(
            side * np.array([0.54, 0.9, 0.9, 0.54]), [0.4, 0.4, -1.6, -1.6], color=COPPER, lw=0
        )
        for place in np.linspace(0.135, 0.97, 17):
            x, y = strand(np.array([place]), side * (0.5 * THICK + 0.24))
            axes.plot(x, y, "o", color=ROLL, ms=9, mec="#555555", mew=0.6)
        for place in np.linspace(0.16, 0.6, 9):
            tip = strand(np.array([place]), side * (0.5 * THICK + 0.05))
            for spread in (-0.012, 0.012):
                end = strand(np.array([place + spread]), side * (0.5 * THICK + 0.8))
                axes.plot([tip[0][0], end[0][0]], [tip[1][0], end[1][0]], color=WATER, lw=1.0)
    x, y = strand(np.array([HERE - 0.004, HERE + 0.004]), np.array([-0.62, -0.62]))
    u, v = strand(np.array([HERE - 0.004, HERE + 0.004]), np.array([0.62, 0.62]))
    axes.fill([*x, *u[::-1]], [*y, *v[::-1]], fill=False, ec="black", lw=1.6, zorder=5)
    names = (
        ("meniscus", (0.0, 0.0), (1.6, 0.55)),
        ("mould: 1, 2", (0.9, -0.9), (1.6, -0.9)),
        ("slice: 3, 4", strand(np.array([HERE]), 0.62), (3.4, -4.6)),
        ("rolls and sprays: 5, 6", strand(np.array([0.5]), 0.9), (5.0, -6.6)),
        ("end of the pool: 7", strand(np.array([SOLID_AT]), 0.5), (6.2, -8.2)),
    )
    for text, at, place in names:
        axes.annotate(
            text, (float(np.ravel(at[0])[0]), float(np.ravel(at[1])[0])), place, fontsize=9,
            va="center", arrowprops={"arrowstyle": "-", "lw": 0.8, "color": "#333333"},
        )  # fmt: skip
    axes.set_xlim(-1.6, 10.6)
    axes.set_ylim(-11.2, 1.2)


def section(axes: Axes) -> None:
    """The slice from above: what flows and acts in its plane, and what is left out along it."""
    axes.fill([-2, 2, 2, -2], [-1.2, -1.2, 1.2, 1.2], color=SHELL, lw=0)
    axes.fill([-1.5, 1.5, 1.5, -1.5], [-0.7, -0.7, 0.7, 0.7], color=LIQUID, lw=0)
    out = {"arrowstyle": "-|>", "color": "#0072b2", "lw": 1.6}
    for x, y in ((0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)):
        axes.annotate("", (2.6 * x, 1.75 * y), (1.7 * x, 0.9 * y), arrowprops=out)
    axes.text(0.12, 1.55, "heat, in the plane", fontsize=9, color="#0072b2", va="center")
    push = {"arrowstyle": "-|>", "color": "#d55e00", "lw": 1.3}
    for x in (-1.0, 1.0):
        axes.annotate("", (x, 0.68), (x, 0.2), arrowprops=push)
        axes.annotate("", (x, -0.68), (x, -0.2), arrowprops=push)
    axes.text(0, 0, "pressure\nof the liquid", fontsize=9, ha="center", va="center")
    axes.text(
        0, -2.15, "both planes of the slice stay plane;\nno heat flows along the strand",
        fontsize=9, ha="center", va="center",
    )  # fmt: skip
    axes.set_xlim(-3, 3)
    axes.set_ylim(-2.7, 2.2)


def main() -> None:
    """Draw the sketch."""
    from PIL import Image

    with look():
        figure = new_figure(9.0, 4.6, layout="none")
        for place, draw in (((0.0, 0.0, 0.56, 1.0), caster), ((0.57, 0.1, 0.42, 0.8), section)):
            axes = figure.add_axes(place)
            axes.set_aspect("equal")
            axes.set_axis_off()
            draw(axes)
        figure.savefig(TARGET, dpi=100)
    Image.open(TARGET).convert("RGB").quantize(64).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
