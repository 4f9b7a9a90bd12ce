"""Figures over the section: temperature field, and solid, mushy and liquid regions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import is_chosen, place_said, said
from castfem.post.plots.style import (
    LIQUIDUS_COLOUR,
    SOLIDUS_COLOUR,
    STYLE,
    Margins,
    new_figure,
)
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import triangulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import TriMesh
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from matplotlib.tri import Triangulation

STATES = {"solid": "#5b6f82", "mushy": "#f2a541", "liquid": "#fbe7b2"}


MARGINS = Margins(left=0.72, right=0.15, above=0.15, below=0.5, between=0.62)
MIRRORED = {"quarter": ((1, 1), (-1, 1), (-1, -1), (1, -1)), "half": ((1, 1), (-1, 1))}
"""Signs of x and y of the parts that form the whole section, by modelled part."""


@dataclass(frozen=True, slots=True)
class Steel:
    """Freezing range: solidus and liquidus [K]."""

    solidus: float
    liquidus: float

    @classmethod
    def of(cls, facts: Mapping[str, Any]) -> Steel | None:
        """Make it from entries `solidus` and `liquidus`; None if they are missing."""
        try:
            return cls(float(facts["solidus"]), float(facts["liquidus"]))
        except (KeyError, TypeError, ValueError):
            return None


def section_triangles(
    fields: Fields,
    values: NDArray[np.float64],
    mirrored: bool = True,
    moved: NDArray[np.float64] | float = 0.0,
) -> tuple[Triangulation, NDArray[np.float64]]:
    """The mesh, displaced [m], as triangles [mm] with a nodal field on it."""
    from matplotlib.tri import Triangulation

    points = fields.points[:, :2] + moved
    plane, triangles, parents = triangulate(points, fields.cells, fields.cell, fields.order)
    nodal = values[parents].mean(axis=1)
    part = str(fields.attributes.get("symmetry", "whole"))
    signs = MIRRORED.get(part, ((1, 1),)) if mirrored else ((1, 1),)
    points = np.vstack([1e3 * plane * np.array(sign) for sign in signs])
    offsets = range(0, len(points), len(plane))
    table = np.vstack([triangles + offset for offset in offsets])
    return Triangulation(points[:, 0], points[:, 1], table), np.tile(nodal, len(signs))


def draw_temperature(fields: Fields, steel: Steel | None, *, index: int = -1) -> Figure:
    """The temperature field, with solidus and liquidus drawn in it and in its scale.

    Thin white lines are isotherms, at the numbers of the scale.
    """
    mesh, values = section_triangles(fields, fields.values("temperature", index) - ZERO_CELSIUS)
    figure, axes = frame(mesh, when("Temperature", fields, index), bar=True)
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-6:
        low, high = low - 1.0, high + 1.0
    shades = shade(axes, mesh, values, "inferno", low, high)
    bar = colour_bar(figure, axes, shades, lies=lies_flat(mesh))
    marked = [] if steel is None else [steel.solidus - ZERO_CELSIUS, steel.liquidus - ZERO_CELSIUS]
    for level, colour in zip(marked, (SOLIDUS_COLOUR, LIQUIDUS_COLOUR), strict=False):
        if low < level < high:
            mark = bar.ax.axvline if lies_flat(mesh) else bar.ax.axhline
            mark(level, color=colour, linewidth=2.0)
    near = 0.03 * (high - low)
    lines = [
        level
        for level in bar.get_ticks()
        if low < level < high and all(abs(level - other) > near for other in marked)
    ]
    if lines:
        axes.tricontour(mesh, values, levels=lines, colors="white", linewidths=0.5, alpha=0.6)
    handles = draw_isotherms(axes, mesh, values, steel)
    if handles:
        legend_below(figure, handles)
    return figure


def draw_states(fields: Fields, steel: Steel | None, *, index: int = -1) -> Figure | None:
    """Solid, mushy and liquid regions with their area fractions; None if the steel is unknown."""
    if steel is None:
        return None
    temperature = fields.values("temperature", index)
    mesh, values = section_triangles(fields, temperature)
    figure, axes = frame(mesh, when("State of the steel", fields, index), bar=False)
    handles = fill_states(axes, mesh, values, steel)
    for handle, share in zip(handles, state_shares(mesh, values, steel), strict=True):
        handle.set_label(f"{handle.get_label()}  {100 * share:.1f} %")
    legend_below(figure, handles)
    return figure


def fill_states(
    axes: Axes, mesh: Triangulation, kelvin: NDArray[np.float64], steel: Steel
) -> list[Patch]:
    """Fill the solid, mushy and liquid regions; return their legend entries."""
    from matplotlib.patches import Patch

    low = min(float(kelvin.min()), steel.solidus) - 1.0
    liquidus = max(steel.liquidus, float(np.nextafter(steel.solidus, np.inf)))
    high = max(float(kelvin.max()), liquidus) + 1.0
    levels = [low, steel.solidus, liquidus, high]
    axes.tricontourf(mesh, kelvin, levels=levels, colors=list(STATES.values()))
    return [Patch(facecolor=c, edgecolor="#444444", label=name) for name, c in STATES.items()]


def state_shares(
    mesh: Triangulation, values: NDArray[np.float64], steel: Steel
) -> tuple[float, float, float]:
    """Area fractions that are solid, mushy and liquid, exact for the drawn triangles."""
    corners = np.sort(values[mesh.triangles], axis=1)
    x, y = mesh.x[mesh.triangles], mesh.y[mesh.triangles]
    area = 0.5 * np.abs(
        (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    )
    solid = float((_share_below(corners, steel.solidus) * area).sum() / area.sum())
    not_liquid = float((_share_below(corners, steel.liquidus) * area).sum() / area.sum())
    return solid, not_liquid - solid, 1.0 - not_liquid


def _share_below(corners: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Fraction of each triangle below a level, for a linear field with sorted corner values."""
    a, b, c = corners.T
    with np.errstate(divide="ignore", invalid="ignore"):
        rising = (level - a) ** 2 / ((b - a) * (c - a))
        falling = 1.0 - (c - level) ** 2 / ((c - a) * (c - b))
    share = np.where(level < b, rising, falling)
    return np.where(level <= a, 0.0, np.where(level >= c, 1.0, share))


