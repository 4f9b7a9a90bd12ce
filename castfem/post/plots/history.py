"""Figures along the strand: surface temperatures, shell, heat and the time steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.result_registry import AT_FRACTION, find, probe_label
from castfem.base.shown_units import plain_unit, said
from castfem.base.types import Array
from castfem.post.plots.fronts import open_front
from castfem.post.plots.legend import place_legend
from castfem.post.plots.section import Steel
from castfem.post.plots.style import (
    LIQUIDUS_COLOUR,
    SOLIDUS_COLOUR,
    Abscissa,
    dress,
    new_panels,
    probe_colours,
)
from castfem.post.plots.tensile import draw_tensile
from castfem.runs.results.resolution import STAIR

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_THERMAL, _MECHANICAL = "#0072b2", "#d55e00"
_NO_PROBES = ("min", "max")  # ends of names of columns over the whole section
_NAMED = 3  # probes with one curve that are all named
_MANY = 150  # steps; their Newton iterations would blacken a line plot


def probes_with(table: pandas.DataFrame, prefix: str) -> dict[str, str]:
    """Probe to column, of the columns `prefix_PROBE` that hold any number.

    A column of the whole slice that begins so is none of them.
    """
    return {
        name[len(prefix) + 1 :]: name
        for name in map(str, table.columns)
        if name.startswith(f"{prefix}_")
        and name[len(prefix) + 1 :] not in _NO_PROBES
        and ((known := find(name)) is None or known[1])
        and table[name].notna().any()
    }


def curves(table: pandas.DataFrame, prefix: str) -> list[tuple[str, str, str]]:
    """Label, colour and column of each curve `prefix_PROBE`.

    Probes whose curves would hide one another share one; the faces of a square are all "mid-face".
    """
    probes = probes_with(table, prefix)
    colours = probe_colours(list(probes))
    found: dict[str, list[str]] = {}  # column to the probes that share its curve
    for probe, column in probes.items():
        values = table[column].to_numpy()
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
    if len(names) > _NAMED:
        return f"{names[0]} and {len(names) - 1} others"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def draw_surface_temperature(
    table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None
) -> Figure | None:
    """Surface temperature at the probes, and in the core."""
    surfaces = curves(table, "surface_temperature")
    if not surfaces:
        return None
    figure, (axes,) = new_panels(1, 3.4)
    for probe, colour, column in surfaces:
        label = probe if probe == "surface" else f"surface, {probe}"
        axes.plot(abscissa.values, table[column], color=colour, label=label)
    if "temperature_core" in table and table["temperature_core"].notna().any():
        core = table["temperature_core"]
        axes.plot(abscissa.values, core, color="#444444", linestyle=":", label="core")
    if steel is not None:
        for name, level, colour in (
            ("liquidus", steel.liquidus, LIQUIDUS_COLOUR),
            ("solidus", steel.solidus, SOLIDUS_COLOUR),
        ):
            axes.axhline(
                level - ZERO_CELSIUS,
                color=colour,
                linewidth=0.9,
                linestyle="--",
                label=f"{name} {said(level - ZERO_CELSIUS, 'degC', '.1f')}",
            )
    axes.set_ylabel(axis_label(table, surfaces[0][2]), gid=surfaces[0][2])
    dress([axes], abscissa)
    place_legend(axes, 3)
    return figure


def draw_shell(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Depth of the solidus and of the liquidus below the surface at the probes."""
    solid, liquid = curves(table, "shell"), curves(table, "liquidus_depth")
    if not solid and not liquid:
        return None
    figure, (axes,) = new_panels(1, 3.4)
    between = dict.fromkeys(found[1] for c in table if (found := AT_FRACTION.fullmatch(str(c))))
    chosen = [(curves(table, f"fs{p}"), f"fs = {int(p) / 100:g}", ":") for p in between]
    for lines, kind, style in (
        (solid, "solidus (shell)", "-"), *chosen, (liquid, "liquidus", "--"),
    ):  # fmt: skip
        for probe, colour, column in lines:
            label = f"{probe}, {kind}"
            depth = open_front(table[column].to_numpy())
            axes.plot(abscissa.values, depth, color=colour, linestyle=style, label=label)
            cell = column.replace("shell_", "solidus_cell_", 1)
            if lines is solid and has_values(table, cell):
                _draw_stair(axes, abscissa, depth, table[cell], colour)
    axes.set_ylim(0.0, axes.get_ylim()[1])
    axes.set_ylabel(axis_label(table, [*solid, *liquid][0][2]), gid=[*solid, *liquid][0][2])
    dress([axes], abscissa)
    place_legend(axes, 2 if len(axes.lines) > 3 else 1)
    return figure


