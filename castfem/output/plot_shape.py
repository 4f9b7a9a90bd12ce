"""Figures of the strained section: its stress and how it is distorted.

They show what is modelled, a quarter, a half or the whole of the section, with the displacement
magnified by a round factor that stands in the legend.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.output.fields import Fields
from castfem.output.plot_section import (
    Steel,
    colour_bar,
    frame,
    legend_below,
    lies_flat,
    section_triangles,
    when,
)
from castfem.output.shape import Outline, displacement, magnification, von_mises
from castfem.output.style import SOLIDUS_COLOUR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.tri import Triangulation

Array = NDArray[np.float64]

SOFT = ("#d9d9d9", "#efefef")  # mushy, liquid: no scale of stress applies to them
STRESS_MAP = "viridis"
_BANDS = 12  # of the scale of stress, at most
_UNMOVED, _MOVED = "#555555", "#c0392b"
_SHELL = "#dfe6ec"
_MARGIN = 0.05  # around the section, of its larger side
_ASIDE = 0.3  # sine from which on the centre lies to one side of a normal
_UNCLEAR = 4.0  # ratio of the sides from which axes of equal scale leave no room for a shape


def draw_von_mises(fields: Fields, steel: Steel | None, *, index: int = -1) -> Figure | None:
    """Von Mises stress in what is solid, on the distorted section; mush and liquid are grey.

    Args:
        fields: Of the run.
        steel: What is solid.
        index: Of the time, as in a list.

    Returns:
        None in a run without stress, or while nothing is solid.
    """
    stress = von_mises(fields, index)
    if stress is None or steel is None:
        return None
    temperature = fields.values("temperature", index)
    solid = temperature <= steel.solidus
    if not solid.any():
        return None
    moved, factor, outline = _magnified(fields, index)
    mesh, values = section_triangles(fields, 1e-6 * stress, mirrored=False, moved=factor * moved)
    figure, axes = frame(mesh, when("Von Mises stress", fields, index), bar=True)
    levels = stress_levels(float(1e-6 * stress[solid].max()))
    # what lies beyond the scale is soft, and covered; its very end would not be drawn
    values = np.clip(values, levels[0], (1 - 1e-6) * levels[-1])
    shades = axes.tricontourf(mesh, values, levels=levels, cmap=STRESS_MAP)
    label = "von Mises stress in the solid [MPa]"
    colour_bar(figure, axes, shades, lies_flat(mesh), label)
    _, kelvin = section_triangles(fields, temperature, mirrored=False)
    handles = cover_soft(axes, mesh, kelvin, steel)
    if factor > 0.0:
        handles = [*_draw_outlines(axes, fields, outline, moved, factor, "#222222"), *handles]
        _fit(axes, fields, moved * factor)
    legend_below(figure, handles)
    return figure


def draw_shape(fields: Fields, steel: Steel | None, *, index: int = -1) -> Figure | None:
    """The distorted section beside its shape at the meniscus, the shell, and the largest moves.

    Args:
        fields: Of the run.
        steel: What is solid.
        index: Of the time, as in a list.

    Returns:
        None in a run without displacement, or for a strip, which has no shape.
    """
    if "displacement" not in fields.names:
        return None
    moved, factor, outline = _magnified(fields, index)
    if factor == 0.0:
        return None
    temperature = fields.values("temperature", index)
    mesh, kelvin = section_triangles(fields, temperature, mirrored=False, moved=factor * moved)
    figure, axes = frame(mesh, when("Shape of the section", fields, index), bar=False)
    handles = _draw_outlines(axes, fields, outline, moved, factor, _MOVED)
    if steel is not None and kelvin.min() < steel.solidus:
        low, high = float(kelvin.min()) - 1.0, max(float(kelvin.max()), steel.solidus) + 1.0
        axes.tricontourf(mesh, kelvin, levels=[low, steel.solidus, high], colors=[_SHELL, "w"])
        if kelvin.max() > steel.solidus:
            handles.append(_draw_solidus(axes, mesh, kelvin, steel))
    _fit(axes, fields, moved * factor)
    _name_extremes(axes, fields, outline, moved, factor)
    legend_below(figure, handles)
    return figure


def stress_levels(largest: float) -> Array:
    """Round levels [MPa] from 0 to the first above the largest stress."""
    from matplotlib.ticker import MaxNLocator

    locator = MaxNLocator(_BANDS, steps=[1, 2, 2.5, 5, 10])
    ticks = np.asarray(locator.tick_values(0.0, max(largest, 1e-6)), dtype=np.float64)
    ticks = ticks[ticks >= 0.0]
    return ticks[: int(np.searchsorted(ticks, largest * (1 - 1e-9))) + 1]


def _magnified(fields: Fields, index: int) -> tuple[Array, float, Outline]:
    """Displacement (n, 2) [m], the factor to draw it with (0: a mere line), and the outline."""
    outline = Outline.of(fields)
    moved = displacement(fields, index)
    sides = np.ptp(fields.points[:, :2], axis=0)
    if sides.max() > _UNCLEAR * sides.min() and not outline.cuts:
        return np.zeros_like(moved), 0.0, outline
    return moved, magnification(moved[np.unique(outline.surface)], fields.points), outline


def cover_soft(axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel) -> list[Line2D]:
    """Covers mush and liquid with grey; returns the legend of what it drew."""
    from matplotlib.lines import Line2D

    if kelvin.max() <= steel.solidus:
        return []
    liquidus = max(steel.liquidus, float(np.nextafter(steel.solidus, np.inf)))
    levels = [steel.solidus, liquidus, max(float(kelvin.max()), liquidus) + 1.0]
    axes.tricontourf(mesh, kelvin, levels=levels, colors=SOFT)
    soft = [
        Line2D([], [], color=colour, marker="s", markersize=8, linestyle="none", label=name)
        for name, colour in zip(("mushy", "liquid"), SOFT, strict=True)
    ]
    return [_draw_solidus(axes, mesh, kelvin, steel), *soft]


def _draw_solidus(axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel) -> Line2D:
    """The inside of the shell; its entry of the legend."""
    from matplotlib.lines import Line2D

    if kelvin.min() < steel.solidus:
        axes.tricontour(
            mesh, kelvin, levels=[steel.solidus], colors=[SOLIDUS_COLOUR], linewidths=[1.0]
        )
    return Line2D([], [], color=SOLIDUS_COLOUR, linewidth=1.0, label="solidus")


def _draw_outlines(
    axes: Axes, fields: Fields, outline: Outline, moved: Array, factor: float, colour: str
) -> list[Line2D]:
    """The outline at the meniscus and now, the planes of symmetry; their legend."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    handles = []
    for shift, shade, width, label in (
        (0.0, _UNMOVED, 0.8, "at the meniscus"),
        (factor, colour, 1.4, f"displacement × {factor:g}"),
    ):
        points = 1e3 * (fields.points[:, :2] + shift * moved)
        lines = list(points[outline.surface])
        axes.add_collection(LineCollection(lines, colors=shade, linewidths=width))
        handles.append(Line2D([], [], color=shade, linewidth=width, label=label))
    chain: dict[str, Any] = {"color": "#444444", "linewidth": 0.9, "linestyle": "-."}
    for axis, pieces in outline.cuts.items():
        ends = 1e3 * fields.points[pieces][:, :, 1 - axis]
        line = np.array([[0.0, ends.min()], [0.0, ends.max()]])
        axes.plot(*(line.T if axis == 0 else line.T[::-1]), **chain)
    if outline.cuts:
        handles.append(Line2D([], [], **chain, label="symmetry"))
    return handles


