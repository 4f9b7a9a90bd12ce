"""Small studies: the grid of the corner and its error, what a sweep costs, diagrams of steels."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import grades, peritectic, sweep_cost
from benchmarks.billet_grid import (
    COARSE,
    CORNER,
    DEFAULT,
    FINE,
    PATH,
    RESULTS,
    STATED,
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


def test_a_result_is_within_its_error_or_not() -> None:
    """A billet that failed has none."""
    values = {COARSE: 2.0, DEFAULT: 1.5, FINE: 1.2, STATED: 0.4}
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
    assert found[0]["stated"] == 0.4 and found[0][COARSE] == pytest.approx(0.5)
    assert found[0][FINE] == pytest.approx(0.3) and within(found[0])
    assert not within(found[0] | {FINE: 0.41}) and FINE not in errors([rows[1], rows[3]])[0]


def test_no_published_billet_fails_and_errors_hold_for_19_of_20_corners() -> None:
    """Of all 14 billets, on all cells; the page lists the results that are not within."""
    rows = Output().rows("billet_grid")
    assert not any(row["failure"] for row in rows)
    found = errors(rows)
    assert len(found) == len([*grid()]) * len(RESULTS)
    finer = [row for row in found if row["result"] in CORNER]
    assert all(FINE in row for row in finer)
    assert sum(map(within, finer)) >= 0.95 * len(finer)


# The table of what a sweep costs: shares of the whole, and the pairs


def test_shares_are_those_of_the_whole(tmp_path: Path) -> None:
    times = {"march": (3.0, 32), "each": (0.5, 32), "first": (1.0, 2), "imports": (2.0, 2)}
    times |= {"parent": (2.0, 1), "figures": (2.0, 0)}
    output = Output(tmp_path, "scripting.md")
    output.csv(
        "sweep_cost",
        [
            {"part": part, "each [s]": each, "times": count, "whole [s]": 121.0}
            for part, (each, count) in times.items()
        ],
    )
    pairs = [(False, 8.0), (True, 5.0), (False, 9.0), (True, 4.0)]
    output.csv(
        "sweep_at_once",
        [{"turn": 0, "at once": way, "wall [s]": wall, "load": 0.1} for way, wall in pairs],
    )
    sweep_cost.show(output)
    text = output.page.read_text(encoding="utf-8")
    assert "| the time loops | 3.00 | 32 | 80.0 |" in text
    assert "| start of a worker, its imports | 2.00 | 2 | 3.3 |" in text
    assert "figures of a run, with `--figures` | 2.00 |  |  |" in text
    assert "took 121 s, the parts add up to 120 s" in text and "2.00 times as fast" in text


def test_tapers_are_as_many_as_runs() -> None:
    assert len(set(sweep_cost.tapers(32))) == 32


def test_the_corner_s_meshes_that_go_up_and_down_have_three_times_their_difference() -> None:
    """Of the case and the finer one, which is more than half of that to the coarser one."""
    shells = {"cells 1 mm": 17.0, "default": 13.0, "cells 0.5 mm": 15.0}
    rows = [
        {"diagram": diagram, "law": "kozlowski_zhu", "varied": kind, "shell_corner": shell}
        for diagram, change in (("pascon", 1.0), ("assessed", 0.0))
        for kind, shell in ((kind, shell + change) for kind, shell in shells.items())
    ]
    (found,) = peritectic.stated(rows)
    assert (found["shell_corner"], found["error"]) == (13.0, pytest.approx(3.0 * 2.0))
    assert peritectic.stated(rows[:3])[0]["error"] is None


def test_the_largest_difference_of_a_diagram_is_told_by_database_and_manganese() -> None:
    def row(database: str, manganese: float, off: float) -> dict[str, object]:
        limits = {key: 1500.0 for key in (*grades.LIMITS, "solid")}
        theirs = {f"{key}_database": value + off for key, value in limits.items()}
        whole = {"database": database, "Mn": manganese, "Si": 0.1, "liquidus_regression": 1490.0}
        return {**whole, **limits, **theirs}

    found = grades.largest([row("a", 0.0, 1.0), row("a", 0.0, -3.0), row("a", 1.0, 0.5)])
    assert [(one["Mn"], one["steels"], one["solidus"], one["solid"]) for one in found] == [
        (0.0, 2, 3.0, 3.0), (1.0, 1, 0.5, 0.5),
    ]  # fmt: skip
    assert [one["liquidus_regression"] for one in found] == [11.0, 10.5]
