"""Figure of what the inputs do to an optimum: Sobol indices of each result and each variable."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.shown_units import Scale
from castfem.post.plots.style import DPI, look
from castfem.studies.optimisation.chosen_units import unit_name
from castfem.studies.optimisation.optimum import Spreading, SpreadRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_NAME = "spread.png"
_WIDTH, _BAR = 3.0, 0.32  # inches, of a panel and of an input in it
_COLOUR = "#0072b2"


def draw_spread(spread: Spreading, path: Path, scales: Sequence[Scale] = ()) -> None:
    """Draw a spread.

    Args:
        spread: What is drawn.
        path: Of the file.
        scales: What turns the changes of each row into what is shown; left out: as they are.

    Raises:
        RunFailure: The file cannot be written.
    """
    with look(), replacing(path) as temporary:
        indices_figure(spread, scales).savefig(temporary, dpi=DPI, format="png")


def indices_figure(spread: Spreading, scales: Sequence[Scale] = ()) -> Figure:
    """Return the figure: a panel for each row, two bars in it for each input."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = len(spread.rows)
    height = 1.4 + _BAR * len(spread.labels)
    figure = Figure(figsize=(2.0 + _WIDTH * columns, height), layout="constrained")
    FigureCanvasAgg(figure)
    grid: Any = figure.subplots(1, columns, squeeze=False, sharey=True)[0]
    places = np.arange(len(spread.labels))
    scales = scales or [Scale(row.unit) for row in spread.rows]
    for axes, row, scale in zip(grid, spread.rows, scales, strict=True):
        total = axes.barh(places, row.total, 0.7, color=_COLOUR, alpha=0.3, label="total")
        first = axes.barh(places, row.first, 0.35, color=_COLOUR, label="first order")
        axes.set_title(_title(row, scale), fontsize=8)
        axes.set_xlim(0.0, 1.0)
        axes.set_xlabel("Sobol index")
    grid[0].set_yticks(places, [label.replace(" [times]", "") for label in spread.labels])
    grid[0].tick_params(axis="y", labelsize=7)
    grid[0].invert_yaxis()
    figure.legend(handles=[first, total], loc="outside lower right", ncols=2, fontsize=7)
    return figure


def _title(row: SpreadRow, scale: Scale) -> str:
    low, high = (scale(end) for end in row.change)
    unit = f" {unit_name(scale.unit)}".rstrip()
    return f"{row.name}\n{low:+.2g} to {high:+.2g}{unit}"
