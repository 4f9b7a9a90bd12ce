"""The whole strand over the clock: speed, shell and surface by position, the end of the pool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array
from castfem.post.plots.maps import edges
from castfem.post.plots.style import STYLE, head, look, new_panels, save
from castfem.runs.caster.files import definition, read_table
from castfem.runs.output.folder import (
    CASTER_FIGURE,
    CASTER_NAME,
    FIGURES_NAME,
    STRAND_ROWS_NAME,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAPS = (("shell_", "viridis"), ("surface_temperature_", "inferno"))
_ROWS = 200  # of a map, along the strand
_RIGHT = 0.86  # share of the width at which maps end, before their bars
_LINE = "#d55e00"


def draw_strand(folder: Path, title: str, length: float) -> Path:
    """Draw a caster's files.

    Args:
        folder: Of the run.
        title: Above the picture.
        length: To the end of the machine, m.
    """
    path = folder / FIGURES_NAME / f"{CASTER_FIGURE}.png"
    path.parent.mkdir(exist_ok=True)
    save(strand_figure(folder, title, length), path)
    return path


@look()
def strand_figure(folder: Path, title: str, length: float) -> Figure:
    """Return the speed above maps of shell and surface temperature, with the end of the pool."""
    caster, _, words = read_table(folder / CASTER_NAME)
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    minutes = [float(time) / 60.0 for time in caster["time"]]
    figure, axes = new_panels(1 + len(_MAPS), 2.4)
    figure.subplots_adjust(right=_RIGHT)
    head(figure, title)
    speed = scale_of("m/min", "speed")
    axes[0].plot(minutes, speed(caster["speed"]), color="0.2")
    axes[0].set_ylabel(f"casting speed [{plain_unit(speed.unit)}]")
    axes[0].set_ylim(bottom=0.0)
    for at, event in zip(minutes, words.get("event", ()), strict=False):
        if event:
            axes[0].axvline(at, color=_LINE, lw=0.8, ls=":")
            axes[0].annotate(
                event, (at, 0.04), xycoords=("data", "axes fraction"), rotation=90, fontsize=7,
                ha="right", va="bottom",
            )  # fmt: skip
    for panel, (start, colours) in zip(axes[1:], _MAPS, strict=True):
        name = next(name for name in strand if name.startswith(start))
        _draw_map(panel, strand, name, (caster["time"], length), colours)
        panel.plot(
            minutes, caster["metallurgical_length"], color="white", lw=2.6, solid_capstyle="butt"
        )
        panel.plot(
            minutes, caster["metallurgical_length"], color=_LINE, lw=1.5, label="end of the pool"
        )
        panel.legend(loc="lower left", fontsize=7)
    axes[-1].set_xlabel("time by the clock [min]")
    return figure


def _draw_map(
    panel: Axes, strand: dict[str, Array], name: str, extent: tuple[Array, float], colours: str
) -> None:
    clock, length = extent
    places: Array = np.linspace(0.0, length, _ROWS, dtype=np.float64)
    values = np.array([_along(strand, name, now, places) for now in clock])
    found, probe = definition(name)
    scale = scale_of(found.unit, name)
    shades = panel.pcolormesh(
        edges(np.divide(clock, 60.0)), edges(places), np.ma.masked_invalid(scale(values)).T,
        cmap=colours, shading="flat", rasterized=True,
    )  # fmt: skip
    box = panel.get_position()
    place = (_RIGHT + 0.015, box.y0, 0.015, box.height)
    bar = panel.figure.add_axes(place)  # type: ignore[union-attr]
    panel.figure.colorbar(shades, cax=bar)  # type: ignore[union-attr]
    label = found.result(0.0, probe).label
    bar.set_ylabel(f"{label} [{plain_unit(scale.unit)}]", fontsize=8)
    bar.tick_params(labelsize=STYLE.panel[0] * 2.2)
    panel.set_ylim(length, 0.0)
    panel.set_ylabel("position [m]")
    panel.grid(False)


def _along(strand: dict[str, Array], name: str, now: float, places: Array) -> Array:
    """A column along the strand at an instant; NaN below the lowest slice."""
    rows = np.flatnonzero(strand["clock"] == now)
    if not len(rows):
        return np.full(len(places), np.nan)
    order = rows[np.argsort(strand["position"][rows])]
    return np.interp(places, strand["position"][order], strand[name][order], right=np.nan)
