"""Figure of the mould at the optimum: how it closes, and what the strand meets in it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.shown_units import scale_of
from castfem.post.plots.style import DPI, look
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.studies.optimisation.chosen_units import unit_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_NAME = "mould.png"
_WIDTH, _HEIGHT = 5.2, 1.5  # inches, of a panel
_BELOW = -0.04  # of the height of a panel
_COLOURS = ("#0072b2", "#d55e00", "#009e73")
_PANELS = {
    ("gap", "mm"): {"gap_mid_face": "mid-face", "gap_corner": "corner"},
    ("pressure", "MPa"): {
        "contact_pressure_mid_face": "mid-face",
        "contact_pressure_corner": "corner",
        "mean_contact_pressure_max": "largest mean",
    },
    ("in contact", "percent"): {"contact_share": ""},
    ("von Mises", "MPa"): {"von_mises_max": "largest", "von_mises_corner": "corner"},
}
"""What is drawn of a run's history, in its unit, over the distance from the meniscus."""


def draw_mould(head: Sequence[str], rows: Sequence[Sequence[float]], run: Path, path: Path) -> None:
    """Draw a mould and the run in it.

    Args:
        head: Headings of the mould's table.
        rows: Its rows, distance from the meniscus first, mm.
        run: Folder of the run.
        path: Of the file.

    Raises:
        RunFailure: The file cannot be written.
    """
    with look(), replacing(path) as temporary:
        mould_figure(head, rows, run).savefig(temporary, dpi=DPI, format="png")


def mould_figure(head: Sequence[str], rows: Sequence[Sequence[float]], run: Path) -> Figure:
    """Return the figure: a panel for the mould, and one for each that the run's history has."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    history = read_history(run / HISTORY_NAME)
    panels = {
        label: {name: words for name, words in columns.items() if name in history}
        for label, columns in _PANELS.items()
    }
    panels = {label: columns for label, columns in panels.items() if columns}
    length = scale_of("mm")
    end = rows[-1][0]
    position = 1e3 * history["position"].to_numpy()
    inside = position <= end * (1.0 + 1e-9)
    count = 1 + len(panels)
    figure = Figure(figsize=(_WIDTH, 0.5 + _HEIGHT * count), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots(count, 1, squeeze=False, sharex=True)[:, 0]
    for number, (name, colour) in enumerate(zip(head[1:], _COLOURS, strict=False), start=1):
        closed = [rows[0][number] - row[number] for row in rows]
        label = name.removesuffix(" [mm]")
        places = length(np.array([row[0] for row in rows]))
        axes[0].plot(places, length(np.array(closed)), color=colour, label=label, lw=1.2)
    axes[0].set_ylabel(f"narrower by [{length.unit}]", fontsize=8)
    for panel, ((label, unit), columns) in zip(axes[1:], panels.items(), strict=True):
        scale = scale_of(unit, next(iter(columns)))
        for (name, words), colour in zip(columns.items(), _COLOURS, strict=False):
            values = scale(history[name].to_numpy()[inside])
            panel.plot(length(position[inside]), values, color=colour, label=words, lw=1.2)
        panel.set_ylabel(f"{label} [{unit_name(scale.unit)}]", fontsize=8)
        panel.set_ylim(bottom=_BELOW * panel.get_ylim()[1])  # a curve along 0 is seen
    for panel in axes:
        if len(panel.get_lines()) > 1:
            panel.legend(fontsize=7, ncols=3, loc="best", frameon=False)
    axes[-1].set_xlabel(f"below the meniscus [{length.unit}]")
    axes[-1].set_xlim(0.0, length(end))
    return figure
