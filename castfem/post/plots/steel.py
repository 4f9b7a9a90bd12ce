"""Draws the properties of a steel: phases, heat, conductivity, density, contraction."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.libraries import own_style
from castfem.base.types import Array
from castfem.physics.materials.describe import celsius
from castfem.physics.materials.iron_carbon import Diagram, Side
from castfem.physics.materials.phase_table import FRACTIONS, PhaseTable
from castfem.physics.materials.solid_fraction import LeverFraction
from castfem.physics.materials.steel import Steel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLD, HOT = 700.0 + ZERO_CELSIUS, 1600.0 + ZERO_CELSIUS  # K, range of the wide panels
LIQUID, DELTA, GAMMA, SOLID = "#c1272d", "#0072b2", "#2e8b57", "#333333"


@own_style()
def plot_steel(steel: Steel, path: str | os.PathLike[str], beside: Steel | None = None) -> Path:
    """Draw the properties of a steel over temperature in one picture.

    Panels: fractions of the phases (thesis Figs 23-25) or the solid fraction; carbon in each phase;
    effective specific heat and enthalpy (Fig. 29); conductivity and density; mean coefficient of
    thermal linear expansion (Fig. 28). Panels without data are left out. For a steel from a
    database also all phases at lower temperatures.

    Args:
        steel: The steel.
        path: Output file; its ending selects the format (png, svg, pdf).
        beside: The steel without its database, for comparison of solid fraction and heat.

    Returns:
        The path written.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    panels: list[Callable[[Axes, Steel], None]] = [_fractions]
    if steel.diagram is not None and steel.diagram.carbon > 0.0:
        panels.append(_carbon)
    if isinstance(steel.diagram, PhaseTable):
        panels.append(_all_phases)
    panels += [_effective_heat, _enthalpy, _conductivity]
    if steel.expansion is not None:
        panels.append(_expansion)
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(10.0, 3.5 * rows), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False).ravel()
    for draw, axis in zip(panels, axes, strict=False):
        draw(axis, steel)
        if beside is not None and draw in _COMPARED:
            _COMPARED[draw](axis, beside)
            _legend(axis, 4 if draw is _fractions else 3)
        axis.set_xlabel("temperature [°C]")
        axis.xaxis.set_major_locator(MaxNLocator(6))
        axis.grid(True, color="0.92")
        axis.set_axisbelow(True)
    for axis in axes[len(panels) :]:
        axis.remove()
    figure.suptitle(_title(steel))
    target = Path(path)
    figure.savefig(target, dpi=130)
    return target


def _title(steel: Steel) -> str:
    amounts = ", ".join(f"{w:g} %{element}" for element, w in steel.composition.items())
    return f"{steel.name} ({amounts})" if amounts else steel.name


def _legend(axis: Axes, columns: int = 3, extra: Axes | None = None) -> None:
    """Put the legend above the axes, where there is no curve."""
    handles, labels = axis.get_legend_handles_labels()
    if extra is not None:
        more = extra.get_legend_handles_labels()
        handles, labels = handles + more[0], labels + more[1]
    axis.legend(
        handles, labels, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns,
        frameon=False, borderaxespad=0.2, handlelength=1.8, columnspacing=1.2, fontsize="small",
    )  # fmt: skip


def _sides(lower: float, upper: float, breaks: Array) -> tuple[Array, list[Side]]:
    """Temperatures from `lower` to `upper`, split at each break into its colder and hotter side."""
    inside = [t for t in breaks if lower < t < upper]
    t = np.concatenate([np.linspace(lower, upper, 700), inside, inside])
    hotter = np.concatenate([np.ones(700 + len(inside)), np.zeros(len(inside))])
    order = np.lexsort((hotter, t))
    return t[order], ["above" if h else "below" for h in hotter[order]]


def _curve(
    function: Callable[[Array, Side], Array], lower: float, upper: float, breaks: Array
) -> tuple[Array, Array]:
    """Temperatures in degC and values, with both values where the function jumps."""
    t, sides = _sides(lower, upper, breaks)
    above, below = function(t, "above"), function(t, "below")
    hotter = np.array([side == "above" for side in sides])
    return t - ZERO_CELSIUS, np.where(hotter, above, below)


