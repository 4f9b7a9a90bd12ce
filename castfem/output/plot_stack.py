"""The slices of a run stacked along the strand: a picture in three dimensions, seen from below.

The surface and the planes of symmetry are projected by hand and shaded in the plane: quick, smooth,
and without a display. Displacements are magnified, lengths along the strand shortened.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.output.fields import Fields
from castfem.output.plot_section import Steel, legend_below, section_triangles
from castfem.output.plot_shape import SOFT, STRESS_MAP, stress_levels
from castfem.output.shape import Outline, displacement, magnification, von_mises
from castfem.output.style import CELSIUS, LIQUIDUS_COLOUR, SOLIDUS_COLOUR, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

Array = NDArray[np.float64]

_MOST = 40  # slices; more cannot be told apart
_LENGTH = 1.6  # drawn length of the strand, of width plus height of what is modelled
_SLENDER = 12.0  # ratio of the sides from which a section is a mere line
_ELEVATION = np.radians(-24.0)  # the eye lies below: the last slice is seen, not the first
_OUTSIDE = 50.0  # degrees from x
_INSIDE = {"quarter": 230.0, "half": 130.0}  # from where planes of symmetry are seen
_HEIGHT = 5.2  # inches of a panel
_EDGE = {"color": "#333333", "linewidth": 0.6}


@dataclass(frozen=True, slots=True)
class Stack:
    """The slices of a run.

    Attributes:
        fields: Mesh and steel.
        outline: Of the modelled part.
        position: (k,) below the meniscus [m].
        points: (k, n, 3) nodes as drawn [mm], the third is up.
        temperature: (k, n) [K].
        stress: (k, n) von Mises stress [Pa]; None without mechanics.
        factor: By which displacements are magnified, 0 without any.
    """

    fields: Fields
    outline: Outline
    position: Array
    points: Array
    temperature: Array
    stress: Array | None
    factor: float

    @classmethod
    def of(cls, fields: Fields) -> Stack | None:
        """Reads the slices; None of what is no strand: two times at least, and a way downwards."""
        sides = np.ptp(fields.points[:, :2], axis=0)
        times = np.unique(np.linspace(0, len(fields.times) - 1, _MOST).round().astype(int))
        position = fields.positions[times] if len(fields.times) else np.zeros(0)
        if len(times) < 2 or (np.diff(position) <= 0).any() or sides.max() > _SLENDER * sides.min():
            return None
        outline = Outline.of(fields)
        moved = np.array([displacement(fields, k) for k in times])
        factor = 0.0
        if "displacement" in fields.names:
            factor = magnification(moved[:, np.unique(outline.surface)], fields.points)
        stresses = [s for k in times if (s := von_mises(fields, k)) is not None]
        up = -_LENGTH * sides.sum() * (position - position[0]) / np.ptp(position)
        points = np.empty((*moved.shape[:2], 3))
        points[..., :2] = fields.points[:, :2] + factor * moved
        points[..., 2] = up[:, None]
        temperature = np.array([fields.values("temperature", k) for k in times])
        stress = np.array(stresses) if stresses else None
        return cls(fields, outline, position, 1e3 * points, temperature, stress, factor)


@dataclass(frozen=True, slots=True)
class View:
    """What is seen of a stack from one side.

    Attributes:
        right, up: Directions (3,) of the picture.
        walls: The visible walls, the farther ones first; nodes are numbered slice by slice.
        pieces: (p, 2) nodes of the outline below which these walls stand.
        inside: Whether planes of symmetry are seen.
    """

    right: Array
    up: Array
    walls: Triangulation
    pieces: NDArray[np.intp]
    inside: bool

    @classmethod
    def of(cls, stack: Stack, degrees: float) -> View:
        """Looks from a direction, in degrees from x towards y."""
        from matplotlib.tri import Triangulation

        angle = np.radians(degrees)
        towards = np.array([np.cos(angle), np.sin(angle)])
        right = np.array([-towards[1], towards[0], 0.0])
        up = np.array([*(-np.sin(_ELEVATION) * towards), np.cos(_ELEVATION)])
        plane = stack.fields.points[:, :2]
        pieces = stack.outline.everything
        along = plane[pieces[:, 1]] - plane[pieces[:, 0]]
        seen = along[:, 1] * towards[0] - along[:, 0] * towards[1]
        pieces = pieces[seen > 1e-6 * np.linalg.norm(along, axis=1)]
        pieces = pieces[np.argsort(plane[pieces].mean(axis=1) @ towards, kind="stable")]
        count, nodes = stack.points.shape[:2]
        offset = nodes * np.arange(count - 1)
        a, b = (pieces[:, [end]] + offset for end in (0, 1))
        quads = np.stack([a, b, b + nodes, a + nodes], axis=-1).reshape(-1, 4)
        triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        flat = stack.points.reshape(-1, 3)
        walls = Triangulation(flat @ right, flat @ up, triangles)
        return cls(right, up, walls, pieces, degrees != _OUTSIDE)

    def project(self, points: Array) -> Array:
        """Points (..., 3) in the picture (..., 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def draw_stack(fields: Fields, steel: Steel | None) -> Figure | None:
    """The strand from outside and, if less than the whole is modelled, from its core.

    Args:
        fields: Of the run.
        steel: Isotherms to draw; what is solid.

    Returns:
        None for a strip, or before the second time was written.
    """
    stack = Stack.of(fields)
    if stack is None:
        return None
    part = str(fields.attributes.get("symmetry"))
    sides = [_OUTSIDE, *([_INSIDE[part]] if part in _INSIDE and stack.outline.cuts else [])]
    views = [View.of(stack, side) for side in sides]
    kinds = ["temperature"]
    if stack.stress is not None and steel is not None:
        kinds += ["stress"] if (stack.temperature <= steel.solidus).any() else []
    extents = np.ptp([view.project(stack.points).reshape(-1, 2) for view in views], axis=1)
    widest, highest = extents.max(axis=0)
    wide = max(_HEIGHT * 1.3 * widest / highest, 1.9)
    count = len(kinds) * len(views)
    figure = new_figure(wide * count + 0.5, _HEIGHT + 1.5)
    rows = figure.subplots(1, count, squeeze=False)[0]
    for number, kind in enumerate(kinds):
        group = list(rows[number * len(views) : (number + 1) * len(views)])
        for axes, view in zip(group, views, strict=True):
            shades = _draw_view(axes, stack, view, kind, steel)
        label = "temperature [°C]" if kind == "temperature" else "von Mises stress, solid [MPa]"
        figure.colorbar(shades, ax=group, location="bottom", label=label, shrink=0.8, aspect=30)
    _draw_scale(rows[0], stack, views[0])
    legend_below(figure, _legend(stack, steel, "stress" in kinds))
    return figure


def _draw_view(
    axes: Axes, stack: Stack, view: View, kind: str, steel: Steel | None
) -> ScalarMappable:
    """One picture; returns its colours."""
    from matplotlib.tri import Triangulation

    values, options = _shading(stack, kind, steel)
    kelvin = stack.temperature
    end = stack.points[-1]
    mesh, last = section_triangles(stack.fields, values[-1], mirrored=False)
    _, last_kelvin = section_triangles(stack.fields, kelvin[-1], mirrored=False)
    shift = end[:, :2] * 1e-3 - stack.fields.points[:, :2]
    plane, _ = section_triangles(stack.fields, values[-1], mirrored=False, moved=shift)
    flat = np.column_stack([plane.x, plane.y, np.full(len(plane.x), end[0, 2])])
    bottom = Triangulation(flat @ view.right, flat @ view.up, mesh.triangles)
    shades = axes.tripcolor(view.walls, values.ravel(), shading="gouraud", **options)
    axes.tripcolor(bottom, last, shading="gouraud", **options)
    if steel is not None:
        _draw_isotherms(axes, bottom, last_kelvin, steel, kind)
        if view.inside:
            _draw_isotherms(axes, view.walls, kelvin.ravel(), steel, kind)
    _draw_edges(axes, stack, view)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("from the core" if view.inside else "from outside", fontsize=9.5)
    return shades


def _shading(stack: Stack, kind: str, steel: Steel | None) -> tuple[Array, dict[str, Any]]:
    """Values (k, n) in the unit of the scale, and the scale."""
    from matplotlib import colormaps

    if kind == "temperature" or stack.stress is None or steel is None:
        celsius = stack.temperature - CELSIUS
        low, high = float(celsius.min()), float(celsius.max())
        return celsius, {"cmap": "inferno", "vmin": low, "vmax": max(high, low + 1.0)}
    stress = 1e-6 * stack.stress
    solid = stack.temperature <= steel.solidus
    top = float(stress_levels(float(stress[solid].max()))[-1])
    colours = colormaps[STRESS_MAP].copy()
    colours.set_under(SOFT[0])
    return np.where(solid, stress, -top), {"cmap": colours, "vmin": 0.0, "vmax": top}


def _draw_isotherms(
    axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel, kind: str
) -> None:
    """Solidus and liquidus; of the stress, what is soft is covered."""
    low, high = float(kelvin[mesh.triangles].min()), float(kelvin[mesh.triangles].max())
    liquidus = max(steel.liquidus, float(np.nextafter(steel.solidus, np.inf)))
    if kind == "stress" and high > steel.solidus:
        levels = [steel.solidus, liquidus, max(high, liquidus) + 1.0]
        axes.tricontourf(mesh, kelvin, levels=levels, colors=SOFT)
    for level, colour in ((steel.solidus, SOLIDUS_COLOUR), (steel.liquidus, LIQUIDUS_COLOUR)):
        if low < level < high and (kind == "temperature" or level == steel.solidus):
            axes.tricontour(mesh, kelvin, levels=[level], colors=[colour], linewidths=[1.0])


def _draw_edges(axes: Axes, stack: Stack, view: View) -> None:
    """The outline of the last slice, what is seen of the first, and the upright edges."""
    from matplotlib.collections import LineCollection

    first = view.project(stack.points[0])[view.pieces]
    last = view.project(stack.points[-1])[stack.outline.everything]
    nodes, count = np.unique(view.pieces, return_counts=True)
    upright = [view.project(stack.points[:, node]) for node in nodes[count == 1]]
    plane = stack.fields.points[:, :2]
    for node in nodes[count == 2]:  # where two walls meet at an angle
        ends = view.pieces[(view.pieces == node).any(axis=1)]
        along = plane[ends[:, 1]] - plane[ends[:, 0]]
        along /= np.linalg.norm(along, axis=1)[:, None]
        if along[0] @ along[1] < 0.7:
            upright.append(view.project(stack.points[:, node]))
    axes.add_collection(LineCollection([*first, *last, *upright], **_EDGE))


def _draw_scale(axes: Axes, stack: Stack, view: View) -> None:
    """Positions below the meniscus, along the left of the picture."""
    from matplotlib.ticker import MaxNLocator

    scale, unit = (1.0, "m") if stack.position[-1] > 2.0 else (1e3, "mm")
    start, end = scale * stack.position[0], scale * stack.position[-1]
    ticks = MaxNLocator(7, steps=[1, 2, 5, 10]).tick_values(start, end)
    ticks = ticks[(ticks >= start - 1e-9) & (ticks <= end + 1e-9)]
    drawn = view.project(stack.points)
    column = drawn[:, int(drawn[0, :, 0].argmin())]
    left = float(drawn[..., 0].min())
    heights = np.interp(ticks, scale * stack.position, column[:, 1])
    room = 0.03 * float(np.ptp(drawn[..., 1]))
    axes.plot([left - room] * 2, [column[0, 1], column[-1, 1]], **_EDGE)
    for tick, height in zip(ticks, heights, strict=True):
        axes.plot([left - 1.5 * room, left - room], [height] * 2, **_EDGE)
        axes.text(left - 1.8 * room, height, f"{tick:g}", ha="right", va="center", fontsize=8)
    middle = 0.5 * float(column[0, 1] + column[-1, 1])
    axes.text(
        left - 5.5 * room,
        middle,
        f"position below the meniscus [{unit}]",
        rotation=90,
        ha="right",
        va="center",
        fontsize=9,
    )


def _legend(stack: Stack, steel: Steel | None, stress: bool) -> list[Any]:
    """Isotherms, what is soft, and how the shape is magnified."""
    from matplotlib.lines import Line2D

    handles: list[Any] = []
    if steel is not None:
        handles = [
            Line2D([], [], color=SOLIDUS_COLOUR, label="solidus"),
            Line2D([], [], color=LIQUIDUS_COLOUR, label="liquidus"),
        ]
    if stress:
        handles += [
            Line2D([], [], color=colour, marker="s", markersize=8, linestyle="none", label=name)
            for name, colour in zip(("mushy", "liquid"), SOFT, strict=True)
        ]
    if stack.factor > 0.0:
        handles.append(Line2D([], [], linestyle="none", label=f"displacement × {stack.factor:g}"))
    return handles
