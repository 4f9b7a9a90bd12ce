"""Figure of an optimum: objective and constraints along each variable through it."""

from __future__ import annotations

import math
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from castfem.base.atomic_files import replacing
from castfem.model.optimise import bound
from castfem.post.plots.style import DPI, look
from castfem.studies.optimisation.chosen_units import (
    difference_in,
    difference_scale,
    in_words,
    unit_name,
    value_in,
)
from castfem.studies.optimisation.front import Front
from castfem.studies.optimisation.optimum import Kept, Optimum, Value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURE_NAME, FRONT_NAME = "optimum.png", "front.png"
_WIDTH, _HEIGHT = 3.4, 2.3  # inches, of a panel
_LINE = 34  # characters along the height of one


def draw(optimum: Optimum, path: Path) -> None:
    """Draw an optimum.

    Raises:
        RunFailure: The file cannot be written.
    """
    figure = optimum_figure(optimum)
    with look(), replacing(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")


def optimum_figure(optimum: Optimum) -> Figure:
    """Return a column for each variable, a row for the objective and each constraint."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows, columns = 1 + len(optimum.constraints), len(optimum.values)
    with look():
        figure = Figure(
            figsize=(1.2 + _WIDTH * columns, 0.6 + _HEIGHT * rows), layout="constrained"
        )
        FigureCanvasAgg(figure)
        grid: Any = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
        for column, value in enumerate(optimum.values):
            _objective(grid[0][column], optimum, value)
            for row, kept in enumerate(optimum.constraints, start=1):
                _constraint(grid[row][column], optimum, value, kept, row - 1)
            unit = f" [{value.unit}]" if value.unit else ""
            grid[-1][column].set_xlabel(f"{value.key}{unit}")
        _name_rows(grid, optimum)
        figure.suptitle(optimum.title, fontsize=9)
        handles, labels = grid[-1][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", fontsize=7, ncols=len(handles))
    return figure


def draw_front(front: Front, path: Path) -> None:
    """Draw a front: what is to be best over what it is weighed against, and where to find it.

    Raises:
        RunFailure: The file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = 1 + len(front.keys)
    with look():
        figure = Figure(figsize=(1.5 * _WIDTH, 0.5 + 0.8 * _HEIGHT * rows), layout="constrained")
        FigureCanvasAgg(figure)
        axes: Any = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
        second = [value_in(front.second, point.second) for point in front.points]
        first = [value_in(front.first, point.first) for point in front.points]
        axes[0].plot(second, first, color="#0072b2", marker="o", ms=4, lw=1.0)
        best = f"{front.first.label}: best"
        axes[0].plot(
            second[:1], first[:1], color="#d55e00", marker="o", ms=6, ls="none", label=best
        )
        axes[0].legend(fontsize=7, frameon=False)
        axes[0].set_ylabel(fill(in_words(front.first), _LINE), fontsize=8)
        for number, key in enumerate(front.keys):
            values = [point.values[number] for point in front.points]
            axes[1 + number].plot(second, values, color="0.35", marker="o", ms=3.5, lw=1.0)
            axes[1 + number].set_ylabel(key, fontsize=8)
        axes[-1].set_xlabel(in_words(front.second))
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=DPI, format="png")


def _name_rows(grid: Any, optimum: Optimum) -> None:
    assert optimum.objective is not None
    grid[0][0].set_ylabel(fill(in_words(optimum.objective), _LINE), fontsize=8)
    for row, kept in enumerate(optimum.constraints, start=1):
        side = "above" if bound(kept.text).sense == "at_least" else "below"
        unit = unit_name(difference_scale(kept.known).unit) or "-"
        words = f"{kept.known.label} {side} its bound [{unit}]"
        grid[row][0].set_ylabel(fill(words, _LINE), fontsize=8)


def _frame(axes: Axes, value: Value) -> None:
    axes.axvspan(value.low, value.high, color="0.88", lw=0, label="cannot be told from the best")
    axes.axvline(value.value, color="0.5", lw=0.8)


def _curve(axes: Axes, optimum: Optimum, value: Value, here: float, there: list[float]) -> None:
    """A result over one variable, the optimum among its steps."""
    places = [step.value for step in optimum.away if step.key == value.key]
    pairs = sorted(zip([*places, value.value], [*there, here], strict=True))
    axes.plot(*zip(*pairs, strict=True), color="#0072b2", marker="o", ms=3.5, lw=1.2)
    axes.plot([value.value], [here], color="#d55e00", marker="o", ms=5.5, ls="none", label="best")


def _objective(axes: Axes, optimum: Optimum, value: Value) -> None:
    known = optimum.objective
    assert known is not None
    _frame(axes, value)
    there = [value_in(known, known.value + s.objective) for s in optimum.away if s.key == value.key]
    _curve(axes, optimum, value, value_in(known, known.value), there)


def _constraint(axes: Axes, optimum: Optimum, value: Value, kept: Kept, number: int) -> None:
    _frame(axes, value)
    known = kept.known
    there = [
        difference_in(known, s.left[number]) if s.left else float("nan")
        for s in optimum.away
        if s.key == value.key
    ]
    _curve(axes, optimum, value, difference_in(known, kept.left), there)
    error = difference_in(known, kept.error)
    if math.isfinite(error):
        axes.axhspan(
            -error, error, color="#d55e00", alpha=0.15, lw=0, label="error of what is left, about 0"
        )
    axes.axhline(0.0, color="#d55e00", lw=0.9)
