"""The figure of a calibration: measured values beside the case before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_units import plain_unit
from castfem.base.types import Array
from castfem.post.plots.style import look, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Compared:
    """A result where it was measured.

    Attributes:
        name: Of the result. label: What it is. unit: Of the values.
        position: (n,), m. measured: (n,). error: (n,), NaN where none is known.
        before: Of the case as it was (n,). after: As fitted (n,).
    """

    name: str
    label: str
    unit: str
    position: Array
    measured: Array
    error: Array
    before: Array
    after: Array


@look()
def draw_calibration(panels: Sequence[Compared]) -> Figure:
    """One panel a result, over the position."""
    figure = new_figure(7.2, 0.9 + 2.6 * len(panels))
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for ax, panel in zip(axes, panels, strict=True):
        order = np.argsort(panel.position)
        at = panel.position[order]
        known = np.isfinite(panel.error).all()
        ax.errorbar(
            at, panel.measured[order], yerr=panel.error[order] if known else None,
            fmt="o", color="#333333", markersize=4, capsize=2, label="measured",
        )  # fmt: skip
        ax.plot(at, panel.before[order], color="#999999", ls="--", marker=".", label="before")
        ax.plot(at, panel.after[order], color="#0072b2", marker=".", label="fitted")
        ax.set_ylabel(f"{panel.label} [{plain_unit(panel.unit)}]", gid=panel.name)
    axes[0].legend(loc="best")
    axes[-1].set_xlabel("position below the meniscus [m]")
    return figure
