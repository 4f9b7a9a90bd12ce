"""Vector graphics of the page with values at the pointer: curves along the strand, section."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ROUNDING, ZERO_CELSIUS
from castfem.base.libraries import own_matplotlib
from castfem.base.result_registry import probe_label
from castfem.base.shown_units import documented, place_said, plain_unit, scale_of
from castfem.post.compare.figures import Curve, Panel, engineering, figures
from castfem.post.compare.runs import Run
from castfem.post.plots.section import MIRRORED
from castfem.post.plots.style import probe_colours
from castfem.runs.output.field_files import HDF5_NAME
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import UNITS
from castfem.runs.output.summary_file import Summary


@dataclass(frozen=True, slots=True)
class Frame:
    """Size of a chart, and the margins of its content, pixels."""

    width: int = 720
    height: int = 260
    left: int = 64
    right: int = 12
    top: int = 10
    bottom: int = 40

    def across(self, low: float, high: float) -> Callable[[float], float]:
        """Return the mapping of values between two limits to the horizontal axis."""
        inner = self.width - self.left - self.right
        return lambda value: self.left + inner * (value - low) / (high - low)

    def up(self, low: float, high: float) -> Callable[[float], float]:
        """Return the mapping of values between two limits to the vertical axis."""
        inner = self.height - self.top - self.bottom
        return lambda value: self.height - self.bottom - inner * (value - low) / (high - low)


FRAME = Frame()
_DASHES = ("", "7 4", "2 3", "9 3 2 3")


@dataclass(frozen=True, slots=True)
class Series:
    """One curve."""

    label: str  #: label in the legend
    colour: str  #: colour of the line
    dash: str  #: dash pattern, "" for a solid line
    x: NDArray[np.float64]  #: (n,) position, in the shown unit (m)
    y: NDArray[np.float64]  #: (n,) in the unit of the chart


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick of an axis: its place in the drawing, and its number."""

    place: float
    text: str


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves over the position below the meniscus, laid out for drawing."""

    title: str  #: title of the figure
    label: str  #: label of its vertical axis, with unit
    lines: tuple[dict[str, str], ...]  #: legend, colour, dash and path (SVG) of each curve
    across: tuple[Tick, ...]  #: ticks of the position, m
    up: tuple[Tick, ...]  #: ticks of the values
    #: data for the pointer: x, and the values of each curve, None if missing
    data: dict[str, Any]


def charts(runs: Sequence[Run]) -> list[Chart]:
    """The figures of the histories of some runs.

    For one run the places of a quantity share a chart; for several each place has its own.
    """
    found = []
    drawn = figures(runs, runs[0], least=1)
    count = sum(len(panel.curves) for _, panels in drawn for panel in panels)
    # All curves together take at most 1.2 MB, at 30 bytes per point; more than 240 points are not
    # visible on 640 pixels.
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
    """Charts by unit, each with its place ("" for all) and its curves."""
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
    """A place, or an extreme of a section, as text."""
    return {"max": "largest", "min": "smallest"}.get(place, probe_label(place) if place else "")


def _series(curve: Curve, label: str, colour: str, dash: str, points: int) -> Series:
    """A curve, thinned to a number of points; its ends and extremes are kept."""
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
    place_x, place_y = FRAME.across(left, right), FRAME.up(low, high)
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
    """Ticks with enough digits to distinguish them."""
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
    """Round numbers from below `low` to beyond `high`, with at most `most` steps."""
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
    """Values with five digits for the pointer; None if missing."""
    return [float(f"{v:.5g}") if math.isfinite(v) else None for v in values]


_SHOWN = {"temperature": "inferno", "von_mises": "viridis", "solid_fraction": "cividis"}
_SCALED = {"K": ("degC", 1.0, -ZERO_CELSIUS), "Pa": ("MPa", 1e-6, 0.0), "-": ("", 1.0, 0.0)}
_CORNERS = {"triangle": 3, "quadrilateral": 4}


@dataclass(frozen=True, slots=True)
class Section:
    """The cells of a section, with fields at some positions."""

    box: tuple[float, float]  #: width and height of the drawing
    #: signs of x and y of the parts that form the whole section
    mirrors: tuple[tuple[int, int], ...]
    polygons: tuple[str, ...]  #: corners of each cell, in SVG notation
    #: label and ticks of the axis along x, and of that along y
    axes: tuple[tuple[str, tuple[Tick, ...]], ...]
    places: tuple[str, ...]  #: positions below the meniscus, as text
    start: int  #: index of the first one shown: the mould's exit; the end for a run that ends there
    #: name, unit, limits, palette and the values of all cells and positions (base64 of 16-bit
    #: numbers, 0 to 65535 between the limits)
    fields: tuple[dict[str, Any], ...]


def sections(folders: Sequence[Path]) -> list[Section | None]:
    """The sections of runs on one page, with a common colour scale for each field.

    Returns:
        One per run; None for a run without fields, or with too many cells for a page.
    """
    found = [_read(folder, len(folders)) for folder in folders]
    limits: dict[str, tuple[float, float]] = {}
    for _, values in filter(None, found):
        for name, part in values.items():
            low, high = limits.get(name, (np.inf, -np.inf))
            limits[name] = min(low, float(part.min())), max(high, float(part.max()))
    return [
        None
        if one is None
        else replace(
            one[0],
            fields=tuple(
                _field(name, part, *limits[name], one[0].start) for name, part in one[1].items()
            ),
        )
        for one in found
    ]


def _read(folder: Path, runs: int) -> tuple[Section, dict[str, NDArray[np.float64]]] | None:
    """Read the section of a run, and each field in its shown unit (positions, cells).

    Returns:
        None without fields, or with too many cells for a page.
    """
    if not (folder / HDF5_NAME).is_file():
        return None
    with Fields(folder) as fields:
        names = [name for name in _SHOWN if name in fields.names and fields.centre(name) == "point"]
        # Above 6000 cells a page is slow; a cell takes 110 bytes, all sections together at most 1.2
        # MB.
        most = min(6000, 1_200_000 // (110 * runs))
        if not names or not 0 < len(fields.cells) <= most:
            return None
        corners = fields.cells[:, : _CORNERS[fields.cell]]
        count = len(fields.times)
        places = min(max(1, 16 // runs), count)
        evenly = np.linspace(count - 1, 0, places).round().astype(int)
        states = np.asarray(fields.positions, float)
        marks = [int(np.argmin(np.abs(states - at))) for at in _marks(folder, float(states[-1]))]
        chosen = np.unique([*evenly, *marks])
        start = int(np.searchsorted(chosen, marks[0])) if marks else len(chosen) - 1
        box, polygons, axes = _drawing(fields.points[:, :2], corners, str(_part(fields)))
        shown = {name: _values(fields, name, corners, chosen) for name in names}
        positions = [float(fields.positions[i]) for i in chosen]
        words = tuple(place_said(one, near=".0f", beyond=np.inf) for one in positions)
        mirrors = MIRRORED.get(_part(fields), ((1, 1),))
        return Section(box, mirrors, polygons, axes, words, start, ()), shown


def _marks(folder: Path, end: float) -> list[float]:
    """Positions at which a run to `end` (m) leaves its mould and is completely solid, m."""
    summary = Summary.load(folder)
    if summary is None or summary.mould_exit is None or summary.mould_exit >= end:
        return []
    length = summary.quantities.get("metallurgical_length")
    solid = [] if length is None or not np.isfinite(length.value) else [length.value]
    return [summary.mould_exit, *solid]


def _part(fields: Fields) -> str:
    return str(fields.attributes.get("symmetry", "whole"))


def _drawing(
    points: NDArray[np.float64], corners: NDArray[np.int32], part: str
) -> tuple[tuple[float, float], tuple[str, ...], tuple[tuple[str, tuple[Tick, ...]], ...]]:
    """Size of the whole section's drawing, cells relative to its centre (y upwards), and axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high) * (part not in ("quarter", "half"), part != "quarter")
    half = np.abs(np.vstack([low, high]) - middle).max(axis=0)
    scale = 230.0 / half.max()
    flat = (points - middle) * scale * np.array([1.0, -1.0])
    width, height = (float(f"{2 * scale * h:.1f}") for h in half)
    polygons = (" ".join(f"{x:.1f},{y:.1f}" for x, y in flat[cell]) for cell in corners)
    shown, axes = scale_of("mm"), []
    for name, sign, at, reach in zip("xy", (1.0, -1.0), middle, half, strict=True):
        left, right = (float(shown(1e3 * end)) for end in (at - reach, at + reach))
        numbers = marks(left, right, max(2, int(2.0 * reach * scale / 46.0)))
        inside = [v for v in numbers if left - ROUNDING <= v <= right + ROUNDING]
        each, zero = sign * 2.0 * reach * scale / (right - left), 0.5 * (left + right)

        def place(value: float, each: float = each, zero: float = zero) -> float:
            return each * (value - zero)

        places = ticks(inside, place)
        axes.append((f"{name} [{plain_unit(shown.unit)}]", places))
    return (width, height), tuple(polygons), tuple(axes)


