"""Axes for a notebook or a script: columns of the history, and a field over the section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.shown_units import is_chosen, place_said, plain_unit
from castfem.base.units import nearest
from castfem.post.plots.history import axis_label
from castfem.post.plots.section import section_triangles, shade
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.runs.output.history import Columns

_COLOURS = {"temperature": "inferno", "gap": "cividis"}
_SHOWN = {"K": ("°C", 1.0, -ZERO_CELSIUS), "Pa": ("MPa", 1e-6, 0.0), "m": ("mm", 1e3, 0.0)}


def plot_columns(table: Columns, names: Sequence[str], axes: Axes | None) -> Axes:
    """Plot columns of a history over the position below the meniscus."""
    from matplotlib import pyplot

    unknown = [name for name in names if name not in table]
    if unknown or not names:
        missing = ", ".join(unknown) or "is named"
        near = nearest(unknown[0], table.columns) if unknown else ""
        raise InputError(f"plot: no column {missing}; there are {', '.join(table.columns)}{near}")
    units = {str(table.attrs["units"].get(name, "-")) for name in names}
    if len(units) > 1:
        raise InputError(
            f"plot: {', '.join(names)} have different units: {', '.join(sorted(units))}"
        )
    drawn = axes if axes is not None else pyplot.subplots(layout="constrained")[1]
    for name in names:
        drawn.plot(table["position"], table[name], label=name.replace("_", " "))
    drawn.set_xlabel("position below the meniscus [m]", gid="position")
    drawn.set_ylabel(axis_label(table, names[0]), gid=names[0])
    if len(names) > 1:
        drawn.set_ylabel(f"[{plain_unit(units.pop())}]")
        drawn.legend()
    return _turned(drawn)


def plot_field(fields: Fields, name: str, index: int, axes: Axes | None) -> Axes:
    """Plot a scalar field over the whole section, in mm, with its colour scale."""
    from matplotlib import pyplot

    values = fields.values(name, index)
    if values.ndim != 1 or fields.centre(name) != "point":
        raise InputError(f"section: {name} is not a scalar at the nodes; take fields() and draw it")
    unit, factor, offset = _SHOWN.get(UNITS.get(name, "-"), ("", 1.0, 0.0))
    mesh, shown = section_triangles(fields, factor * values + offset)
    drawn = axes if axes is not None else pyplot.subplots(layout="constrained")[1]
    drawn.set_xlim(float(mesh.x.min()), float(mesh.x.max()))
    drawn.set_ylim(float(mesh.y.min()), float(mesh.y.max()))
    drawn.set_aspect("equal")
    finite = shown[np.isfinite(shown)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    shades = shade(drawn, mesh, shown, _COLOURS.get(name, "viridis"), low, max(high, low + 1e-9))
    label = f"{name.replace('_', ' ')} [{unit}]" if unit else name.replace("_", " ")
    figure = drawn.figure.get_figure(root=True)
    assert figure is not None
    figure.colorbar(shades, ax=drawn, label=label)
    where = place_said(float(fields.positions[index]), near=".5g", beyond=np.inf)
    drawn.set_title(f"{where} below the meniscus")
    drawn.set_xlabel("x [mm]")
    drawn.set_ylabel("y [mm]")
    return _turned(drawn)


def _turned(drawn: Axes) -> Axes:
    """Convert the axes, and those of a colour scale beside them, to the chosen units."""
    figure = drawn.figure.get_figure(root=True)
    if is_chosen() and figure is not None:
        from castfem.post.plots.chosen_units import in_chosen_units

        in_chosen_units(figure)
    return drawn