def _freezing_range(steel: Steel) -> tuple[float, float]:
    """Temperatures around melting and delta -> gamma, K, for the narrow panels."""
    lowest, highest = steel.solidus, steel.liquidus
    if steel.diagram is not None:
        transforms = steel.diagram.gamma_start, steel.diagram.gamma_end
        ends = [lowest, highest, *(t for t in transforms if t is not None)]
        lowest, highest = min(ends), max(ends)
    margin = max(0.15 * (highest - lowest), 10.0)
    return lowest - margin, highest + margin


def _fractions(axis: Axes, steel: Steel) -> None:
    lower, upper = _freezing_range(steel)
    breaks = steel.breakpoints(lower, upper)
    diagram = steel.diagram
    own = _curve(steel.solid_fraction, lower, upper, breaks)
    if diagram is None:
        axis.plot(*own, color=SOLID, label="solid")
    else:
        for name, colour, label in _PHASES:
            curve = _curve(_of_phase(diagram, name), lower, upper, breaks)
            axis.plot(*curve, color=colour, label=label)
        if not isinstance(steel.fraction, LeverFraction):
            axis.plot(*own, color=SOLID, ls="--", lw=1.2, label="solid, as used")
    axis.set_ylabel("mass fraction [-]")
    axis.set_ylim(-0.03, 1.03)
    _legend(axis, 4)


_PHASES = (
    ("liquid", LIQUID, "liquid"),
    ("delta", DELTA, "δ ferrite"),
    ("gamma", GAMMA, "austenite"),
)


def _of_phase(diagram: Diagram, name: str) -> Callable[[Array, Side], Array]:
    def values(temperature: Array, side: Side) -> Array:
        found: Array = getattr(diagram.phases(temperature, side), name)
        return found

    return values


def _all_phases(axis: Axes, steel: Steel) -> None:
    table = steel.diagram
    assert isinstance(table, PhaseTable)
    t = table.temperature - ZERO_CELSIUS
    colours = dict(zip(FRACTIONS, (LIQUID, DELTA, GAMMA, "#e69f00", "#9467bd", "0.5"), strict=True))
    labels = {"delta": "δ ferrite", "gamma": "austenite", "alpha": "α ferrite"}
    for name, colour in colours.items():
        if table.columns[name].any():
            axis.plot(t, table.columns[name], color=colour, label=labels.get(name, name))
    axis.set_ylabel("mass fraction [-]")
    _legend(axis)


def _carbon(axis: Axes, steel: Steel) -> None:
    assert steel.diagram is not None
    lower, upper = _freezing_range(steel)
    breaks = steel.breakpoints(lower, upper)
    for name, colour, label in _PHASES:
        curve = _curve(_of_phase(steel.diagram, f"carbon_{name}"), lower, upper, breaks)
        axis.plot(*curve, color=colour, label=f"in {label}")
    axis.set_ylabel("carbon content [wt%]")
    axis.set_ylim(bottom=0.0)
    _legend(axis)


def _effective_heat(axis: Axes, steel: Steel) -> None:
    lower, upper = steel.solidus - 120.0, steel.liquidus + 80.0
    breaks = steel.breakpoints(lower, upper)
    # In short pieces, so that a curved latent heat is drawn smoothly.
    edges = np.unique(np.concatenate([[lower], breaks, [upper], np.linspace(lower, upper, 60)]))
    along: list[float] = []
    effective: list[float] = []
    for start, end in itertools.pairwise(edges):
        t, left, right, latent, _ = steel.enthalpy_knots(start, end)
        heat = (left + latent) / steel.density(t[:-1], "above")
        last = (right + latent) / steel.density(t[1:], "below")
        along += list(np.repeat(t - ZERO_CELSIUS, 2)[1:-1])
        effective += list(np.ravel(np.column_stack([heat, last])) / 1e3)
    axis.plot(along, effective, color=LIQUID, label="with latent heat, c̃")
    sensible = _curve(steel.specific_heat, lower, upper, breaks)
    axis.plot(sensible[0], sensible[1] / 1e3, color=SOLID, lw=1.2, ls="--", label="without it, c")
    t, *_, jump = steel.enthalpy_knots(lower, upper)
    density = 0.5 * (steel.density(t, "above") + steel.density(t, "below"))
    for at, released in zip(t[jump > 0.0], (jump / density)[jump > 0.0], strict=True):
        label = f"{released / 1e3:.0f} kJ/kg released at {at - ZERO_CELSIUS:.1f} °C"
        axis.axvline(at - ZERO_CELSIUS, color=GAMMA, ls=":", lw=1.5, label=label)
    if max(effective) > 30.0:
        axis.set_yscale("log")
    else:
        axis.set_ylim(0.0, 1.08 * max(effective))
    axis.set_ylabel("specific heat [kJ/(kg K)]")
    _legend(axis)


