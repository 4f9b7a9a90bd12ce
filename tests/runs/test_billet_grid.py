"""Ordinary billets in their moulds: no false breakout, and no corner that goes back and forth."""

from __future__ import annotations

import numpy as np
import pytest

import castfem
from benchmarks.billet_grid import CARBONS, LAWS, SPEEDS, TAPERS, Billet
from castfem.model import load_case, shipped_cases

pytestmark = pytest.mark.slow

OPEN = 0.02  # mm
MELTED = 0.3  # mm; what cells of 1.2 mm see at 0.12 % C, and finer ones do not
CELLS = ("surface_size=1.2 mm", "corner_size=1.2 mm", "face_size=12 mm", "core_size=15 mm")
BILLETS = [
    Billet(
        CARBONS[number % len(CARBONS)],
        [*SPEEDS][number % len(SPEEDS)],
        [*LAWS][(number // 2) % len(LAWS)],
        TAPERS[(2 * number) % len(TAPERS)],
    )
    for number in range(10)
]


@pytest.mark.parametrize("billet", BILLETS, ids=lambda b: f"{b.carbon}-{b.size}-{b.law}-{b.taper}")
def test_a_billet_keeps_its_shell(billet: Billet) -> None:
    """The first 60 mm: its corner leaves the wall, comes back at most once, and hardly melts."""
    keys = (*billet.keys(), "casting.length=60 mm", *(f"mesh.{one}" for one in CELLS))
    case = load_case(shipped_cases.find("billet180/peritectic"), keys)
    with castfem.run(case) as result:
        table = result.history
    apart = table["gap_corner"].to_numpy() > OPEN
    assert np.count_nonzero(np.diff(apart.astype(int)) == 1) <= 2
    shell = table["shell_corner"].to_numpy()
    assert np.max(np.maximum.accumulate(shell) - shell) < MELTED
    assert table["energy_error"].abs().max() < 1e-9
