"""Error against run time: what the figures of several benchmarks have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.report import Row, front
from castfem.post.plots.style import look, new_figure

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Panel = tuple[str, Sequence[Row], str, str]
"""Title, runs, key of the error, and what it is.

A run has `seconds`, the error, `default`, and `colour`, `marker` and `size` of its point."""


def errors_over_time(
    panels: Sequence[Sequence[Panel]],
    legend: Sequence[tuple[str, str, str]],
    logarithmic: bool = True,
) -> Figure:
    """Each run a point, the default ringed, those joined that no other beats.

    Args:
        panels: Row by row.
        legend: Words, marker and colour of its entries.
        logarithmic: Whether errors are drawn so.
    """
    with look():
        figure = new_figure(8.6, 3.2 * len(panels))
        grid = figure.subplots(len(panels), len(panels[0]), squeeze=False)
        for axis, (title, rows, key, label) in zip(
            grid.flat, (one for line in panels for one in line), strict=True
        ):
            axis.plot(*front(rows, key), "-", color="#777777", linewidth=1.0)
            for row in rows:
                point, style = (row["seconds"], row[key]), {"color": row["colour"]}
                axis.plot(*point, row["marker"], markersize=row["size"], **style)
                if row["default"]:
                    axis.plot(*point, "o", markersize=15, fillstyle="none", color="black")
            axis.set(xscale="log", xlabel="processor time [s]", ylabel=f"error: {label}")
            axis.set_title(title)
            _plain(axis.xaxis)
            if logarithmic:
                axis.set_yscale("log")
                _plain(axis.yaxis)
            else:
                axis.set_ylim(bottom=0.0)
        handles = [
            figure.axes[0].plot([], [], mark, color=colour, label=words)[0]
            for words, mark, colour in legend
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=8)
    return figure


def _plain(axis: Axis) -> None:
    """Numbers without powers of ten."""
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "25" else "")
