"""The figures of a comparison, as data, and their drawing.

A column is named `quantity_place`: `shell_mid_face`. Columns of one quantity make one figure with a
panel for each place. A quantity without an entry in `FIGURES` is drawn under its own name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas

from castfem.base.result_registry import AT_FRACTION, probe_label
from castfem.base.shown_units import plain_unit
from castfem.post.compare.runs import Run
from castfem.post.compare.sections import draw_sections
from castfem.post.plots.along_strand import rate_of
from castfem.post.plots.history import open_front, prefix_for
from castfem.post.plots.style import STYLE, Abscissa, dress, look, new_panels, save
from castfem.runs.results.labels import beside_wall

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_PLACES = ("mid_face", "narrow_face", "corner", "max", "min", "mean", "core")
_LAST = ("max", "min", "mean")  # suffixes that are not places: their panels come after the others
_NOT_DRAWN = ("time", "position", "step", "cooling_power", "penetration", "solidus_cell")
_FRONTS = ("shell", "liquidus_depth")
_NOT_DRAWN_ENDINGS = ("error", "newton", "iterations", "newton_mechanics")


@dataclass(frozen=True, slots=True)
class Definition:
    """Names of a figure."""

    quantity: str  #: prefix of the names of its columns; also the name of its file
    title: str  #: title of the figure
    label: str  #: label of its axes, without unit
    zero: bool = False  #: whether the axis begins at zero
    #: names of the largest and the smallest value of the section
    extremes: tuple[str, str] = ("largest", "smallest")
    span: float = 0.0  #: smallest span of the axis, in the drawn unit: less is rounding


_HOTTEST = ("highest", "lowest")
FIGURES = (
    Definition("surface_temperature", "Surface temperature", "temperature"),
    Definition("temperature", "Temperature of the section", "temperature", extremes=_HOTTEST),
    Definition("shell", "Shell: depth of the solidus below the surface", "shell", zero=True),
    Definition("liquidus_depth", "Depth of the liquidus below the surface", "depth", zero=True),
    Definition("heat_flux", "Heat flux out of the surface", "heat flux", zero=True),
    Definition("heat_rate", "Heat leaving the strand", "heat leaving", zero=True),
    Definition("heat_removed", "Heat removed since the meniscus", "heat removed", zero=True),
    Definition("heat_share", "Heat removed since the meniscus, {base} = 100 %", "share", span=1.0),
    Definition("von_mises", "Von Mises stress", "stress", zero=True),
    Definition("stress", "Stress", "stress"),
    Definition("displacement", "Displacement of the surface, outwards", "displacement"),
    Definition("size", "Size of the section", "size"),
    Definition("gap", "Gap between strand and mould", "gap", zero=True, span=STYLE.gap),
    Definition("contact_pressure", "Contact pressure", "pressure", True, _HOTTEST),
    Definition(
        "mean_contact_pressure", "Contact pressure, mean over 5 mm", "pressure", True, _HOTTEST
    ),
    Definition("contact_share", "Share of the surface in contact", "share", True, span=1.0),
    Definition("contact_sticking", "Share of the surface that sticks", "share", True, span=1.0),
    Definition("axial_strain", "Axial strain", "strain"),
    Definition("axial_stress", "Axial stress at the surface", "stress"),
    Definition("effort", "Axial effort between rolls and drives", "effort"),
    Definition("axial_force", "Axial force, modelled part", "force"),
    Definition("friction_force", "Friction on the modelled part", "force per length"),
    Definition("mould_friction", "Friction of the mould on the strand", "force per length"),
    Definition("mould_pull", "Withdrawal resistance of the mould", "force"),
    Definition("friction_pull", "Accumulated friction", "force"),
)


@dataclass(frozen=True, slots=True)
class Curve:
    """A column of one run."""

    run: Run  #: the run
    position: np.ndarray  #: (n,) below the meniscus, m
    values: np.ndarray  #: (n,) in the unit of the panel


@dataclass(frozen=True, slots=True)
class Panel:
    """One place of a figure."""

    place: str  #: "mid_face", or ""
    unit: str  #: unit of the values
    curves: tuple[Curve, ...]  #: one per run


def figures(
    runs: Sequence[Run], base: Run, *, least: int = 2
) -> list[tuple[Definition, list[Panel]]]:
    """Return the figures of the columns that several runs have, each with its panels.

    Runs without a history are left out; an idealised mould is left out of the figure of the gap.

    Args:
        runs: In the order of the curves.
        base: Run whose heat is 100 %.
        least: Number of runs that must have a column.
    """
    tables = {id(run): history for run in runs if (history := run.history()) is not None}
    drawn = [run for run in runs if id(run) in tables]
    if len(drawn) < least:
        return []
    for run in drawn:
        _derive(tables[id(run)], tables.get(id(base)))
    names = dict.fromkeys(str(name) for run in drawn for name in tables[id(run)].columns)
    grouped: dict[str, list[Panel]] = {}
    for column in names:
        quantity, place = parts(column, list(names))
        if quantity in _NOT_DRAWN or column.endswith(_NOT_DRAWN_ENDINGS):
            continue
        having = {id(run): t for run in drawn if column in (t := tables[id(run)])}
        units = {str(t.attrs["units"][column]) for t in having.values()}
        if len(having) < least or len(units) > 1:
            continue
        if any(t[column].isna().all() for t in having.values()):
            continue
        front = quantity in _FRONTS or AT_FRACTION.fullmatch(column) is not None
        curves = tuple(
            Curve(run, t["position"].to_numpy(), open_front(v) if front else v)
            for run in drawn
            if (t := having.get(id(run))) is not None
            for v in (t[column].to_numpy(),)
        )
        if _vary(curves, units):
            grouped.setdefault(quantity, []).append(Panel(place, units.pop(), curves))
    return _ordered(grouped)


def parts(column: str, columns: Sequence[str]) -> tuple[str, str]:
    """Return quantity and place of a column; places are those with a temperature."""
    probes = [c.removeprefix("surface_temperature_") for c in columns]
    places = {p for p, c in zip(probes, columns, strict=True) if p != c} | set(_PLACES)
    for place in sorted(places, key=len, reverse=True):
        if column.endswith(f"_{place}"):
            return column.removesuffix(f"_{place}"), place
    return column, ""


def _vary(curves: Sequence[Curve], units: Set[str]) -> bool:
    """Whether the curves show any variation.

    A core that stays liquid, a force that is rounding or a fraction that is zero show none; but a
    shell that has not begun or a gap that stays closed is a result.
    """
    values = np.concatenate([curve.values for curve in curves])
    values = values[np.isfinite(values)]
    largest = float(np.abs(values).max(initial=0.0))
    if units & {"kN", "kN/m"}:
        return largest > STYLE.force
    if largest == 0.0:
        return len(values) > 0 and "mm" in units
    return float(np.ptp(values)) > 1e-6 * largest  # otherwise constant and equal in all runs


def _ordered(grouped: dict[str, list[Panel]]) -> list[tuple[Definition, list[Panel]]]:
    """Return the known figures in their order, then the others."""
    known = {d.quantity: d for d in FIGURES}
    names = [name for name in known if name in grouped]
    names += [name for name in grouped if name not in known]
    found = []
    for name in names:
        plain = name.replace("_", " ")
        definition = known.get(name, Definition(name, plain.capitalize(), plain))
        if name.startswith("fs") and name[2:].isdigit():
            title = f"Depth below the surface to fs = {int(name[2:]) / 100:g}"
            definition = Definition(name, title, "depth", zero=True)
        panels = sorted(grouped[name], key=lambda panel: panel.place in _LAST)
        found.append((definition, _different(panels)))
    return found


def _alike(one: Panel, other: Panel) -> bool:
    """Whether the same runs have indistinguishable curves."""
    if [id(c.run) for c in one.curves] != [id(c.run) for c in other.curves]:
        return False
    for mine, theirs in zip(one.curves, other.curves, strict=True):
        finite = theirs.values[np.isfinite(theirs.values)]
        unseen = 2e-3 * float(np.ptp(finite)) if len(finite) else 0.0
        if not np.allclose(mine.values, theirs.values, rtol=0.0, atol=unseen, equal_nan=True):
            return False
    return True


def _different(panels: list[Panel]) -> list[Panel]:
    """Drop panels whose curves equal earlier ones, as on the faces of a square section."""
    kept: list[Panel] = []
    for panel in panels:
        if panel.unit in (p.unit for p in kept) and any(_alike(panel, other) for other in kept):
            continue
        kept.append(panel)
    return kept


def _derive(table: pandas.DataFrame, base: pandas.DataFrame | None) -> None:
    """Add the heat flow, and the heat removed relative to the base run.

    Below the mould the largest gap is undefined, although a history has 0.
    """
    units = table.attrs["units"]
    if "gap_max" in table:
        table["gap_max"] = table["gap_max"].where(beside_wall(table))
    if "heat_removed" not in table or units["heat_removed"] != "J/m":
        return
    removed, position = np.asarray(table["heat_removed"]), np.asarray(table["position"])
    if "heat_rate" not in table:
        table["heat_rate"] = rate_of(table)
        units["heat_rate"] = "W/m"
    if base is not None and "heat_removed" in base:
        theirs = np.interp(position, base["position"], base["heat_removed"], right=np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            table["heat_share"] = np.where(theirs > 0, 100.0 * removed / theirs, np.nan)
        units["heat_share"] = "%"


_BASE_COLOUR = "#222222"
_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31")
# Each run also has its own dashes, so that hidden curves are visible through the gaps, and a print
# in grey can be read.
_DASHES: tuple[Any, ...] = ("-", (0, (7, 2)), (0, (4, 1.5, 1, 1.5)), (0, (3, 2)), (0, (1, 1.2)))
_PERCENT = ("contact_share", "contact_sticking", "axial_strain")  # fractions drawn in %


@dataclass(frozen=True, slots=True)
class Pen:
    """Style of the curves of a run: colour, dashes, and width [pt]."""

    colour: Any
    dashes: Any
    width: float


def draw(folder: Path, runs: Sequence[Run], base: Run) -> list[Path]:
    """Draw all figures for which the runs have data."""
    drawn = []
    pens = _pens(runs, base)
    with look():
        for definition, panels in figures(runs, base):
            figure = _draw_figure(definition, panels, pens, base)
            drawn.append(save(figure, folder / f"{definition.quantity}.png"))
        for name, section in draw_sections(runs, words).items():
            shaded = name in ("temperature", "shape")
            drawn.append(save(section, folder / f"section_{name}.png", shaded=shaded))
    return drawn


def words(label: str) -> str:
    """The label of a run for readers."""
    return label.replace("degC", "°C").replace("_", " ")


def _pens(runs: Sequence[Run], base: Run) -> dict[int, Pen]:
    """Black for the base run, a colour for each other; from a colour map if there are many."""
    others = [run for run in runs if run is not base]
    if len(others) <= len(_COLOURS):
        chosen: list[Any] = list(_COLOURS)
    else:
        from matplotlib import colormaps

        chosen = list(colormaps["viridis"](np.linspace(0.0, 0.92, len(others))))
    pens = {
        id(run): Pen(colour, dashes, 1.6)
        for run, colour, dashes in zip(others, chosen, cycle(_DASHES), strict=False)
    }
    return {id(base): Pen(_BASE_COLOUR, "-", 2.8), **pens}


def _draw_figure(
    definition: Definition, panels: Sequence[Panel], pens: Mapping[int, Pen], base: Run
) -> Figure:
    """One panel per place, one curve per run."""
    order = [curve.run for curve in panels[0].curves]
    longest = max(len(words(run.label)) for run in order)
    columns = 3 if longest < 30 else 2 if longest < 50 else 1
    figure, axes = new_panels(
        len(panels),
        3.4 if len(panels) == 1 else 2.1,
        above=0.28,
        below=0.1 + 0.22 * math.ceil(len(order) / columns),
    )
    abscissa = _abscissa(panels[0])
    for panel, ax in zip(panels, axes, strict=True):
        factor, unit = engineering(definition, panel)
        # The base first, so that a run that coincides with it is visible.
        for curve in sorted(panel.curves, key=lambda c: c.run is not base):
            pen = pens[id(curve.run)]
            ax.plot(
                curve.position * abscissa.scale,
                curve.values * factor,
                color=pen.colour,
                linestyle=pen.dashes,
                linewidth=pen.width,
                label=words(curve.run.label),
            )
        what = f"{definition.label} [{unit}]"
        column = f"{definition.quantity}_{panel.place}"
        ax.set_ylabel(f"{_place(definition, panel)}\n{what}" if panel.place else what, gid=column)
        if definition.zero:
            low = min(float(np.nanmin(c.values)) for c in panel.curves) * factor
            ax.set_ylim(bottom=min(0.0, low))
        _scale(ax, definition)
    _dress(axes, abscissa)
    handles = {text: line for line, text in zip(*axes[0].get_legend_handles_labels(), strict=True)}
    names = [words(run.label) for run in order]
    figure.legend(
        [handles[name] for name in names],
        names,
        loc="lower center",
        ncols=columns,
        frameon=False,
        handlelength=3.4,
    )
    title = definition.title.format(base=words(base.label))
    figure.suptitle(title, fontsize=10.5, y=1.0 - 0.1 / figure.get_size_inches()[1])
    return figure


def _scale(ax: Axes, definition: Definition) -> None:
    """Set the span of an axis, from its lower end or about its middle; plain numbers on it.

    An offset such as +1e2 beside the axis would be read as a factor, or overlooked.
    """
    ax.ticklabel_format(useOffset=False)
    low, high = ax.get_ylim()
    missing = definition.span - (high - low)
    if missing > 0.0:
        below = 0.0 if definition.zero else 0.5 * missing
        ax.set_ylim(low - below, high + missing - below)


def _place(definition: Definition, panel: Panel) -> str:
    """Title of a panel: the name of a probe, or of an extreme."""
    if panel.place in ("max", "min"):
        return definition.extremes[panel.place == "min"]
    if definition.quantity == "size" and panel.place == "corner":
        return "diagonal"
    return probe_label(panel.place)


def _dress(axes: list[Axes], abscissa: Abscissa) -> None:
    """Give the panels their x axis, with the time on top if it is the same for all runs."""
    if np.isfinite(abscissa.time).all():
        dress(axes, abscissa)
        return
    for ax in axes:
        ax.set_xlim(0.0, float(abscissa.values[-1]))
    axes[-1].set_xlabel(abscissa.label, gid="position")


def _abscissa(panel: Panel) -> Abscissa:
    """The x axis: the longest range of positions; zones and times only if all runs share them."""
    longest = max(panel.curves, key=lambda curve: curve.position[-1])
    tables = [curve.run.history() for curve in panel.curves]
    speeds = [float(t["position"].iloc[-1] / t["time"].iloc[-1]) for t in tables if t is not None]
    zones = longest.run.summary.zones
    same = all(curve.run.summary.zones[: len(zones)] == zones for curve in panel.curves)
    steady = np.ptp(speeds) <= 1e-6 * max(speeds) and all(
        np.allclose(table["position"], speeds[0] * table["time"], rtol=1e-6)
        for table in tables
        if table is not None
    )
    time = longest.position / speeds[0] if steady else np.full(len(longest.position), np.nan)
    return Abscissa(time, longest.position, zones if same else ())


def engineering(definition: Definition, panel: Panel) -> tuple[float, str]:
    """Factor and unit for the axis: joules and watts with a prefix, fractions in percent."""
    unit = plain_unit(panel.unit)
    if unit == "-" and definition.quantity in _PERCENT:
        return 100.0, "%"
    largest = max(float(np.nanmax(np.abs(curve.values))) for curve in panel.curves)
    size, prefixed = prefix_for(largest, unit)
    return 1.0 / size, prefixed
