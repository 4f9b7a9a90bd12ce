"""Pictures of a caster: side view with the phases of its rolls; resistance and drives."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.physics.machine.bending_zones import phases
from castfem.physics.machine.rolls import Rolls
from castfem.physics.machine.side import Side
from castfem.post.plots.style import head, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from castfem.physics.machine.extraction.drives import Shares
    from castfem.physics.machine.extraction.effort import KnownResistance


_COLOURS = {
    "vertical": "#d9d9d9",
    "bending": "#e69f00",
    "arc": "#f0d9b0",
    "straightening": "#d55e00",
    "straight": "#d9d9d9",
}
_COPPER, _ROLL, _DRIVEN, _WATER = "#b87333", "#9aa5b1", "#1f4e79", "#2f9bd8"
_DEFECT = "#c1121f"
_RESISTANCE, _POTENTIAL, _EFFORT, _LEFT = "#d55e00", "#1f4e79", "#0072b2", "#c6d4e1"


@dataclass(frozen=True, slots=True)
class Spray:
    """A spray in side view."""

    start: float  #: its start on the face, from the meniscus, m
    end: float  #: its end, m
    stand_off: float  #: distance of its nozzle from the face, m
    inside: bool  #: whether it is on the intrados
    #: whether its nozzles have another share of their water than nominal
    defect: bool = False


def draw(
    rolls: Rolls,
    thickness: float,
    path: str | os.PathLike[str],
    *,
    mould_end: float | None = None,
    marks: Sequence[tuple[float, str]] = (),
    sprays: Sequence[Spray] = (),
    title: str = "",
) -> None:
    """Draw a machine to a picture file; thickness, end of the mould and marks are in m."""
    side = Side(rolls, thickness, max((place for place, _ in marks), default=0.0))
    with look():
        span = np.ptp(side.extrados, axis=0) + 1.0
        width = 11.0  # inches
        figure = new_figure(width, float(np.clip(width * span[1] / span[0], 4.0, 11.0)) + 0.6)
        ax = figure.subplots()
        _strand(ax, side, mould_end)
        _rolls(ax, side)
        _sprays(ax, side, sprays)
        _numbers(ax, side)
        _marks(ax, side, marks)
        ax.set_aspect("equal")
        ax.set_xlabel("from the mould [m]")
        ax.set_ylabel("height above the meniscus [m]")
        ax.legend(loc="upper right")
        head(figure, title, 10.5)
        figure.savefig(path, dpi=130)


def _strand(ax: Axes, side: Side, mould_end: float | None) -> None:
    """The strand, coloured by phase of the machine, and the mould around its top."""
    pairs, named = side.rolls.pairs, set[str]()
    first, last = pairs[0].position, pairs[-1].position
    parts = [
        (phase.kind, pairs[phase.first].position, pairs[phase.last].position)
        for phase in phases(side.rolls)
    ]
    ends = ((None, 0.0, first), *parts, (None, last, float(side.s[-1])))
    for kind, start, end in ends:
        colour = _COLOURS[kind or "vertical"]
        label = kind if kind in ("bending", "arc", "straightening") and kind not in named else None
        named |= {label} if label else set()
        ax.fill(*side.part(start, end).T, color=colour, linewidth=0.0, label=label)
    if mould_end is None:
        return
    for face, outward in ((side.extrados, -1.0), (side.intrados, 1.0)):
        inside = side.s <= mould_end
        wall = face[inside] + outward * 0.06 * side.inward[inside]
        outline = np.concatenate([face[inside], wall[::-1]])
        name = "mould" if outward < 0.0 else None
        ax.fill(*outline.T, color=_COPPER, linewidth=0.0, label=name)


def _rolls(ax: Axes, side: Side) -> None:
    """Draw all rolls, driven ones darker."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle, Patch

    drawn: dict[str, list[Patch]] = {"rolls": [], "driven rolls": [], "rolls with a defect": []}
    for pair in side.rolls.pairs:
        kind = "driven rolls" if pair.driven else "rolls"
        for centre in side.across(pair.position, 0.5 * pair.diameter):
            if not pair.lost:
                circle = Circle(tuple(centre), 0.5 * pair.diameter)
                drawn["rolls with a defect" if pair.defect else kind].append(circle)
    colours = {"rolls": _ROLL, "driven rolls": _DRIVEN, "rolls with a defect": _DEFECT}
    for label, circles in drawn.items():
        if circles:
            colour = colours[label]
            ax.add_collection(PatchCollection(circles, facecolor=colour, edgecolor="none"))
            ax.plot([], [], "o", color=colour, label=label)


