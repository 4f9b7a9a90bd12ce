"""A round in a straight mould, where the gap decides on the heat: whole as its quarter."""

from __future__ import annotations

from typing import Any

import pytest
from runs.billet_runs import run_in_memory
from small_case import small

# What makes a round in a mould of its billet.
ROUND: dict[str, Any] = {
    "casting.length": "200 mm",
    "section": {"shape": "round", "diameter": "150 mm"},
    "mesh": {"order": 2, "surface_size": "3 mm", "face_size": "10 mm", "core_size": "10 mm"},
    "cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)",
    "thermal.time.step": "0.25 s",
    "mechanics": {},
    "mould": {"length": "200 mm", "taper": "0 %/m"},
    "coupling": {"interval": "0.25 s"},
    "output": {"figures": False, "fields": []},
}


def test_the_gap_of_a_round_is_that_of_its_quarter() -> None:
    """Windows are repeated, relaxed by sums over the surface: the same share of each vertex."""
    case = small(ROUND)
    quarter, whole = (
        run_in_memory(case.with_({"section.symmetry": part})) for part in ("quarter", "whole")
    )
    for kept in (quarter, whole):
        assert kept.summary is not None
        assert kept.summary.steps["coupling iterations"] > len(kept.samples)
    assert whole.value("heat_removed") == pytest.approx(quarter.value("heat_removed"), rel=1e-7)
