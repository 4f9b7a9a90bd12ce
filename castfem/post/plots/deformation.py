"""Figures of the strained section: its stress and its deformation.

They show the modelled part, a quarter, a half or the whole of the section, with the displacement
magnified by a round factor given in the legend.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.shown_units import said, scale_of
from castfem.base.types import Array
from castfem.post.plots.section import (
    Steel,
    colour_bar,
    frame,
    legend_below,
    lies_flat,
    section_triangles,
    when,
)
from castfem.post.plots.shape import Distortion, von_mises
from castfem.post.plots.style import SOLIDUS_COLOUR
from castfem.runs.output.fields import Fields

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.tri import Triangulation, TriContourSet


SOFT = ("#d9d9d9", "#efefef")  # mushy, liquid: not in the stress scale
STRESS_MAP = "viridis"
_UNMOVED, _MOVED, _WALL = "#333333", "#c0392b", "#9a9a9a"
_SHELL = "#dfe6ec"


def draw_von_mises(fields: Fields, steel: Steel | None) -> Figure | None:
    """Von Mises stress in the solid, on the deformed section; mushy zone and liquid are grey.

    Returns:
        None for a run without stress, or while nothing is solid.
    """
    each = ((state, von_mises(fields, state)) for state in reversed(range(len(fields.times))))
    index, stress = next((one for one in each if one[1] is not None), (-1, None))
    if stress is None or steel is None:
        return None
    temperature = fields.values("temperature", index)
    solid = temperature <= steel.solidus
    if not solid.any():
        return None
    distortion, factor = _magnified(fields, index)
    moved = factor * distortion.moved
    mesh, values = section_triangles(fields, 1e-6 * stress, mirrored=False, moved=moved)
    figure, axes = frame(mesh, when("Von Mises stress", fields, index), bar=True)
    levels = stress_levels(float(1e-6 * stress[solid].max()))
    shades = fill_stress(axes, mesh, values, levels)
    label = "von Mises stress in the solid [MPa]"
    colour_bar(figure, axes, shades, lies_flat(mesh), label)
    _, kelvin = section_triangles(fields, temperature, mirrored=False)
    handles = cover_soft(axes, mesh, kelvin, steel)
    if factor > 0.0:
        lines = draw_outlines(axes, distortion, factor, "#222222")
        handles = [*lines, *_draw_symmetry(axes, distortion), *handles]
        _fit(axes, distortion, factor)
    legend_below(figure, handles)
    return figure


def draw_shape(fields: Fields, steel: Steel | None) -> Figure | None:
    """The deformed section, its shape at the meniscus, the shell and the largest displacements.

    Returns:
        None for a run without displacement, or for a strip, which has no shape.
    """
    if "displacement" not in fields.names:
        return None
    distortion, factor = _magnified(fields, -1)
    if factor == 0.0:
        return None
    temperature, moved = fields.values("temperature"), factor * distortion.moved
    mesh, kelvin = section_triangles(fields, temperature, mirrored=False, moved=moved)
    figure, axes = frame(mesh, when("Shape of the section", fields, -1), bar=False)
    handles = draw_outlines(axes, distortion, factor, _MOVED)
    handles += _draw_symmetry(axes, distortion)
    if steel is not None and kelvin.min() < steel.solidus:
        low, high = float(kelvin.min()) - 1.0, max(float(kelvin.max()), steel.solidus) + 1.0
        axes.tricontourf(mesh, kelvin, levels=[low, steel.solidus, high], colors=[_SHELL, "w"])
        if kelvin.max() > steel.solidus:
            handles.append(_draw_solidus(axes, mesh, kelvin, steel))
    _fit(axes, distortion, factor)
    _name_extremes(axes, distortion, factor)
    legend_below(figure, handles)
    return figure


def fill_stress(axes: Axes, mesh: Triangulation, values: Array, levels: Array) -> TriContourSet:
    """Fill a section with the colours of a stress [MPa].

    Values beyond the scale belong to soft material, which is covered afterwards. They are cut just
    below its end, since matplotlib would not draw them.
    """
    within = np.clip(values, levels[0], (1 - 1e-6) * levels[-1])
    return axes.tricontourf(mesh, within, levels=levels, cmap=STRESS_MAP)


def stress_levels(largest: float) -> Array:
    """Levels [MPa] from 0 to the first above the largest stress, round in the shown unit."""
    from matplotlib.ticker import MaxNLocator

    scale = scale_of("MPa", "von_mises")
    largest = scale(largest)

    locator = MaxNLocator(12, steps=[1, 2, 2.5, 5, 10])
    ticks = np.asarray(locator.tick_values(0.0, max(largest, 1e-6)), dtype=np.float64)
    ticks = ticks[ticks >= 0.0]
    levels = ticks[: int(np.searchsorted(ticks, largest * (1 - 1e-9))) + 1]
    return np.asarray(scale.back(levels))


def _magnified(fields: Fields, index: int) -> tuple[Distortion, float]:
    """The deformation, and its magnification (0: a mere line)."""
    distortion = Distortion.of(fields, index)
    sides = np.ptp(distortion.points, axis=0)
    line = sides.max() > 4.0 * sides.min() and not distortion.outline.cuts
    return distortion, 0.0 if line else distortion.factor()


def cover_soft(axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel) -> list[Line2D]:
    """Cover mushy zone and liquid with grey; return the legend entries."""
    if kelvin.max() <= steel.solidus:
        return []
    fill_soft(axes, mesh, kelvin, steel, float(kelvin.max()))
    return [_draw_solidus(axes, mesh, kelvin, steel), *soft_handles()]


def fill_soft(axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel, hottest: float) -> None:
    """Fill the mushy and liquid regions, up to the hottest temperature."""
    liquidus = max(steel.liquidus, float(np.nextafter(steel.solidus, np.inf)))
    levels = [steel.solidus, liquidus, max(hottest, liquidus) + 1.0]
    axes.tricontourf(mesh, kelvin, levels=levels, colors=SOFT)


def soft_handles() -> list[Line2D]:
    """Legend entries of the mushy and liquid regions."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=colour, marker="s", markersize=8, linestyle="none", label=name)
        for name, colour in zip(("mushy", "liquid"), SOFT, strict=True)
    ]


