"""Surface temperatures from roll to roll, above the cooling of each face."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.physics.machine.bending_zones import phases
from castfem.physics.machine.rolls import Rolls
from castfem.physics.machine.spray_layout import KINDS, Stretch
from castfem.post.plots.history import axis_label, curves
from castfem.post.plots.style import Abscissa, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from castfem.model import Case
    from castfem.runs.output.history import Columns

_COLOURS = dict(zip(KINDS, ("#404040", "#f3dfb8", "#2f9bd8", "#a9d6f2"), strict=True))
_NAMES = {
    "run_off": "run-off water",
    "contact": "contact with a roll",
    "shade": "shade (radiation)",
}


def draw_roll_to_roll(table: Columns, abscissa: Abscissa, case: Case) -> Figure | None:
    """Draw the surface temperatures of a case with [secondary]: whole length and detail.

    Returns:
        The figure; None for a run that has not left its mould.
    """
    rolls = None if case.machine is None else case.machine.pairs()
    start = case.cooling[-1].to
    lines = curves(table, "surface_temperature")
    if case.secondary is None or rolls is None or start is None or not lines:
        return None
    end = float(abscissa.position[-1])
    if not abscissa.along or end <= start:
        return None
    faces = faces_met(case, rolls, end)
    lanes = 0.16 * len(faces)  # inches
    panel_height = 2.5  # inches
    figure = new_figure(9.0, 2.0 * (panel_height + lanes) + 1.2)
    ratios = [panel_height, lanes, panel_height, lanes]
    axes = figure.subplots(4, 1, gridspec_kw={"height_ratios": ratios})
    for (panel, strip), ends in zip(
        ((axes[0], axes[1]), (axes[2], axes[3])), ((start, end), close_by(rolls, start, end)),
        strict=True,
    ):  # fmt: skip
        _temperatures(panel, table, abscissa, lines, ends)
        _lanes(strip, faces, ends)
        panel.sharex(strip)
        panel.tick_params(labelbottom=False)
    for number, pair in enumerate(rolls.pairs, 1):
        low, high = axes[3].get_xlim()
        if low < pair.position < high:
            axes[2].axvline(pair.position, color="#bfbfbf", linewidth=0.6, zorder=0.5)
            axes[2].annotate(
                f"#{number}", (pair.position, 1.0), xycoords=("data", "axes fraction"),
                xytext=(0, 2), textcoords="offset points", ha="center", fontsize=7.5,
            )  # fmt: skip
    axes[0].legend(ncols=3, loc="upper right", fontsize=8)
    axes[0].set_ylabel(axis_label(table, lines[0][2]), gid=lines[0][2])
    axes[2].set_ylabel(axis_label(table, lines[0][2]), gid=lines[0][2])
    axes[3].set_xlabel("position below the meniscus [m]")
    for kind in KINDS:
        axes[3].plot([], [], "s", color=_COLOURS[kind], label=_NAMES.get(kind, kind))
    axes[3].legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, -1.0), fontsize=8)
    return figure


def faces_met(case: Case, rolls: Rolls, end: float) -> dict[str, tuple[Stretch, ...]]:
    """Return the stretches of each face down to a position, m, by its label."""
    table, height = case.secondary, case.section.outline()[1]
    assert table is not None and height is not None
    line, rows = rolls.line(height), table.rows(rolls, height)
    found: dict[str, tuple[Stretch, ...]] = {}
    for group in case.section.outer_groups():
        if not group.startswith("corner"):
            met = table.on_face(group, rolls, rows, line.inclination, end)[1]
            found[group.removeprefix("wide_face_").replace("_", " ")] = met
    return found


def close_by(rolls: Rolls, start: float, end: float) -> tuple[float, float]:
    """Ends of the detailed range: straightening, or else the last pitches passed, m."""
    pitches, places = 8, [pair.position for pair in rolls.pairs]
    for phase in phases(rolls):
        if phase.kind == "straightening" and places[phase.last] <= end:
            first, last = places[phase.first], places[phase.last]
            return first - 0.5 * (last - first) / pitches, last + 0.5 * (last - first) / pitches
    met = [place for place in places if start < place < end]
    return (met[-pitches] if len(met) >= pitches else start), end


def _temperatures(
    axes: Axes,
    table: Columns,
    abscissa: Abscissa,
    lines: list[tuple[str, str, str]],
    ends: tuple[float, float],
) -> None:
    """Plot the surface temperatures between two positions, m."""
    within = (abscissa.position >= ends[0]) & (abscissa.position <= ends[1])
    shown = []
    for name, colour, column in lines:
        values = np.asarray(table[column])
        axes.plot(abscissa.position, values, color=colour, linewidth=1.1, label=name)
        shown.append(values[within])
    found = np.concatenate(shown)
    found = found[np.isfinite(found)]
    if found.size:
        room = max(float(np.ptp(found)), 1.0)
        axes.set_ylim(found.min() - 0.08 * room, found.max() + 0.02 * room)
    axes.set_xlim(*ends)


def _lanes(axes: Axes, faces: dict[str, tuple[Stretch, ...]], ends: tuple[float, float]) -> None:
    """Draw the stretches of each face, one lane per face."""
    for lane, met in enumerate(faces.values()):
        for kind in KINDS:
            spans = [(s.start, s.end - s.start) for s in met if s.kind == kind]
            axes.broken_barh(spans, (lane - 0.42, 0.84), facecolor=_COLOURS[kind], linewidth=0.0)
    axes.set_yticks(range(len(faces)), list(faces), fontsize=8)
    axes.set_ylim(len(faces) - 0.5, -0.5)
    axes.set_xlim(*ends)
    axes.grid(False)
