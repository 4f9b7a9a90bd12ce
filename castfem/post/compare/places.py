"""Where sections side by side, the scale of their colours and their legend are placed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.post.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ACROSS = 3  # sections side by side
_CELL = 2.2  # inches, the longer side of a section
_LEFT, _RIGHT, _ABOVE, _BELOW = 0.6, 1.0, 0.7, 1.0  # inches around them all
_BESIDE, _BETWEEN = 0.4, 0.65  # inches from one to the next
_MARGIN = 0.04  # of a section
_ENTRY = 1.7  # inches; of the legend


def places(
    drawn: Sequence[NDArray[np.float64]], title: str, *, bar: bool = True, margin: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure with axes [mm] of one scale for all sections, placed by hand.

    Args:
        drawn: (n, 2) what each of them has to show [mm].
        title: Of the figure.
        bar: Leave room for the scale of the colours.
        margin: Leave some room around what is shown.
    """
    sides = np.max([np.ptp(places, axis=0) for places in drawn], axis=0)
    around = _MARGIN * float(sides.max()) if margin else 0.0
    sides = sides + 2.0 * around
    wide, high = (_CELL * side / sides.max() for side in sides)
    across = 2 if len(drawn) == 4 else min(_ACROSS, len(drawn))
    down = math.ceil(len(drawn) / across)
    right = _RIGHT if bar else 0.2
    width = _LEFT + across * wide + (across - 1) * _BESIDE + right
    height = _ABOVE + down * high + (down - 1) * _BETWEEN + _BELOW
    figure = new_figure(width, height, layout="none")
    figure.suptitle(title, fontsize=10.5, y=1.0 - 0.12 / height)
    axes = []
    for number, shown in enumerate(drawn):
        row, column = divmod(number, across)
        left = _LEFT + column * (wide + _BESIDE)
        bottom = _BELOW + (down - 1 - row) * (high + _BETWEEN)
        ax = figure.add_axes((left / width, bottom / height, wide / width, high / height))
        ax.grid(False)
        ax.tick_params(labelsize=8)
        ax.locator_params(nbins=5)
        left, bottom = shown.min(axis=0) - around
        ax.set_xlim(left, left + sides[0])
        ax.set_ylim(bottom, bottom + sides[1])
        # Labels that are not shown still tell the unit of the numbers.
        ax.set_ylabel("y [mm]", visible=column == 0)
        ax.set_xlabel("x [mm]", visible=number + across >= len(drawn))
        axes.append(ax)
    return figure, axes


def bar(figure: Figure, shades: Any, label: str) -> None:
    """The scale of the colours to the right of all sections."""
    width, height = figure.get_size_inches()
    left = width - _RIGHT + 0.15
    tall = height - _ABOVE - _BELOW
    place = figure.add_axes((left / width, _BELOW / height, 0.14 / width, tall / height))
    figure.colorbar(shades, cax=place, label=label)


def legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """The legend below everything, on as many lines as it needs."""
    fitting = max(1, int(figure.get_size_inches()[0] / _ENTRY))
    rows = math.ceil(len(handles) / fitting)
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="lower center",
        ncols=math.ceil(len(handles) / max(rows, 1)) or 1,
        frameon=False,
    )
