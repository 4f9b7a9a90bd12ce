"""Curves over the strand as vector graphics, with the numbers for the reader's pointer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.libraries import own_matplotlib
from castfem.base.result_registry import probe_label
from castfem.base.shown_units import documented, plain_unit, scale_of
from castfem.post.compare.drawing import engineering
from castfem.post.compare.figures import Curve, Panel, figures
from castfem.post.compare.runs import Run
from castfem.post.plots.style import probe_colours


@dataclass(frozen=True, slots=True)
class Frame:
    """Size of a chart, and the margins of what is drawn in it, pixels."""

    width: int = 720
    height: int = 260
    left: int = 64
    right: int = 12
    top: int = 10
    bottom: int = 40


FRAME = Frame()
_DASHES = ("", "7 4", "2 3", "9 3 2 3")


@dataclass(frozen=True, slots=True)
class Series:
    """One curve."""

    label: str  #: for the legend
    colour: str  #: of the line
    dash: str  #: its pattern, empty for a full line
    x: NDArray[np.float64]  #: (n,) position, in the unit it is shown in (m)
    y: NDArray[np.float64]  #: (n,) in the unit of the chart


@dataclass(frozen=True, slots=True)
class Tick:
    """A mark of an axis: where it stands in the drawing, and its number."""

    place: float
    text: str


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves over the position below the meniscus, ready to be drawn."""

    title: str  #: of the figure
    label: str  #: of its vertical axis, with unit
    lines: tuple[dict[str, str], ...]  #: legend, colour, dash and path (SVG) of each curve
    across: tuple[Tick, ...]  #: marks of the position, m
    up: tuple[Tick, ...]  #: marks of the values
    #: what the pointer is told: x, and the values of each curve, None where it has none
    data: dict[str, Any]


