"""The whole strand over the clock: speed, shell by position, the end of the pool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array
from castfem.post.plots.maps import edges
from castfem.post.plots.style import STYLE, head, look, new_figure
from castfem.runs.caster.files import definition, read_table
from castfem.runs.output.folder import CASTER_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

_ROWS = 200  # of the map, along the strand
_LINE = "#d55e00"


@look()
def strand_figure(folder: Path, title: str, length: float) -> Figure:
    """Return the speed above a map of the shell, with the end of the pool."""
    caster, _, words = read_table(folder / CASTER_NAME)
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    minutes = [float(time) / 60.0 for time in caster["time"]]
    figure = new_figure(STYLE.width, 5.6)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 2.2), width_ratios=(1.0, 0.025))
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    head(figure, title)
    speed = scale_of("m/min", "speed")
    above.plot(minutes, speed(caster["speed"]), color="0.2")
    above.set_ylabel(f"casting speed [{plain_unit(speed.unit)}]")
    above.set_ylim(bottom=0.0)
    above.tick_params(labelbottom=False)
    for at, event in zip(minutes, words.get("event", ()), strict=False):
        if event:
            above.axvline(at, color=_LINE, lw=0.8, ls=":")
            above.annotate(
                event, (at, 0.04), xycoords=("data", "axes fraction"), rotation=90, fontsize=7,
                ha="right" if at > minutes[0] else "left", va="bottom",
            )  # fmt: skip
    shades, words_of = _draw_shell(below, strand, caster["time"], length)
    figure.colorbar(shades, cax=figure.add_subplot(grid[1, 1]), label=words_of)
    pool = caster["metallurgical_length"]
    below.plot(minutes, pool, color="white", lw=2.8, solid_capstyle="butt")
    below.plot(minutes, pool, color=_LINE, lw=1.6, label="end of the pool")
    below.legend(loc="lower left", fontsize=7)
    below.set_xlabel("time by the clock [min]")
    return figure


def _draw_shell(
    axes: Axes, strand: dict[str, Array], clock: Array, length: float
) -> tuple[ScalarMappable, str]:
    """Draw the shell at the first probe over clock and position."""
    name = next(name for name in strand if name.startswith("shell_"))
    places, gap = place_grid(length), widest_gap(strand)
    values = np.array([along(strand, name, now, places, gap) for now in clock])
    found, probe = definition(name)
    scale = scale_of(found.unit, name)
    shades = axes.pcolormesh(
        edges(np.divide(clock, 60.0)), edges(places), scale(values).T,
        cmap="viridis", shading="flat", rasterized=True,
    )  # fmt: skip
    axes.set_ylim(length, 0.0)
    axes.set_ylabel("position below the meniscus [m]")
    axes.grid(False)
    return shades, f"{found.result(0.0, probe).label} [{plain_unit(scale.unit)}]"


def place_grid(length: float) -> Array:
    """Return the positions at which a strand is shown, m."""
    return np.linspace(0.0, length, _ROWS, dtype=np.float64)


def widest_gap(strand: dict[str, Array]) -> float:
    """Return the largest distance of two slices that follow one another, m."""
    apart, same = np.diff(strand["position"]), np.diff(strand["clock"]) == 0.0
    return float(np.max(apart[same], initial=0.0))


def along(strand: dict[str, Array], name: str, now: float, places: Array, gap: float) -> Array:
    """A column along the strand at an instant: at its ends as at the nearest slice.

    NaN below the first slice of a cast, and farther from a slice than slices are from one another.
    """
    rows = np.flatnonzero(strand["clock"] == now)
    if not len(rows):
        return np.full(len(places), np.nan)
    order = rows[np.argsort(strand["position"][rows])]
    at = strand["position"][order]
    below = 0.0 if strand["slice"][order[-1]] == 1.0 else gap
    there = (places >= at[0] - gap) & (places <= at[-1] + below)
    return np.where(there, np.interp(places, at, strand[name][order]), np.nan)
