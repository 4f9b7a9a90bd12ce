"""A round in a straight mould, where the gap decides on the heat: whole as its quarter."""

from __future__ import annotations

from pathlib import Path

import pytest
from time_loop.moulded import marched

from castfem.case import load_case

ROUND = """
title = "round"

[casting]
speed = "3.6 m/min"
length = "200 mm"
superheat = "40 K"

[steel]
name = "carbon_042"

[section]
shape = "round"
diameter = "150 mm"

[mesh]
order = 2
surface_size = "3 mm"
face_size = "10 mm"
core_size = "10 mm"

[[cooling]]
name = "mould"

[[cooling.surface]]
law = "contact"
coefficient = "1600 W/(m^2 K)"
gap_conductivity = "0.15 W/(m K)"
wall = "160 degC"

[thermal.time]
step = "0.25 s"

[mechanics]

[mould]
length = "200 mm"
taper = "0 %/m"

[coupling]
interval = "0.25 s"

[output]
figures = false
fields = []
"""


def test_the_gap_of_a_round_is_that_of_its_quarter(tmp_path: Path) -> None:
    """Intervals are repeated, relaxed by sums over the surface: the same share of each vertex."""
    path = tmp_path / "round.toml"
    path.write_text(ROUND)
    quarter, whole = (
        marched(load_case(path, (f"section.symmetry={part}",))) for part in ("quarter", "whole")
    )
    for kept in (quarter, whole):
        assert kept.summary is not None
        assert kept.summary.steps["passes through intervals"] > len(kept.samples)
    assert whole.value("heat_removed") == pytest.approx(quarter.value("heat_removed"), rel=1e-7)
