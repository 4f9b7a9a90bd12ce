"""Figures of studies: optimisation, calibration, sensitivities, mould distortion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.result_registry import find
from castfem.base.shown_quantity import unit_of_difference
from castfem.base.shown_units import Scale, label_shown, plain_unit, scale_of
from castfem.base.types import Array
from castfem.model.optimise import bound
from castfem.post.plots.style import STYLE, head, look, new_figure, save
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.studies.optimisation.optimum import (
    Front,
    Optimum,
    ResultWithError,
    Spread,
    Value,
    unit_name,
)
from castfem.studies.sensitivity.result import Row, Sensitivity, ShownRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OPTIMUM_NAME, FRONT_NAME, SPREAD_NAME, MOULD_NAME = (
    "optimum.png", "front.png", "spread.png", "mould.png",
)  # fmt: skip
_BLUE, _ORANGE, _GREEN = "#0072b2", "#d55e00", "#009e73"
_MOULD_PANELS = {
    ("gap", "mm"): {"gap_mid_face": "mid-face", "gap_corner": "corner"},
    ("pressure", "MPa"): {
        "contact_pressure_mid_face": "mid-face",
        "contact_pressure_corner": "corner",
        "mean_contact_pressure_max": "largest mean",
    },
    ("in contact", "percent"): {"contact_share": ""},
    ("von Mises", "MPa"): {"von_mises_max": "largest", "von_mises_corner": "corner"},
}
"""Quantities of a run's history that are drawn over the distance from the meniscus, with units."""


