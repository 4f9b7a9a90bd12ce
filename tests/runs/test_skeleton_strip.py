"""A strip that freezes at one temperature has no mushy zone: a skeleton of it changes nothing."""

from __future__ import annotations

import numpy as np
from runs.billet_runs import run_in_memory

from castfem.model import load_case, shipped_cases


def test_a_skeleton_that_freezes_at_once_neither_folds_nor_bears() -> None:
    """With a flow stress that fell to nothing with the solid fraction its cells folded."""
    path = shipped_cases.find("verification/weiner_boley_coarse")
    found = []
    for mush in ("none", "skeleton"):
        kept = run_in_memory(load_case(path, (f"mechanics.mush={mush}", "casting.length=20 mm")))
        state = kept.states[-1].mechanical
        assert state is not None
        found.append((kept.value("axial_strain"), np.abs(state.stress).max()))
    (strain, stress), (strain_with, stress_with) = found
    assert abs(strain_with / strain - 1.0) < 1e-3
    assert abs(stress_with / stress - 1.0) < 0.02