def _marks(ax: Axes, side: Side, marks: Sequence[tuple[float, str]]) -> None:
    """A line across the strand at each marked position, with its text beyond the intrados."""
    for after, (place, words) in enumerate(sorted(marks, reverse=True)):
        beyond = (1.0 + 0.7 * after) * 0.6  # m; texts are placed one above the other
        line = np.array([side.across(place, 0.0)[0], side.across(place, beyond)[1]])
        ax.plot(*line.T, color="k", linewidth=2.0)
        ax.annotate(words, line[1], (4, 2), textcoords="offset points", fontsize=8.5)


def _numbers(ax: Axes, side: Side) -> None:
    """Numbers of some rolls, beside those of the extrados."""
    for i in numbered(side.rolls):
        pair = side.rolls.pairs[i]
        x, y = side.across(pair.position, pair.diameter)[0]
        off = -11.0 * side.at(side.inward, pair.position)  # points
        ax.annotate(
            f"#{i + 1}", (x, y), (off[0], off[1]), textcoords="offset points", fontsize=7.5,
            color=_DEFECT if pair.defect else "k", ha="center", va="center",
        )  # fmt: skip


def numbered(rolls: Rolls) -> list[int]:
    """Indices of pairs to be numbered: with a defect, driven, first, last, every fifth.

    Of two neighbours only one is numbered; of defective ones both.
    """
    pairs = rolls.pairs
    found = {i for i, pair in enumerate(pairs) if pair.defect}
    for more in (
        [i for i, pair in enumerate(pairs) if pair.driven],
        [0, len(pairs) - 1],
        range(4, len(pairs), 5),
    ):
        found |= {i for i in more if not {i - 1, i + 1} & found}
    return sorted(found)


def _sprays(ax: Axes, side: Side, sprays: Sequence[Spray]) -> None:
    """Draw every spray, from its nozzle to its area on the face."""
    from matplotlib.collections import PolyCollection

    fans: dict[str, list[Array]] = {"sprays": [], "sprays with a defect": []}
    for spray in sprays:
        middle, which = 0.5 * (spray.start + spray.end), 1 if spray.inside else 0
        ends = [side.across(place, 0.0)[which] for place in (spray.start, spray.end)]
        nozzle = side.across(middle, spray.stand_off)[which]
        kind = "sprays with a defect" if spray.defect else "sprays"
        fans[kind].append(np.array([nozzle, *ends]))
    for (label, shapes), colour in zip(fans.items(), (_WATER, _DEFECT), strict=True):
        if shapes:
            ax.add_collection(PolyCollection(shapes, facecolor=colour, edgecolor="none"))
            ax.plot([], [], "v", color=colour, label=label)


def draw_drives(
    rolls: Rolls, known: KnownResistance, path: str | os.PathLike[str], title: str = ""
) -> None:
    """Draw resistance and axial force over position, and each drive's load (Figs 144-145, 174)."""
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
    """Cumulative resistance, drive forces, and capacity of the drives."""
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
    """Axial force, reduced at each drive; defective rolls are marked."""
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
    """Load of each drive, and its remaining capacity."""
    driven = np.flatnonzero(capacities > 0.0)
    names = [f"#{i + 1}" for i in driven]
    load = 1e-3 * shares.drive[driven]
    axes.bar(names, load, color=_POTENTIAL, label="pulls")
    left = 1e-3 * capacities[driven] - load
    if np.isfinite(left).all():
        axes.bar(names, left, bottom=load, color=_LEFT, label="has left")
    axes.set_ylabel("drive [kN]")
    axes.legend()