def draw_isotherms(
    axes: Axes, mesh: Triangulation, values: NDArray[np.float64], steel: Steel | None
) -> list[Any]:
    """Draw solidus and liquidus in a field in degC; return their legend entries."""
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke

    if steel is None:
        return []
    handles = []
    for name, level, colour in (
        ("solidus", steel.solidus - ZERO_CELSIUS, SOLIDUS_COLOUR),
        ("liquidus", steel.liquidus - ZERO_CELSIUS, LIQUIDUS_COLOUR),
    ):
        if values.min() < level < values.max():
            line = axes.tricontour(mesh, values, levels=[level], colors=[colour], linewidths=[1.2])
            line.set_path_effects([withStroke(linewidth=2.4, foreground="white")])
        words = f"{name} {said(level, 'degC', '.1f', name)}"
        handles.append(Line2D([], [], color=colour, label=words))
    return handles


def _size(mesh: Triangulation) -> tuple[float, float]:
    """Width and height of the frame [inch], proportional to the section unless very slender."""
    ratio = float(np.ptp(mesh.x) / np.ptp(mesh.y))
    if 1 / STYLE.slender < ratio < STYLE.slender:
        return (7.2, 7.2 / ratio) if ratio > STYLE.wide else (5.0 * ratio, 5.0)
    return (7.2, 2.2) if ratio > 1 else (2.2, 5.0)


def lies_flat(mesh: Triangulation) -> bool:
    """Whether the section is so wide that the colour bar is placed below it."""
    width, height = _size(mesh)
    return width / height > STYLE.wide


