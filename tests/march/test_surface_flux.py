"""The heat flux told of a place of the surface is that place's own."""

from __future__ import annotations

import pytest
from moulded import billet, marched


@pytest.mark.parametrize(
    ("cooled", "other"), [("mid_face", "narrow_face"), ("narrow_face", "mid_face")]
)
def test_through_a_face_that_nothing_cools_flows_nothing(cooled: str, other: str) -> None:
    on = {"mid_face": "wide_face", "narrow_face": "narrow_face"}[cooled]
    case = billet(
        "thermal", "casting.length=30 mm", f"cooling.mould.surface.0.on=['{on}']", "mesh.order=1"
    )
    last = marched(case).readings[-1]
    assert last.flux[cooled] > 1e6
    assert last.flux[other] == 0.0
