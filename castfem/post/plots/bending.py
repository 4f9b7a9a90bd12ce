"""Figures of a strand in its rolls: thickness of the slice, neutral axis, stress; its bulges."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from castfem.post.plots.history import axis_label, curves, drawn_panels, has_values, unit_of
from castfem.post.plots.legend import place_legend
from castfem.post.plots.section import Steel
from castfem.post.plots.style import Abscissa, dress, new_panels

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PLACES = {"intrados": "#0072b2", "centre": "#7f7f7f", "extrados": "#d55e00"}
_APART = 0.15  # of the axis beyond the faces, which the neutral axis is drawn within


def draw_slice(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Thickness of the slice at three places ([Pascon2003] Fig. 158), and its neutral axis."""
    if not has_values(table, "slice_thickness_centre"):
        return None
    panels: list[Callable[[Axes], None]] = [lambda panel: _thickness(panel, table, abscissa)]
    if has_values(table, "neutral_axis"):
        panels.append(lambda panel: _neutral_axis(panel, table, abscissa))
    if curves(table, "axial_stress"):
        panels.append(lambda panel: _stress(panel, table, abscissa))
    return drawn_panels(panels, 2.3, abscissa)


def _thickness(panel: Axes, table: pandas.DataFrame, abscissa: Abscissa) -> None:
    for place, colour in _PLACES.items():
        panel.plot(abscissa.values, table[f"slice_thickness_{place}"], color=colour, label=place)
    panel.set_ylabel("thickness of\nthe slice [-]")


def _neutral_axis(panel: Axes, table: pandas.DataFrame, abscissa: Abscissa) -> None:
    """Where it lies within the strand; beyond its faces contraction outweighs bending."""
    axis = table["neutral_axis"].to_numpy()
    known = has_values(table, "size_mid_face_intrados")
    across = float(table["size_mid_face_intrados"].iloc[0]) if known else np.nan
    half = 0.5 * across if known else float(np.nanmax(np.abs(axis)))
    panel.plot(abscissa.values, axis, ".", color="#333333", markersize=3.5)
    for end, name in ((half, "intrados"), (-half, "extrados")):
        panel.axhline(end, color=_PLACES[name], linewidth=1.0, linestyle="--")
        inside, away = ("top", -4) if end > 0.0 else ("bottom", 4)
        panel.annotate(name, (0.01, end), (0, away), xycoords=panel.get_yaxis_transform(),
                       textcoords="offset points", va=inside, fontsize=8.5)  # fmt: skip
    panel.set_ylim(-(1.0 + _APART) * half, (1.0 + _APART) * half)
    panel.set_ylabel(axis_label(table, "neutral_axis"), gid="neutral_axis")


def _stress(panel: Axes, table: pandas.DataFrame, abscissa: Abscissa) -> None:
    for label, colour, column in curves(table, "axial_stress"):
        style = "--" if "extrados" in column else "-"
        panel.plot(abscissa.values, table[column], style, color=colour, linewidth=1.2, label=label)
    panel.axhline(0.0, color="#555555", linewidth=0.7)
    first = curves(table, "axial_stress")[0][2]
    panel.set_ylabel(axis_label(table, first), gid=first)


def draw_bulging(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Bulge at the middle of the wide faces, largest of each pitch, and what the rolls bear."""
    if not has_values(table, "bulge_pitch"):
        return None
    figure, axes = new_panels(2, 2.6)
    for face in ("intrados", "extrados"):
        colour, style = _PLACES[face], "--" if face == "extrados" else "-"
        axes[0].plot(
            abscissa.values, table[f"bulge_{face}"], style, color=colour, linewidth=1.2,
            label=f"{face}, once a window",
        )  # fmt: skip
    axes[0].plot(
        abscissa.values, table["bulge_pitch"], ".", color="#333333", markersize=3.5,
        label="largest of the pitch",
    )  # fmt: skip
    axes[0].axhline(0.0, color="#555555", linewidth=0.7)
    axes[0].set_ylabel(f"bulge [{unit_of(table, 'bulge_pitch')}]")
    axes[1].plot(abscissa.values, table["roll_force"], color=_PLACES["intrados"], linewidth=1.2)
    axes[1].set_ylabel(f"force on a roll [{unit_of(table, 'roll_force')}]")
    dress(axes, abscissa)
    place_legend(axes[0])
    return figure


BENDING_FIGURES = {"slice": draw_slice, "bulging": draw_bulging}