def _values(
    fields: Fields, name: str, corners: NDArray[np.int32], chosen: NDArray[np.int_]
) -> NDArray[np.float64]:
    """A field in its shown unit, averaged over each cell (chosen positions, cells)."""
    unit, factor, offset = _SCALED[UNITS[name]]
    values = np.stack([fields.values(name, int(i))[corners].mean(axis=1) for i in chosen])
    found: NDArray[np.float64] = np.nan_to_num(scale_of(unit, name)(factor * values + offset))
    return found


def palette(name: str, shades: int = 24) -> list[str]:
    """Colours of a scale, from its lower end."""
    colours = own_matplotlib().colormaps[name]
    from matplotlib.colors import to_hex

    return [to_hex(colours(i / (shades - 1))) for i in range(shades)]


def _field(
    name: str, values: NDArray[np.float64], low: float, high: float, start: int
) -> dict[str, Any]:
    """A field (positions, cells) in a colour scale between two limits."""
    scale = scale_of(_SCALED[UNITS[name]][0], name)
    if high - low < 1e-9 * max(1.0, abs(high)):
        high = low + 1.0
    levels = np.round(65535 * (values - low) / (high - low)).astype("<u2")
    shades = palette(_SHOWN[name])
    last = len(shades) - 1
    return {
        "name": name.replace("von_mises", "von Mises stress").replace("_", " "),
        "unit": plain_unit(scale.unit),
        "low": float(f"{low:.6g}"),
        "high": float(f"{high:.6g}"),
        "ends": [f"{low:.4g}", f"{high:.4g}"],
        "palette": shades,
        "first": [min(last, int(len(shades) * int(level) / 65536)) for level in levels[start]],
        "values": base64.b64encode(levels.tobytes()).decode("ascii"),
    }