def _heat_content(steel: Steel, lower: float, upper: float) -> tuple[Array, Array]:
    """Temperatures, degC, repeated at jumps, and the heat since the first, J/m3."""
    t, left, right, latent, jump = steel.enthalpy_knots(lower, upper)
    gain = (0.5 * (left + right) + latent) * np.diff(t)
    total = np.concatenate([[0.0], np.cumsum(gain)]) + np.cumsum(jump) - jump
    return np.repeat(t - ZERO_CELSIUS, 2), np.ravel(np.column_stack([total, total + jump]))


def _enthalpy(axis: Axes, steel: Steel) -> None:
    lower, upper = steel.solidus - 120.0, steel.liquidus + 80.0
    at, values = _heat_content(steel, lower, upper)
    axis.plot(at, values / 1e9, color=LIQUID, label=f"from {lower - ZERO_CELSIUS:.0f} °C on")
    limits = {"solidus": (steel.solidus, "--"), "liquidus": (steel.liquidus, ":")}
    if steel.solidus == steel.liquidus:
        limits = {"melting point": (steel.solidus, "--")}
    for label, (value, style) in limits.items():
        text = f"{label} {celsius(value)} °C"
        axis.axvline(value - ZERO_CELSIUS, color="0.5", lw=1.0, ls=style, label=text)
    axis.set_ylabel("enthalpy [GJ/m³]")
    _legend(axis)


def _compare_fractions(axis: Axes, beside: Steel) -> None:
    lower, upper = (t + ZERO_CELSIUS for t in axis.get_xlim())
    own = _curve(beside.solid_fraction, lower, upper, beside.breakpoints(lower, upper))
    axis.plot(*own, color="0.4", ls="--", lw=1.2, label="solid, built-in")


def _compare_enthalpy(axis: Axes, beside: Steel) -> None:
    drawn = np.asarray(axis.lines[0].get_xdata())
    lower, upper = (float(t) + ZERO_CELSIUS for t in (drawn[0], drawn[-1]))
    at, values = _heat_content(beside, lower, upper)
    axis.plot(at, values / 1e9, color="0.4", ls="--", lw=1.2, label="built-in")


_COMPARED: dict[Callable[..., None], Callable[[Axes, Steel], None]] = {
    _fractions: _compare_fractions,
    _enthalpy: _compare_enthalpy,
}


def _conductivity(axis: Axes, steel: Steel) -> None:
    breaks = steel.breakpoints(COLD, HOT)
    axis.plot(*_curve(steel.conductivity, COLD, HOT, breaks), color=LIQUID, label="conductivity")
    axis.set_ylabel("conductivity [W/(m K)]")
    other = axis.twinx()
    other.plot(*_curve(steel.density, COLD, HOT, breaks), color=DELTA, ls="--", label="density")
    other.set_ylabel("density [kg/m³]")
    # The conductivity slightly above the density, so that two constants do not coincide.
    for one, down, up in ((axis, 0.75, 0.55), (other, 0.55, 0.75)):
        low, high = one.get_ylim()
        middle, span = 0.5 * (low + high), max(high - low, 0.1 * abs(high + low))
        one.set_ylim(middle - down * span, middle + up * span)
    _legend(axis, extra=other)


def _expansion(axis: Axes, steel: Steel) -> None:
    below = np.linspace(COLD, steel.solidus - 1e-2, 500)
    t = np.concatenate([below, [steel.solidus, HOT]])
    axis.plot(
        t - ZERO_CELSIUS,
        1e6 * steel.thermal_expansion(t),
        color=GAMMA,
        label="mean from the solidus",
    )
    axis.set_ylabel("mean expansion [10⁻⁶/K]")
    axis.set_ylim(bottom=0.0)
    other = axis.twinx()
    other.plot(
        t - ZERO_CELSIUS,
        1e2 * steel.thermal_strain(t),
        color=SOLID,
        ls="--",
        label="thermal strain",
    )
    by_phase = 1e2 * steel.transformation_strain(t)
    if np.any(np.abs(by_phase) > 1e-3):
        other.plot(t - ZERO_CELSIUS, by_phase, color=DELTA, ls=":", label="by δ → γ")
    other.set_ylabel("thermal strain [%]")
    _legend(axis, extra=other)
