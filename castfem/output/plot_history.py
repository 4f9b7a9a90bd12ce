"""Figures along the strand: surface temperatures, shell, heat and the march itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from castfem.output.plot_section import Steel
from castfem.output.plot_tensile import draw_tensile
from castfem.output.style import (
    CELSIUS,
    LIQUIDUS_COLOUR,
    SOLIDUS_COLOUR,
    Course,
    dress,
    new_figure,
    probe_colours,
    probe_label,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 7.2  # inches
_THERMAL, _MECHANICAL = "#0072b2", "#d55e00"
_NO_PROBES = ("min", "max")  # ends of names of columns over the whole section
_MANY = 150  # steps; their Newton iterations would blacken a line plot


def probes_with(table: pandas.DataFrame, prefix: str) -> dict[str, str]:
    """Probe to column, of the columns `prefix_PROBE` that hold any number."""
    return {
        name[len(prefix) + 1 :]: name
        for name in map(str, table.columns)
        if name.startswith(f"{prefix}_")
        and name[len(prefix) + 1 :] not in _NO_PROBES
        and table[name].notna().any()
    }


def curves(table: pandas.DataFrame, prefix: str) -> list[tuple[str, str, str]]:
    """Label, colour and column of each curve `prefix_PROBE`.

    Probes whose curves would hide one another, as at the faces of a square, share one.
    """
    probes = probes_with(table, prefix)
    colours = probe_colours(list(probes))
    found: list[tuple[str, str, str]] = []
    for probe, column in probes.items():
        values = table[column].to_numpy()
        near = 2e-3 * np.ptp(values[np.isfinite(values)])
        for i, (label, colour, other) in enumerate(found):
            if np.allclose(table[other], values, rtol=0, atol=near, equal_nan=True):
                found[i] = (f"{label} and {probe_label(probe)}", colour, other)
                break
        else:
            found.append((probe_label(probe), colours[probe], column))
    return found


def draw_surface_temperature(
    table: pandas.DataFrame, course: Course, steel: Steel | None
) -> Figure | None:
    """Surface temperature at the probes, and in the core."""
    surfaces = curves(table, "surface_temperature")
    if not surfaces:
        return None
    figure = new_figure(_WIDTH, 4.4)
    axes = figure.add_subplot()
    for probe, colour, column in surfaces:
        label = probe if probe == "surface" else f"surface, {probe}"
        axes.plot(course.abscissa, table[column], color=colour, label=label)
    if "temperature_core" in table and table["temperature_core"].notna().any():
        core = table["temperature_core"]
        axes.plot(course.abscissa, core, color="#444444", linestyle=":", label="core")
    if steel is not None:
        for name, level, colour in (
            ("liquidus", steel.liquidus, LIQUIDUS_COLOUR),
            ("solidus", steel.solidus, SOLIDUS_COLOUR),
        ):
            axes.axhline(
                level - CELSIUS,
                color=colour,
                linewidth=0.9,
                linestyle="--",
                label=f"{name} {level - CELSIUS:.1f} °C",
            )
    axes.set_ylabel(f"temperature [{unit_of(table, surfaces[0][2])}]")
    dress([axes], course)
    axes.legend(loc="best")
    return figure


def draw_shell(table: pandas.DataFrame, course: Course, steel: Steel | None) -> Figure | None:
    """Depth of the solidus and of the liquidus below the surface at the probes."""
    solid, liquid = curves(table, "shell"), curves(table, "liquidus_depth")
    if not solid and not liquid:
        return None
    figure = new_figure(_WIDTH, 4.4)
    axes = figure.add_subplot()
    for lines, kind, style in ((solid, "solidus (shell)", "-"), (liquid, "liquidus", "--")):
        for probe, colour, column in lines:
            label = f"{probe}, {kind}"
            axes.plot(course.abscissa, table[column], color=colour, linestyle=style, label=label)
    axes.set_ylim(bottom=0.0)
    unit = unit_of(table, [*solid, *liquid][0][2])
    axes.set_ylabel(f"depth below the surface [{unit}]")
    dress([axes], course)
    axes.legend(loc="upper left", ncols=2 if len(solid) + len(liquid) > 3 else 1)
    return figure


def draw_heat(table: pandas.DataFrame, course: Course, steel: Steel | None) -> Figure | None:
    """Heat flux at the probes; heat leaving the strand and all that has left it."""
    fluxes = curves(table, "heat_flux")
    totals = _totals(table)
    panels = bool(fluxes) + bool(totals)
    if not panels:
        return None
    figure = new_figure(_WIDTH, 1.2 + 2.7 * panels)
    axes = list(figure.subplots(panels, 1, sharex=True, squeeze=False)[:, 0])
    if fluxes:
        for label, colour, column in fluxes:
            axes[0].plot(course.abscissa, table[column], color=colour, label=label)
        axes[0].set_ylabel(f"heat flux [{unit_of(table, fluxes[0][2])}]")
        axes[0].legend(loc="best")
    dress(axes, course)
    if totals:
        _draw_totals(axes[-1], course, totals)
    return figure


def draw_steps(table: pandas.DataFrame, course: Course, steel: Steel | None) -> Figure | None:
    """Time step, Newton iterations, errors of energy and forces, penetration of a mould."""
    found = [
        (draw, [name for name in names if has_values(table, name)])
        for draw, names in (
            (_draw_step, ("step",)),
            (_draw_newton, ("newton", "newton_mechanics")),
            (_draw_errors, ("energy_error", "force_error")),
            (_draw_penetration, ("penetration",)),
        )
    ]
    panels = [(draw, names) for draw, names in found if names]
    if not panels:
        return None
    figure = new_figure(_WIDTH, 1.2 + 1.7 * len(panels))
    axes = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
    for panel, (draw, names) in zip(axes, panels, strict=True):
        draw(panel, table, course, names)
        if any(name.endswith(("mechanics", "force_error")) for name in names):
            panel.legend(loc="best", ncols=2)
    dress(axes, course)
    return figure


def _draw_step(panel: Axes, table: pandas.DataFrame, course: Course, names: list[str]) -> None:
    """The time step."""
    values = table[names[0]].to_numpy()
    panel.step(course.abscissa, values, where="pre", color=_THERMAL, linewidth=1.2)
    _log_scale(panel, values)
    panel.set_ylabel(f"time step [{unit_of(table, names[0])}]")


def _draw_newton(panel: Axes, table: pandas.DataFrame, course: Course, names: list[str]) -> None:
    """Newton iterations of the temperature and of the mechanics."""
    from matplotlib.ticker import MaxNLocator

    for name in names:
        mechanical = name.endswith("mechanics")
        colour = _MECHANICAL if mechanical else _THERMAL
        values = table[name].to_numpy()
        label = "mechanics" if mechanical else "temperature"
        if len(values) > _MANY:
            panel.plot(course.abscissa, values, ".", color=colour, markersize=2.5, label=label)
        else:
            panel.step(
                course.abscissa, values, where="pre", color=colour, linewidth=1.0, label=label
            )
    panel.set_ylim(0, np.nanmax(table[names].to_numpy()) + 1)
    panel.yaxis.set_major_locator(MaxNLocator("auto", integer=True))
    panel.set_ylabel("Newton\niterations [-]")


def _draw_errors(panel: Axes, table: pandas.DataFrame, course: Course, names: list[str]) -> None:
    """How far energy and forces are out of balance; what is exact is left out."""
    for name in names:
        forces = name == "force_error"
        size = np.abs(table[name].to_numpy())
        panel.plot(
            course.abscissa,
            np.where(size == 0, np.nan, size),
            ".",
            color=_MECHANICAL if forces else _THERMAL,
            markersize=2.5,
            label="forces" if forces else "energy",
        )
    panel.set_yscale("log")
    panel.set_ylabel("relative error [-]" if len(names) > 1 else f"{_ERRORS[names[0]]} [-]")


_ERRORS = {
    "energy_error": "relative error of\nthe energy",
    "force_error": "relative error of\nthe forces",
}


def _draw_penetration(
    panel: Axes, table: pandas.DataFrame, course: Course, names: list[str]
) -> None:
    """How deep the surface lies in the wall."""
    panel.plot(course.abscissa, table[names[0]], color=_MECHANICAL, linewidth=1.2)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(f"largest\npenetration [{unit_of(table, names[0])}]")


def _totals(table: pandas.DataFrame) -> dict[str, tuple[np.ndarray, str]]:
    """Label to values and unit of the heat leaving the strand and of all that has left it.

    The former is taken from what left it over each step, unless there is a column of its own.
    """
    found = {}
    if has_values(table, "heat_rate"):
        found["heat leaving the strand"] = (
            table["heat_rate"].to_numpy(),
            unit_of(table, "heat_rate"),
        )
    elif has_values(table, "heat_removed") and unit_of(table, "heat_removed") == "J/m":
        time, removed = table["time"].to_numpy(), table["heat_removed"].to_numpy()
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.diff(removed) / np.diff(time)
        found["heat leaving the strand"] = (np.concatenate([rate[:1], rate]), "W/m")
    if has_values(table, "heat_removed"):
        found["heat removed"] = (table["heat_removed"].to_numpy(), unit_of(table, "heat_removed"))
    return {label: _engineering(*pair) for label, pair in found.items()}


def _draw_totals(axes: Axes, course: Course, totals: dict[str, tuple[np.ndarray, str]]) -> None:
    """The heat rate on the left, the heat removed on the right; one alone takes the left."""
    panels = [axes, axes.twinx()] if len(totals) == 2 else [axes]
    for panel, (label, (values, unit)) in zip(panels, totals.items(), strict=True):
        colour = "#d55e00" if label == "heat removed" else "#0072b2"
        style = "default" if label == "heat removed" else "steps-pre"
        panel.plot(course.abscissa, values, color=colour, drawstyle=style)
        finite = values[np.isfinite(values)]
        panel.set_ylim(bottom=min(0.0, float(finite.min(initial=0.0))))
        panel.set_ylabel(f"{label} [{unit}]", color=colour)
        panel.tick_params(axis="y", colors=colour)
    if len(panels) == 2:
        panels[1].grid(False)


def _log_scale(panel: Axes, values: np.ndarray) -> None:
    """A logarithmic axis with plain numbers, if there is anything to tell apart; else from zero."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    positive = values[values > 0]
    decades = np.ptp(np.log10(positive)) if len(positive) else 0.0
    if decades < 0.3:
        panel.set_ylim(bottom=0.0)
        return
    panel.set_yscale("log")
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    panel.yaxis.set_major_formatter(plain)
    if decades < 3:
        panel.yaxis.set_minor_locator(LogLocator(subs=(2, 5)))
        panel.yaxis.set_minor_formatter(plain)
        panel.tick_params(axis="y", which="minor", labelsize=8)


def _engineering(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Joules and watts with the prefix that suits their size."""
    if not unit.startswith(("J", "W")):
        return values, unit
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    for factor, prefix in ((1e6, "M"), (1e3, "k")):
        if largest >= factor:
            return values / factor, prefix + unit
    return values, unit


def has_values(table: pandas.DataFrame, name: str) -> bool:
    """Whether a column is there and holds any number."""
    return name in table and bool(table[name].notna().any())


def unit_of(table: pandas.DataFrame, name: str) -> str:
    """The unit of a column as figures write it."""
    unit = str(table.attrs["units"][name])
    return unit.replace("degC", "°C").replace("^2", "²").replace("^3", "³").replace("um", "µm")


HISTORY_FIGURES: dict[str, Callable[[pandas.DataFrame, Course, Steel | None], Figure | None]] = {
    "surface_temperature": draw_surface_temperature,
    "shell": draw_shell,
    "heat": draw_heat,
    "steps": draw_steps,
    "tensile": draw_tensile,
}
