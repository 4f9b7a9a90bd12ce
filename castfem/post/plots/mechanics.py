"""Figures of the mechanics along the strand: stress, size, axial strain, contact with the mould."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.shown_units import said
from castfem.post.plots.history import axis_label, curves, drawn_panels, has_values, unit_of
from castfem.post.plots.legend import place_legend
from castfem.post.plots.section import Steel
from castfem.post.plots.style import Abscissa, dress, new_panels

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ALL: dict[str, Any] = {
    "color": "#444444",
    "linestyle": ":",
    "linewidth": 1.5,
}  # over the whole section
_SINGLE = "#0072b2"
_MEAN_PRESSURE = "mean_contact_pressure_max"
CLOSED = 0.01  # mm, the least the axis of the gap reaches: what is less is no gap to look at
_HELD = 1e-6  # mm; a surface that moves by less is held, as that of a strip
_NOTHING = 1e-6  # kN; a free strand carries less, the rounding of the solver


def draw_stress(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Von Mises stress at the probes, and the largest of the section."""
    lines = curves(table, "von_mises")
    if not lines and not has_values(table, "von_mises_max"):
        return None
    figure, (axes,) = new_panels(1, 3.4)
    _draw_probes(axes, table, abscissa, "von_mises", "surface, ")
    if has_values(table, "von_mises_max"):
        axes.plot(abscissa.values, table["von_mises_max"], **_ALL, label="largest in the section")
    name = lines[0][2] if lines else "von_mises_max"
    axes.set_ylabel(axis_label(table, name), gid=name)
    axes.set_ylim(bottom=0.0)
    dress([axes], abscissa)
    place_legend(axes)
    return figure


