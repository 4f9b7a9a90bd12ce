"""Sizes of a case, scaled; and a case known again whatever its sizes are."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_case import small

from castfem.base.shown_quantity import Quantity
from castfem.model import load_case
from castfem.runs.output.summary import Summary
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.estimate import RULES
from castfem.studies.accuracy.ladder import Level, levels
from castfem.studies.accuracy.table import gather

CASES = Path(__file__).parents[2] / "cases"
TAPERED = CASES / "billet125" / "taper_0.toml"


def test_cells_are_scaled_and_depths_stay() -> None:
    case = small({"mesh.surface_depth": "6 mm"})
    finer = case.with_(sizes.changes(case, {"mesh": 0.5}))
    for name in sizes.CELLS:
        assert getattr(finer.mesh, name) == pytest.approx(0.5 * getattr(case.mesh, name))
    assert finer.mesh.surface_depth == case.mesh.surface_depth
    assert finer.thermal == case.thermal


def test_adaptive_steps_are_scaled_by_their_tolerance() -> None:
    """Half the step has an eighth of the error of a step, with a scheme of second order."""
    case = small({"thermal.time": {"adaptive": {"tolerance": "1 K"}}})
    finer = case.with_(sizes.changes(case, {"step": 0.5})).thermal.time.adaptive
    assert finer is not None
    assert finer.tolerance == pytest.approx(0.125)
    assert finer.largest == pytest.approx(0.25)


def test_windows_and_the_steps_within_are_parted() -> None:
    """The shipped step of 0.25 s is cut to the windows of 0.1 s: that is what is refined."""
    case = load_case(TAPERED)
    assert sizes.steps_fill_windows(case)
    assert sizes.changes(case, {"step": 0.5}) == {"thermal.time.step": "0.05 s"}
    longer = sizes.changes(case, {"coupling": 2.0})
    assert longer["coupling.interval"] == "0.2 s"
    assert longer["thermal.time.step"] == "0.1 s"
    assert "thermal.time.step" not in sizes.changes(case, {"coupling": 0.5})


def test_a_window_that_is_a_length_stays_one() -> None:
    case = load_case(CASES / "slab1200" / "bending.toml")
    assert sizes.changes(case, {"coupling": 0.5})["coupling.interval"] == "50 mm"
    growing = case.with_({"coupling.growth": 4.0})
    assert sizes.changes(growing, {"coupling": 0.5})["coupling.strain_error"] == 2.5e-6
    assert sizes.key(growing.with_({"coupling.strain_error": 1e-6})) == sizes.key(growing)
    assert sizes.window(case) == pytest.approx(5.0)


def test_a_case_is_known_whatever_its_sizes() -> None:
    case = load_case(TAPERED)
    for level in levels(case):
        assert sizes.key(level.case) == sizes.key(case), level.name
        found = sizes.factors_between(sizes.described(case), sizes.described(level.case))
        assert found is not None
        if level.axis:
            assert found[level.axis] == pytest.approx(level.factor, rel=1e-4)
    assert sizes.key(case.with_({"casting.length": "0.5 m"})) != sizes.key(case)
    assert sizes.key(case.with_(speed="3 m/min")) != sizes.key(case)


def test_a_mesh_of_another_grading_is_none_of_the_ladder() -> None:
    case = small()
    other = case.with_({"mesh.core_size": "10 mm"})
    assert sizes.factors_between(sizes.described(case), sizes.described(other)) is None


def test_cells_are_counted_and_not_taken_on_trust() -> None:
    """Values stand by the mean size of the cells that a mesh has, not by what was asked for."""
    case = small()
    rungs = levels(case)
    counts = {level.factor: sizes.cell_count(level.case) for level in rungs if level.axis != "step"}
    assert counts[2.0] < counts[1.0] < counts[2.0**-0.5]
    results = {
        one.name: Summary("", "finished", {"heat": Quantity(one.factor, "J", "heat")})
        for one in rungs
    }
    part = gather(case, rungs, results, ()).quantities["heat"].parts["mesh"]
    wanted = {(counts[1.0] / counts[f]) ** 0.5: f for f in counts}
    assert dict(part.values) == pytest.approx(wanted)


def test_cheap_ones_first() -> None:
    names = [level.name for level in levels(load_case(TAPERED))]
    assert names[0] == "mesh_x2"
    assert names[-1] == "coupling_x0.5"
    assert set(names) >= {"base", "step_x0.5", "step_x0.25", "mesh_x0.707"}
    assert not any(name.startswith("coupling") for name in (one.name for one in levels(small())))


def test_shorter_windows_are_not_charged_with_their_steps() -> None:
    """Of v = 7 s + 2 w, with steps that fill the windows, the part of the windows is 2 w."""
    case = load_case(TAPERED)
    rungs = levels(case)

    def result(level: Level) -> Summary:
        window = level.factor if level.axis == "coupling" else 1.0
        step = level.factor if level.axis == "step" else min(window, 1.0)
        value = 7.0 * step + 2.0 * window
        return Summary(level.name, "finished", {"heat": Quantity(value, "J", "heat")})

    results = {level.name: result(level) for level in rungs}
    parts = gather(case, rungs, results, ()).quantities["heat"].parts
    assert parts["coupling"].order == pytest.approx(1.0)
    assert parts["coupling"].error == pytest.approx(RULES.safety * 2.0)
    assert parts["step"].error == pytest.approx(RULES.safety * 7.0)
    assert parts["mesh"].error == 0.0


def test_a_case_without_a_mould_is_told_nothing_of_its_gap() -> None:
    """Its windows are not repeated: a tolerance would draw a warning at each run."""
    slab = load_case(CASES / "slab1200" / "slab.toml")
    assert "coupling.settled" not in sizes.changes(slab, {"coupling": 2.0})
    assert "coupling.settled" in sizes.changes(load_case(TAPERED), {"coupling": 2.0})
