"""The taper that just keeps a bound is read off runs about it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.optimum_time import just_kept


def test_between_runs_on_a_line_it_is_where_the_line_crosses() -> None:
    tapers = [0.5, 0.6, 0.8]
    found = just_kept(tapers, [0.3 * (t - 0.67) for t in tapers], [5.0 + 20.0 * t for t in tapers])
    assert found == pytest.approx([0.67, 18.4], rel=1e-9)


def test_a_run_that_just_keeps_it_is_the_answer() -> None:
    found = just_kept([0.5, 0.6, 0.8], [-1.0, 0.0, 0.5], [4.0, 7.0, 9.0])
    assert found == pytest.approx([0.6, 7.0])


def test_runs_that_all_miss_it_have_no_answer() -> None:
    with pytest.raises(ValueError):
        just_kept([0.5, 0.6], [-2.0, -1.0], list(np.ones(2)))
