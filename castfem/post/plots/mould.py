"""Draw a mould: its section at three positions, its wall and its temperature along it."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.mould.mould import Mould
from castfem.post.plots.style import head, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STAGES = ("meniscus", "half way", "exit")
_STAGE_COLOURS = ("#7f7f7f", "#e69f00", "#d55e00")
_MARK_COLOURS = ("#0072b2", "#d55e00", "#009e73")
_SHOWN = 0.12
"""Largest deviation as it is drawn, over half the section's smaller size."""


def draw(mould: Mould, path: str | os.PathLike[str], title: str = "") -> None:
    """Draw a mould to a picture file."""
    heated = mould.wall_temperature is not None and len(mould.wall_temperature.values) > 1
    with look():
        figure = new_figure(12.6 if heated else 10.6, 5.8)
        axes = figure.subplots(1, 3 if heated else 2, width_ratios=(5.4, 3.8, 2)[: 2 + heated])
        head(figure, title)
        _section(axes[0], mould)
        _wall(axes[1], mould)
        if heated:
            _temperature(axes[2], mould)
        for panel in axes[1:]:
            panel.set_ylim(1e3 * mould.length, 0.0)
            panel.set_ylabel("position below the meniscus [mm]")
        figure.savefig(path, dpi=130)


def _section(ax: Axes, mould: Mould) -> None:
    """The contour at meniscus, half way and exit, its deviation from the first magnified."""
    positions = (0.0, 0.5 * mould.length, mould.length)
    outlines = [_closed(mould, position) for position in positions]
    moved = [outline - outlines[0] for outline in outlines]
    most = max(float(np.hypot(*m.T).max()) for m in moved)
    small = min(float(np.ptp(outlines[0][:, axis])) for axis in (0, 1))
    times = _round(_SHOWN * 0.5 * small / most) if most > 1e-9 * small else 1.0
    for name, position, deviation, colour in zip(
        _STAGES, positions, moved, _STAGE_COLOURS, strict=True
    ):
        x, y = 1e3 * (outlines[0] + times * deviation).T
        ax.plot(x, y, color=colour, solid_capstyle="round", label=f"{name}, {1e3 * position:g} mm")
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(f"wall, deviation x {times:g}" if times != 1.0 else "wall")
    ax.legend(loc="center")


def _closed(mould: Mould, position: float) -> Array:
    """Points (n, 2) round the contour, as many at every position, m."""
    points = np.concatenate([s.points(33) for s in mould.contour(position).segments])
    return np.concatenate([points, points[:1]])


def _round(factor: float) -> float:
    """The largest of 1, 2, 5, 10, 20 ... not above a factor, at least 1."""
    decade = 10.0 ** math.floor(math.log10(factor)) if factor > 1.0 else 1.0
    return max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= max(factor, 1.0))


def _wall(ax: Axes, mould: Mould) -> None:
    """How far the wall has moved in since the meniscus."""
    z = np.unique(
        np.concatenate(
            [
                np.linspace(0.0, mould.length, 201),
                [k for c in mould.tapers.profiles for k in c.knots() if k <= mould.length],
            ]
        )
    )
    start = mould.marks(0.0)
    marks = [mould.marks(float(position)) for position in z]
    for name, colour in zip(start, _MARK_COLOURS, strict=False):
        closing = [1e3 * (start[name] - mark[name]) for mark in marks]
        ax.plot(closing, 1e3 * z, color=colour, label=name)
    ax.axvline(0.0, color="#7f7f7f", linewidth=0.8)
    ax.set_xlabel("wall moved inwards since the meniscus [mm]")
    ax.set_title("wall along the mould")
    ax.legend(loc="best")


def _temperature(ax: Axes, mould: Mould) -> None:
    """Temperature of the wall's face."""
    z = np.linspace(0.0, mould.length, 201)
    ax.plot([mould.temperature(float(p)) - ZERO_CELSIUS for p in z], 1e3 * z, color="#c0392b")
    ax.set_xlabel("wall temperature [°C]")
    ax.margins(x=0.2)