def charts(runs: Sequence[Run]) -> list[Chart]:
    """The figures of the histories of some runs.

    Of one run the places of a quantity share a chart; of several each place has its own.
    """
    found = []
    drawn = figures(runs, runs[0], least=1)
    count = sum(len(panel.curves) for _, panels in drawn for panel in panels)
    # All curves take 1.2 MB at most, a point 30 bytes; more than 240 are not seen on 640 pixels.
    points = min(240, max(30, 1_200_000 // (30 * max(1, count))))
    for definition, panels in drawn:
        if len(runs) == 1 and definition.quantity == "heat_share":
            continue
        title = definition.title.format(base=runs[0].label)
        for unit, group in _groups(panels, points, alone=len(runs) == 1).items():
            factor, scaled = engineering(definition, next(p for p in panels if p.unit == unit))
            scale = scale_of(documented(scaled), definition.quantity)
            for place, series in group:
                name = title if not place else f"{title}: {place}"
                label = f"{definition.label} [{plain_unit(scale.unit)}]"
                curves = [replace(one, y=scale(factor * one.y)) for one in series]
                found.append(chart(name, label, curves, zero=definition.zero))
    return found


def _groups(
    panels: Sequence[Panel], points: int, *, alone: bool
) -> dict[str, list[tuple[str, tuple[Series, ...]]]]:
    """Unit to charts, each with the place it is of (empty for all) and its curves."""
    found: dict[str, list[tuple[str, tuple[Series, ...]]]] = {}
    if not alone:
        colours = list(probe_colours([f"run {i}" for i in range(8)]).values())
        for panel in panels:
            runs = tuple(
                _series(
                    curve, curve.run.label, colours[i % 8], _DASHES[i // 8 % len(_DASHES)], points
                )
                for i, curve in enumerate(panel.curves)
            )
            where = _place(panel.place)
            found.setdefault(panel.unit, []).append((where, runs))
        return found
    colours_of = probe_colours([panel.place for panel in panels])
    together: dict[str, list[Series]] = {}
    for panel in panels:
        label = _place(panel.place) or "strand"
        one = _series(panel.curves[0], label, colours_of[panel.place], "", points)
        together.setdefault(panel.unit, []).append(one)
    return {unit: [("", tuple(series))] for unit, series in together.items()}


def _place(place: str) -> str:
    """A place in words; the extremes of a section as such."""
    return {"max": "largest", "min": "smallest"}.get(place, probe_label(place) if place else "")


def _series(curve: Curve, label: str, colour: str, dash: str, points: int) -> Series:
    """A curve, thinned to so many points; its ends and extremes stay."""
    x, y = np.asarray(curve.position, float), np.asarray(curve.values, float)
    x = scale_of("m", "position")(x)
    if len(x) > points:
        kept = np.unique(np.linspace(0, len(x) - 1, points).round().astype(int))
        if np.isfinite(y).any():
            kept = np.union1d(kept, [np.nanargmin(y), np.nanargmax(y)])
        x, y = x[kept], y[kept]
    return Series(label, colour, dash, x, y)


def chart(title: str, label: str, series: Sequence[Series], *, zero: bool) -> Chart:
    """Lay curves out on one pair of axes."""
    x = np.concatenate([one.x for one in series])
    y = np.concatenate([one.y[np.isfinite(one.y)] for one in series])
    left, right = _span(float(x.min()), float(x.max()))
    low, high = float(y.min(initial=np.inf)), float(y.max(initial=-np.inf))
    if not math.isfinite(low):
        low = high = 0.0
    low, high = _span(min(low, 0.0) if zero else low, high)
    across, up = marks(left, right), marks(low, high)
    low, high = min(low, up[0]), max(high, up[-1])

    inner_width = FRAME.width - FRAME.left - FRAME.right
    inner_height = FRAME.height - FRAME.top - FRAME.bottom

    def place_x(value: float) -> float:
        return FRAME.left + inner_width * (value - left) / (right - left)

    def place_y(value: float) -> float:
        return FRAME.height - FRAME.bottom - inner_height * (value - low) / (high - low)

    return Chart(
        title,
        label,
        tuple(
            {"label": s.label, "colour": s.colour, "dash": s.dash, "path": path}
            for s, path in ((s, _path(s, place_x, place_y)) for s in series)
        ),
        ticks([v for v in across if left <= v <= right], place_x),
        ticks(up, place_y),
        {
            "x": [left, right], "y": [low, high],
            "curves": [{"x": _rounded(s.x), "y": _rounded(s.y)} for s in series],
        },
    )  # fmt: skip


def ticks(values: Sequence[float], place: Callable[[float], float]) -> tuple[Tick, ...]:
    """Marks with as many digits as tell one from the next."""
    texts = next(
        texts
        for digits in range(4, 15 + 1)
        if len(set(texts := [f"{value:.{digits}g}" for value in values])) == len(values)
        or digits == 15
    )
    return tuple(Tick(place(value), text) for value, text in zip(values, texts, strict=True))


def _span(low: float, high: float) -> tuple[float, float]:
    """Two limits that differ."""
    if high - low > 1e-12 * max(abs(low), abs(high)):
        return low, high
    return low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)


def marks(low: float, high: float, most: int = 6) -> list[float]:
    """Round numbers from below `low` to beyond `high`, with at most so many steps."""
    own_matplotlib()
    from matplotlib.ticker import MaxNLocator

    return [float(v) for v in MaxNLocator(most).tick_values(low, high)]


def _path(series: Series, place_x: Any, place_y: Any) -> str:
    """A curve as an SVG path, interrupted where it has no value."""
    words, drawing = [], False
    for x, y in zip(series.x, series.y, strict=True):
        if not math.isfinite(y):
            drawing = False
            continue
        words.append(f"{'L' if drawing else 'M'}{place_x(x):.1f} {place_y(y):.1f}")
        drawing = True
    return "".join(words)


def _rounded(values: NDArray[np.float64]) -> list[float | None]:
    """Values with five digits for the pointer; None where there is none."""
    return [float(f"{v:.5g}") if math.isfinite(v) else None for v in values]
