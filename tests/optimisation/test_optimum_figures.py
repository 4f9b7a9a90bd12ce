"""Figures of an optimum: the mould with what the strand meets in it, and what the inputs do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from known_results import HEAT, SPEED, STRESS, solve
from matplotlib.colors import to_hex
from small_case import small

from castfem.base.shown_units import Scale, ShownUnits, shown_in
from castfem.post.plots.studies import indices_figure, mould_figure, optimum_figure
from castfem.post.plots.style import save
from castfem.studies.optimisation import Study
from castfem.studies.optimisation.optimum import Spread, SpreadRow

HEAD = ["distance [mm]", "width [mm]", "diagonal [mm]"]
ROWS = [[0.0, 125.0, 172.6], [300.0, 124.8, 172.3], [600.0, 124.6, 172.0]]
SPREAD = Spread(
    ("h [times]", "steel.overrides.solidus.value [degC]"),
    (
        SpreadRow("von_mises_max", (-1.0, 2.0), "MPa", 0.1, None, (0.25, 0.5), (0.5, 0.75)),
        SpreadRow("mould.taper", (-0.02, 0.03), "%/m", None, None, (0.9, 0.1), (0.9, 0.1)),
    ),
    32, 0, False, False,
)  # fmt: skip


def run(folder: Path, **columns: Any) -> Path:
    z = np.array([0.0, 0.3, 0.6, 0.9])
    table = pd.DataFrame({"time [s]": z / 0.06, "position [m]": z, **columns})
    table.to_csv(folder / "history.csv", index=False)
    return folder


def test_the_mould_and_the_run_in_it(tmp_path):
    """Down to the end of the mould, with the panels that the run has columns for."""
    gaps = {"gap_mid_face [mm]": [0.0, 0.01, 0.02, 9.0], "gap_corner [mm]": [0.0, 0.02, 0.1, 9.0]}
    folder = run(tmp_path, **gaps, **{"von_mises_max [MPa]": [0.0, 3.0, 7.0, 99.0]})
    sizes, gap, stress = mould_figure(HEAD, ROWS, folder).axes
    assert [line.get_label() for line in sizes.get_lines()] == ["width", "diagonal"]
    assert sizes.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.3, 0.6])
    assert gap.get_lines()[1].get_xdata() == pytest.approx([0.0, 300.0, 600.0])
    assert gap.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.02, 0.1])
    assert stress.get_lines()[0].get_ydata() == pytest.approx([0.0, 3.0, 7.0])
    assert stress.get_xlim() == (0.0, 600.0)
    with shown_in(ShownUnits("si")):
        sizes, gap, stress = mould_figure(HEAD, ROWS, folder).axes
    assert (stress.get_ylabel(), stress.get_xlabel()) == (
        "von Mises [Pa]",
        "below the meniscus [m]",
    )
    assert sizes.get_lines()[1].get_ydata() == pytest.approx([0.0, 0.3e-3, 0.6e-3])
    assert gap.get_lines()[1].get_xdata() == pytest.approx([0.0, 0.3, 0.6])
    assert stress.get_lines()[0].get_ydata() == pytest.approx([0.0, 3e6, 7e6])
    assert len(mould_figure(HEAD, ROWS, run(tmp_path)).axes) == 1
    save(mould_figure(HEAD, ROWS, folder), tmp_path / "mould.png")
    assert (tmp_path / "mould.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("constraints", [[], ["heat_removed >= 2 MJ/m"]])
def test_the_bands_of_an_optimum_are_explained(tmp_path: Path, constraints: list[str]) -> None:
    """The grey one is the interval; the orange one, of constraints alone, their error about 0."""
    table = {"minimise": STRESS, "variable": [SPEED], "constraints": constraints}
    asked = Study(small({"casting.length": "6 mm", "optimise": table}))
    optimum = solve(asked, lambda w: {STRESS: (w.values[0] - 3.0) ** 2, HEAT: 1e6 * w.values[0]})
    (legend,) = optimum_figure(optimum).legends
    said = dict(zip((t.get_text() for t in legend.texts), legend.legend_handles, strict=True))
    assert {"best", "cannot be told from the best"} <= set(said)
    assert [one for one in said if one.startswith("error")] == (
        ["error of what is left, about 0"] if constraints else []
    )
    for line, handle in said.items():
        if line.startswith("error"):
            assert to_hex(handle.get_facecolor()) == "#d55e00" and handle.get_alpha() == 0.15
    save(optimum_figure(optimum), tmp_path / "optimum.png")
    assert (tmp_path / "optimum.png").read_bytes().startswith(b"\x89PNG")


def test_the_indices_of_each_input(tmp_path):
    stress, place = indices_figure(SPREAD).axes
    assert [bar.get_width() for bar in stress.patches] == [0.5, 0.75, 0.25, 0.5]
    assert [text.get_text() for text in stress.get_yticklabels()] == [
        "h", "steel.overrides.solidus.value [degC]",
    ]  # fmt: skip
    assert place.get_title() == "mould.taper\n-0.02 to +0.03 %/m"
    stress, _ = indices_figure(SPREAD, [Scale("Pa", 1e6), Scale("%/m")]).axes
    assert stress.get_title() == "von_mises_max\n-1e+06 to +2e+06 Pa"
    save(indices_figure(SPREAD), tmp_path / "spread.png")
    assert (tmp_path / "spread.png").read_bytes().startswith(b"\x89PNG")
