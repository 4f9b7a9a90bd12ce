"""While slivers of solid freeze in fed liquid the slice keeps its thickness."""

from __future__ import annotations

import pytest
from runs.billet_runs import FED, Kept, billet, run_in_memory

from castfem.base.errors import RunFailure

RUBBING = 'mould.friction={law="coulomb",coefficient=0.3}'
SHORT = ("casting.length=120 mm", *FED)


def strained(window: str, *sets: str) -> Kept:
    return run_in_memory(billet("taper_1", *SHORT, f"coupling.interval={window}", *sets))


def axial_strains(kept: Kept) -> list[float]:
    """Axial strain after each window."""
    return [s.mechanical.generalized_strains[0] for s in kept.states if s.mechanical is not None]


def test_axial_strain_does_not_depend_on_the_window() -> None:
    """It drifted by so much a step: at 20 ms to +0.09 %, with friction to +0.6 %."""
    coarse, fine = (axial_strains(strained(window, RUBBING)) for window in ("0.1 s", "0.04 s"))
    assert max(max(coarse), max(fine)) < 2e-5
    assert coarse[-1] == pytest.approx(-0.6e-3, abs=0.1e-3)
    assert fine[-1] == pytest.approx(coarse[-1], abs=0.6e-4)


def test_a_small_force_moves_planes_without_a_shell_by_next_to_nothing() -> None:
    """A hundredth of a newton on the strand: liquid alone gave way by 0.2 % in 40 mm."""
    kept = strained("0.1 s", "casting.length=40 mm", "mechanics.planes.force=0.01 N")
    strains = axial_strains(kept)
    assert len(strains) > 5
    assert 0.0 < max(strains) < 2e-6


def test_liquid_without_a_wall_is_named_where_no_step_can_hold_it() -> None:
    wide = billet("taper_1", *SHORT, "mould.width=127 mm", "mould.height=127 mm")
    with pytest.raises(
        RunFailure, match=r"smallest step .*; mould\.width: \(127 mm\) leaves a gap"
    ):
        run_in_memory(wide)
