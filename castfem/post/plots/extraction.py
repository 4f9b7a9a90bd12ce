"""Draw what the rolls of a machine resist with, what its drives take, and what is in the strand."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.post.plots.style import head, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.physics.machine.extraction.drives import Shares
    from castfem.physics.machine.extraction.effort import KnownResistance
    from castfem.physics.machine.rolls import Rolls

_RESISTANCE, _POTENTIAL, _EFFORT = "#d55e00", "#1f4e79", "#0072b2"
_LEFT = "#c6d4e1"


def draw(
    rolls: Rolls, known: KnownResistance, path: str | os.PathLike[str], title: str = ""
) -> None:
    """Draw resistance and effort over position, and the load of each drive (Figs 144-145, 174)."""
    place = np.array([pair.position for pair in rolls.pairs])
    steps, shares, capacities = known.steps, known.shares, known.capacities
    with look():
        figure = new_figure(9.0, 8.4)
        total, effort, drives = figure.subplots(3)
        _cumulated(total, place, steps, shares, capacities)
        _effort(effort, place, shares, rolls)
        _loads(drives, shares, capacities)
        head(figure, title, 10.5)
        figure.savefig(path, dpi=130)


def _cumulated(axes: Axes, place: Array, steps: Array, shares: Shares, capacities: Array) -> None:
    """Resistance to each position, what drives take of it, and what they could at most."""
    for values, colour, style, label in (
        (steps, _RESISTANCE, "-", "resistance of the rolls"),
        (shares.drive, _POTENTIAL, "-", "taken by the drives"),
        (capacities, _POTENTIAL, ":", "what the drives could take"),
    ):
        if np.isfinite(values).all():
            axes.step(place, 1e-3 * np.cumsum(values), where="post", color=colour, ls=style,
                      label=label)  # fmt: skip
    axes.set_ylabel("sum to here [kN]")
    axes.set_xlim(0.0, float(place[-1]) + 0.5)
    axes.set_ylim(bottom=0.0)
    axes.legend()


def _effort(axes: Axes, place: Array, shares: Shares, rolls: Rolls) -> None:
    """Axial effort, down at each drive; rolls with a defect are marked."""
    at = np.repeat(place, 2)
    value = np.column_stack([shares.effort, shares.effort - shares.drive]).ravel()
    axes.plot(at, 1e-3 * value, color=_EFFORT)
    axes.fill_between(at, 1e-3 * value, color=_EFFORT, alpha=0.15, linewidth=0.0)
    for i, pair in enumerate(rolls.pairs):
        if pair.defect:
            axes.axvline(pair.position, color=_RESISTANCE, linewidth=0.9, linestyle="--")
            axes.annotate(f"#{i + 1} {pair.defect}", (pair.position, 0.97), (-3, 0),
                          xycoords=axes.get_xaxis_transform(), textcoords="offset points",
                          ha="right", va="top", rotation=90, fontsize=8)  # fmt: skip
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    axes.set_ylabel("effort in the strand [kN]")
    axes.set_xlabel("position [m]")
    axes.set_xlim(0.0, float(place[-1]) + 0.5)


def _loads(axes: Axes, shares: Shares, capacities: Array) -> None:
    """Load of each drive, and what it has left."""
    driven = np.flatnonzero(capacities > 0.0)
    names = [f"#{i + 1}" for i in driven]
    load = 1e-3 * shares.drive[driven]
    axes.bar(names, load, color=_POTENTIAL, label="pulls")
    left = 1e-3 * capacities[driven] - load
    if np.isfinite(left).all():
        axes.bar(names, left, bottom=load, color=_LEFT, label="has left")
    axes.set_ylabel("drive [kN]")
    axes.legend()
