"""The figure of a tensile test: stress over strain, beside the analytical answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.post.plots.section import Steel
from castfem.post.plots.style import Abscissa, new_figure

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


def draw_tensile(table: pandas.DataFrame, abscissa: Abscissa, steel: Steel | None) -> Figure | None:
    """Stress over strain; over time if the bar is held for a while."""
    if not {"strain", "stress"} <= set(table.columns):
        return None
    unit = str(table.attrs["units"]["stress"])
    strain = 100.0 * table["strain"].to_numpy()
    by_time = bool((np.abs(np.diff(strain)) <= 1e-9 * np.ptp(strain)).any())
    x = table["time"].to_numpy() if by_time else strain
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    if table.get("analytical_stress") is not None and table["analytical_stress"].notna().any():
        axes.plot(
            x, table["analytical_stress"], color="#e39c37", linewidth=4.0, alpha=0.6,
            label="analytical", solid_capstyle="butt",
        )  # fmt: skip
    axes.plot(x, table["stress"], color="#0072b2", linewidth=1.3, label="integrated")
    axes.set_xlabel("time [s]" if by_time else "strain [%]")
    axes.set_ylabel(f"stress [{unit}]")
    if (table["stress"] >= 0.0).all():
        axes.set_ylim(bottom=0.0)
    axes.legend(loc="best")
    return figure
