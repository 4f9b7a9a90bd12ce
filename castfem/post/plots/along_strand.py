"""The figures along the strand, from the columns of a history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_units import said
from castfem.base.types import Array
from castfem.post.plots.history import (
    Line,
    Panel,
    at_probes,
    axis_label,
    axis_of,
    column,
    curves,
    drawn,
    open_front,
    prefix_for,
)
from castfem.post.plots.section import Steel
from castfem.post.plots.style import LIQUIDUS_COLOUR, SOLIDUS_COLOUR, STYLE, Abscissa, new_figure
from castfem.runs.results.labels import STAIR, beside_wall, has_values, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from castfem.runs.output.history import Columns

_THERMAL, _MECHANICAL, _GREY = "#0072b2", "#d55e00", "#444444"
_DOTS: dict[str, Any] = {"marker": ".", "linestyle": "none"}
# values of the whole section
_WHOLE: dict[str, Any] = {"color": _GREY, "linestyle": ":", "linewidth": 1.5}
_MEAN_PRESSURE = "mean_contact_pressure_max"
_PLACES = {"intrados": "#0072b2", "centre": "#7f7f7f", "extrados": "#d55e00"}


def draw_surface_temperature(
    table: Columns, abscissa: Abscissa, steel: Steel | None
) -> Figure | None:
    """Surface temperature at the probes, and core temperature."""
    lines = [
        Line(np.asarray(table[name]), label if label == "surface" else f"surface, {label}",
             {"color": colour})
        for label, colour, name in curves(table, "surface_temperature")
    ]  # fmt: skip
    if not lines:
        return None
    axis = axis_of(table, "surface_temperature")
    lines += column(table, "temperature_core", "core", color=_GREY, linestyle=":")
    for name, colour in (("liquidus", LIQUIDUS_COLOUR), ("solidus", SOLIDUS_COLOUR)):
        if steel is not None:
            level = getattr(steel, name) - ZERO_CELSIUS
            style = {"color": colour, "linewidth": 0.9, "linestyle": "--"}
            label = f"{name} {said(level, 'degC', '.1f')}"
            lines.append(Line(np.full(len(table), level), label, style))
    return drawn([Panel(lines, *axis, columns=3)], 3.4, abscissa)


def draw_shell(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Depth of the solidus and of the liquidus below the surface at the probes."""
    between = dict.fromkeys(found[1] for c in table if (found := AT_FRACTION.fullmatch(str(c))))
    fronts = [("shell", "solidus (shell)", "-")]
    fronts += [(f"fs{p}", f"fs = {int(p) / 100:g}", ":") for p in between]
    fronts.append(("liquidus_depth", "liquidus", "--"))
    lines, axis = [], ("", "")
    for prefix, kind, dashes in fronts:
        for probe, colour, name in curves(table, prefix):
            axis = axis if axis[0] else (axis_label(table, name), name)
            cell = name.replace("shell_", "solidus_cell_", 1)
            resolved = cell != name and has_values(table, cell)
            band = STAIR * np.asarray(table[cell]) if resolved else None  # from the cell size
            style = {"color": colour, "linestyle": dashes}
            depth = open_front(np.asarray(table[name]))
            lines.append(Line(depth, f"{probe}, {kind}", style, band))
    panel = Panel(lines, *axis, zero=True, columns=2 if len(lines) > 3 else 1)
    return drawn([panel], 3.4, abscissa) if lines else None


