"""Maps of the surface of the strand: temperature, low-ductility range, crack indexes.

The colours are those of [Pascon2003] (Figs 154 to 165): green above the range, blue below, from
violet to light yellow within; for an index white is zero.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_quantity import from_si
from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array, Indices
from castfem.physics.machine.stations import Stations
from castfem.post.plots.style import STYLE, Abscissa, dress, new_panels
from castfem.runs.output.surface_maps import IN_BAND, SurfaceLine, SurfaceMap, SurfaceMaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

_RED = "#c1272d"
_WORDS = {"won": "damage (Won)", "clyne_davies": "time ratio", "rdg": "pressure drop"}
_ROUNDED = {"1/s": 1e5}  # factors on indexes in some units


@lru_cache
def temperature_colours() -> Colormap:
    """Blue, violet to light yellow, green; a third of the scale each."""
    from matplotlib.colors import LinearSegmentedColormap

    parts = (
        ("#08306b", "#2171b5", "#9ecae1"),
        ("#6a1b9a", "#c2185b", "#f57c00", "#fff59d"),
        ("#a5d6a7", "#2e7d32", "#0b3d16"),
    )
    third, anchors = 1.0 / 3.0, []
    for i, colours in enumerate(parts):
        at = np.linspace(i * third, (i + 1) * third, len(colours))
        anchors += list(zip(np.clip(at, 0.0, 1.0).tolist(), colours, strict=True))
    return LinearSegmentedColormap.from_list("ductility", anchors, N=3 * STYLE.shades)


def band_norm(low: float, high: float, band: tuple[float, float]) -> Normalize:
    """A scale from the coldest to the hottest in which the range takes a third."""
    from matplotlib.colors import FuncNorm

    # K, at least, beyond the range
    ends = [min(low, band[0] - 25.0), *band, max(high, band[1] + 25.0)]
    thirds = np.linspace(0.0, 1.0, 4)
    functions = (
        lambda value: np.interp(value, ends, thirds),
        lambda share: np.interp(share, thirds, ends),
    )
    return FuncNorm(functions, vmin=ends[0], vmax=ends[-1])


def band_ticks(norm: Normalize) -> list[float]:
    """Round temperatures along such a scale, including the ends of the range."""
    return [round(float(tick), -1) for tick in norm.inverse(np.linspace(0.0, 1.0, 7))]


@lru_cache
def index_colours() -> Colormap:
    """White for zero, then from light yellow to dark red."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    found = ListedColormap(colormaps["YlOrRd"](np.linspace(0.08, 1.0, STYLE.shades)))
    return found.with_extremes(bad="white")


def edges(centres: Array) -> Array:
    """Ends of the cells around points: half-way between them, (n + 1,)."""
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([centres[:1], middle, centres[-1:]])


def draw_maps(maps: SurfaceMaps, abscissa: Abscissa) -> Figure | None:
    """Temperature, range, I1 and I2 over the length around the section and the position.

    Returns:
        None before the second step.
    """
    rows = np.flatnonzero(np.diff(maps.position, prepend=-1.0) > 0.0)
    if len(rows) < 2 or not abscissa.along:
        return None
    shown = [m for m in maps.heading.maps if m.name in ("I1", "I2")]
    figure, axes = new_panels(2 + len(shown), 1.75)  # inches of a panel
    figure.subplots_adjust(right=0.84)
    line, x = maps.heading.line, edges(maps.position[rows] * abscissa.scale)
    y = edges(1e3 * line.way)
    celsius = maps["temperature"][rows] - ZERO_CELSIUS
    band = tuple(end - ZERO_CELSIUS for end in maps.heading.band)
    norm = band_norm(float(celsius.min()), float(celsius.max()), (band[0], band[1]))
    options: dict[str, Any] = {"shading": "flat"}
    shades = axes[0].pcolormesh(x, y, celsius.T, cmap=temperature_colours(), norm=norm, **options)
    bar = _bar(axes[0], shades, "temperature [°C]")
    bar.set_ticks(band_ticks(norm))
    _draw_band(axes[1], maps, x, y, rows, options)
    for panel, one in zip(axes[2:], shown, strict=True):
        _draw_index(panel, maps, one, (x, y, rows), abscissa)
    stations = Stations.of_columns(**maps.heading.caster())
    for panel in axes:
        _name_faces(panel, line)
        panel.grid(False)
    dress(axes, abscissa)
    _mark_phases(axes, stations, abscissa)
    return figure


def draw_depths(maps: SurfaceMaps, abscissa: Abscissa) -> Figure | None:
    """Hot tearing criteria over the depth and the position, with the brittle range.

    For each criterion the first line into the section is drawn, and the one with its largest value.

    Returns:
        None before the second step, or if nothing has frozen.
    """
    rows = np.flatnonzero(np.diff(maps.position, prepend=-1.0) > 0.0)
    line, chosen = maps.heading.line, []
    for one in maps.heading.maps[1:]:
        final = maps[one.name][-1]
        if final.max() > 0.0:
            lines = dict.fromkeys((0, int(line.face[int(np.argmax(final))])))
            chosen += [(one, face) for face in lines]
    if len(rows) < 2 or not abscissa.along or not chosen:
        return None
    figure, axes = new_panels(len(chosen), 1.75)
    figure.subplots_adjust(right=0.84)
    x = maps.position[rows] * abscissa.scale
    for panel, (one, face) in zip(axes, chosen, strict=True):
        places = np.flatnonzero(line.face == face)
        depth = 1e3 * line.way[places]
        kelvin = maps["temperature"][np.ix_(rows, places)]
        values = index_values(maps, one)[np.ix_(rows, places)]
        top, band = float(index_values(maps, one).max()), maps.heading.band
        hidden = (values <= 0.0) | (kelvin > band[1])  # between one vertex and the next
        shades = panel.pcolormesh(
            edges(x), edges(depth), np.ma.masked_where(hidden, values).T, cmap=index_colours(),
            vmin=0.0, vmax=top, shading="flat", rasterized=True,
        )  # fmt: skip
        _bar(panel, shades, index_label(one))
        if kelvin.min() < band[1] and kelvin.max() > band[0]:
            panel.contour(x, depth, kelvin.T, levels=list(band), colors="#333333", linewidths=0.7)
        frozen = depth[kelvin.min(axis=0) < band[1]]
        panel.set_ylim(min(1.15 * float(frozen.max(initial=0.05 * depth[-1])), depth[-1]), 0.0)
        panel.set_ylabel(f"{line.faces[face]}\ndepth [mm]", fontsize=8.0)
        panel.grid(False)
    dress(axes, abscissa)
    _mark_phases(axes, Stations.of_columns(**maps.heading.caster()), abscissa)
    return figure


