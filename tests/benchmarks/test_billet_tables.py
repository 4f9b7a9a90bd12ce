"""Tables of small studies: the coupled billet, the grid of the corner, a sweep, steels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks import (
    billet_cost,
    billet_error,
    billet_trade,
    caster_error,
    grades,
    sweep_cost,
)
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
from benchmarks.billet_run import Found, Listener, every, mesh, run
from benchmarks.report import Output, power
from castfem.model import load_case
from castfem.studies.accuracy.sizes import assignments, described, key


def found(**values: float) -> Found:
    units = {"shell_mid_face": "mm", "heat_removed": "MJ/m", "von_mises_max": "MPa"}
    units = {n: units.get(n, "-") for n in values}
    labels = dict.fromkeys(values, "what it is") | {"von_mises_max": "stress, at x = 1, y = 2 mm"}
    return Found(values, 2.0, 900, labels=labels, units=units)


def test_all_times_of_a_time_loop_are_measured() -> None:
    small = (*mesh(4.0), every(0.25), "casting.length=60 mm")
    walled = billet_cost.run_case("taper_1", small)
    numbers = billet_cost.numbers(walled)
    assert walled["watched"] == pytest.approx(walled["seconds"], rel=0.02)
    assert {"petsc", "assembly", "law", "contact"} <= set(walled["parts"])
    assert 0.0 < numbers["libraries_mechanics"] < 100.0
    assert 50.0 < numbers["mechanics"] < 100.0
    free = billet_cost.numbers(billet_cost.run_case("idealised", small))
    assert free["contact"] == 0.0 < numbers["contact"]


def test_growth_is_the_exponent_of_the_cells() -> None:
    rows = [{"cells": n, "seconds": 3.0 * n**1.2} for n in (400, 900, 3600)]
    assert power(rows, "seconds") == pytest.approx(1.2)


def test_errors_are_after_the_values(tmp_path: Path) -> None:
    shipped = {
        "taper_1": found(shell_mid_face=4.8, heat_removed=9.09, von_mises_max=12.0),
        "idealised": found(shell_mid_face=4.8, heat_removed=9.1),
    }
    finer = {
        "taper_1": found(shell_mid_face=4.83, heat_removed=9.09, von_mises_max=11.5),
        "idealised": found(shell_mid_face=4.7, heat_removed=9.0),
    }
    output = Output(tmp_path, "billet.md")
    billet_error.show_errors(output, shipped, finer)
    text = output.page.read_text(encoding="utf-8")
    assert "| what it is [mm] | 4.80 (-0.030) | 4.80 (+0.100) |" in text
    assert "| what it is [MJ/m] | 9.090 (0) | 9.100 (+0.1000) |" in text
    assert "| stress [MPa] | 12.00 (+0.500) |  |" in text


def test_faces_of_a_square_billet_are_one() -> None:
    both = found(shell_narrow_face=1.0, shell_corner=1.0, shell_mid_face=1.0, position=0.6)
    assert billet_error.main_names([both]) == ["shell_mid_face", "shell_corner"]


def test_largest_error_is_relative_to_its_unit() -> None:
    exact = dict.fromkeys(billet_trade.COMPARED, 1.0)
    errors = billet_trade.errors(exact | {"von_mises_max": 0.8, "size_corner": 1.015}, exact)
    assert errors["von_mises_max"] == pytest.approx(0.2)
    assert errors["worst"] == pytest.approx(2.0)  # 0.2 of 0.1 MPa; 15 of 10 um are less


def test_every_mould_is_run_and_has_its_reference() -> None:
    tried = list(billet_trade.settings(quick=False))
    assert tried.count(billet_trade.DEFAULT) == 1
    assert len(set(tried)) == len(tried)
    for mould in billet_trade.MOULDS:
        assert set(billet_trade.reference(mould)) == set(billet_trade.COMPARED)


def test_figure_marks_the_default() -> None:
    rows = [
        {"kind": one.kind, "size": one.size, "window": one.window, "seconds": 1.0 / one.size}
        | {"worst": one.size, "von_mises_max": one.size, "default": one == billet_trade.DEFAULT}
        for one in billet_trade.settings(quick=False)
    ]
    figure = billet_trade.draw({"0 %/m": rows})
    rings = [line for line in figure.axes[0].lines if line.get_fillstyle() == "none"]
    assert [float(line.get_xdata()[0]) for line in rings] == [1.25]


# Billets in their moulds: results on the way, and their tables

SMALL = (*mesh(3.0), every(0.25), "casting.length=150 mm")


def listener(**tracks: list[float]) -> Listener:
    return Listener(np.inf, tracks={name.replace("_", " ", 1): t for name, t in tracks.items()})


def test_places_are_interpolated_between_windows() -> None:
    heard = listener(
        position=[0.0, 0.1, 0.2], surface_corner=[1800.0, 1700.0, 1600.0],
        gap_mid_face=[0.0, 0.0, 0.0], gap_corner=[0.0, 0.0, 0.004],
    )  # fmt: skip
    assert heard.cools_to("corner", 1725.0) == pytest.approx(75.0)
    assert np.isnan(heard.cools_to("corner", 1500.0))
    assert heard.lost() == pytest.approx(125.0)  # contact is lost at a quarter of 4 um
    assert np.isnan(listener(position=[0.0, 0.1], gap_corner=[0.0, 0.0]).lost())


@pytest.fixture(scope="module")
def untapered() -> Iterator[dict[str, float]]:
    found = run("taper_0", SMALL)
    assert not found.failure
    yield dict(found.values)


def test_untapered_mould_loses_its_corner_after_freezing(untapered: dict[str, float]) -> None:
    assert untapered["first_mush"] < untapered["first_solid"] < untapered["closed_solid"] < 150.0
    assert 30.0 < untapered["lost"] < 130.0
    assert untapered["gap_max"] > 1e-3
    assert untapered["pressure_mean"] == pytest.approx(untapered["force"] / 62.5)


def test_fine_run_has_all_sizes_halved() -> None:
    case = load_case(PATH, next(grid()).keys())
    fine = beside(case, FINE).case
    assert key(fine) == key(case)
    sizes, halved = described(case), described(fine)
    assert {"mesh.corner_size", "tolerance", "window"} <= set(sizes)
    assert halved == pytest.approx({name: 0.5 * size for name, size in sizes.items()})
    assert fine.coupling.settled == 0.5 * case.coupling.settled


def test_coarse_run_is_that_of_accuracy_coarse() -> None:
    keys = next(grid()).keys()
    case = load_case(PATH, keys)
    expected = load_case(PATH, (*keys, *assignments(case, COARSE)))
    assert described(beside(case, COARSE).case) == described(expected) != described(case)


def test_result_is_within_its_error_or_not() -> None:
    """A failed billet has none."""
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


def test_published_billets_and_their_errors() -> None:
    """None of the 14 billets fails on any cells, and errors hold for 19 of 20 corners."""
    rows = Output().rows("billet_grid")
    assert not any(row["failure"] for row in rows)
    found = errors(rows)
    assert len(found) == len([*grid()]) * len(RESULTS)
    finer = [row for row in found if row["result"] in CORNER]
    assert all(FINE in row for row in finer)
    assert sum(map(within, finer)) >= 0.95 * len(finer)


def test_tapers_are_distinct() -> None:
    assert len(set(sweep_cost.tapers(32))) == 32


def test_largest_differences_of_a_diagram_are_grouped() -> None:
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


def test_published_formula_is_as_close_as_stated() -> None:
    rows = Output().rows("grades_published")
    made = grades.published(Output().rows("grades_diagram"))
    assert len(rows) == len(made) == 24
    assert all(a == pytest.approx(b, abs=1e-4) for a, b in zip(rows, made, strict=True))
    # By hand: 0.25 % C, 1.4 % Mn, 0.3 % Si.
    (one,) = [r for r in rows if (r["C"], r["Mn"]) == (0.25, 1.4)]
    assert one["liquidus_formula"] == pytest.approx(1538 - 13.75 - 5.0 - 3.9 - 6.72)
    assert one["solidus_formula"] == pytest.approx(1527 - 46.875 - 6.15 - 9.1)
    for row in rows:
        assert abs(row["liquidus_off"]) < (2.0 if row["C"] <= 0.25 else 5.0)
        assert abs(row["solidus_off"]) < (7.1 if (row["C"], row["Mn"]) in FAR else 4.0)


FAR = ((0.1, 1.4), (0.12, 1.4))
"""Carbon and manganese of the steels whose solidus is 7 K off."""


def test_curves_of_a_caster_are_compared_where_known() -> None:
    fine = np.arange(5.0), np.array([np.nan, 1.0, 4.0, 3.0, 9.0])
    coarse = np.array([1.0, 3.0, 4.0]), np.array([1.0, 3.0, np.nan])
    assert caster_error.apart(fine, coarse) == pytest.approx(2.0)
    assert np.isnan(caster_error.apart(fine, (fine[0], np.full(5, np.nan))))