@look()
def optimum_figure(optimum: Optimum) -> Figure:
    """Return a figure: a column per variable, a row for the objective and each constraint."""
    objective = optimum.objective
    assert objective is not None
    rows, columns = 1 + len(optimum.constraints), len(optimum.values)
    figure = new_figure(1.2 + STYLE.panel[0] * columns, 0.6 + STYLE.panel[1] * rows)
    grid: Any = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
    grid[0][0].set_ylabel(fill(objective.in_words, STYLE.label), fontsize=8)
    for row, one in enumerate(optimum.constraints, start=1):
        side = "above" if bound(one.text).sense == "at_least" else "below"
        words = f"{one.result.label} {side} its bound [{one.result.difference_unit or '-'}]"
        grid[row][0].set_ylabel(fill(words, STYLE.label), fontsize=8)
    for column, value in enumerate(optimum.values):
        _draw_column(grid[:, column], optimum, objective, value)
    head(figure, optimum.title, 9.0)
    handles, labels = grid[-1][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", fontsize=7, ncols=len(handles))
    return figure


def _draw_column(
    column: Sequence[Axes], optimum: Optimum, objective: ResultWithError, value: Value
) -> None:
    away = [step for step in optimum.neighbours if step.key == value.key]
    here = [objective.chosen(objective.value)]
    there = [[objective.chosen(objective.value + step.objective) for step in away]]
    for number, one in enumerate(optimum.constraints):
        shown = one.result.chosen_difference
        here.append(shown(one.left))
        there.append([shown(step.left[number]) if step.left else math.nan for step in away])
    for axes, own, others in zip(column, here, there, strict=True):
        words = "cannot be distinguished from the best"
        axes.axvspan(value.low, value.high, color="0.88", lw=0, label=words)
        axes.axvline(value.value, color="0.5", lw=0.8)
        places = [*(step.value for step in away), value.value]
        pairs = sorted(zip(places, [*others, own], strict=True))
        axes.plot(*zip(*pairs, strict=True), color=_BLUE, marker="o", ms=3.5, lw=1.2)
        axes.plot([value.value], [own], color=_ORANGE, marker="o", ms=5.5, ls="none", label="best")
    for axes, one in zip(column[1:], optimum.constraints, strict=True):
        error = one.result.chosen_difference(one.error)
        if math.isfinite(error):
            words = "error of what is left, about 0"
            axes.axhspan(-error, error, color=_ORANGE, alpha=0.15, lw=0, label=words)
        axes.axhline(0.0, color=_ORANGE, lw=0.9)
    column[-1].set_xlabel(f"{value.key} [{value.unit}]" if value.unit else value.key)


@look()
def front_figure(front: Front) -> Figure:
    """Return a figure of the first result over the second; below, each variable over the first."""
    rows = 1 + len(front.keys)
    figure = new_figure(1.5 * STYLE.panel[0], 0.5 + 0.8 * STYLE.panel[1] * rows)
    axes: Any = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
    second = [front.second.chosen(point.second) for point in front.points]
    first = [front.first.chosen(point.first) for point in front.points]
    axes[0].plot(second, first, color=_BLUE, marker="o", ms=4, lw=1.0)
    best = {"marker": "o", "ms": 6, "ls": "none", "label": f"{front.first.label}: best"}
    axes[0].plot(second[:1], first[:1], color=_ORANGE, **best)
    axes[0].legend(fontsize=7, frameon=False)
    axes[0].set_ylabel(fill(front.first.in_words, STYLE.label), fontsize=8)
    for number, key in enumerate(front.keys):
        values = [point.values[number] for point in front.points]
        axes[1 + number].plot(second, values, color="0.35", marker="o", ms=3.5, lw=1.0)
        axes[1 + number].set_ylabel(key, fontsize=8)
    axes[-1].set_xlabel(front.second.in_words)
    return figure


@look()
def indices_figure(spread: Spread, scales: Sequence[Scale] = ()) -> Figure:
    """Return the Sobol indices: a panel for each row of a spread, two bars for each input."""
    figure = new_figure(2.0 + 3.0 * len(spread.rows), 1.4 + 0.32 * len(spread.labels))
    grid: Any = figure.subplots(1, len(spread.rows), squeeze=False, sharey=True)[0]
    places = np.arange(len(spread.labels))
    scales = scales or [Scale(row.unit) for row in spread.rows]
    for axes, row, scale in zip(grid, spread.rows, scales, strict=True):
        total = axes.barh(places, row.total, 0.7, color=_BLUE, alpha=0.3, label="total")
        first = axes.barh(places, row.first, 0.35, color=_BLUE, label="first order")
        low, high = (scale(end) for end in row.change)
        change = f"{low:+.2g} to {high:+.2g} {unit_name(scale.unit)}".rstrip()
        axes.set_title(f"{row.name}\n{change}", fontsize=8)
        axes.set_xlim(0.0, 1.0)
        axes.set_xlabel("Sobol index")
    grid[0].set_yticks(places, [label.replace(" [times]", "") for label in spread.labels])
    grid[0].tick_params(axis="y", labelsize=7)
    grid[0].invert_yaxis()
    figure.legend(handles=[first, total], loc="outside lower right", ncols=2, fontsize=7)
    return figure


@look()
def mould_figure(head: Sequence[str], rows: Sequence[Sequence[float]], run: Path) -> Figure:
    """Return a figure with a panel for the mould and one for each group of history columns."""
    history = read_columns(run / HISTORY_NAME)
    panels = {
        label: {name: words for name, words in columns.items() if name in history}
        for label, columns in _MOULD_PANELS.items()
    }
    panels = {label: columns for label, columns in panels.items() if columns}
    length, end, colours = scale_of("mm"), rows[-1][0], (_BLUE, _ORANGE, _GREEN)
    position = 1e3 * history["position"]
    inside = position <= end * (1.0 + 1e-9)
    count = 1 + len(panels)
    figure = new_figure(5.2, 0.5 + 1.5 * count)
    every: Any = figure.subplots(count, 1, squeeze=False, sharex=True)[:, 0]
    places = length(np.array([row[0] for row in rows]))
    for number, (name, colour) in enumerate(zip(head[1:], colours, strict=False), start=1):
        closed = np.array([rows[0][number] - row[number] for row in rows])
        label = name.removesuffix(" [mm]")
        every[0].plot(places, length(closed), color=colour, label=label, lw=1.2)
    every[0].set_ylabel(f"narrower by [{length.unit}]", fontsize=8)
    for axes, ((label, unit), columns) in zip(every[1:], panels.items(), strict=True):
        scale = scale_of(unit, next(iter(columns)))
        for (name, words), colour in zip(columns.items(), colours, strict=False):
            values = scale(history[name][inside])
            axes.plot(length(position[inside]), values, color=colour, label=words, lw=1.2)
        axes.set_ylabel(f"{label} [{unit_name(scale.unit)}]", fontsize=8)
        axes.set_ylim(bottom=-0.04 * axes.get_ylim()[1])  # keeps a curve at 0 visible
    for axes in every:
        if len(axes.get_lines()) > 1:
            axes.legend(fontsize=7, ncols=3, loc="best", frameon=False)
    every[-1].set_xlabel(f"below the meniscus [{length.unit}]")
    every[-1].set_xlim(0.0, length(end))
    return figure


@dataclass(frozen=True, slots=True)
class Compared:
    """Measured and computed values of one result."""

    name: str  #: name of the result
    label: str  #: description
    unit: str  #: unit of the values
    position: Array  #: (n,), m
    measured: Array  #: (n,) measured values
    error: Array  #: (n,) error of measurement, NaN where unknown
    before: Array  #: (n,) computed, before the fit
    after: Array  #: (n,) computed, after the fit


@look()
def calibration_figure(results: Sequence[Compared]) -> Figure:
    """Return a figure with a row per result: over position, and computed over measured values."""
    figure = new_figure(9.6, 1.2 + 2.6 * len(results))
    grid: Any = figure.subplots(len(results), 2, squeeze=False, width_ratios=(1.5, 1.0))
    for (along, against), one in zip(grid, results, strict=True):
        error = one.error if np.isfinite(one.error).all() else None
        unit = f"[{plain_unit(one.unit)}]"
        dots: dict[str, Any] = {"fmt": "o", "color": "#333333", "ms": 4, "capsize": 3}
        name = "measured" if error is None else "measured ± standard error"
        along.errorbar(one.position, one.measured, yerr=error, label=name, **dots)
        ends = [f(np.r_[one.measured, one.before, one.after]) for f in (np.min, np.max)]
        room = 0.06 * (ends[1] - ends[0] or abs(ends[0]) or 1.0)
        ends = [ends[0] - room, ends[1] + room]
        against.plot(ends, ends, color="0.4", lw=1.0, label="computed = measured")
        for values, label, style in (
            (one.before, "computed, before", {"color": _ORANGE, "marker": "s", "mfc": "none"}),
            (one.after, "computed, fitted", {"color": _BLUE, "marker": "D"}),
        ):
            along.plot(one.position, values, ls="none", ms=6, label=label, **style)
            against.plot(one.measured, values, ls="none", ms=6, **style)
        along.set_xlabel("position below the meniscus [m]", gid="position")
        known = find(one.name)
        along.set_ylabel(f"{known[0].axis_label if known else 'value'} {unit}", gid=one.name)
        along.set_title(one.label, fontsize=9.5)
        along.set_xlim(0.0, 1.05 * max(float(each.position.max()) for each in results))
        against.set(xlim=ends, ylim=ends, box_aspect=1)
        against.set_xlabel(f"measured {unit}", gid=one.name)
        against.set_ylabel(f"computed {unit}", gid=one.name)
    drawn = [axes.get_legend_handles_labels() for axes in grid[0]]
    handles, labels = ([*one, *other] for one, other in zip(*drawn, strict=True))
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    return figure


FIGURE_NAME = "sensitivity.png"
_UP, _DOWN = "#d55e00", "#0072b2"


def draw_tornado(found: Sensitivity, path: Path) -> None:
    """Draw a panel for each result, in it a pair of bars for each parameter."""
    names = list(found.quantities)
    across = min(2, len(names))
    down = -(-len(names) // across)
    with look():
        figure = new_figure(4.6 * across + 0.6, 0.9 + down * (0.75 + 0.3 * len(found.parameters)))
        grid = np.atleast_1d(figure.subplots(down, across, squeeze=False)).ravel()
        for axes, name in zip(grid, names, strict=False):
            _panel(axes, [row for row in found.rows() if row.name == name])
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        head(figure, found.title, 9.0)
        save(figure, path)


def spread_of(row: Row) -> str:
    """The parameter with the amount it is varied by."""
    one = ShownRow.of(row)
    spread = f"\N{PLUS-MINUS SIGN}{one.spread:.3g} {plain_unit(one.spread_unit)}"
    return f"{row.parameter.name} {spread}".rstrip()


def _panel(axes: Axes, rows: list[Row]) -> None:
    """Draw the bars of one result on a linear scale; a sentence if there are none."""
    change_of = [row.change for row in rows]
    said = ""
    if all(one == 0.0 for one in change_of):
        said = "depends on none of them"
    elif not np.isfinite(change_of).any():
        said = "no derivative of it is known"
    if said:
        axes.set_axis_off()
        text = f"{label_shown(rows[0].quantity.label)}\n{said}"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=8)
        return
    order = sorted(rows, key=lambda row: abs(row.change) if np.isfinite(row.change) else -1.0)
    places = np.arange(len(order))
    change = np.array([row.change for row in order])
    axes.barh(places, change, height=0.62, color=_UP, label="more of it")
    axes.barh(places, -change, height=0.62, color=_DOWN, label="less of it")
    axes.set_yticks(places, [spread_of(row) for row in order], fontsize=7)
    axes.set_ylim(-0.6, len(order) - 0.4)  # rows without a bar included
    axes.axvline(0.0, color="0.3", lw=0.8)
    quantity = rows[0].quantity
    unit = plain_unit(unit_of_difference(quantity.shown_unit))
    text = f"change of {label_shown(quantity.label)} [{unit}]"
    axes.set_xlabel(text, fontsize=8, gid=rows[0].name)  # identifies its unit
    axes.legend(fontsize=6.5, loc="lower right", frameon=False)
