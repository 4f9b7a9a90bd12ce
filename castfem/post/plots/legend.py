"""Legends that hide no curve: below all panels, or where there is room in a panel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend


def low_legend(figure: Figure, handles: list[Any]) -> None:
    """Gives a figure its legend below all, in as many columns as fit into its width."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    for columns in range(len(handles), 0, -1):
        options: dict[str, Any] = {"ncols": columns, "frameon": False, "columnspacing": 1.2}
        legend = figure.legend(handles=handles, loc="lower center", **options)
        box = legend.get_window_extent(canvas.get_renderer())  # type: ignore[no-untyped-call]
        if box.width <= figure.bbox.width or columns == 1:
            return
        legend.remove()


def place_legend(panel: Axes, columns: int = 2) -> None:
    """Gives a panel its legend where no curve runs: in a corner or at an edge, else above all.

    To be called when curves, limits and size of the panel are settled. Where there is no room the
    axis is made longer.
    """
    drawn = _drawn_curves(panel)
    sizes: list[tuple[float, float]] = []
    for count in range(1, columns + 1):
        legend = panel.legend(loc="upper left", ncols=count)
        width, height = _size(panel, legend)
        if sizes and width > 1.0:
            break
        sizes.append((width, height))
        for name, left, low in _spots(width, height):
            under = _heights(drawn, left, left + width)
            if not ((under > low) & (under < low + height)).any():
                legend.set_loc(name)
                return
    width, height = sizes[-1]
    highest = {  # of the curves under each upper corner
        name: float(_heights(drawn, left, left + width).max(initial=0.0))
        for name, left, _ in _spots(width, height)[:2]
    }
    name = min(highest, key=lambda corner: highest[corner])
    low, high = panel.get_ylim()
    panel.set_ylim(low, low + (high - low) * highest[name] / max(1.0 - height, 0.2))
    panel.legend(loc=name, ncols=len(sizes))


def _spots(width: float, height: float) -> list[tuple[str, float, float]]:
    """Where a legend may stand, the best first: its name, left and lower end of its room."""
    across = {"left": 0.0, "right": 1.0 - width, "center": 0.5 * (1.0 - width)}
    up = {"upper": 1.0 - height, "lower": 0.0, "center": 0.5 * (1.0 - height)}
    both = [(h, v) for h in ("left", "right", "center") for v in ("upper", "lower", "center")]
    both.sort(key=lambda spot: (spot[0] == "center") + 2 * (spot[1] == "center"))
    both.sort(key=lambda spot: spot[1] != "upper" if "center" not in spot else 2)
    names = {("center", "center"): "center"}
    return [(names.get((h, v), f"{v} {h}"), across[h], up[v]) for h, v in both]


def _heights(
    drawn: list[tuple[NDArray[np.float64], NDArray[np.float64]]], left: float, right: float
) -> NDArray[np.float64]:
    """Heights of all curves between two shares of the width."""
    found = np.concatenate([np.zeros(0), *[y[(x >= left) & (x <= right)] for x, y in drawn]])
    return found[np.isfinite(found)]


def _size(panel: Axes, legend: Legend) -> tuple[float, float]:
    """Width and height of a legend with the room around it, of those of the panel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = panel.figure.get_figure(root=True)
    assert figure is not None
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    box = legend.get_window_extent(canvas.get_renderer())  # type: ignore[no-untyped-call]
    around, room = panel.get_window_extent(), 0.2 * figure.dpi  # inches in all
    return float((box.width + room) / around.width), float((box.height + room) / around.height)


def _drawn_curves(panel: Axes) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The curves of a panel as shares of its width and height, close points on each."""
    grid = np.linspace(0.0, 1.0, 401, dtype=np.float64)
    found = []
    for line in panel.lines:
        path = np.asarray(line.get_xydata(), dtype=np.float64)
        inside = panel.transAxes.inverted().transform(line.get_transform().transform(path))
        if len(inside) and (np.diff(inside[:, 0]) >= 0.0).all():
            y = np.interp(grid, inside[:, 0], inside[:, 1], left=np.nan, right=np.nan)
            found.append((grid, np.asarray(y, dtype=np.float64)))
    return found