def draw_heat(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Heat flux at the probes; heat flow out of the strand; total heat removed."""
    panels = []
    if fluxes := at_probes(table, "heat_flux"):
        panels.append(Panel(fluxes, *axis_of(table, "heat_flux"), zero=True))
    for label, (values, unit) in heat_totals(table).items():
        size, prefixed = prefix_for(float(np.abs(values[np.isfinite(values)]).max(initial=0)), unit)
        steps = "steps-pre" if "leaving" in label else "default"
        line = Line((values / size).astype(np.float64), "", {"color": _GREY, "drawstyle": steps})
        label = f"{label} [{prefixed}]".replace("leaving ", "leaving\n")
        panels.append(Panel([line], label, zero=True))
    return drawn(panels, 2.0, abscissa)


def heat_totals(table: Columns) -> dict[str, tuple[Array, str]]:
    """Values and units of the heat flow out of the strand and of the total heat removed, by label.

    The former is computed from the heat of each step, unless it has its own column.
    """
    found = {}
    if has_values(table, "heat_rate"):
        rate, unit = np.asarray(table["heat_rate"]), unit_of(table, "heat_rate")
        found["heat leaving the strand"] = rate, unit
    elif has_values(table, "heat_removed") and unit_of(table, "heat_removed") == "J/m":
        found["heat leaving the strand"] = rate_of(table), "W/m"
    if has_values(table, "heat_removed"):
        removed = np.asarray(table["heat_removed"])
        found["heat removed"] = removed, unit_of(table, "heat_removed")
    return found


def rate_of(table: Columns) -> Array:
    """Heat flow of each step, from the heat removed so far."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.diff(np.asarray(table["heat_removed"])) / np.diff(np.asarray(table["time"]))
    return np.concatenate([rate[:1], rate])


def draw_steps(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Time step, Newton iterations, errors of energy and forces, penetration of a mould."""
    panels = []
    if has_values(table, "step"):
        step = np.asarray(table["step"])
        step = np.where(step > 0.0, step, np.nan)  # none at the meniscus
        style = {"color": _THERMAL, "linewidth": 1.2, "drawstyle": "steps-pre"}
        finish = _log_scale(step)
        panels.append(Panel([Line(step, "", style)], *axis_of(table, "step"), finish=finish))
    named = {"newton": ("temperature", _THERMAL), "newton_mechanics": ("mechanics", _MECHANICAL)}
    kinds: dict[str, Any] = {"linewidth": 1.0, "drawstyle": "steps-pre"}
    if len(table) > 150:  # Newton iterations of more steps would fill a line plot
        kinds = {**_DOTS, "markersize": 2.5}
    lines = _by_colour(table, named, **kinds)
    if lines:
        panels.append(Panel(lines, "Newton\niterations [-]", finish=_whole_numbers(lines)))
    named = {"energy_error": ("energy", _THERMAL), "force_error": ("forces", _MECHANICAL)}
    inexact = {name: look for name, look in named.items() if _is_inexact(table, name)}
    lines = [
        Line(np.where(line.values == 0.0, np.nan, np.abs(line.values)), line.label, line.style)
        for line in _by_colour(table, inexact, **_DOTS, markersize=2.5)
    ]
    if lines:
        label = "relative error [-]" if len(lines) > 1 else axis_label(table, next(iter(inexact)))
        panels.append(Panel(lines, label, finish=_powers_of_ten))
    if lines := column(table, "penetration", color=_MECHANICAL, linewidth=1.2):
        panels.append(Panel(lines, *axis_of(table, "penetration"), zero=True))
    return drawn(panels, 1.5, abscissa)


def _by_colour(table: Columns, named: dict[str, tuple[str, str]], **style: Any) -> list[Line]:
    """Lines of columns with their label and colour; a single one needs no label."""
    there = [name for name in named if has_values(table, name)]
    alone = len(there) == 1
    return [
        Line(np.asarray(table[name]), "" if alone else named[name][0],
             {"color": named[name][1], **style})
        for name in there
    ]  # fmt: skip


def _is_inexact(table: Columns, name: str) -> bool:
    """Whether an error is not zero in every row, so that a logarithmic axis is possible."""
    return has_values(table, name) and bool(np.nan_to_num(table[name]).any())


def _whole_numbers(lines: list[Line]) -> Callable[[Axes], None]:
    """Integers along an axis from 0, with room for a legend."""
    from matplotlib.ticker import MaxNLocator

    top = 1.4 * max(float(np.nanmax(line.values)) for line in lines) + 1.0

    def finish(panel: Axes) -> None:
        panel.set_ylim(0, top)
        panel.yaxis.set_major_locator(MaxNLocator(5, integer=True))
        if len(lines) > 1:
            panel.legend(loc="upper right", ncols=2)

    return finish


def _powers_of_ten(panel: Axes) -> None:
    """A logarithmic axis numbered in plain text, since formulas take time to parse."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(numticks=6))
    panel.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: "10" + f"{np.log10(value):.0f}".translate(raised))
    )
    panel.yaxis.set_minor_locator(NullLocator())
    if len(panel.lines) > 1:
        panel.set_ylim(top=panel.get_ylim()[1] * 10.0**2.5)
        panel.legend(loc="upper right", ncols=2)  # above the curves