def draw_size(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Change of the size of the section since the meniscus; where it has none, the displacement."""
    sizes = curves(table, "size")
    measured = {name[len("size_") :] for name in table.columns if str(name).startswith("size_")}
    others = [
        c for c in curves(table, "displacement") if c[2][len("displacement_") :] not in measured
    ]
    others = [c for c in others if float(np.ptp(table[c[2]].dropna())) > _HELD]
    panels = [lines for lines in (sizes, others) if lines]
    if not panels:
        return None
    figure, axes = new_panels(len(panels), 3.4 if len(panels) == 1 else 2.6)
    for panel, lines in zip(axes, panels, strict=True):
        for label, colour, column in lines:
            values = table[column].to_numpy()
            if lines is sizes:
                start = float(values[np.isfinite(values)][0])
                label = label.replace("corner", "diagonal")
                unit = str(table.attrs["units"][column])
                label += f", from {said(start, unit, '.2f', column)}"
                values = values - start
            panel.plot(abscissa.values, values, color=colour, label=label)
        _mark_zero(panel)
        label = axis_label(table, lines[0][2])
        words = f"change of {label}" if lines is sizes else label
        panel.set_ylabel(words, gid=lines[0][2])
    dress(axes, abscissa)
    for panel in axes:
        place_legend(panel)
    return figure


def draw_axial(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Strain of the slice along the strand, and the force that goes with it."""
    strained, loaded = has_values(table, "axial_strain"), has_values(table, "axial_force")
    if loaded:
        loaded = float(np.nanmax(np.abs(table["axial_force"].to_numpy()))) > _NOTHING
    if not strained and not loaded:
        return None
    count = strained + loaded
    figure, axes = new_panels(count, 3.4 if count == 1 else 2.4)
    if strained:
        label = "free slice, no axial force" if has_values(table, "axial_force") else ""
        axes[0].plot(abscissa.values, 100.0 * table["axial_strain"], color=_SINGLE, label=label)
        axes[0].set_ylabel("axial strain [%]")
    if loaded:
        axes[-1].plot(abscissa.values, table["axial_force"], color=_SINGLE)
        axes[-1].set_ylabel(axis_label(table, "axial_force"), gid="axial_force")
    for panel in axes:
        _mark_zero(panel)
    dress(axes, abscissa)
    if strained and label and not loaded:
        place_legend(axes[0])
    return figure


def draw_contact(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Gap and pressure between strand and mould, how much of the surface touches, friction."""
    found: list[Callable[[Axes], None]] = []
    for prefix, largest, smallest in (
        ("gap", "gap_max", CLOSED),
        ("contact_pressure", _highest_pressure(table), 0.0),
    ):
        if curves(table, prefix) or has_values(table, largest):
            found.append(_over_surface(table, abscissa, prefix, largest, smallest))
    friction = "mould_friction" if has_values(table, "mould_friction") else "friction_force"
    for name in ("contact_share", friction):
        if has_values(table, name) and table[name].any():
            found.append(_single(table, abscissa, name))
    return drawn_panels(found, 2.1, abscissa) if found else None


def _highest_pressure(table: pandas.DataFrame) -> str:
    """The column of the highest pressure: its mean, which does not hang on the mesh, if there."""
    return _MEAN_PRESSURE if has_values(table, _MEAN_PRESSURE) else "contact_pressure_max"


def _over_surface(
    table: pandas.DataFrame,
    abscissa: Abscissa,
    prefix: str,
    largest: str,
    smallest: float,
) -> Callable[[Axes], None]:
    """Draws a quantity at the probes and its largest value; the axis reaches `smallest`."""

    def draw(panel: Axes) -> None:
        name = _draw_probes(panel, table, abscissa, prefix) or largest
        if has_values(table, largest):
            label = "largest anywhere" + (", over 5 mm" if largest == _MEAN_PRESSURE else "")
            panel.plot(abscissa.values, table[largest], **_ALL, label=label)
        panel.set_ylabel(axis_label(table, name), gid=name)
        low, high = panel.get_ylim()
        high = max(high, smallest)
        panel.set_ylim(low if _negative(panel, smallest) else -0.03 * high, high)

    return draw


def _single(table: pandas.DataFrame, abscissa: Abscissa, name: str) -> Callable[[Axes], None]:
    """Draws one column."""

    def draw(panel: Axes) -> None:
        percent, label = name == "contact_share", axis_label(table, name)
        fraction = percent and label.endswith("[-]")  # of older runs
        factor = 100.0 if fraction else 1.0
        panel.plot(abscissa.values, table[name] * factor, color=_SINGLE)
        panel.set_ylabel(label.replace("[-]", "[%]") if fraction else label, gid=name)
        if percent:
            panel.set_ylim(0.0, 105.0)
        elif not _negative(panel):
            panel.set_ylim(bottom=0.0)

    return draw


def _draw_probes(
    panel: Axes, table: pandas.DataFrame, abscissa: Abscissa, prefix: str, where: str = ""
) -> str:
    """Draws the columns `prefix_PROBE`; returns the first of them, "" if there is none."""
    lines = curves(table, prefix)
    for label, colour, column in lines:
        panel.plot(abscissa.values, table[column], color=colour, label=f"{where}{label}")
    return lines[0][2] if lines else ""


def _negative(panel: Axes, smallest: float = 0.0) -> bool:
    """Whether anything drawn lies clearly below zero, beside the size of it all or `smallest`."""
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in panel.lines])
    finite = drawn[np.isfinite(drawn)]
    size = float(np.abs(finite).max(initial=smallest))
    return bool((finite < -0.02 * size).any())


def _mark_zero(panel: Axes) -> None:
    """A line where nothing has changed."""
    panel.axhline(0.0, color="#8a8a8a", linewidth=0.9, zorder=1)


def draw_extraction(
    table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None
) -> Figure | None:
    """Resistance of the rolls, pull of the drives, and the effort that is left in the strand."""
    if not has_values(table, "effort") or not has_values(table, "roll_resistance"):
        return None
    figure, axes = new_panels(2, 2.6)
    for name, colour, label in (
        ("roll_resistance", "#d55e00", "resistance of the rolls"),
        ("drive_force", "#1f4e79", "pull of the drives"),
    ):
        axes[0].plot(abscissa.values, table[name], color=colour, label=label)
    unit = unit_of(table, "roll_resistance")
    axes[0].set_ylabel(f"sum to here [{unit}]", gid="roll_resistance")
    axes[1].plot(abscissa.values, table["effort"], color=_SINGLE)
    axes[1].set_ylabel(axis_label(table, "effort"), gid="effort")
    for panel in axes:
        _mark_zero(panel)
    dress(axes, abscissa)
    place_legend(axes[0])
    return figure


MECHANICS_FIGURES: dict[
    str, Callable[[pandas.DataFrame, Abscissa, Steel | None], Figure | None]
] = {
    "stress": draw_stress,
    "size": draw_size,
    "axial": draw_axial,
    "contact": draw_contact,
    "extraction": draw_extraction,
}
