"""Figures along the strand: panels of curves as data, and their drawing.

A figure is a list of `Panel`, each with its lines; `drawn` draws it. The columns of a history for
one quantity at several probes are found by `curves`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.result_registry import find, probe_label
from castfem.base.types import Array
from castfem.post.plots.style import Abscissa, dress, new_panels, probe_colours
from castfem.runs.results.labels import has_values, probes_with, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

    from castfem.runs.output.history import Columns


@dataclass(frozen=True, slots=True)
class Line:
    """A curve."""

    values: Array  #: (n,) along the strand
    label: str = ""  #: label in the legend; "" for none
    style: Mapping[str, Any] = field(default_factory=dict)  #: options of `Axes.plot`
    band: Array | None = None  #: (n,) half width of a shaded band; None for none


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves on one pair of axes."""

    lines: Sequence[Line]  #: the curves
    label: str  #: label of the vertical axis, with unit
    name: str = ""  #: name of the column by which a chosen unit is found
    zero: bool = False  #: the axis begins at zero, unless values are clearly below
    #: start of the axis below zero, relative to its height, so that a curve at zero is visible
    below: float = 0.0
    reach: float = 0.0  #: value that the axis includes
    baseline: bool = False  #: draw a line at zero
    columns: int = 2  #: columns of the legend
    finish: Callable[[Axes], object] | None = None  #: further changes to the axes

    def draw(self, axes: Axes, abscissa: Abscissa) -> None:
        """Draw everything except the legend."""
        for line in self.lines:
            axes.plot(abscissa.values, line.values, **{"label": line.label, **line.style})
            if line.band is not None:
                edges = line.values - line.band, line.values + line.band
                shade: dict[str, Any] = {"alpha": 0.18, "linewidth": 0.0, "zorder": 1.5}
                axes.fill_between(abscissa.values, *edges, color=line.style["color"], **shade)
        if self.baseline:
            axes.axhline(0.0, color="#8a8a8a", linewidth=0.9, zorder=1)
        if self.zero:
            low, high = axes.get_ylim()
            high = max(high, self.reach)
            axes.set_ylim(low if self._is_negative() else -self.below * high, high)
        axes.set_ylabel(self.label, gid=self.name or None)
        if self.finish is not None:
            self.finish(axes)

    def _is_negative(self) -> bool:
        values = np.concatenate([line.values for line in self.lines])
        finite = values[np.isfinite(values)]
        size = float(np.abs(finite).max(initial=self.reach))
        return bool((finite < -0.02 * size).any())


def drawn(panels: Sequence[Panel], height: float, abscissa: Abscissa) -> Figure | None:
    """Panels below one another; None without any."""
    if not panels:
        return None
    figure, axes = new_panels(len(panels), height)
    for one, panel in zip(axes, panels, strict=True):
        panel.draw(one, abscissa)
    dress(axes, abscissa)
    for one, panel in zip(axes, panels, strict=True):
        if one.get_legend() is None and one.get_legend_handles_labels()[0]:
            place_legend(one, panel.columns)
    return figure


def column(table: Columns, name: str, label: str = "", **style: Any) -> list[Line]:
    """The line of a column; empty if the column is missing or has no values."""
    return [Line(np.asarray(table[name]), label, style)] if has_values(table, name) else []


def at_probes(table: Columns, prefix: str, where: str = "", **style: Any) -> list[Line]:
    """The lines of the columns `prefix_PROBE`, their labels after `where`."""
    return [
        Line(np.asarray(table[name]), f"{where}{label}", {"color": colour, **style})
        for label, colour, name in curves(table, prefix)
    ]


def axis_of(table: Columns, *names: str) -> tuple[str, str]:
    """Label of an axis and name of its column: the first existing of columns or prefixes."""
    for name in names:
        found = (
            name if has_values(table, name) else next(iter(probes_with(table, name).values()), "")
        )
        if found:
            return axis_label(table, found), found
    raise KeyError(", ".join(names))


