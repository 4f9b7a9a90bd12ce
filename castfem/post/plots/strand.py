"""Pictures of the strand: the slices of a run stacked in three dimensions, seen from below.

The surface and the symmetry planes are projected by hand and shaded in 2D: fast, smooth, and
without a display. Displacements are magnified and lengths along the strand shortened.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import plain_unit, scale_of
from castfem.base.types import Array
from castfem.post.plots.deformation import STRESS_MAP, fill_soft, soft_handles, stress_levels
from castfem.post.plots.history import low_legend
from castfem.post.plots.section import Steel, section_triangles, shade
from castfem.post.plots.shape import Outline, displacement, magnification, von_mises
from castfem.post.plots.style import (
    LIQUIDUS_COLOUR,
    SOLIDUS_COLOUR,
    STYLE,
    Margins,
    new_figure,
)
from castfem.runs.output.fields import Fields
from castfem.runs.output.stacked_slices import at_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation


_ELEVATION = np.radians(-24.0)  # the eye is below: the last slice is visible, not the first
_OUTSIDE = 50.0  # degrees from x
_INSIDE = {"quarter": 230.0, "half": 130.0}  # directions from which symmetry planes are visible


PICTURES = Margins(left=0.95, right=0.0, above=0.35, below=1.15, beside=0.25)
_HEIGHT = 5.2  # height of a picture, inches
_EDGE: dict[str, Any] = {"color": "#333333", "linewidth": 0.9}
_RING: dict[str, Any] = {"color": "#555555", "linewidth": 0.45, "alpha": 0.55}


@dataclass(frozen=True, slots=True)
class Stack:
    """Stacked slices of a run: walls, with interpolated rows between slices, and the last slice."""

    fields: Fields  #: mesh and steel
    #: (p, 2) pieces of the outline between nodes of a row, the steel on their left
    pieces: NDArray[np.intp]
    plane: Array  #: (m, 2) undeformed nodes of a row [mm]
    position: Array  #: (r,) position of the rows below the meniscus [m]
    points: Array  #: (r, m, 3) nodes as drawn [mm], third coordinate upwards
    temperature: Array  #: (r, m) [K]
    stress: Array | None  #: (r, m) von Mises stress [Pa]; None without mechanics
    end: Array  #: (n, 3) nodes of the last slice as drawn [mm]
    hottest: float  #: highest temperature of all slices [K]
    strongest: float  #: highest stress in the solid of all slices [Pa]
    factor: float  #: magnification of displacements, 0 without any

    @classmethod
    def of(cls, fields: Fields, steel: Steel | None) -> Stack | None:
        """Read the slices; None for less than two times or a slice that does not move."""
        sides = np.ptp(fields.points[:, :2], axis=0)
        # Of states written while the strand stood still, keep the last.
        onward = np.flatnonzero(np.diff(fields.positions, append=np.inf) > 0.0)
        # more cannot be distinguished
        chosen = np.linspace(0, max(len(onward) - 1, 0), 40).round().astype(int)
        times = onward[np.unique(chosen)] if len(onward) else onward
        position = fields.positions[times]
        if len(times) < 2 or (np.diff(position) <= 0).any():
            return None
        if sides.max() > STYLE.slender * sides.min():
            return None
        outline = Outline.of(fields)
        nodes = np.unique(outline.everything)
        kelvin, pascal, shift, hottest, strongest = [], [], [], -np.inf, 0.0
        for k in times:
            whole, stress = fields.values("temperature", int(k)), von_mises(fields, int(k))
            kelvin.append(whole[nodes])
            hottest = max(hottest, float(whole.max()))
            if stress is not None and steel is not None:
                pascal.append(stress[nodes])
                strongest = max(strongest, float(stress[whole <= steel.solidus].max(initial=0.0)))
            shift.append(displacement(fields, int(k)))
        factor, moved = 0.0, np.array([u[nodes] for u in shift])
        if "displacement" in fields.names:
            surface = np.unique(outline.surface)
            factor = magnification(np.array([u[surface] for u in shift]), fields.points)
        rows = _between(position)
        fall = -1.6 * float(sides.sum()) / float(np.ptp(position))
        plane = fields.points[:, :2]
        drawn = plane[nodes] + factor * at_rows(rows, position, moved)
        up = np.broadcast_to(fall * (rows - rows[0])[:, None, None], (*drawn.shape[:2], 1))
        last = np.full((len(plane), 1), fall * (rows[-1] - rows[0]))
        return cls(
            fields=fields,
            pieces=np.searchsorted(nodes, outline.everything),
            plane=1e3 * plane[nodes],
            position=rows,
            points=1e3 * np.concatenate([drawn, up], axis=2),
            temperature=at_rows(rows, position, np.array(kelvin)),
            stress=(
                at_rows(rows, position, np.array(pascal))
                if strongest > 0.0 and len(pascal) == len(times)
                else None
            ),
            end=1e3 * np.column_stack([plane + factor * shift[-1], last]),
            hottest=hottest,
            strongest=strongest,
            factor=factor,
        )


def _between(position: Array) -> Array:
    """Positions of rows, including the slices, close enough for smooth shading."""
    # triangles between distant slices would be visible
    each = max(1, -(-60 // (len(position) - 1)))
    parts = np.arange(each) / each
    inner = position[:-1, None] + np.diff(position)[:, None] * parts
    return np.append(inner.ravel(), position[-1])


@dataclass(frozen=True, slots=True)
class View:
    """The visible part of a stack from one direction."""

    right: Array  #: directions (3,) of the picture
    up: Array
    #: the visible walls, the farther ones first; nodes are numbered row by row
    walls: Triangulation
    pieces: NDArray[np.intp]  #: (p, 2) pieces of the outline under these walls
    inside: bool  #: whether symmetry planes are visible

    @classmethod
    def of(cls, stack: Stack, degrees: float) -> View:
        """View from a direction, in degrees from x towards y."""
        from matplotlib.tri import Triangulation

        angle = np.radians(degrees)
        towards = np.array([np.cos(angle), np.sin(angle)])
        right = np.array([-towards[1], towards[0], 0.0])
        up = np.array([*(-np.sin(_ELEVATION) * towards), np.cos(_ELEVATION)])
        along = stack.plane[stack.pieces[:, 1]] - stack.plane[stack.pieces[:, 0]]
        seen = along[:, 1] * towards[0] - along[:, 0] * towards[1]
        pieces = stack.pieces[seen > 1e-6 * np.linalg.norm(along, axis=1)]
        near = stack.plane[pieces].mean(axis=1) @ towards
        pieces = pieces[np.argsort(near, kind="stable")]
        rows, nodes = stack.temperature.shape
        offset = nodes * np.arange(rows - 1)
        a, b = (pieces[:, [end]] + offset for end in (0, 1))
        quads = np.stack([a, b, b + nodes, a + nodes], axis=-1).reshape(-1, 4)
        triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        flat = stack.points.reshape(-1, 3)
        walls = Triangulation(flat @ right, flat @ up, triangles)
        return cls(right, up, walls, pieces, degrees != _OUTSIDE)

    def project(self, points: Array) -> Array:
        """Project points (..., 3) onto the picture (..., 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def draw_stack(fields: Fields, steel: Steel | None) -> Figure | None:
    """Draw the strand from outside and, if less than the whole is modelled, from its core.

    Returns:
        None for a strip, or before the second time was written.
    """
    stack = Stack.of(fields, steel)
    if stack is None:
        return None
    part = str(fields.attributes.get("symmetry"))
    sides = [_OUTSIDE, *([_INSIDE[part]] if part in _INSIDE else [])]
    views = [View.of(stack, side) for side in sides]
    kinds = ["temperature", *(["stress"] if stack.stress is not None else [])]
    extents = np.ptp([view.project(stack.points).reshape(-1, 2) for view in views], axis=1)
    widest, highest = extents.max(axis=0)
    wide = max(_HEIGHT * widest / highest, 1.9)
    figure, rows, bars = _places(len(kinds), len(views), wide)
    for number, (kind, bar) in enumerate(zip(kinds, bars, strict=True)):
        group = list(rows[number * len(views) : (number + 1) * len(views)])
        for axes, view in zip(group, views, strict=True):
            shades = _draw_view(axes, stack, view, kind, steel)
            _fit(axes, view, stack, 1.01 * extents.max(axis=0))
        label = "temperature [°C]" if kind == "temperature" else "von Mises stress, solid [MPa]"
        figure.colorbar(shades, cax=bar, orientation="horizontal", label=label)
    _draw_scale(rows[0], stack, views[0])
    handles = _legend(stack, steel)
    low_legend(figure, handles)
    return figure


def _places(kinds: int, views: int, wide: float) -> tuple[Figure, list[Axes], list[Axes]]:
    """An empty figure with pictures `wide` inches wide, left to right, and the scales below.

    They are placed by hand: a layout search would take as long as drawing.
    """
    count = kinds * views
    width = PICTURES.left + count * (wide + PICTURES.beside)
    height = PICTURES.below + _HEIGHT + PICTURES.above
    figure = new_figure(width, height, layout="none")

    def place(left: float, bottom: float, across: float, up: float) -> Axes:
        return figure.add_axes((left / width, bottom / height, across / width, up / height))

    lefts = [PICTURES.left + number * (wide + PICTURES.beside) for number in range(count)]
    pictures = [place(left, PICTURES.below, wide, _HEIGHT) for left in lefts]
    span = views * (wide + PICTURES.beside) - PICTURES.beside
    scales = [place(left + 0.1 * span, 0.85, 0.8 * span, 0.12) for left in lefts[::views]]
    return figure, pictures, scales


def _draw_view(
    axes: Axes, stack: Stack, view: View, kind: str, steel: Steel | None
) -> ScalarMappable:
    from matplotlib.tri import Triangulation

    fields = stack.fields
    walls, last, options = _shading(stack, kind)
    shift = 1e-3 * stack.end[:, :2] - fields.points[:, :2]
    plane, values = section_triangles(fields, last, mirrored=False, moved=shift)
    _, kelvin = section_triangles(fields, fields.values("temperature"), mirrored=False)
    flat = np.column_stack([plane.x, plane.y, np.full(len(plane.x), stack.end[0, 2])])
    bottom = Triangulation(flat @ view.right, flat @ view.up, plane.triangles)
    shades = shade(axes, view.walls, walls.ravel(), *options)
    if steel is not None and (view.inside or kind == "stress"):
        _draw_isotherms(axes, view.walls, stack.temperature.ravel(), steel, kind)
    shade(axes, bottom, values, *options)
    if steel is not None:
        _draw_isotherms(axes, bottom, kelvin, steel, kind)
    _draw_edges(axes, stack, view)
    _draw_rings(axes, stack, view)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("from the core" if view.inside else "from outside", fontsize=9.5)
    return shades


def _fit(axes: Axes, view: View, stack: Stack, size: Array) -> None:
    """Set limits for the same width and height in all pictures, so that they have one scale."""
    drawn = view.project(stack.points).reshape(-1, 2)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    start, end = 0.5 * (low + high - size), 0.5 * (low + high + size)
    axes.set_xlim(start[0], end[0])
    axes.set_ylim(start[1], end[1])


def _shading(stack: Stack, kind: str) -> tuple[Array, Array, tuple[str, float, float]]:
    """Values of the walls (r, m) and of the last slice (n,) in the unit of the scale; the scale."""
    if kind == "temperature" or stack.stress is None:
        last = stack.fields.values("temperature") - ZERO_CELSIUS
        low = float(stack.temperature.min()) - ZERO_CELSIUS
        high = max(stack.hottest - ZERO_CELSIUS, low + 1.0)
        return stack.temperature - ZERO_CELSIUS, last, ("inferno", low, high)
    stress = von_mises(stack.fields)
    assert stress is not None
    top = float(stress_levels(1e-6 * stack.strongest)[-1])
    return 1e-6 * stack.stress, 1e-6 * stress, (STRESS_MAP, 0.0, top)


def _draw_isotherms(
    axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel, kind: str
) -> None:
    """Draw solidus and liquidus; in stress plots, cover the non-solid part."""
    low, high = float(kelvin[mesh.triangles].min()), float(kelvin[mesh.triangles].max())
    if kind == "stress" and high > steel.solidus:
        fill_soft(axes, mesh, kelvin, steel, high)
    for level, colour in ((steel.solidus, SOLIDUS_COLOUR), (steel.liquidus, LIQUIDUS_COLOUR)):
        if low < level < high and (kind == "temperature" or level == steel.solidus):
            axes.tricontour(mesh, kelvin, levels=[level], colors=[colour], linewidths=[1.0])


def _draw_edges(axes: Axes, stack: Stack, view: View) -> None:
    """Draw the outline of the last slice, the visible part of the first, and the upright edges."""
    from matplotlib.collections import LineCollection

    first = view.project(stack.points[0])[view.pieces]
    last = view.project(stack.points[-1])[stack.pieces]
    nodes, count = np.unique(view.pieces, return_counts=True)
    upright = list(nodes[count == 1])
    for node in nodes[count == 2]:
        ends = view.pieces[(view.pieces == node).any(axis=1)]
        along = stack.plane[ends[:, 1]] - stack.plane[ends[:, 0]]
        along /= np.linalg.norm(along, axis=1)[:, None]
        if along[0] @ along[1] < 0.7:  # cosine above which two walls meet at an edge
            upright.append(node)
    lines = [view.project(stack.points[:, node]) for node in upright]
    axes.add_collection(LineCollection([*first, *last, *lines], **_EDGE))


def _ticks(stack: Stack) -> tuple[Array, float, str]:
    """Rounded positions below the meniscus as shown, units per metre, and the unit."""
    from matplotlib.ticker import MaxNLocator

    metres, usual = (1.0, "m") if stack.position[-1] > 2.0 else (1e3, "mm")
    along = scale_of(usual, "position")
    scale, unit = metres * along.factor, plain_unit(along.unit)
    start, end = scale * stack.position[0], scale * stack.position[-1]
    ticks = np.asarray(MaxNLocator(7, steps=[1, 2, 5, 10]).tick_values(start, end))
    return ticks[(ticks >= start - 1e-9) & (ticks <= end + 1e-9)], scale, unit


def _draw_rings(axes: Axes, stack: Stack, view: View) -> None:
    """Draw the scale's positions on the walls: they lie higher at an edge than beside it."""
    from matplotlib.collections import LineCollection

    ticks, scale, _ = _ticks(stack)
    inner = ticks[(ticks > scale * stack.position[0]) & (ticks < scale * stack.position[-1])]
    points = at_rows(inner / scale, stack.position, stack.points)
    rings = view.project(points)[:, view.pieces].reshape(-1, 2, 2)
    axes.add_collection(LineCollection([*rings], **_RING))


def _draw_scale(axes: Axes, stack: Stack, view: View) -> None:
    """Draw positions below the meniscus along the left side of the picture."""
    ticks, scale, unit = _ticks(stack)
    drawn = view.project(stack.points)
    column = drawn[:, int(drawn[0, :, 0].argmin())]
    left = float(drawn[..., 0].min())
    heights = np.interp(ticks, scale * stack.position, column[:, 1])
    room = 0.03 * float(np.ptp(drawn[..., 1]))
    outside: dict[str, Any] = {**_EDGE, "clip_on": False, "scalex": False, "scaley": False}
    axes.plot([left - room] * 2, [column[0, 1], column[-1, 1]], **outside)
    for tick, height in zip(ticks, heights, strict=True):
        axes.plot([left - 1.5 * room, left - room], [height] * 2, **outside)
        axes.text(left - 1.8 * room, height, f"{tick:g}", ha="right", va="center", fontsize=8)
    middle = 0.5 * float(column[0, 1] + column[-1, 1])
    axes.text(
        left - 4.6 * room,
        middle,
        f"position below the meniscus [{unit}]",
        rotation=90,
        ha="right",
        va="center",
        fontsize=9,
    )


def _legend(stack: Stack, steel: Steel | None) -> list[Any]:
    """Isotherms, the non-solid part, and the magnification of the shape."""
    from matplotlib.lines import Line2D

    handles: list[Any] = []
    if steel is not None:
        handles = [
            Line2D([], [], color=SOLIDUS_COLOUR, label="solidus"),
            Line2D([], [], color=LIQUIDUS_COLOUR, label="liquidus"),
        ]
    if stack.stress is not None:
        handles += soft_handles()
    if stack.factor > 0.0:
        handles.append(Line2D([], [], linestyle="none", label=f"displacement × {stack.factor:g}"))
    return handles
