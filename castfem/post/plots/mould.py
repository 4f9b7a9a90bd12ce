"""Pictures of a mould: its taper, its working wall, the section at the meniscus that fits it.

Figures are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.mould.cavity import Sides
from castfem.physics.mould.mould import Mould
from castfem.physics.mould.perimeter import Places
from castfem.post.plots.style import STYLE, head, look, new_figure, round_factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.physics.mould.hot.model import HotWall
    from castfem.studies.mould_fit.coupled import Drawing
    from castfem.studies.mould_fit.meniscus_outline import Attempt, Outline

_STAGES = ("meniscus", "half way", "exit")
_GREY = "#7f7f7f"
_STAGE_COLOURS = (_GREY, "#e69f00", "#d55e00")
_COLOURS = ("#0072b2", "#d55e00", "#009e73")


@contextmanager
def _panels(
    path: str | os.PathLike[str], title: str, size: tuple[float, float], ratios: Sequence[float]
) -> Iterator[list[Axes]]:
    """Panels side by side, written to a picture file (png, pdf, svg) at the end of the block."""
    with look():
        figure = new_figure(*size)
        axes: Any = figure.subplots(1, len(ratios), width_ratios=ratios)
        head(figure, title)
        yield list(axes)
        figure.savefig(path, dpi=130)


def _in_mm(ax: Axes, title: str) -> None:
    """Finish a panel of a section."""
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(title)
    ax.legend(loc="center")


def _downwards(axes: Sequence[Axes], length: float) -> None:
    """Let the position increase downwards in the panels."""
    for panel in axes:
        panel.set_ylim(1e3 * length, 0.0)
        panel.set_ylabel("position below the meniscus [mm]")


def closed(mould: Mould, position: float, points: int = STYLE.segment) -> Array:
    """Points (n, 2) around the contour, as many at every position, m."""
    found = np.concatenate([s.points(points) for s in mould.contour(position).segments])
    return np.concatenate([found, found[:1]])


def draw(mould: Mould, path: str | os.PathLike[str], title: str = "") -> None:
    """Draw a mould: its section at three positions, its wall and its temperature along it."""
    heated = mould.wall_temperature is not None and len(mould.wall_temperature.values) > 1
    size = (12.6 if heated else 10.6, 5.8)
    with _panels(path, title, size, (5.4, 3.8, 2.0)[: 2 + heated]) as axes:
        _section(axes[0], mould)
        _wall(axes[1], mould)
        if heated:
            z = np.linspace(0.0, mould.length, 201)
            kelvin = [mould.temperature(float(p)) for p in z]
            axes[2].plot(np.array(kelvin) - ZERO_CELSIUS, 1e3 * z, color="#c0392b")
            axes[2].set_xlabel("wall temperature [°C]")
            axes[2].margins(x=0.2)
        _downwards(axes[1:], mould.length)


def _section(ax: Axes, mould: Mould) -> None:
    """The contour at meniscus, half way and exit, its deviation from the first magnified."""
    positions = (0.0, 0.5 * mould.length, mould.length)
    outlines = [closed(mould, position) for position in positions]
    moved = [outline - outlines[0] for outline in outlines]
    most = max(float(np.hypot(*m.T).max()) for m in moved)
    small = min(float(np.ptp(outlines[0][:, axis])) for axis in (0, 1))
    times = round_factor(0.12 * 0.5 * small / most) if most > 1e-9 * small else 1.0
    for name, position, deviation, colour in zip(
        _STAGES, positions, moved, _STAGE_COLOURS, strict=True
    ):
        x, y = 1e3 * (outlines[0] + times * deviation).T
        ax.plot(x, y, color=colour, solid_capstyle="round", label=f"{name}, {1e3 * position:g} mm")
    _in_mm(ax, f"wall, deviation x {times:g}" if times != 1.0 else "wall")


def _wall(ax: Axes, mould: Mould) -> None:
    """Inward displacement of the wall since the meniscus."""
    knots = [k for c in mould.tapers.profiles for k in c.knots() if k <= mould.length]
    z = np.unique([*np.linspace(0.0, mould.length, 201), *knots])
    start = mould.marks(0.0)
    marks = [mould.marks(float(position)) for position in z]
    for name, colour in zip(start, _COLOURS, strict=False):
        closing = [1e3 * (start[name] - mark[name]) for mark in marks]
        ax.plot(closing, 1e3 * z, color=colour, label=name)
    ax.axvline(0.0, color=_GREY, linewidth=0.8)
    ax.set_xlabel("wall moved inwards since the meniscus [mm]")
    ax.set_title("wall along the mould")
    ax.legend(loc="best")


def draw_hot(found: Drawing, wall: HotWall, path: str | os.PathLike[str], title: str = "") -> None:
    """Draw a cold and working mould: section, width and diagonal, temperature of its faces."""
    with _panels(path, title, (12.6, 5.8), (5.0, 3.6, 3.6)) as axes:
        _hot_section(axes[0], found)
        _wider(axes[1], found)
        _faces(axes[2], wall)
        _downwards(axes[1:], found.cold.length)
        for panel in axes[1:]:
            # a legend inside would hide curves
            panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2, fontsize=8)


def _hot_section(ax: Axes, found: Drawing) -> None:
    """The cold section half way down, and the working wall at three positions."""
    length = found.cold.length
    # begins and ends in a corner
    angle = np.asarray(np.linspace(0.25, 2.25, 721) * np.pi, np.float64)
    for name, position, colour in zip(_STAGES, (0.0, 0.5 * length, length), _COLOURS, strict=True):
        cold, hot = (
            radius_at(closed(mould, position, STYLE.dense), angle)
            for mould in (found.cold, found.hot)
        )
        radius = 1e3 * (cold + STYLE.hot_times * (hot - cold))
        label = f"{name}, {1e3 * position:g} mm"
        ax.plot(radius * np.cos(angle), radius * np.sin(angle), color=colour, label=label)
    outline = 1e3 * closed(found.cold, 0.5 * length, STYLE.dense)
    ax.plot(*outline.T, color=_GREY, linewidth=0.8, label="cold")
    _in_mm(ax, f"wall at work, distortion x {STYLE.hot_times:g}")


def radius_at(points: Array, angle: Array) -> Array:
    """Distance from the centre, at some angles, of a closed outline around it."""
    own = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    order = np.argsort(own)
    return np.interp(angle, own[order], np.hypot(*points[order].T), period=2.0 * np.pi)


def _wider(ax: Axes, found: Drawing) -> None:
    """Difference of the widths of the working and the cold mould."""
    z = np.linspace(0.0, found.cold.length, 201)
    cold, hot = ([m.dimensions(float(p)) for p in z] for m in (found.cold, found.hot))
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


def draw_section(
    attempts: Sequence[Attempt], sides: Sides, path: str | os.PathLike[str], title: str = ""
) -> None:
    """Draw the section at the meniscus that gives the wanted one at the end (Fig. 121)."""
    last = attempts[-1]
    with _panels(path, title, (12.6, 4.9), (4.0, 4.0, 3.6)) as (left, right, steps):
        _outline(left, last.start, sides, "at the meniscus", "#0072b2")
        _outline(right, last.end, sides, "at the end", "#d55e00")
        number = np.arange(1, len(attempts) + 1)
        steps.semilogy(number, [1e6 * one.worst for one in attempts], "o-", color="#009e73")
        steps.set_xticks(number)
        steps.set_xlabel("run")
        steps.set_ylabel("largest deviation [um]")
        steps.set_title("deviation from the required section")


def _outline(ax: Axes, outline: Outline, sides: Sides, where: str, colour: str) -> None:
    """The rectangle, and an outline relative to it."""
    places = Places.spread(sides, 60, 30, order=1)
    points, normals = places.on(sides)
    offset = np.interp(places.ways(sides), outline.ways, outline.offset)
    shifted = points + STYLE.outline_times * offset[:, None] * normals
    pens: tuple[dict[str, Any], ...] = ({"color": _GREY, "linewidth": 0.8}, {"color": colour})
    for shape, pen, label in zip((points, shifted), pens, ("wanted", "section"), strict=True):
        x, y = 1e3 * shape.T
        signs = ((1, 1, 1), (-1, 1, -1), (-1, -1, 1), (1, -1, -1))
        whole = [np.stack([sx * x, sy * y], 1)[::way] for sx, sy, way in signs]
        ax.plot(*np.concatenate([*whole, whole[0][:1]]).T, **pen, label=label)
    _in_mm(ax, f"{where}, x {STYLE.outline_times:g}")
