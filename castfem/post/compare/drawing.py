"""Draws the figures of a comparison: histories laid over one another, sections side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.result_registry import probe_label
from castfem.base.shown_units import plain_unit
from castfem.post.compare.figures import Definition, Panel, figures
from castfem.post.compare.runs import Run
from castfem.post.compare.sections import draw_sections
from castfem.post.plots.history import prefix_for
from castfem.post.plots.style import Abscissa, dress, look, new_panels, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BASE_COLOUR = "#222222"
_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31")
# Each run has its own dashes, too: through the gaps one sees what lies below, and a print in grey
# can be read.
_DASHES: tuple[Any, ...] = ("-", (0, (7, 2)), (0, (4, 1.5, 1, 1.5)), (0, (3, 2)), (0, (1, 1.2)))
_PERCENT = ("contact_share", "contact_sticking", "axial_strain")  # fractions drawn in %


@dataclass(frozen=True, slots=True)
class Pen:
    """How the curves of a run are drawn: colour, dashes, and width [pt]."""

    colour: Any
    dashes: Any
    width: float


def draw(folder: Path, runs: Sequence[Run], base: Run) -> list[Path]:
    """Draw all figures for which the runs have the data."""
    drawn = []
    pens = _pens(runs, base)
    with look():
        for definition, panels in figures(runs, base):
            figure = _draw_figure(definition, panels, pens, base)
            drawn.append(save(figure, folder / f"{definition.quantity}.png"))
        for name, section in draw_sections(runs, words).items():
            shaded = name in ("temperature", "shape")
            drawn.append(save(section, folder / f"section_{name}.png", shaded=shaded))
    return drawn


def words(label: str) -> str:
    """The label of a run as a reader writes it."""
    return label.replace("degC", "°C").replace("_", " ")


def _pens(runs: Sequence[Run], base: Run) -> dict[int, Pen]:
    """Black for the base run, a colour for each other; along a scale when they are many."""
    others = [run for run in runs if run is not base]
    if len(others) <= len(_COLOURS):
        chosen: list[Any] = list(_COLOURS)
    else:
        from matplotlib import colormaps

        chosen = list(colormaps["viridis"](np.linspace(0.0, 0.92, len(others))))
    pens = {
        id(run): Pen(colour, dashes, 1.6)
        for run, colour, dashes in zip(others, chosen, cycle(_DASHES), strict=False)
    }
    return {id(base): Pen(_BASE_COLOUR, "-", 2.8), **pens}


def _draw_figure(
    definition: Definition, panels: Sequence[Panel], pens: Mapping[int, Pen], base: Run
) -> Figure:
    """A panel for each place, a curve for each run."""
    order = [curve.run for curve in panels[0].curves]
    longest = max(len(words(run.label)) for run in order)
    columns = 3 if longest < 30 else 2 if longest < 50 else 1
    figure, axes = new_panels(
        len(panels),
        3.4 if len(panels) == 1 else 2.1,
        above=0.28,
        below=0.1 + 0.22 * math.ceil(len(order) / columns),
    )
    abscissa = _abscissa(panels[0])
    for panel, ax in zip(panels, axes, strict=True):
        factor, unit = engineering(definition, panel)
        # The base first, so that a run that lies on it is seen.
        for curve in sorted(panel.curves, key=lambda c: c.run is not base):
            pen = pens[id(curve.run)]
            ax.plot(
                curve.position * abscissa.scale,
                curve.values * factor,
                color=pen.colour,
                linestyle=pen.dashes,
                linewidth=pen.width,
                label=words(curve.run.label),
            )
        what = f"{definition.label} [{unit}]"
        column = f"{definition.quantity}_{panel.place}"
        ax.set_ylabel(f"{_place(definition, panel)}\n{what}" if panel.place else what, gid=column)
        if definition.zero:
            low = min(float(np.nanmin(c.values)) for c in panel.curves) * factor
            ax.set_ylim(bottom=min(0.0, low))
        _scale(ax, definition)
    _dress(axes, abscissa)
    handles = {text: line for line, text in zip(*axes[0].get_legend_handles_labels(), strict=True)}
    names = [words(run.label) for run in order]
    figure.legend(
        [handles[name] for name in names],
        names,
        loc="lower center",
        ncols=columns,
        frameon=False,
        handlelength=3.4,
    )
    title = definition.title.format(base=words(base.label))
    figure.suptitle(title, fontsize=10.5, y=1.0 - 0.1 / figure.get_size_inches()[1])
    return figure


def _scale(ax: Axes, definition: Definition) -> None:
    """Let an axis span what it must, from its lower end or about its middle; whole numbers at it.

    An offset such as +1e2 beside the axis would be read as a factor, or not at all.
    """
    ax.ticklabel_format(useOffset=False)
    low, high = ax.get_ylim()
    missing = definition.span - (high - low)
    if missing > 0.0:
        below = 0.0 if definition.zero else 0.5 * missing
        ax.set_ylim(low - below, high + missing - below)


def _place(definition: Definition, panel: Panel) -> str:
    """What a panel shows: the name of a probe, or which extreme."""
    if panel.place in ("max", "min"):
        return definition.extremes[panel.place == "min"]
    if definition.quantity == "size" and panel.place == "corner":
        return "diagonal"
    return probe_label(panel.place)


def _dress(axes: list[Axes], abscissa: Abscissa) -> None:
    """Give the panels their x axis, with the time on top if it is the same for all runs."""
    if np.isfinite(abscissa.time).all():
        dress(axes, abscissa)
        return
    for ax in axes:
        ax.set_xlim(0.0, float(abscissa.values[-1]))
    axes[-1].set_xlabel(abscissa.label, gid="position")


def _abscissa(panel: Panel) -> Abscissa:
    """The x axis: the longest range of positions; zones and times only if all runs share them."""
    longest = max(panel.curves, key=lambda curve: curve.position[-1])
    tables = [curve.run.history() for curve in panel.curves]
    speeds = [float(t["position"].iloc[-1] / t["time"].iloc[-1]) for t in tables if t is not None]
    zones = longest.run.summary.zones
    same = all(curve.run.summary.zones[: len(zones)] == zones for curve in panel.curves)
    steady = np.ptp(speeds) <= 1e-6 * max(speeds) and all(
        np.allclose(table["position"], speeds[0] * table["time"], rtol=1e-6)
        for table in tables
        if table is not None
    )
    time = longest.position / speeds[0] if steady else np.full(len(longest.position), np.nan)
    return Abscissa(time, longest.position, zones if same else ())


def engineering(definition: Definition, panel: Panel) -> tuple[float, str]:
    """Factor and unit for the axis: joules and watts with a prefix, fractions in percent."""
    unit = plain_unit(panel.unit)
    if unit == "-" and definition.quantity in _PERCENT:
        return 100.0, "%"
    largest = max(float(np.nanmax(np.abs(curve.values))) for curve in panel.curves)
    size, prefixed = prefix_for(largest, unit)
    return 1.0 / size, prefixed