def frame(mesh: Triangulation, title: str, bar: bool) -> tuple[Figure, Axes]:
    """A figure for the section, axes in mm, with room for a colour bar; placed by hand."""
    width, height = _size(mesh)
    flat = lies_flat(mesh)
    if width < 4.0:
        title = title.replace(", ", ",\n").replace(" at ", "\nat ")
    right = 0.075 * width + 0.75 if bar and not flat else MARGINS.right
    bottom = MARGINS.below + (MARGINS.between if bar and flat else 0.0)
    top = MARGINS.above + 0.2 * (title.count("\n") + 1)
    across, up = max(MARGINS.left + width + right, 3.6), bottom + height + top
    aside = 0.5 * (across - MARGINS.left - width - right)  # for a figure wider than its content
    figure = new_figure(across, up, layout="none")
    figure.subplots_adjust(
        left=(MARGINS.left + aside) / across,
        right=1.0 - (right + aside) / across,
        bottom=bottom / up,
        top=1.0 - top / up,
    )
    axes = figure.add_subplot()
    true = np.ptp(mesh.x) / np.ptp(mesh.y) / (width / height)
    axes.set_aspect("equal" if 0.99 < true < 1.01 else "auto")
    axes.grid(False)
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")
    axes.set_xlim(mesh.x.min(), mesh.x.max())
    axes.set_ylim(mesh.y.min(), mesh.y.max())
    axes.set_title(title)
    return figure, axes


def shade(
    axes: Axes, mesh: Triangulation, values: NDArray[np.float64], cmap: str, low: float, high: float
) -> TriMesh:
    """Shade a nodal field smoothly, faster than `tripcolor`; the limits of the axes are kept."""
    from matplotlib.collections import TriMesh
    from matplotlib.colors import Normalize

    shades = TriMesh(mesh, cmap=cmap, norm=Normalize(low, high))
    shades.set_array(values)
    shades.set_in_layout(False)
    axes.add_collection(shades, autolim=False)
    return shades


def colour_bar(
    figure: Figure, axes: Axes, shades: ScalarMappable, lies: bool, label: str = "temperature [°C]"
) -> Colorbar:
    """The colour scale, as long as the frame."""
    if not lies:
        return _turned(
            figure.colorbar(shades, cax=axes.inset_axes((1.03, 0, 0.045, 1)), label=label)
        )
    height = axes.get_position().height * figure.get_size_inches()[1]
    place = axes.inset_axes((0.0, -(MARGINS.below + 0.12) / height, 1.0, 0.12 / height))
    return _turned(figure.colorbar(shades, cax=place, orientation="horizontal", label=label))


def _turned(bar: Colorbar) -> Colorbar:
    """A colour scale with ticks at round numbers of the shown unit."""
    if is_chosen():
        from castfem.post.plots.chosen_units import turn

        turn(bar.long_axis)
    return bar


def legend_below(figure: Figure, handles: list[Any]) -> None:
    """A legend below everything, on one or two lines if there is room; the figure is enlarged."""
    width, height = figure.get_size_inches()
    lines = (len(handles), (len(handles) + 1) // 2)
    columns = next((n for n in lines if width > 1.4 * n), 1)
    rows = -(-len(handles) // columns)
    higher = height + 0.08 + 0.19 * rows
    margins = figure.subplotpars
    figure.set_size_inches(width, higher)
    figure.subplots_adjust(
        bottom=1.0 - (1.0 - margins.bottom) * height / higher,
        top=1.0 - (1.0 - margins.top) * height / higher,
    )
    figure.legend(handles=handles, loc="lower center", ncols=columns, frameon=False)


def when(what: str, fields: Fields, index: int) -> str:
    """The title: field, position and time."""
    position, time = float(fields.positions[index]), float(fields.times[index])
    where = place_said(position, near=".4g")
    return f"{what} at {where} below the meniscus, t = {said(time, 's', '.4g', 'time')}"