def _draw_stair(
    axes: Axes, abscissa: Abscissa, depth: Array, cell: pandas.Series, colour: str
) -> None:
    """How well the cells resolve a depth: within the shaded band."""
    off = STAIR * cell.to_numpy()
    shade: dict[str, Any] = {"color": colour, "alpha": 0.18, "linewidth": 0.0, "zorder": 1.5}
    axes.fill_between(abscissa.values, depth - off, depth + off, **shade)


def draw_heat(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Heat flux at the probes; heat leaving the strand; all that has left it."""
    fluxes = curves(table, "heat_flux")
    totals = _totals(table)
    if not fluxes and not totals:
        return None
    figure, axes = new_panels(bool(fluxes) + len(totals), 2.0)
    for label, colour, column in fluxes:
        axes[0].plot(abscissa.values, table[column], color=colour, label=label)
        axes[0].set_ylabel(axis_label(table, column), gid=column)
    for panel, (label, (values, unit)) in zip(axes[bool(fluxes) :], totals.items(), strict=True):
        style = "steps-pre" if "leaving" in label else "default"
        panel.plot(abscissa.values, values, color="#444444", drawstyle=style)
        panel.set_ylabel(f"{label} [{unit}]".replace("leaving ", "leaving\n"))
    for panel in axes:
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]) if _below_zero(panel) else 0.0)
    dress(axes, abscissa)
    if fluxes:
        place_legend(axes[0])
    return figure


def _below_zero(panel: Axes) -> bool:
    """Whether anything drawn is negative."""
    return any(np.nanmin(np.asarray(line.get_ydata(), dtype=float)) < 0.0 for line in panel.lines)


def draw_steps(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Time step, Newton iterations, errors of energy and forces, penetration of a mould."""
    found = [
        (draw, [name for name in names if there(table, name)])
        for draw, names, there in (
            (_draw_step, ("step",), has_values),
            (_draw_newton, ("newton", "newton_mechanics"), has_values),
            (_draw_errors, ("energy_error", "force_error"), _is_inexact),
            (_draw_penetration, ("penetration",), has_values),
        )
    ]
    panels = [(draw, names) for draw, names in found if names]
    if not panels:
        return None
    figure, axes = new_panels(len(panels), 1.5)
    for panel, (draw, names) in zip(axes, panels, strict=True):
        draw(panel, table, abscissa, names)
        if any(name.endswith(("mechanics", "force_error")) for name in names):
            panel.legend(loc="upper right", ncols=2)  # above what is drawn
    dress(axes, abscissa)
    return figure


def _is_inexact(table: pandas.DataFrame, name: str) -> bool:
    """Whether an error is not nothing in every row: only then a logarithmic axis has anything."""
    return has_values(table, name) and bool((table[name].fillna(0.0) != 0.0).any())


def _draw_step(panel: Axes, table: pandas.DataFrame, abscissa: Abscissa, names: list[str]) -> None:
    """The time step."""
    values = np.where(table[names[0]] > 0.0, table[names[0]], np.nan)  # none at the meniscus
    panel.step(abscissa.values, values, where="pre", color=_THERMAL, linewidth=1.2)
    _log_scale(panel, values)
    panel.set_ylabel(axis_label(table, names[0]), gid=names[0])


def _draw_newton(
    panel: Axes, table: pandas.DataFrame, abscissa: Abscissa, names: list[str]
) -> None:
    """Newton iterations of the temperature and of the mechanics."""
    from matplotlib.ticker import MaxNLocator

    for name in names:
        mechanical = name.endswith("mechanics")
        colour = _MECHANICAL if mechanical else _THERMAL
        values = table[name].to_numpy()
        label = "mechanics" if mechanical else "temperature"
        if len(values) > _MANY:
            panel.plot(abscissa.values, values, ".", color=colour, markersize=2.5, label=label)
        else:
            panel.step(
                abscissa.values, values, where="pre", color=colour, linewidth=1.0, label=label
            )
    panel.set_ylim(0, 1.4 * np.nanmax(table[names].to_numpy()) + 1)
    panel.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    panel.set_ylabel("Newton\niterations [-]")


def _draw_errors(
    panel: Axes, table: pandas.DataFrame, abscissa: Abscissa, names: list[str]
) -> None:
    """How far energy and forces are out of balance; what is exact is left out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    for name in names:
        forces = name == "force_error"
        size = np.abs(table[name].to_numpy())
        panel.plot(
            abscissa.values,
            np.where(size == 0, np.nan, size),
            ".",
            color=_MECHANICAL if forces else _THERMAL,
            markersize=2.5,
            label="forces" if forces else "energy",
        )
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(numticks=6))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _power(value)))
    panel.yaxis.set_minor_locator(NullLocator())
    panel.set_ylim(top=panel.get_ylim()[1] * 10.0 ** (2.5 * (len(names) > 1)))
    panel.set_ylabel("relative error [-]" if len(names) > 1 else axis_label(table, names[0]))


def _power(value: float) -> str:
    """A power of ten in plain characters: formulas have to be parsed, which takes its time."""
    exponent = f"{np.log10(value):.0f}"
    return "10" + exponent.translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _draw_penetration(
    panel: Axes, table: pandas.DataFrame, abscissa: Abscissa, names: list[str]
) -> None:
    """How deep the surface lies in the wall."""
    panel.plot(abscissa.values, table[names[0]], color=_MECHANICAL, linewidth=1.2)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(axis_label(table, names[0]), gid=names[0])


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


def _log_scale(panel: Axes, values: np.ndarray) -> None:
    """A logarithmic axis with plain numbers, if there is anything to tell apart; else from zero."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    positive = values[values > 0]
    decades = np.ptp(np.log10(positive)) if len(positive) else 0.0
    if decades < 1.0:
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
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    size, prefixed = prefix_for(largest, unit)
    return values / size, prefixed


def prefix_for(largest: float, unit: str) -> tuple[float, str]:
    """What to divide by, and the unit then: of joules and watts the one that suits their size."""
    if unit.startswith(("J", "W")):
        for size, prefix in ((1e6, "M"), (1e3, "k")):
            if largest >= size:
                return size, prefix + unit
    return 1.0, unit


def drawn_panels(
    panels: Sequence[Callable[[Axes], None]], height: float, abscissa: Abscissa
) -> Figure:
    """Panels below one another, each drawn and with a legend where it has something to name.

    Args:
        panels: What draws each.
        height: Of each, in.
        abscissa: Of all.
    """
    figure, axes = new_panels(len(panels), height)
    for panel, draw in zip(axes, panels, strict=True):
        draw(panel)
    dress(axes, abscissa)
    for panel in axes:
        if panel.get_legend_handles_labels()[0]:
            place_legend(panel)
    return figure


def has_values(table: pandas.DataFrame, name: str) -> bool:
    """Whether a column is there and holds any number."""
    return name in table and bool(table[name].notna().any())


def axis_label(table: pandas.DataFrame, name: str) -> str:
    """What a column is and its unit, for the axis of a figure."""
    known = find(name)
    label = name.replace("_", " ") if known is None else known[0].axis_label
    return f"{label} [{unit_of(table, name)}]"


def unit_of(table: pandas.DataFrame, name: str) -> str:
    """The unit of a column as figures write it."""
    return plain_unit(str(table.attrs["units"][name]))


HISTORY_FIGURES: dict[str, Callable[[pandas.DataFrame, Abscissa, Steel | None], Figure | None]] = {
    "surface_temperature": draw_surface_temperature,
    "shell": draw_shell,
    "heat": draw_heat,
    "steps": draw_steps,
    "tensile": draw_tensile,
}