def _draw_solidus(axes: Axes, mesh: Triangulation, kelvin: Array, steel: Steel) -> Line2D:
    """Draw the inside of the shell; return its legend entry."""
    from matplotlib.lines import Line2D

    if kelvin.min() < steel.solidus:
        axes.tricontour(
            mesh, kelvin, levels=[steel.solidus], colors=[SOLIDUS_COLOUR], linewidths=[1.0]
        )
    return Line2D([], [], color=SOLIDUS_COLOUR, linewidth=1.0, label="solidus")


def draw_outlines(axes: Axes, distortion: Distortion, factor: float, colour: str) -> list[Line2D]:
    """Draw the outline at the meniscus and now, and the wall [mm]; return the legend entries."""
    from matplotlib.lines import Line2D

    here: dict[str, Any] = {"color": _UNMOVED, "linewidth": 0.8, "linestyle": (0, (5, 3))}
    now: dict[str, Any] = {"color": colour, "linewidth": 1.2}
    wall: dict[str, Any] = {"color": _WALL, "linewidth": 3.0, "solid_capstyle": "butt"}
    handles = []
    if distortion.wall is not None:  # below parts in contact with it
        axes.plot(*(1e3 * distortion.wall.drawn(factor)).T, **wall)
        handles.append(Line2D([], [], **wall, label="mould"))
    for shift, pen, label in (
        (0.0, here, "at the meniscus"),
        (factor, now, f"displacement × {factor:g}"),
    ):
        points = 1e3 * (distortion.points + shift * distortion.moved)
        for chain in distortion.outline.chains():
            axes.plot(*points[chain].T, **pen)
        handles.append(Line2D([], [], **pen, label=label))
    return handles


def _draw_symmetry(axes: Axes, distortion: Distortion) -> list[Line2D]:
    from matplotlib.lines import Line2D

    chain: dict[str, Any] = {"color": "#444444", "linewidth": 0.9, "linestyle": "-."}
    for axis, pieces in distortion.outline.cuts.items():
        ends = 1e3 * distortion.points[pieces][:, :, 1 - axis]
        line = np.array([[0.0, ends.min()], [0.0, ends.max()]])
        axes.plot(*(line.T if axis == 0 else line.T[::-1]), **chain)
    return [Line2D([], [], **chain, label="symmetry")] if distortion.outline.cuts else []


def _fit(axes: Axes, distortion: Distortion, factor: float) -> None:
    """Set limits that include all shapes, with a margin."""
    places = distortion.places(factor)
    margin = 0.05 * float(np.ptp(places, axis=0).max())
    axes.set_xlim(places[:, 0].min() - margin, places[:, 0].max() + margin)
    axes.set_ylim(places[:, 1].min() - margin, places[:, 1].max() + margin)


def _name_extremes(axes: Axes, distortion: Distortion, factor: float) -> None:
    """Write the largest outward and inward displacement of the surface at their places."""
    places, moved = distortion.points, distortion.moved
    nodes, normals = distortion.outline.outward(places)
    outward = 1e3 * np.einsum("ij,ij->i", moved[nodes], normals)
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    for number in _extremes(outward, places[nodes]):
        point = 1e3 * (places[nodes[number]] + factor * moved[nodes[number]])
        name = point + 0.36 * (1e3 * centre - point)  # outside the shell, as long as that is thin
        axes.annotate(
            _signed(float(outward[number])),
            xy=(point[0], point[1]),
            xytext=(name[0], name[1]),
            ha="right" if point[0] > 1e3 * centre[0] else "left",
            va="center",
            fontsize=8.5,
            color=_MOVED,
            bbox={"facecolor": "w", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
            arrowprops={"arrowstyle": "-|>", "color": _MOVED, "linewidth": 0.9, "shrinkB": 1.0},
        )


def _signed(length: float) -> str:
    """A length [mm] with its sign, if it is not zero."""
    rounded = round(length, 2)
    words = said(rounded, "mm", "+.2f", "displacement") if rounded else said(0.0, "mm", ".2f")
    return words.replace("-", "\N{MINUS SIGN}")


def _extremes(outward: Array, points: Array) -> set[int]:
    """Indices of the largest and the smallest value; of equal ones those farthest apart."""
    equal = 0.02 * float(np.abs(outward).max())
    smallest = int(outward.argmin())
    found = [smallest]
    for near in (outward >= outward.max() - equal, outward <= outward.min() + equal):
        candidates = np.flatnonzero(near)
        distances = np.linalg.norm(points[candidates] - points[found[-1]], axis=1)
        found.append(int(candidates[distances.argmax()]))
    first, second = found[1:]
    return {first} if outward[first] - outward[second] <= equal else {first, second}