def _bar(panel: Axes, shades: ScalarMappable, label: str) -> Any:
    figure = panel.figure.get_figure(root=True)
    assert figure is not None
    return figure.colorbar(shades, cax=panel.inset_axes((1.015, 0.0, 0.02, 1.0)), label=label)


def _draw_band(
    panel: Axes, maps: SurfaceMaps, x: Array, y: Array, rows: Indices, options: dict[str, Any]
) -> None:
    """Red in the temperature range of low ductility."""
    from matplotlib.colors import ListedColormap

    inside = maps[IN_BAND][rows].T
    panel.pcolormesh(x, y, inside, cmap=ListedColormap(["white", _RED]), vmin=0, vmax=1, **options)
    low, high = (end - ZERO_CELSIUS for end in maps.heading.band)
    scale = scale_of("degC", "temperature")
    text = f"{scale(low):.0f} to\n{scale(high):.0f} {plain_unit(scale.unit)}"
    panel.text(1.02, 0.5, text, color=_RED, transform=panel.transAxes, va="center", fontsize=8.5)


def _draw_index(
    panel: Axes,
    maps: SurfaceMaps,
    one: SurfaceMap,
    grid: tuple[Array, Array, Indices],
    abscissa: Abscissa,
) -> None:
    """One index, with its largest value marked."""
    x, y, rows = grid
    values = index_values(maps, one)[rows]
    top = float(values.max())
    shown = np.ma.masked_less_equal(values.T, 0.0)
    shades = panel.pcolormesh(
        x,
        y,
        shown,
        cmap=index_colours(),
        vmin=0.0,
        vmax=top or 1.0,
        shading="flat",
        rasterized=True,
    )
    _bar(panel, shades, index_label(one))
    if top > 0.0:
        i, j = np.unravel_index(int(np.argmax(values)), values.shape)
        at = maps.position[rows[i]] * abscissa.scale, 1e3 * maps.heading.line.way[j]
        panel.plot(*at, "o", mfc="none", mec="k", ms=8.0, clip_on=False)


def index_values(maps: SurfaceMaps, one: SurfaceMap) -> Array:
    """An index (rows, vertices) in the unit of its label."""
    return _ROUNDED.get(one.shown, 1.0) * from_si(1.0, one.shown) * maps[one.name]


def index_label(one: SurfaceMap) -> str:
    """Name and unit of an index; strain rates are shown in 1e-5 1/s."""
    rounded = "1e-5 " if one.shown in _ROUNDED else ""
    return f"{_WORDS.get(one.name, one.name)} [{rounded}{plain_unit(one.shown)}]"


def _name_faces(panel: Axes, line: SurfaceLine) -> None:
    """Separate the faces by lines, and name them along the axis."""
    ends = np.flatnonzero(np.diff(line.face)) + 0.5
    way = 1e3 * line.way
    marks = np.interp(ends, np.arange(len(way)), way)
    for mark in marks:
        panel.axhline(mark, color="#333333", linewidth=0.7)
    parts = [0.0, *marks, way[-1]]
    first = [0, *np.ceil(ends).astype(int)]
    names = [line.faces[line.face[i]].replace(" ", "\n", 1) for i in first]
    middles = [0.5 * (a + b) for a, b in pairwise(parts)]
    panel.set_yticks(middles, names, rotation=90, va="center", fontsize=8.0)
    panel.tick_params(axis="y", length=0)
    panel.set_ylim(0.0, way[-1])


def _mark_phases(axes: list[Axes], stations: Stations, abscissa: Abscissa) -> None:
    """Lines where bending and straightening begin and end, and around misaligned rolls.

    They are named in the first panel, misaligned rolls below the rest, since their stretches may be
    within that of the bender.
    """
    if stations.rolls is None:
        return
    from castfem.physics.machine.bending_zones import off_stretches, phases
    from castfem.runs.results.crack_index import BENDS

    pairs, high = stations.rolls.pairs, float(abscissa.values[-1])
    bends = [(p.kind, p.first, p.last, 0.97) for p in phases(stations.rolls) if p.kind in BENDS]
    off = [(one.name, one.first, one.last, 0.8) for one in off_stretches(stations.rolls)]
    for name, first, last, height in (*bends, *off):
        ends = [pairs[i].position * abscissa.scale for i in (first, last)]
        if ends[0] >= high:
            continue
        for panel in axes:
            for end in ends:
                panel.axvline(end, color="#555555", linewidth=0.8, linestyle=":")
        middle = 0.5 * (ends[0] + min(ends[1], high))
        axes[0].text(
            middle, height, name, transform=axes[0].get_xaxis_transform(), ha="center",
            va="top", fontsize=7.5,
            bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 1},
        )  # fmt: skip