def _log_scale(values: Array) -> Callable[[Axes], None]:
    """A logarithmic axis if the values span a decade, otherwise a linear one from zero."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    positive = values[values > 0]
    decades = np.ptp(np.log10(positive)) if len(positive) else 0.0

    def finish(panel: Axes) -> None:
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

    return finish


def draw_stress(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Von Mises stress at the probes, and the largest of the section."""
    lines = at_probes(table, "von_mises", "surface, ")
    lines += column(table, "von_mises_max", "largest in the section", **_WHOLE)
    if not lines:
        return None
    axis = axis_of(table, "von_mises", "von_mises_max")
    return drawn([Panel(lines, *axis, zero=True)], 3.4, abscissa)


def draw_size(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Change of the size of the section since the meniscus; without that, the displacement."""
    panels, lines = [], []
    for label, colour, name in curves(table, "size"):
        values = np.asarray(table[name])
        start = float(values[np.isfinite(values)][0])
        begun = said(start, str(table.attrs["units"][name]), ".2f", name)
        label = f"{label.replace('corner', 'diagonal')}, from {begun}"
        lines.append(Line(values - start, label, {"color": colour}))
    if lines:
        label, name = axis_of(table, "size")
        panels.append(Panel(lines, f"change of {label}", name, baseline=True))
    others = [
        (label, colour, name)
        for label, colour, name in curves(table, "displacement")
        if name.replace("displacement", "size", 1) not in table
        and np.nanmax(table[name]) - np.nanmin(table[name]) > STYLE.held
    ]
    if others:
        lines = [Line(np.asarray(table[n]), label, {"color": c}) for label, c, n in others]
        name = others[0][2]
        panels.append(Panel(lines, axis_label(table, name), name, baseline=True))
    return drawn(panels, 3.4 if len(panels) == 1 else 2.6, abscissa)


def draw_axial(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Axial strain of the slice, and the axial force."""
    force = column(table, "axial_force", color=_THERMAL)
    loaded = bool(force) and float(np.nanmax(np.abs(force[0].values))) > STYLE.force
    panels = []
    if has_values(table, "axial_strain"):
        label = "free slice, no axial force" if force and not loaded else ""
        line = Line(100.0 * np.asarray(table["axial_strain"]), label, {"color": _THERMAL})
        panels.append(Panel([line], "axial strain [%]", baseline=True))
    if loaded:
        panels.append(Panel(force, *axis_of(table, "axial_force"), baseline=True))
    return drawn(panels, 3.4 if len(panels) == 1 else 2.4, abscissa)


def draw_contact(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Gap and pressure between strand and mould, fraction in contact, friction."""
    # the averaged pressure does not depend on the mesh
    mean = has_values(table, _MEAN_PRESSURE)
    highest = _MEAN_PRESSURE if mean else "contact_pressure_max"
    panels = []
    for prefix, largest, words, reach in (
        ("gap", "gap_max", "largest anywhere", STYLE.gap),
        ("contact_pressure", highest, "largest anywhere" + ", over 5 mm" * mean, 0.0),
    ):
        whole = column(table, largest, words, **_WHOLE)
        if prefix == "gap":  # below the mould there is no gap, not a zero one
            whole = [
                replace(w, values=np.where(beside_wall(table), w.values, np.nan)) for w in whole
            ]
        lines = [*at_probes(table, prefix), *whole]
        if lines:
            axis = axis_of(table, prefix, largest)
            panels.append(Panel(lines, *axis, zero=True, below=0.03, reach=reach))
    if has_values(table, "contact_share") and table["contact_share"].any():
        label, name = axis_of(table, "contact_share")
        factor = 100.0 if label.endswith("[-]") else 1.0  # older runs have fractions
        line = Line(factor * np.asarray(table[name]), "", {"color": _THERMAL})
        label = label.replace("[-]", "[%]")
        panels.append(Panel([line], label, name, finish=lambda axes: axes.set_ylim(0.0, 105.0)))
    friction = "mould_friction" if has_values(table, "mould_friction") else "friction_force"
    if (lines := column(table, friction, color=_THERMAL)) and table[friction].any():
        panels.append(Panel(lines, *axis_of(table, friction), zero=True))
    return drawn(panels, 2.1, abscissa)


def draw_extraction(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Resistance of the rolls, drive forces, and axial force in the strand."""
    if not has_values(table, "effort") or not has_values(table, "roll_resistance"):
        return None
    both = column(table, "roll_resistance", "resistance of the rolls", color=_MECHANICAL)
    both += column(table, "drive_force", "pull of the drives", color="#1f4e79")
    label = f"sum to here [{unit_of(table, 'roll_resistance')}]"
    effort = column(table, "effort", color=_THERMAL)
    panels = [
        Panel(both, label, "roll_resistance", baseline=True),
        Panel(effort, *axis_of(table, "effort"), baseline=True),
    ]
    return drawn(panels, 2.6, abscissa)


def draw_slice(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Thickness of the slice at three places ([Pascon2003] Fig. 158), and its neutral axis."""
    if not has_values(table, "slice_thickness_centre"):
        return None
    lines = [
        line
        for place, colour in _PLACES.items()
        for line in column(table, f"slice_thickness_{place}", place, color=colour)
    ]
    panels = [Panel(lines, "thickness of\nthe slice [-]")]
    if lines := column(table, "neutral_axis", **_DOTS, color="#333333", markersize=3.5):
        axis = axis_of(table, "neutral_axis")
        panels.append(Panel(lines, *axis, finish=_within_faces(table)))
    if found := curves(table, "axial_stress"):
        lines = [
            Line(np.asarray(table[name]), label,
                 {"color": c, "linewidth": 1.2, "linestyle": "--" if "extrados" in name else "-"})
            for label, c, name in found
        ]  # fmt: skip
        panels.append(Panel(lines, *axis_of(table, "axial_stress"), baseline=True))
    return drawn(panels, 2.3, abscissa)


def _within_faces(table: Columns) -> Callable[[Axes], None]:
    """Draw the faces of the strand; beyond them contraction outweighs bending."""
    known = has_values(table, "size_mid_face_intrados")
    across = float(np.asarray(table["size_mid_face_intrados"])[0]) if known else np.nan
    half = 0.5 * across if known else float(np.nanmax(np.abs(table["neutral_axis"])))

    def finish(panel: Axes) -> None:
        for end, name in ((half, "intrados"), (-half, "extrados")):
            panel.axhline(end, color=_PLACES[name], linewidth=1.0, linestyle="--")
            inside, away = ("top", -4) if end > 0.0 else ("bottom", 4)
            panel.annotate(name, (0.01, end), (0, away), xycoords=panel.get_yaxis_transform(),
                           textcoords="offset points", va=inside, fontsize=8.5)  # fmt: skip
        panel.set_ylim(-1.15 * half, 1.15 * half)

    return finish


def draw_bulging(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Bulge at the middle of the wide faces, largest of each pitch, and roll forces."""
    if not has_values(table, "bulge_pitch"):
        return None
    lines = []
    for face, dashes in (("intrados", "-"), ("extrados", "--")):
        style = {"color": _PLACES[face], "linestyle": dashes, "linewidth": 1.2}
        lines += column(table, f"bulge_{face}", f"{face}, once a window", **style)
    dots = {**_DOTS, "color": "#333333", "markersize": 3.5}
    lines += column(table, "bulge_pitch", "largest of the pitch", **dots)
    force = column(table, "roll_force", color=_PLACES["intrados"], linewidth=1.2)
    panels = [
        Panel(lines, f"bulge [{unit_of(table, 'bulge_pitch')}]", baseline=True),
        Panel(force, f"force on a roll [{unit_of(table, 'roll_force')}]"),
    ]
    return drawn(panels, 2.6, abscissa)


def draw_tensile(table: Columns, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Stress over strain; over time if the bar is held for a while."""
    if not {"strain", "stress"} <= set(table.columns):
        return None
    unit = str(table.attrs["units"]["stress"])
    strain = 100.0 * np.asarray(table["strain"])
    by_time = bool((np.abs(np.diff(strain)) <= 1e-9 * np.ptp(strain)).any())
    x = np.asarray(table["time"]) if by_time else strain
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    if has_values(table, "analytical_stress"):
        axes.plot(
            x, table["analytical_stress"], color="#e39c37", linewidth=4.0, alpha=0.6,
            label="analytical", solid_capstyle="butt",
        )  # fmt: skip
    axes.plot(x, table["stress"], color="#0072b2", linewidth=1.3, label="integrated")
    axes.set_xlabel("time [s]" if by_time else "strain [%]")
    axes.set_ylabel(f"stress [{unit}]")
    if (table["stress"] >= 0.0).all():
        axes.set_ylim(bottom=0.0)
    axes.legend(loc="best")
    return figure
