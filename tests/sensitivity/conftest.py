"""Stages solved to rounding, so that differences of runs can be compared with derivatives."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from castfem.physics.thermal import problem as heat_balance
from castfem.physics.thermal.stage import BalanceLimits


@pytest.fixture(autouse=True, scope="module")
def exact() -> Iterator[None]:
    """Let Newton's method close the balance of a stage to rounding, for differences of runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(heat_balance, "LIMITS", BalanceLimits(newton=1e-13))
        yield
