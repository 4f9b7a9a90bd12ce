"""Maps of a strand over clock and position: surface, reheating, flux, shell, centre line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array
from castfem.model.quality import band_of
from castfem.post.plots.maps import band_norm, band_ticks, edges, temperature_colours
from castfem.post.plots.strand_over_time import along, place_grid, widest_gap
from castfem.post.plots.style import STYLE, head, look, new_figure
from castfem.runs.caster.files import CENTRE, definition, read_table
from castfem.runs.output.folder import CASTER_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from castfem.model import Case

SURFACE, _REHEATING = "surface_temperature_", "reheating_"
_COLOURS = {"heat_flux": "magma", CENTRE: "cividis", "reheating": "YlOrRd", "shell": "viridis"}
_ACROSS = 3  # panels


def mapped(strand: dict[str, Array], exit: float) -> dict[str, Array]:
    """Return what is shown of a strand's rows, with how far a surface has been reheated, K.

    Args:
        strand: Columns of strand.csv.
        exit: End of the mould, m, from where on reheating counts.
    """
    surfaces = [name for name in strand if name.startswith(SURFACE)]
    first = surfaces[0].removeprefix(SURFACE)
    found = {name: strand[name] for name in surfaces}
    found[_REHEATING + first] = reheated(strand, surfaces[0], exit)
    return found | {n: strand[n] for n in (f"heat_flux_{first}", f"shell_{first}", CENTRE)}


def reheated(strand: dict[str, Array], name: str, exit: float) -> Array:
    """How far a surface is above the coldest that the slice has been since the mould, K.

    As it is known at the instants: between two of them it may have been colder. NaN of a slice that
    has left the mould before the first of them.
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
    """Return a panel for each quantity, with the end of the pool."""
    caster, _, _ = read_table(folder / CASTER_NAME)
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    shown = mapped(strand, case.mould_exit() or 0.0)
    places, minutes = place_grid(case.casting.length), np.divide(caster["time"], 60.0)
    names, gap = list(shown), widest_gap(strand)
    lines = -(-len(names) // _ACROSS)
    figure = new_figure(1.5 * STYLE.width, 0.6 + 2.3 * lines)
    panels = figure.subplots(lines, _ACROSS, sharex=True, sharey=True, squeeze=False)
    head(figure, case.title)
    low, high = (end - ZERO_CELSIUS for end in band_of(case))
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
    _name_axes(panels)
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


def _name_axes(panels: Any) -> None:
    for panel in panels[-1]:
        panel.set_xlabel("time by the clock [min]")
    for panel in panels[:, 0]:
        panel.set_ylabel("position [m]")
