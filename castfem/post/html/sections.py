"""The section of a run at several places of the strand: its cells, and a colour each."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ROUNDING, ZERO_CELSIUS
from castfem.base.libraries import own_matplotlib
from castfem.base.shown_units import place_said, plain_unit, scale_of
from castfem.post.html.charts import Tick, marks, ticks
from castfem.runs.output.field_files import HDF5_NAME
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import UNITS
from castfem.runs.output.summary import Summary

_SHOWN = {"temperature": "inferno", "von_mises": "viridis", "solid_fraction": "cividis"}
_SCALED = {"K": ("degC", 1.0, -ZERO_CELSIUS), "Pa": ("MPa", 1e-6, 0.0), "-": ("", 1.0, 0.0)}
_CORNERS = {"triangle": 3, "quadrilateral": 4}
_MIRRORS = {"quarter": ((1, 1), (-1, 1), (-1, -1), (1, -1)), "half": ((1, 1), (-1, 1))}


@dataclass(frozen=True, slots=True)
class Section:
    """The cells of a section, and what they show at some places."""

    box: tuple[float, float]  #: width and height of the drawing
    #: signs of x and y of the parts that make the whole section
    mirrors: tuple[tuple[int, int], ...]
    polygons: tuple[str, ...]  #: corners of each cell, as SVG has them
    #: label and marks of the axis along x, and of that along y
    axes: tuple[tuple[str, tuple[Tick, ...]], ...]
    places: tuple[str, ...]  #: positions below the meniscus, in words
    start: int  #: which of them is shown first: the mould's exit, of a run that ends there the end
    #: name, unit, limits, palette and the values of all cells and places (base64 of 16-bit numbers,
    #: 0 to 65535 between the limits)
    fields: tuple[dict[str, Any], ...]


def sections(folders: Sequence[Path]) -> list[Section | None]:
    """The sections of runs that share a page, all in one scale of colours a field.

    Returns:
        One for each run; None of one that has no fields, or too many cells for a page.
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
    """Read the section of a run, and each field as it is shown (places, cells).

    Returns:
        None if it has no fields, or too many cells for a page.
    """
    if not (folder / HDF5_NAME).is_file():
        return None
    with Fields(folder) as fields:
        names = [name for name in _SHOWN if name in fields.names and fields.centre(name) == "point"]
        # Beyond 6000 cells a page is slow; a cell takes 110 bytes, all sections 1.2 MB at most.
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
        mirrors = _MIRRORS.get(_part(fields), ((1, 1),))
        return Section(box, mirrors, polygons, axes, words, start, ()), shown


def _marks(folder: Path, end: float) -> list[float]:
    """Where a run that goes on to `end` (m) leaves its mould, and where it is solid, m."""
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
    """Size of the whole section's drawing, the cells about its middle, y upward, and its axes."""
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
    """A field as it is shown, at the chosen places a mean a cell (places, cells)."""
    unit, factor, offset = _SCALED[UNITS[name]]
    values = np.stack([fields.values(name, int(i))[corners].mean(axis=1) for i in chosen])
    found: NDArray[np.float64] = np.nan_to_num(scale_of(unit, name)(factor * values + offset))
    return found


def _field(
    name: str, values: NDArray[np.float64], low: float, high: float, start: int
) -> dict[str, Any]:
    """A field (places, cells) in a scale of colours between two limits."""
    colormaps = own_matplotlib().colormaps
    from matplotlib.colors import to_hex

    scale = scale_of(_SCALED[UNITS[name]][0], name)
    if high - low < 1e-9 * max(1.0, abs(high)):
        high = low + 1.0
    levels = np.round(65535 * (values - low) / (high - low)).astype("<u2")
    palette, shades = colormaps[_SHOWN[name]], 24
    return {
        "name": name.replace("von_mises", "von Mises stress").replace("_", " "),
        "unit": plain_unit(scale.unit),
        "low": float(f"{low:.6g}"),
        "high": float(f"{high:.6g}"),
        "ends": [f"{low:.4g}", f"{high:.4g}"],
        "palette": [to_hex(palette(i / (shades - 1))) for i in range(shades)],
        "first": [min(shades - 1, int(shades * int(level) / 65536)) for level in levels[start]],
        "values": base64.b64encode(levels.tobytes()).decode("ascii"),
    }
