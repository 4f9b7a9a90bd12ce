"""The page of a caster: its strand over time with a slider, its results, its pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.atomic_files import write_text
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.result_registry import probe_label
from castfem.base.shown_units import place_said, plain_unit, said, scale_of, shown_in
from castfem.base.table import pairs
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.machine import thickness_of
from castfem.model.shipped_cases import CASE_NAME
from castfem.physics.machine.side import Side
from castfem.post.html.graphics import FRAME, marks, palette, ticks
from castfem.post.html.page import case_text, json_of, provenance, template, text_of
from castfem.post.plots.caster_figures import SURFACE, mapped
from castfem.post.plots.style import probe_colours
from castfem.post.report.caster import answers
from castfem.post.report.show import how_it_ended
from castfem.runs.caster.files import definition, read_table
from castfem.runs.output.folder import (
    CASTER_FIGURES,
    CASTER_NAME,
    FIGURES_NAME,
    STRAND_ROWS_NAME,
)
from castfem.runs.output.run_record import RunRecord

_INSTANTS, _PIECES = 240, 160
"""Largest numbers on a page: output times, and pieces of the strand in side view."""
_WIDE = 520.0  # width of the side view, pixels


@dataclass(frozen=True, slots=True)
class Panel:
    """A chart of one quantity along the strand, whose curves follow the slider."""

    title: str  #: title of the chart, with its unit
    curves: tuple[tuple[str, str, str], ...]  #: column, legend and colour of each curve
    up: Any  #: ticks of the values
    limits: tuple[float, float]  #: limits of the values
    band: tuple[float, float] | None  #: range of low ductility


def write_caster(folder: Path, target: Path) -> Path:
    """Write the page of a caster, one file without external links."""
    case = load_case(folder / CASE_NAME)
    with shown_in(case.shown_units):
        text = template("caster.html.j2").render(_content(folder, case))
    write_text(target, text, durable=False)
    return target


def _content(folder: Path, case: Case) -> dict[str, Any]:
    caster, _, words = read_table(folder / CASTER_NAME)
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    shown = _in_shown_units(mapped(strand, case.mould_exit() or 0.0))
    panels = list(_panels(shown, case))
    length, along = case.casting.length, scale_of("m", "position")
    across = marks(0.0, float(along(length)))
    count = len(caster["time"])
    chosen = np.unique(np.linspace(0, count - 1, min(count, _INSTANTS)).round().astype(int))
    instants = [
        _instant(strand, shown, float(caster["time"][i]), float(along(1.0))) for i in chosen
    ]
    heads = [
        _said(caster, words.get("event", [""] * count), int(before), int(i))
        for before, i in zip([-1, *chosen], chosen, strict=False)
    ]
    ends = caster["metallurgical_length"][chosen]
    pool = [_rounded(along(value)) for value in ends]
    data = {
        "instants": instants, "heads": heads, "pool": pool, "length": float(along(length)),
        "panels": [{"names": [c[0] for c in p.curves], "limits": p.limits} for p in panels],
        "palette": palette("inferno"),
    }  # fmt: skip
    record = RunRecord.load(folder)
    return {
        "title": case.title, "status": how_it_ended(record), "css": text_of("report.css"),
        "script": text_of("caster.js"), "answers": answers(folder, case), "panels": panels,
        # the longest liquid core
        "heads": heads, "begin": int(np.argmax(np.nan_to_num(ends, nan=-1.0))),
        "across": ticks(
            [v for v in across if v <= along(length)], FRAME.across(0.0, float(along(length)))
        ),
        "along": plain_unit(along.unit), "size": FRAME, "side": _side_view(case),
        "data": json_of(data), "pictures": list(_pictures(folder)),
        "provenance": pairs(provenance(folder, record)), "case": case_text(folder),
    }  # fmt: skip


def _in_shown_units(columns: dict[str, Array]) -> dict[str, Array]:
    """Columns in the shown units; reheating stays in K."""
    found = {}
    for name, values in columns.items():
        known = None if name.startswith("reheating_") else definition(name)[0]
        found[name] = values if known is None else scale_of(known.unit, name)(values)
    return found


def _panels(shown: dict[str, Array], case: Case) -> Iterator[Panel]:
    """The surface temperatures in one chart, each other quantity in its own."""
    surfaces = [name for name in shown if name.startswith(SURFACE)]
    groups = [surfaces, *([name] for name in shown if name not in surfaces)]
    places = {name: name.removeprefix(SURFACE) for name in surfaces}
    colours = probe_colours(list(places.values()))
    for names in groups:
        found, probe = definition(names[0].replace("reheating_", SURFACE))
        unit = "K" if names[0].startswith("reheating_") else scale_of(found.unit, names[0]).unit
        label = "surface temperature" if names is surfaces else found.result(0.0, probe).label
        label = f"reheating: {label}" if names[0].startswith("reheating_") else label
        values = np.concatenate([shown[name][np.isfinite(shown[name])] for name in names])
        low, high = float(values.min(initial=0.0)), float(values.max(initial=1e-9))
        if names is surfaces:
            low = float(values.min())
        up = marks(low, high)
        limits = (up[0], up[-1])
        band = None
        if names is surfaces:
            scale = scale_of("degC", "surface_temperature")
            ends = (scale(t - ZERO_CELSIUS) for t in case.brittle_band)
            band = _places_up(ends, limits)
        curves = tuple(
            (name, probe_label(places[name]) if name in places else "", colours[places[name]])
            if name in places
            else (name, "", "#1d2733")
            for name in names
        )
        title = f"{label} [{plain_unit(unit)}]" if plain_unit(unit) else label
        yield Panel(title, curves, ticks(up, FRAME.up(*limits)), limits, band)


def _places_up(ends: Any, limits: tuple[float, float]) -> tuple[float, float]:
    """Top and bottom of a band in the drawing."""
    low, high = (float(np.clip(end, *limits)) for end in ends)
    place = FRAME.up(*limits)
    return float(place(high)), float(place(low))


def _instant(
    strand: dict[str, Array], shown: dict[str, Array], now: float, metre: float
) -> dict[str, list[float | None]]:
    """The strand at one time: positions, and each quantity there."""
    rows = np.flatnonzero(strand["clock"] == now)
    rows = rows[np.argsort(strand["position"][rows])]
    found = {"x": [_rounded(metre * value) for value in strand["position"][rows]]}
    return found | {name: [_rounded(v) for v in values[rows]] for name, values in shown.items()}


def _said(caster: dict[str, Array], events: list[str], before: int, i: int) -> str:
    """Text on one time, with the events since the previous one."""
    pool = float(caster["metallurgical_length"][i])
    parts = [
        f"{float(caster['time'][i]) / 60.0:.4g} min by the clock",
        f"cast at {said(float(caster['speed'][i]), 'm/min', '.3g')}",
        f"the pool ends at {place_said(pool)}" if np.isfinite(pool) else "no end of the pool",
        *filter(None, events[before + 1 : i + 1]),
    ]
    return "; ".join(parts)


def _side_view(case: Case) -> dict[str, Any] | None:
    """The strand in its machine: pieces with their positions; None without rolls."""
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if rolls is None or thickness is None:
        return None
    side, length = Side(rolls, thickness, case.casting.length), case.casting.length
    ends = [float(end) for end in np.linspace(0.0, length, _PIECES + 1)]
    outlines = [side.part(a, b)[:, :2] for a, b in pairwise(ends)]
    corners = np.concatenate(outlines)
    low, span = corners.min(axis=0), np.ptp(corners, axis=0)
    scale = _WIDE / float(span.max())

    def text(points: Array) -> str:
        drawn = (points - low) * scale
        return " ".join(f"{x:.1f},{span[1] * scale - y:.1f}" for x, y in drawn)

    metre = scale_of("m", "position")
    return {
        "width": float(span[0] * scale), "height": float(span[1] * scale),
        "pieces": [text(outline) for outline in outlines],
        "at": [_rounded(metre(0.5 * (a + b))) for a, b in pairwise(ends)],
    }  # fmt: skip


def _pictures(folder: Path) -> Iterator[str]:
    for name in CASTER_FIGURES:
        path = folder / FIGURES_NAME / f"{name}.png"
        if path.is_file():
            yield base64.b64encode(path.read_bytes()).decode("ascii")


def _rounded(value: Any) -> float | None:
    return float(f"{float(value):.4g}") if np.isfinite(value) else None
