"""Error against run time of the coupled billet, one refinement a colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    "mesh": "#0072b2", "interval": "#d55e00", "gap settled": "#009e73", "penalty": "#cc79a7",
    "Nitsche": "#777777",
}  # fmt: skip
SHOWN = (
    ("von_mises_max", "error of the peak stress [MPa]"),
    ("surface_temperature_corner", "error of the surface, corner [K]"),
)
LEAST = 1e-4  # of the axis: what agrees to rounding is drawn there


def draw(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Difference to the finest run of each family against processor time.

    Args:
        rows: By mould, as `billet_convergence_*.csv` holds them: "refined" is "family = value".
    """
    from castfem.output.style import look, new_figure

    with look():
        figure = new_figure(8.0, 6.2)
        grid = figure.subplots(len(rows), len(SHOWN), squeeze=False)
        for axes, (mould, found) in zip(grid, rows.items(), strict=True):
            for axis, (key, label) in zip(axes, SHOWN, strict=True):
                for family, colour in COLOURS.items():
                    own = [r for r in found if r["refined"].startswith(family) and not r["failure"]]
                    *coarse, finest = own
                    errors = [max(abs(r[key] - finest[key]), LEAST) for r in coarse]
                    times = [r["seconds"] for r in coarse]
                    axis.plot(times, errors, "o-", color=colour, label=family, linewidth=1.2)
                axis.set(xscale="log", yscale="log", xlabel="processor time [s]", ylabel=label)
                axis.xaxis.set_major_formatter("{x:g}")
                axis.xaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "25" else "")
                axis.set_title(mould)
        grid[0][0].legend(loc="best", fontsize=8)
    return figure
