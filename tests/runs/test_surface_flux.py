"""The heat flux told of a place of the surface is that place's own."""

from __future__ import annotations

import pytest
from billet_runs import billet, run_in_memory


@pytest.mark.parametrize(
    ("cooled", "other"), [("mid_face", "narrow_face"), ("narrow_face", "mid_face")]
)
def test_through_a_face_that_nothing_cools_flows_nothing(cooled: str, other: str) -> None:
    on = {"mid_face": "wide_face", "narrow_face": "narrow_face"}[cooled]
    case = billet(
        "thermal", "casting.length=30 mm", f"cooling.mould.surface.0.on=['{on}']", "mesh.order=1"
    )
    last = run_in_memory(case).samples[-1]
    assert last.flux[cooled] > 1e6
    assert last.flux[other] == 0.0


NO_HEAT = ", wall_emissivity=1e-6"
RADIATING = (
    'cooling.mould.surface=[{law="contact", coefficient="1600 W/(m^2 K)", wall="160 degC", '
    'gap_conductivity="0.15 W/(m K)"%s}, '
    '{law="radiation", emissivity=0.8, ambient="160 degC", absorption="200 1/m"%s}]'
)


def _heat(gap: str, of: str) -> float:
    summary = run_in_memory(
        billet("thermal", "casting.length=60 mm", RADIATING % (gap, of))
    ).summary
    assert summary is not None
    return summary.quantities["heat_removed"].value


def test_radiation_counts_where_there_is_a_gap_alone() -> None:
    """Of a case's own gap; and on the groups that both have."""
    touching = _heat(', gap="0 mm"', "")
    assert touching == _heat(', gap="0 mm"', ', on=["narrow"]')
    parts = ("", ', on=["narrow"]', ', on=["wide"]', NO_HEAT)
    all_round, one, other, none = (_heat(', gap="0.5 mm"', part) for part in parts)
    assert touching > all_round > one > none
    assert other == pytest.approx(one, rel=1e-9)  # a square


def test_radiation_crosses_the_gap_of_the_mould() -> None:
    """A mould that opens: the corner, which touches nothing, loses more heat with radiation."""
    opens = ("taper_minus_1", "casting.length=90 mm")
    with_, without = (
        run_in_memory(billet(*opens, RADIATING % ("", of))).samples[-1] for of in ("", NO_HEAT)
    )
    assert with_.mechanics is not None
    gap = with_.mechanics.gap["corner"]
    assert gap > 20e-6
    assert with_.flux["corner"] > without.flux["corner"]