def _fit(axes: Axes, fields: Fields, shift: Array) -> None:
    """Limits that show both shapes, with a margin."""
    both = 1e3 * np.vstack([fields.points[:, :2], fields.points[:, :2] + shift])
    margin = _MARGIN * float(np.ptp(both, axis=0).max())
    axes.set_xlim(both[:, 0].min() - margin, both[:, 0].max() + margin)
    axes.set_ylim(both[:, 1].min() - margin, both[:, 1].max() + margin)


def _name_extremes(
    axes: Axes, fields: Fields, outline: Outline, moved: Array, factor: float
) -> None:
    """Writes the largest outward and inward displacement of the surface where they are."""
    nodes, normals = outline.outward(fields.points)
    outward = 1e3 * np.einsum("ij,ij->i", moved[nodes], normals)
    centre = 0.5 * (fields.points[:, :2].min(axis=0) + fields.points[:, :2].max(axis=0))
    for number in _extremes(outward, fields.points[nodes, :2]):
        node, normal = nodes[number], normals[number]
        point = 1e3 * (fields.points[node, :2] + factor * moved[node])
        sideways = np.array([-normal[1], normal[0]])
        inwards = centre - fields.points[node, :2]
        aside = float(sideways @ inwards) / float(np.linalg.norm(inwards))
        sideways *= np.sign(aside) if abs(aside) > _ASIDE else 0.0
        axes.annotate(
            _signed(float(outward[number])),
            xy=(point[0], point[1]),
            xytext=tuple(-46.0 * normal + 32.0 * sideways),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.5,
            color=_MOVED,
            bbox={"facecolor": "w", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
            arrowprops={"arrowstyle": "-|>", "color": _MOVED, "linewidth": 0.9, "shrinkB": 1.0},
        )


def _signed(length: float) -> str:
    """A length [mm] with its sign, if it is not nothing."""
    rounded = round(length, 2)
    return f"{rounded:+.2f} mm".replace("-", "\N{MINUS SIGN}") if rounded else "0.00 mm"


def _extremes(outward: Array, points: Array) -> set[int]:
    """Numbers of the largest and the smallest value, of equal ones those farthest apart."""
    equal = 0.02 * float(np.abs(outward).max())
    smallest = int(outward.argmin())
    found = [smallest]
    for near in (outward >= outward.max() - equal, outward <= outward.min() + equal):
        candidates = np.flatnonzero(near)
        distances = np.linalg.norm(points[candidates] - points[found[-1]], axis=1)
        found.append(int(candidates[distances.argmax()]))
    first, second = found[1:]
    return {first} if outward[first] - outward[second] <= equal else {first, second}


SHAPE_FIGURES: dict[str, Callable[[Fields, Steel | None], Figure | None]] = {
    "von_mises": draw_von_mises,
    "shape": draw_shape,
}
