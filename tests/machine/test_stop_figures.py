"""Figures of a run whose strand stands for a while: the time on top can be read."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.physics.machine import Changing, Steady, Travel
from castfem.post.plots.style import Abscissa, dress, new_panels


@pytest.mark.parametrize(
    ("way", "end"),
    [
        (Steady(0.06), 10.0),
        (Changing([2.0, 4.0, 64.0, 66.0], [0.06, 0.0, 0.0, 0.06]), 73.0),
        (Changing([0.0, 5.0, 5.1], [0.0, 0.0, 0.06]), 20.0),
    ],
)
def test_times_on_top_stand_apart(way: Travel, end: float) -> None:
    time = np.linspace(0.0, end, 293)
    abscissa = Abscissa(time, np.array([way.position(t) for t in time]))
    figure, axes = new_panels(1, 3.0)
    axes[0].plot(abscissa.values, abscissa.time)
    dress(axes, abscissa)
    figure.canvas.draw()
    (top,) = axes[0].child_axes
    low, high = axes[0].get_xlim()
    ticks = np.array([t for t in top.get_xticks() if 0.0 <= t <= end])
    places = np.interp(ticks, abscissa.time, abscissa.values)
    assert len(ticks) >= 3
    assert np.diff(places).min() > 0.05 * (high - low)
