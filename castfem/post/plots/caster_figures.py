"""The pictures of a caster: the strand over the clock, as maps, and cut at moments.

Speed, shell by position and end of the liquid core over the clock; maps over clock and position of
surface, reheating, flux, shell and centre line; the strand at moments, cut lengthwise through its
middle, in its machine.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array
from castfem.post.plots.maps import band_norm, band_ticks, edges, temperature_colours
from castfem.post.plots.style import STYLE, head, look, new_figure, save
from castfem.runs.caster.files import CENTRE, definition, moment_files, read_table
from castfem.runs.output.folder import CASTER_FIGURES, CASTER_NAME, FIGURES_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    from castfem.model import Case


_ROWS = 200  # rows of the map, along the strand
_LINE = "#d55e00"


@look()
def strand_figure(folder: Path, title: str, length: float) -> Figure:
    """Return the speed above a map of the shell, with the end of the liquid core."""
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
    """Return the largest distance of two consecutive slices, m."""
    apart, same = np.diff(strand["position"]), np.diff(strand["clock"]) == 0.0
    return float(np.max(apart[same], initial=0.0))


def along(strand: dict[str, Array], name: str, now: float, places: Array, gap: float) -> Array:
    """A column along the strand at one time: constant beyond its ends.

    NaN below the first slice of a cast, and where slices are farther apart than normal.
    """
    rows = np.flatnonzero(strand["clock"] == now)
    if not len(rows):
        return np.full(len(places), np.nan)
    order = rows[np.argsort(strand["position"][rows])]
    at = strand["position"][order]
    below = 0.0 if strand["slice"][order[-1]] == 1.0 else gap
    there = (places >= at[0] - gap) & (places <= at[-1] + below)
    return np.where(there, np.interp(places, at, strand[name][order]), np.nan)


SURFACE, _REHEATING = "surface_temperature_", "reheating_"
_COLOURS = {"heat_flux": "magma", CENTRE: "cividis", "reheating": "YlOrRd", "shell": "viridis"}
_ACROSS = 3  # panels in a row
_STRAINED = "I1_max", "I2_max", "bulge_intrados", "bulge_extrados", "roll_force"


def mapped(strand: dict[str, Array], exit: float) -> dict[str, Array]:
    """Return the mapped columns of a strand, with the reheating of the surface, K.

    Args:
        strand: Columns of strand.csv.
        exit: End of the mould, m, below which reheating is computed.
    """
    surfaces = [name for name in strand if name.startswith(SURFACE)]
    first = surfaces[0].removeprefix(SURFACE)
    found = {name: strand[name] for name in surfaces}
    found[_REHEATING + first] = reheated(strand, surfaces[0], exit)
    found |= {n: strand[n] for n in (f"heat_flux_{first}", f"shell_{first}", CENTRE)}
    return found | {n: strand[n] for n in _STRAINED if n in strand and (strand[n] > 0.0).any()}


def reheated(strand: dict[str, Array], name: str, exit: float) -> Array:
    """Rise of a surface temperature above the lowest of the slice since the mould, K.

    From the output times: in between it may have been lower. NaN for a slice that has left the
    mould before the first of them.
    """
    found, clock = np.zeros(len(strand[name])), strand["clock"]
    for number in np.unique(strand["slice"]):
        rows = np.flatnonzero((strand["slice"] == number) & (strand["position"] >= exit))
        rows = rows[np.argsort(clock[rows])]
        values = strand[name][rows]
        known = exit == 0.0 or not (clock[rows] == clock.min()).any()
        found[rows] = values - np.minimum.accumulate(values) if known else np.nan
    return found


@look()
def maps_figure(folder: Path, case: Case) -> Figure:
    """Return a panel for each quantity, with the end of the liquid core."""
    caster, _, _ = read_table(folder / CASTER_NAME)
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    shown = mapped(strand, case.mould_exit() or 0.0)
    places, minutes = place_grid(case.casting.length), np.divide(caster["time"], 60.0)
    names, gap = list(shown), widest_gap(strand)
    lines = -(-len(names) // _ACROSS)
    figure = new_figure(1.5 * STYLE.width, 0.6 + 2.3 * lines)
    panels = figure.subplots(lines, _ACROSS, sharex=True, sharey=True, squeeze=False)
    head(figure, case.title)
    low, high = (end - ZERO_CELSIUS for end in case.brittle_band)
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    for panel, name in zip(panels.flat, names, strict=False):
        rows = {**strand, name: shown[name]}
        values = np.array([along(rows, name, now, places, gap) for now in caster["time"]])
        options, label, ticks = _look_of(name, values, (low, high))
        scaled = options.pop("values")
        shades = panel.pcolormesh(
            edges(minutes), edges(places), scaled.T, shading="flat", rasterized=True, **options
        )
        bar = figure.colorbar(shades, ax=panel)
        if ticks:
            bar.set_ticks(ticks)
        panel.set_title(label, fontsize=8)
        panel.plot(minutes, caster["metallurgical_length"], color="white", lw=2.0)
        panel.plot(minutes, caster["metallurgical_length"], color="k", lw=0.9)
        panel.grid(False)
    panels[0, 0].set_ylim(case.casting.length, 0.0)
    _name_axes(panels, len(names))
    return figure


def _look_of(
    name: str, values: Array, band: tuple[float, float]
) -> tuple[dict[str, Any], str, list[float]]:
    """Values and colours, label and ticks of a map."""
    surface = name.replace(_REHEATING, SURFACE)
    found, probe = definition(surface)
    label = found.result(0.0, probe).label
    if name.startswith(SURFACE):
        norm = band_norm(float(np.nanmin(values)), float(np.nanmax(values)), band)
        options = {"values": values, "cmap": temperature_colours(), "norm": norm}
        return options, f"{label} [°C]", band_ticks(norm)
    if name.startswith(_REHEATING):
        return {"values": values, "cmap": "YlOrRd"}, f"reheating: {label} [K]", []
    scale = scale_of(found.unit, name)
    colours = next((c for start, c in _COLOURS.items() if name.startswith(start)), "viridis")
    unit = plain_unit(scale.unit)
    return {"values": scale(values), "cmap": colours}, f"{label} [{unit}]" if unit else label, []


def _name_axes(panels: Any, count: int) -> None:
    """Name the axes of the panels: times below the last of each column."""
    for panel in panels.flat[max(count - _ACROSS, 0) : count]:
        panel.tick_params(labelbottom=True)
        panel.set_xlabel("time by the clock [min]")
    for panel in panels[:, 0]:
        panel.set_ylabel("position [m]")


_SHOWN = "temperature", "solid_fraction"
_CELSIUS = 500.0, 1550.0
# solid fraction at the end of the liquid core; magnification of the thickness
_SOLID, _THICKER = 0.999, 4.0
_MOVED = 1e-6  # m: a strand whose face moves less sideways is straight


@look()
def moments_figure(folder: Path, case: Case) -> Figure | None:
    """Return a panel for each moment, coloured by temperature; None without moments.

    A bent strand is drawn in its shape, with magnified thickness; a straight one over the whole
    width. Panels are side by side if the strand is higher than wide.
    """
    found = moment_files(folder)
    if not found:
        return None
    cuts = [middle_of(path) for _, path in found]
    spans = np.max([np.ptp(points.reshape(-1, 2), axis=0) for points, _, _ in cuts], axis=0)
    straight = all(np.ptp(points[:, 0, 0]) < _MOVED for points, _, _ in cuts)
    thicker = 1.0 if straight else _THICKER
    each = float(np.clip(STYLE.width * spans[1] / max(spans[0], 1e-9), 2.0, 5.0))
    beside = straight or spans[1] > spans[0]
    shape = (1, len(found)) if beside else (len(found), 1)
    figure = new_figure(STYLE.width, each * shape[0] + 0.8)
    panels = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
    head(figure, case.title)
    for panel, (clock, _), (points, temperature, solid) in zip(panels, found, cuts, strict=True):
        middle = 0.5 * (points[:, :1] + points[:, -1:])
        x, y = np.moveaxis(middle + thicker * (points - middle), -1, 0)
        shades = panel.pcolormesh(
            x, y, temperature - ZERO_CELSIUS, shading="gouraud", cmap="inferno",
            vmin=_CELSIUS[0], vmax=_CELSIUS[1], rasterized=True,
        )  # fmt: skip
        panel.contour(x, y, solid, levels=[_SOLID], colors="#00c8ff", linewidths=1.2)
        panel.set_aspect("auto" if straight else "equal")
        panel.set_title(f"{clock / 60.0:.4g} min by the clock", fontsize=9)
        panel.grid(False)
    figure.colorbar(shades, ax=list(panels), label="temperature [°C]", shrink=0.5)
    for panel in panels[:1] if beside else panels:
        panel.set_ylabel("height [m]")
    where = "across" if straight else f"from the mould, drawn {thicker:g} times as thick"
    figure.supxlabel(f"{where} [m]; blue: edge of the pool", fontsize="medium")
    return figure


def middle_of(path: Path) -> tuple[Array, Array, Array]:
    """Return the middle of the wide faces: points (rows, n, 2) m, temperature K, solid fraction.

    Points are distance from the mould and height from the meniscus, from face to face.
    """
    import meshio

    mesh = meshio.read(path)
    position = np.asarray(mesh.point_data["position"])
    count = int(np.argmax(position != position[0]))  # points of a slice
    points = mesh.points.reshape(-1, count, 3)
    across = np.abs(points[0, :, 1])
    here = np.flatnonzero(across <= across.min() + 1e-6)
    here = here[np.argsort(points[0, here, 0])]
    values = (np.asarray(mesh.point_data[n]).reshape(-1, count)[:, here] for n in _SHOWN)
    temperature, solid = values
    return points[:, here][..., [0, 2]], temperature, solid


def draw_caster(folder: Path, case: Case) -> list[Path]:
    """Draw a caster's files; return the pictures."""
    (folder / FIGURES_NAME).mkdir(exist_ok=True)
    figures = (
        strand_figure(folder, case.title, case.casting.length),
        maps_figure(folder, case),
        moments_figure(folder, case),
    )
    drawn = []
    for name, figure in zip(CASTER_FIGURES, figures, strict=True):
        if figure is not None:
            path = folder / FIGURES_NAME / f"{name}.png"
            save(figure, path)
            drawn.append(path)
    return drawn
