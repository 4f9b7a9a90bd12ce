"""The grid of billets in their moulds: its levels, and what is published of it."""

from __future__ import annotations

import pytest

from benchmarks.billet_grid import (
    COARSE,
    CORNER,
    DEFAULT,
    FINE,
    PATH,
    RESULTS,
    beside,
    errors,
    grid,
    within,
)
from benchmarks.report import Output
from castfem.model import load_case
from castfem.studies.accuracy.sizes import assignments, described, key


def test_the_fine_run_is_the_same_case_with_all_sizes_halved() -> None:
    case = load_case(PATH, next(grid()).keys())
    fine = beside(case, FINE).case
    assert key(fine) == key(case)
    sizes, halved = described(case), described(fine)
    assert {"mesh.corner_size", "tolerance", "window"} <= set(sizes)
    assert halved == pytest.approx({name: 0.5 * size for name, size in sizes.items()})
    assert fine.coupling.settled == 0.5 * case.coupling.settled


def test_the_coarse_run_is_that_of_accuracy_coarse() -> None:
    keys = next(grid()).keys()
    case = load_case(PATH, keys)
    asked = load_case(PATH, (*keys, *assignments(case, COARSE)))
    assert described(beside(case, COARSE).case) == described(asked) != described(case)


def test_an_error_is_three_times_the_difference_of_coarse_and_default() -> None:
    """As `castfem error` has it where two runs tell it; a billet that failed has none."""
    values = {COARSE: 2.0, DEFAULT: 1.5, FINE: 1.2}
    rows = [
        {
            "carbon": "0.12",
            "size": size,
            "failure": failure,
            "level": level,
            **dict.fromkeys(RESULTS, v),
        }
        for size, failure in ((180, ""), (240, "a breakout"))
        for level, v in values.items()
    ]
    found = errors(rows)
    assert [row["result"] for row in found] == [*RESULTS]
    assert found[0]["stated"] == pytest.approx(1.5)
    assert found[0][FINE] == pytest.approx(0.3) and within(found[0])
    assert not within(found[0] | {FINE: 1.51}) and FINE not in errors(rows[:2])[0]


def test_no_published_billet_fails_and_errors_hold_for_nine_of_ten_corners() -> None:
    """Of all 14 billets, on all cells; the page lists the results that are not within."""
    rows = Output().rows("billet_grid")
    assert not any(row["failure"] for row in rows)
    found = errors(rows)
    assert len(found) == len([*grid()]) * len(RESULTS)
    finer = [row for row in found if row["result"] in CORNER]
    assert all(FINE in row for row in finer)
    assert sum(map(within, finer)) >= 0.9 * len(finer)
