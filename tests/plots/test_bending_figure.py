"""The figure of a bent strand: three thicknesses, neutral axis within its faces, axial stress."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

from castfem.plots.bending import draw_slice
from castfem.plots.style import Abscissa, look


def history() -> pandas.DataFrame:
    """A strand that is bent from 1 to 2 m, its neutral axis 20 mm towards the intrados."""
    position = np.linspace(0.0, 4.0, 41)
    k = 0.1 * np.clip(position - 1.0, 0.0, 1.0)
    table = pandas.DataFrame({"time": 50.0 * position, "position": position})
    for place, y in (("intrados", 0.1), ("centre", 0.0), ("extrados", -0.1)):
        table[f"slice_thickness_{place}"] = (1.0 - k * y) / (1.0 - k * 0.02)
    table["neutral_axis"] = np.where((position > 1.0) & (position <= 2.0), 20.0, np.nan)
    table["size_mid_face_intrados"] = 200.0
    table["axial_stress_corner_intrados"] = -100.0 * k
    table.attrs["units"] = {"neutral_axis": "mm", "axial_stress_corner_intrados": "MPa"}
    return table


def test_the_slice_is_drawn_over_the_strand() -> None:
    table = history()
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    with look():
        figure = draw_slice(table, abscissa, None)
        assert draw_slice(table.drop(columns="slice_thickness_centre"), abscissa, None) is None
    assert figure is not None
    thickness, axis, stress = figure.axes[:3]
    drawn = {line.get_label(): line.get_ydata() for line in thickness.get_lines()}
    for place in ("intrados", "centre", "extrados"):
        assert drawn[place] == pytest.approx(table[f"slice_thickness_{place}"])
    faces = [line.get_ydata()[0] for line in axis.get_lines()[1:]]
    assert faces == [100.0, -100.0]
    assert np.nanmax(axis.get_lines()[0].get_ydata()) == 20.0
    assert {text.get_text() for text in axis.texts} == {"intrados", "extrados"}
    assert axis.get_ylabel() == "neutral axis (y) [mm]"
    assert stress.get_ylabel() == "axial stress [MPa]"