def curves(table: Columns, prefix: str) -> list[tuple[str, str, str]]:
    """Label, colour and column of each curve `prefix_PROBE`.

    Probes with coinciding curves share one; the faces of a square are all "mid-face".
    """
    probes = probes_with(table, prefix)
    colours = probe_colours(list(probes))
    found: dict[str, list[str]] = {}  # probes that share a curve, by column
    for probe, column in probes.items():
        values = np.asarray(table[column])
        near = 2e-3 * np.ptp(values[np.isfinite(values)])
        for other, together in found.items():
            if np.allclose(table[other], values, rtol=0, atol=near, equal_nan=True):
                if (together[0], probe) != ("mid_face", "narrow_face"):
                    together.append(probe)
                break
        else:
            found[column] = [probe]
    return [
        (_listed([probe_label(probe) for probe in together]), colours[together[0]], column)
        for column, together in found.items()
    ]


def _listed(names: list[str]) -> str:
    """Names as in a sentence; the first stands for more than three."""
    if len(names) > 3:
        return f"{names[0]} and {len(names) - 1} others"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def open_front(depth: Array) -> Array:
    """Return the depths of a front without those of a closed liquid core.

    Where the core closes, the whole distance from a face to the middle becomes solid at once: the
    depth jumps to half the section, on the narrow face of a slab from some 100 to 700 mm, which has
    no meaning for the shell and hides the rest. A front that moves continuously to the middle is
    kept. The middle of a strained section moves by one or two per cent.

    Args:
        depth: Depth at one place from the top down (rows,); NaN where there is none.
    """
    known = np.flatnonzero(np.isfinite(depth))
    values = depth[known]
    same = int(np.argmax(values[::-1] < 0.98 * values[-1:])) if known.size else 0
    # a single row, or rows after one without a shell, may be the first shell
    if same < 2 or not 0.05 < values[-same - 1] / values[-1] < 0.8:
        return depth
    found = depth.copy()
    found[known[-same:]] = np.nan
    return found


def prefix_for(largest: float, unit: str) -> tuple[float, str]:
    """Divisor and unit for a range of values: joules and watts with a prefix."""
    if unit.startswith(("J", "W")):
        for size, prefix in ((1e6, "M"), (1e3, "k")):
            if largest >= size:
                return size, prefix + unit
    return 1.0, unit


def axis_label(table: Columns, name: str) -> str:
    """Label of a column with its unit, for the axis of a figure."""
    known = find(name)
    label = name.replace("_", " ") if known is None else known[0].axis_label
    return f"{label} [{unit_of(table, name)}]"


def low_legend(figure: Figure, handles: list[Any]) -> None:
    """Put the legend of a figure below everything, in as many columns as fit."""
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
    """Put the legend of a panel where there is no curve: in a corner or at an edge, else above all.

    Call this when curves, limits and size of the panel are final. Without room the axis is
    extended.
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
    highest = {  # largest height of the curves below each upper corner
        name: float(_heights(drawn, left, left + width).max(initial=0.0))
        for name, left, _ in _spots(width, height)[:2]
    }
    name = min(highest, key=lambda corner: highest[corner])
    low, high = panel.get_ylim()
    panel.set_ylim(low, low + (high - low) * highest[name] / max(1.0 - height, 0.2))
    panel.legend(loc=name, ncols=len(sizes))


def _spots(width: float, height: float) -> list[tuple[str, float, float]]:
    """Possible places of a legend, the best first: name, left and lower end of its room."""
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
    """Heights of all curves between two fractions of the width."""
    found = np.concatenate([np.zeros(0), *[y[(x >= left) & (x <= right)] for x, y in drawn]])
    return found[np.isfinite(found)]


def _size(panel: Axes, legend: Legend) -> tuple[float, float]:
    """Width and height of a legend including its margin, relative to the panel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = panel.figure.get_figure(root=True)
    assert figure is not None
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    box = legend.get_window_extent(canvas.get_renderer())  # type: ignore[no-untyped-call]
    around, room = panel.get_window_extent(), 0.2 * figure.dpi  # inches in total
    return float((box.width + room) / around.width), float((box.height + room) / around.height)


def _drawn_curves(panel: Axes) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The curves of a panel relative to its width and height, as dense points."""
    grid = np.linspace(0.0, 1.0, 401, dtype=np.float64)
    found = []
    for line in panel.lines:
        path = np.asarray(line.get_xydata(), dtype=np.float64)
        inside = panel.transAxes.inverted().transform(line.get_transform().transform(path))
        if len(inside) and (np.diff(inside[:, 0]) >= 0.0).all():
            y = np.interp(grid, inside[:, 0], inside[:, 1], left=np.nan, right=np.nan)
            found.append((grid, np.asarray(y, dtype=np.float64)))
    return found
