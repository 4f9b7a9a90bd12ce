"""Draw a mould cold and at work: its section, its width and diagonal, its faces' temperature."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.mould.mould import Mould
from castfem.post.plots.style import head, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.physics.mould.hot.model import HotWall
    from castfem.studies.mould_fit.coupled import Drawing

_COLOURS = ("#0072b2", "#d55e00", "#009e73")
_UNDER = -0.11  # of the height of a panel: its legend, which would hide curves within it
_TIMES = 40.0
"""How much larger than life the distortion of the section is drawn."""
_DENSE = 400
"""Points of a segment of an outline: between two the radius is interpolated, and its error drawn
so much larger, too."""


def draw(found: Drawing, wall: HotWall, path: str | os.PathLike[str], title: str = "") -> None:
    """Draw a mould cold and at work to a picture file."""
    with look():
        figure = new_figure(12.6, 5.8)
        axes = figure.subplots(1, 3, width_ratios=(5.0, 3.6, 3.6))
        head(figure, title)
        _section(axes[0], found)
        _sizes(axes[1], found)
        _faces(axes[2], wall)
        for panel in axes[1:]:
            panel.set_ylim(1e3 * found.cold.length, 0.0)
            panel.set_ylabel("position below the meniscus [mm]")
            panel.legend(loc="upper center", bbox_to_anchor=(0.5, _UNDER), ncols=2, fontsize=8)
        figure.savefig(path, dpi=130)


def _closed(mould: Mould, position: float) -> Array:
    """Points (n, 2) round the contour, m."""
    contour = mould.contour(position)
    points = np.concatenate([s.points(_DENSE) for s in contour.segments])
    return np.concatenate([points, points[:1]])


def _section(ax: Axes, found: Drawing) -> None:
    """The cold section half way down, and the wall at work at three positions."""
    length = found.cold.length
    angle = np.asarray(np.linspace(0.25, 2.25, 721) * np.pi, np.float64)  # ends in a corner
    for name, position, colour in zip(
        ("meniscus", "half way", "exit"), (0.0, 0.5 * length, length), _COLOURS, strict=True
    ):
        radii = [_radius(_closed(mould, position), angle) for mould in (found.cold, found.hot)]
        radius = radii[0] + _TIMES * (radii[1] - radii[0])
        label = f"{name}, {1e3 * position:g} mm"
        x, y = 1e3 * radius * np.cos(angle), 1e3 * radius * np.sin(angle)
        ax.plot(x, y, color=colour, label=label)
    cold = _closed(found.cold, 0.5 * length)
    ax.plot(*(1e3 * cold.T), color="#7f7f7f", linewidth=0.8, label="cold")
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(f"wall at work, distortion x {_TIMES:g}")
    ax.legend(loc="center")


def _radius(points: Array, angle: Array) -> Array:
    """Distance from the centre at angles, of a closed outline round it."""
    own = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    order = np.argsort(own)
    return np.interp(angle, own[order], np.hypot(*points[order].T), period=2.0 * np.pi)


def _sizes(ax: Axes, found: Drawing) -> None:
    """How much wider the mould is at work than in the workshop."""
    z = np.linspace(0.0, found.cold.length, 201)
    cold = [found.cold.dimensions(float(p)) for p in z]
    hot = [found.hot.dimensions(float(p)) for p in z]
    for name, colour in zip(cold[0], _COLOURS, strict=False):
        wider = [1e3 * (h[name] - c[name]) for h, c in zip(hot, cold, strict=True)]
        style = "--" if name == "height" else "-"
        ax.plot(wider, 1e3 * z, color=colour, linestyle=style, label=name)
    ax.set_xlabel("at work less cold [mm]")
    ax.set_title("dimensions")


def _faces(ax: Axes, wall: HotWall) -> None:
    """Temperature of both faces, at mid-face and, if there is one, in the corner."""
    z = 1e3 * wall.displacement.positions
    places = [(0, "-", "" if wall.corner is None else ", mid-face")]
    places += [] if wall.corner is None else [(wall.corner, ":", ", corner")]
    for values, colour, name in (
        (wall.hot, _COLOURS[1], "hot face"),
        (wall.outer, _COLOURS[0], "water side"),
    ):
        for column, style, where in places:
            shown = values[:, column] - ZERO_CELSIUS
            ax.plot(shown, z, color=colour, linestyle=style, label=f"{name}{where}")
    ax.set_xlabel("temperature [°C]")
    ax.set_title("copper")
