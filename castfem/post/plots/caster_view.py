"""The strand in its caster, in three dimensions: its surface, coloured by maps, and the rolls.

It is projected in this module and drawn from the farthest piece to the nearest, without a display.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import place_said
from castfem.base.types import Array, Indices
from castfem.physics.machine.rolls import Pair, Rolls
from castfem.physics.machine.side import Side
from castfem.physics.machine.stations import Stations
from castfem.post.plots.machine import numbered
from castfem.post.plots.maps import (
    band_norm,
    band_ticks,
    index_colours,
    index_label,
    index_values,
    temperature_colours,
)
from castfem.post.plots.style import STYLE, new_figure
from castfem.runs.output.surface_maps import SurfaceLine, SurfaceMaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_AZIMUTH, _ELEVATION = np.radians(-48.0), np.radians(27.0)  # direction of view
_NOTHING = "#ececec"  # where an index is zero
_ROLL, _DRIVEN, _DEFECT = "#9aa5b1", "#1f4e79", "#c1121f"
_ROUND = np.linspace(0.0, 2.0 * np.pi, 21)


@dataclass(frozen=True, slots=True)
class View:
    """Visible part of the strand."""

    #: (n, 4, 2) of the visible pieces of the surface in the picture, m; the farther ones come first
    corners: Array
    row: Indices  #: row, of `rows`, at which each piece begins (n,)
    vertices: Indices  #: vertices that bound it (n, 2)
    rows: Indices  #: rows of the maps (r,)
    side: Side  #: side view of the strand
    half: float  #: half of its width, m
    pairs: tuple[Pair, ...]  #: pairs of rolls that it has reached

    def on_pieces(self, values: Array) -> Array:
        """The largest value of a map (rows, vertices) on each piece, over all its rows (n,)."""
        longest = np.maximum.reduceat(values[: self.rows[-1] + 1], self.rows, axis=0)
        ends = np.maximum(longest[:-1], values[self.rows[1:]])
        return np.asarray(ends[self.row[:, None], self.vertices].max(axis=1))


def projected(points: Array) -> tuple[Array, Array]:
    """Points (..., 3) in the picture (..., 2), and their nearness (...)."""
    across, up = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0]), np.sin(_ELEVATION)
    towards = np.array([np.cos(_AZIMUTH), np.sin(_AZIMUTH), 0.0])
    eye = np.cos(_ELEVATION) * towards + [0.0, 0.0, up]
    above = -up * towards + [0.0, 0.0, np.cos(_ELEVATION)]
    return np.stack([points @ across, points @ above], axis=-1), points @ eye


def view_of(maps: SurfaceMaps, side: Side, rows: Indices) -> View:
    """The visible surface of the strand: the modelled part and its mirror images."""
    line, found = maps.heading.line, []
    for sign in mirrored(line):
        found.append(_pieces(line, side, maps.position[rows], np.array(sign)))
    corners, depth, row, vertex = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(depth, kind="stable")
    half = float(np.abs(line.place[:, 0]).max())
    reached = float(maps.position[rows[-1]])
    pairs = tuple(pair for pair in side.rolls.pairs if pair.position <= reached)
    return View(corners[order], row[order], vertex[order], rows, side, half, pairs)


def mirrored(line: SurfaceLine) -> list[tuple[float, float]]:
    """Signs of x and y of all parts of the section, from the planes at which the surface ends."""
    near = 1e-6 * float(np.ptp(line.place))
    signs = [(1.0, 1.0)]
    for axis in (0, 1):
        if not line.closed and line.place[:, axis].min() >= -near:
            signs += [(-x, y) if axis == 0 else (x, -y) for x, y in signs]
    return signs


def _pieces(
    line: SurfaceLine, side: Side, position: Array, sign: Array
) -> tuple[Array, Array, Indices, Indices]:
    """Visible pieces between two rows and two vertices: corners, depth, row, vertices."""
    points = side.placed(position, line.place * sign)
    flat, depth = projected(points)
    count = len(line.nodes)
    here = np.arange(count if line.closed else count - 1)
    ahead = (here + 1) % count
    corners = np.stack([flat[:-1, here], flat[:-1, ahead], flat[1:, ahead], flat[1:, here]], axis=2)
    one, other = corners[:, :, 2] - corners[:, :, 0], corners[:, :, 3] - corners[:, :, 1]
    turned = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    seen = turned * sign[0] * sign[1] > 0.0  # counterclockwise, like the surface seen from outside
    near = 0.25 * (depth[:-1, here] + depth[:-1, ahead] + depth[1:, ahead] + depth[1:, here])
    i, j = np.nonzero(seen)
    return corners[i, j], near[i, j], i, np.stack([here[j], ahead[j]], axis=1)


def draw_caster(maps: SurfaceMaps, rolls: Rolls | None = None) -> Figure | None:
    """The strand between its rolls: its temperature and, with mechanics, I1.

    Returns:
        None for a strand without rolls, or before the second step.
    """
    heading = maps.heading
    stations = Stations.of_columns(**heading.caster())
    onward = np.flatnonzero(np.diff(maps.position, prepend=-1.0) > 0.0)
    rolls = stations.rolls if rolls is None else rolls
    if stations.rolls is None or rolls is None or not stations.thickness or len(onward) < 2:
        return None
    rows = onward[np.unique(np.linspace(0, len(onward) - 1, 260).round().astype(int))]  # at most
    side = Side(rolls, stations.thickness, float(maps.position[-1]))
    view = view_of(maps, side, rows)
    names = [name for name in ("temperature", "I1") if name in maps.names()]
    spans = np.ptp(_everything(view), axis=0) + 2.0 * STYLE.caster
    wide = 5.75  # inches of a picture
    figure = new_figure(wide * len(names), wide * float(spans[1] / spans[0]) + 0.7)
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        _draw(panel, maps, view, name)
    return figure


def _everything(view: View) -> Array:
    """Points that the picture must contain (n, 2)."""
    ends = [
        projected(_circle(centre, 0.5 * pair.diameter, sign * (view.half + STYLE.roll_end)))[0]
        for pair in view.pairs
        for centre in view.side.across(pair.position, 0.5 * pair.diameter)
        for sign in (-1.0, 1.0)
    ]
    return np.concatenate([view.corners.reshape(-1, 2), *ends])


def _circle(centre: Array, radius: float, across: float) -> Array:
    """A circle around a point of the side view, at a distance from the middle (n, 3), m."""
    x, z = centre[0] + radius * np.cos(_ROUND), centre[1] + radius * np.sin(_ROUND)
    return np.stack([x, np.full(len(_ROUND), across), z], axis=1)


def _draw(panel: Axes, maps: SurfaceMaps, view: View, name: str) -> None:
    from matplotlib.collections import PolyCollection

    options: dict[str, Any]
    largest = " "  # as high as the other title, so that the bars are level
    if name == "temperature":
        values, label = maps[name] - ZERO_CELSIUS, "temperature [°C]"
        low, high = (end - ZERO_CELSIUS for end in maps.heading.band)
        norm = band_norm(float(values.min()), float(values.max()), (low, high))
        shown, options = view.on_pieces(values), {"cmap": temperature_colours(), "norm": norm}
    else:
        one = next(one for one in maps.heading.maps if one.name == name)
        values, label = index_values(maps, one), index_label(one)
        shown = np.ma.masked_less_equal(view.on_pieces(values), 0.0)
        # White on white the strand would be invisible.
        colours = index_colours().with_extremes(bad=_NOTHING)
        options = {"cmap": colours, "clim": (0.0, float(values.max()) or 1.0)}
        row, vertex = np.unravel_index(int(values.argmax()), values.shape)  # may be hidden
        where = f"{maps.heading.line.words(int(vertex))}, {place_said(maps.position[row])}"
        largest = f"largest: {where}"
    _draw_rolls(panel, view, inner=False)
    corners: Any = view.corners
    strand = PolyCollection(corners, array=shown, edgecolors="face", linewidths=0.3, **options)
    panel.add_collection(strand)
    _draw_rolls(panel, view, inner=True)
    _draw_numbers(panel, view)
    places = _everything(view)
    panel.set_xlim(
        float(places[:, 0].min()) - STYLE.caster, float(places[:, 0].max()) + STYLE.caster
    )
    panel.set_ylim(
        float(places[:, 1].min()) - STYLE.caster, float(places[:, 1].max()) + STYLE.caster
    )
    panel.set_aspect("equal")
    panel.set_axis_off()
    figure = panel.figure.get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(
        strand, ax=panel, orientation="horizontal", shrink=0.75, pad=0.02, label=label
    )
    # A title of the panel has no room in the layout, which does not know its equal scales.
    bar.ax.set_title(largest, fontsize=8.5)
    if name == "temperature":
        bar.set_ticks(band_ticks(strand.norm))


def _draw_rolls(panel: Axes, view: View, inner: bool) -> None:
    """The rolls of the extrados behind the strand, or those of the intrados before it; all ends."""
    from matplotlib.collections import PolyCollection
    from scipy.spatial import ConvexHull

    bodies: list[Array] = []
    ends: dict[str, list[Array]] = {_ROLL: [], _DRIVEN: [], _DEFECT: []}
    for pair in (pair for pair in view.pairs if not pair.lost):
        centres, radius = view.side.across(pair.position, 0.5 * pair.diameter), 0.5 * pair.diameter
        near, far = (
            projected(_circle(centres[int(inner)], radius, sign * (view.half + STYLE.roll_end)))[0]
            for sign in (-1.0, 1.0)
        )
        both = np.concatenate([near, far])
        bodies.append(both[ConvexHull(both).vertices])
        for centre in centres if inner else ():
            end = _circle(centre, radius, -(view.half + STYLE.roll_end))
            colour = _DEFECT if pair.defect else _DRIVEN if pair.driven else _ROLL
            ends[colour].append(projected(end)[0])
    veil: dict[str, Any] = {"alpha": 0.13} if inner else {}
    panel.add_collection(PolyCollection(bodies, facecolors=_ROLL, edgecolors="none", **veil))
    for colour, circles in ends.items():
        panel.add_collection(PolyCollection(circles, facecolors=colour, edgecolors="none"))


def _draw_numbers(panel: Axes, view: View) -> None:
    """Numbers of some rolls, beside the ends of those of the extrados."""
    for i in numbered(view.side.rolls):
        if i >= len(view.pairs):
            break
        pair = view.pairs[i]
        outer, inner = (
            projected(np.array([x, -(view.half + STYLE.roll_end), z]))[0]
            for x, z in view.side.across(pair.position, pair.diameter)
        )
        off = 8.0 * (outer - inner) / np.linalg.norm(outer - inner)  # points
        panel.annotate(
            f"#{i + 1}", (outer[0], outer[1]), (off[0], off[1]), textcoords="offset points",
            fontsize=6.5, color=_DEFECT if pair.defect else "k", ha="center", va="center",
        )  # fmt: skip
