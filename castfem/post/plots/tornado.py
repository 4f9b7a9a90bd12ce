"""The tornado figure: what each parameter does to each result, the largest on top."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_quantity import unit_of_difference
from castfem.base.shown_units import label_shown, plain_unit
from castfem.post.plots.style import look, new_figure, save
from castfem.studies.sensitivity.result import Row, Sensitivity, ShownRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURE_NAME = "sensitivity.png"
_UP, _DOWN = "#d55e00", "#0072b2"
_ACROSS = 2  # panels side by side


def draw_tornado(found: Sensitivity, path: Path) -> None:
    """Draw a panel for each result, in it a pair of bars for each parameter.

    Raises:
        RunFailure: The file cannot be written.
    """
    names = list(found.quantities)
    across = min(_ACROSS, len(names))
    down = -(-len(names) // across)
    with look():
        figure = new_figure(4.6 * across + 0.6, 0.9 + down * (0.75 + 0.3 * len(found.parameters)))
        grid = np.atleast_1d(figure.subplots(down, across, squeeze=False)).ravel()
        for axes, name in zip(grid, names, strict=False):
            _panel(axes, [row for row in found.rows() if row.name == name])
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        figure.suptitle(found.title, fontsize=9)
        save(figure, path)


def spread_of(row: Row) -> str:
    """The parameter with what it is moved by."""
    one = ShownRow.of(row)
    spread = f"\N{PLUS-MINUS SIGN}{one.spread:.3g} {plain_unit(one.spread_unit)}"
    return f"{row.parameter.name} {spread}".rstrip()


def _panel(axes: Axes, rows: list[Row]) -> None:
    """Bars of one result; linear, so that both sides are as long. A sentence if there are none."""
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
    axes.set_ylim(-0.6, len(order) - 0.4)  # also of those without a bar
    axes.axvline(0.0, color="0.3", lw=0.8)
    quantity = rows[0].quantity
    unit = plain_unit(unit_of_difference(quantity.shown_unit))
    text = f"change of {label_shown(quantity.label)} [{unit}]"
    axes.set_xlabel(text, fontsize=8, gid=rows[0].name)  # by which its own unit is found
    axes.legend(fontsize=6.5, loc="lower right", frameon=False)
