"""Where sizes are compared on the way: within the mould, and nowhere above the start of a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from castfem.post.compare.table import _way


@pytest.mark.parametrize(
    ("start", "places"), [(0.0, (0.2, 0.4, 0.6)), (0.3, (0.4, 0.6)), (0.6, (0.6,))]
)
def test_no_place_above_the_start_of_a_run(start: float, places: tuple[float, ...]) -> None:
    base: Any = SimpleNamespace(summary=SimpleNamespace(mould_exit=0.6))
    history = pd.DataFrame({"position": np.linspace(start, 2.0, 9)})
    assert _way([history], base, [base]) == pytest.approx(places)
