"""Draws the figures of a comparison: histories laid over one another, sections side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.compare.figures import Definition, Panel, figures
from castfem.compare.runs import Run
from castfem.output.fields import Fields
from castfem.output.plot_section import Steel, section_triangles
from castfem.output.style import (
    CELSIUS,
    LIQUIDUS_COLOUR,
    SOLIDUS_COLOUR,
    Course,
    dress,
    look,
    new_figure,
    probe_label,
    save,
)
from castfem.output.xdmf import HDF5_NAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

_WIDTH = 7.4  # inches
_BASE_COLOUR = "#222222"
_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31")
# Fields drawn over the section at the end of the runs: name, title, label, factor, shift.
SECTIONS = (
    ("temperature", "Temperature", "temperature [°C]", 1.0, -CELSIUS),
    ("von_mises", "Von Mises stress", "stress [MPa]", 1e-6, 0.0),
)


def draw(folder: Path, runs: Sequence[Run], base: Run) -> list[Path]:
    """Draw all figures for which the runs have the data.

    Raises:
        RunFailure: They cannot be written.
        InputError: A file of a run is damaged.
    """
    drawn = []
    colours = _colours(runs, base)
    with look():
        for definition, panels in figures(runs, base):
            figure = _draw_figure(definition, panels, colours, base)
            drawn.append(save(figure, folder / f"{definition.quantity}.png"))
        for name, title, label, factor, shift in SECTIONS:
            section = _draw_sections(runs, name, title, label, (factor, shift))
            if section is not None:
                drawn.append(save(section, folder / f"section_{name}.png"))
    return drawn


def _colours(runs: Sequence[Run], base: Run) -> dict[int, object]:
    """Black for the base run, a colour for each other; along a scale when they are many."""
    others = [run for run in runs if run is not base]
    if len(others) <= len(_COLOURS):
        chosen: list[object] = list(_COLOURS)
    else:
        from matplotlib import colormaps

        chosen = list(colormaps["viridis"](np.linspace(0.0, 0.92, len(others))))
    found = {id(run): colour for run, colour in zip(others, chosen, strict=False)}
    return {id(base): _BASE_COLOUR, **found}


def _draw_figure(
    definition: Definition, panels: Sequence[Panel], colours: dict[int, object], base: Run
) -> Figure:
    """A panel for each place, a curve for each run."""
    legend = 0.25 * math.ceil(len(panels[0].curves) / 3)
    figure = new_figure(_WIDTH, 1.3 + legend + (3.2 if len(panels) == 1 else 2.4 * len(panels)))
    axes = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
    course = _course(panels[0])
    for panel, ax in zip(panels, axes, strict=True):
        factor, unit = _engineering(panel)
        # The base first, so that a run that lies on it is seen.
        for curve in sorted(panel.curves, key=lambda c: c.run is not base):
            ax.plot(
                curve.position * course.scale,
                curve.values * factor,
                color=colours[id(curve.run)],
                linewidth=2.4 if curve.run is base else 1.5,
                label=_label(curve.run),
            )
        place = f", {probe_label(panel.place)}" if panel.place else ""
        ax.set_ylabel(f"{definition.label}{place}\n[{unit}]")
        if definition.zero:
            low = min(float(np.nanmin(c.values)) for c in panel.curves) * factor
            ax.set_ylim(bottom=min(0.0, low))
    _dress(axes, course)
    handles = {text: line for line, text in zip(*axes[0].get_legend_handles_labels(), strict=True)}
    order = [_label(curve.run) for curve in panels[0].curves]
    columns = 3 if max(map(len, order)) < 30 else 2
    figure.legend(
        [handles[name] for name in order],
        order,
        loc="outside lower center",
        ncols=columns,
        frameon=False,
    )
    figure.suptitle(definition.title, fontsize=10.5)
    return figure


def _label(run: Run) -> str:
    return run.label.replace("degC", "°C")


def _dress(axes: list[Axes], course: Course) -> None:
    """Give the panels their x axis, with the time on top if it is the same for all runs."""
    if np.isfinite(course.time).all():
        dress(axes, course)
        return
    for ax in axes:
        ax.set_xlim(0.0, float(course.abscissa[-1]))
    axes[-1].set_xlabel(course.label)


def _course(panel: Panel) -> Course:
    """The x axis: the longest way of all runs; zones, and a time, only if all runs share them."""
    longest = max(panel.curves, key=lambda curve: curve.position[-1])
    tables = [curve.run.history() for curve in panel.curves]
    speeds = [float(t["position"].iloc[-1] / t["time"].iloc[-1]) for t in tables if t is not None]
    zones = longest.run.summary.zones
    same = all(curve.run.summary.zones[: len(zones)] == zones for curve in panel.curves)
    steady = np.ptp(speeds) <= 1e-6 * max(speeds)
    time = longest.position / speeds[0] if steady else np.full(len(longest.position), np.nan)
    return Course(time, longest.position, zones if same else ())


def _engineering(panel: Panel) -> tuple[float, str]:
    """Factor and unit for the axis: joules and watts with a prefix, degrees as they are written."""
    unit = panel.unit.replace("degC", "°C").replace("^2", "²").replace("^3", "³")
    if not unit.startswith(("J", "W")):
        return 1.0, unit
    largest = max(float(np.nanmax(np.abs(curve.values))) for curve in panel.curves)
    for size, prefix in ((1e6, "M"), (1e3, "k")):
        if largest >= size:
            return 1.0 / size, prefix + unit
    return 1.0, unit


def _draw_sections(
    runs: Sequence[Run], name: str, title: str, label: str, scale: tuple[float, float]
) -> Figure | None:
    """The field `name` of all runs where they end, in one colour scale; None if one has it not."""
    pictures: list[tuple[Run, Triangulation, np.ndarray]] = []
    for run in runs:
        if not (run.folder / HDF5_NAME).is_file():
            return None
        with Fields(run.folder) as fields:
            if name not in fields.names or fields.centre(name) != "point":
                return None
            mesh, values = section_triangles(fields, fields.values(name), mirrored=False)
            pictures.append((run, mesh, scale[0] * values + scale[1]))
    across = min(3, len(pictures))
    down = math.ceil(len(pictures) / across)
    ratio = float(np.ptp(pictures[0][1].y) / np.ptp(pictures[0][1].x))
    if not 0.2 < ratio < 5.0:
        return None  # a strip: its picture would say nothing
    cell = 2.6
    figure = new_figure(cell * across + 1.4, (cell * ratio + 0.35) * down + 0.5)
    axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
    low = min(float(values.min()) for _, _, values in pictures)
    high = max(float(values.max()) for _, _, values in pictures)
    for ax in axes.flat:
        ax.set_visible(False)
    for ax, (run, mesh, values) in zip(axes.flat, pictures, strict=False):
        ax.set_visible(True)
        shades = ax.tripcolor(
            mesh, values, shading="gouraud", cmap="inferno", vmin=low, vmax=max(high, low + 1e-9)
        )
        if name == "temperature":
            _freezing_range(ax, mesh, values, run)
        ax.set_aspect("equal")
        ax.grid(False)
        ax.set_title(_label(run), fontsize=9)
        ax.tick_params(labelleft=True, labelbottom=True, labelsize=8)
    figure.colorbar(shades, ax=axes, label=label, shrink=0.8)
    lines = " (blue: solidus, red: liquidus)" if name == "temperature" else ""
    figure.suptitle(f"{title} where the runs end{lines}; x, y in mm", fontsize=10.5)
    return figure


def _freezing_range(ax: Axes, mesh: Triangulation, values: np.ndarray, run: Run) -> None:
    """Draw solidus and liquidus into a temperature field in degC."""
    steel = Steel.of({name: q.value for name, q in run.summary.quantities.items()})
    if steel is None:
        return
    for level, colour in ((steel.solidus, SOLIDUS_COLOUR), (steel.liquidus, LIQUIDUS_COLOUR)):
        if values.min() < level - CELSIUS < values.max():
            ax.tricontour(mesh, values, levels=[level - CELSIUS], colors=["white"], linewidths=2.2)
            ax.tricontour(mesh, values, levels=[level - CELSIUS], colors=[colour], linewidths=1.1)
