"""Sizes of a case, scaled; and a case recognized with any sizes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from small_case import small

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.model import load_case
from castfem.runs.output.summary_file import Summary
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.estimate import RULES, Estimate, convergence_index, estimate
from castfem.studies.accuracy.ladder import Level, levels, propose, read_share
from castfem.studies.accuracy.table import Entry, ErrorTable, Ran, gather

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
    """With half the step a scheme of second order has an eighth of the error of a step."""
    case = small({"thermal.time": {"adaptive": {"tolerance": "1 K"}}})
    finer = case.with_(sizes.changes(case, {"step": 0.5})).thermal.time.adaptive
    assert finer.tolerance == pytest.approx(0.125)
    assert finer.largest == pytest.approx(1.0)


def test_windows_and_their_steps_are_separated() -> None:
    """The shipped step of 0.25 s is cut to the windows of 0.2 s, which are refined."""
    case = load_case(TAPERED)
    assert sizes.steps_fill_windows(case)
    assert sizes.changes(case, {"step": 0.5}) == {"thermal.time.step": "0.1 s"}
    longer = sizes.changes(case, {"coupling": 2.0})
    assert longer["coupling.interval"] == "0.4 s"
    assert longer["thermal.time.step"] == "0.2 s"
    assert "thermal.time.step" not in sizes.changes(case, {"coupling": 0.5})


def test_window_of_a_length_remains_one() -> None:
    case = load_case(CASES / "slab1200" / "bending.toml")
    assert sizes.changes(case, {"coupling": 0.5})["coupling.interval"] == "50 mm"
    growing = case.with_({"coupling.growth": 4.0})
    assert sizes.changes(growing, {"coupling": 0.5})["coupling.strain_error"] == 2.5e-6
    assert sizes.key(growing.with_({"coupling.strain_error": 1e-6})) == sizes.key(growing)
    assert sizes.window(case) == pytest.approx(5.0)


def test_case_is_recognized_with_any_sizes() -> None:
    case = load_case(TAPERED)
    for level in levels(case):
        assert sizes.key(level.case) == sizes.key(case), level.name
        found = sizes.factors_between(sizes.described(case), sizes.described(level.case))
        assert found is not None
        if level.axis:
            assert found[level.axis] == pytest.approx(level.factor, rel=1e-4)
    assert sizes.key(case.with_({"casting.length": "0.5 m"})) != sizes.key(case)
    assert sizes.key(case.with_(speed="3 m/min")) != sizes.key(case)


def test_mesh_of_another_grading_is_not_in_the_ladder() -> None:
    case = small()
    other = case.with_({"mesh.core_size": "10 mm"})
    assert sizes.factors_between(sizes.described(case), sizes.described(other)) is None


def test_cells_of_the_mesh_are_counted() -> None:
    """Values belong to the mean size of the actual cells, not to the requested size."""
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


def test_cheap_runs_come_first() -> None:
    names = [level.name for level in levels(load_case(TAPERED))]
    assert names[0] == "mesh_x2"
    assert names[-1] == "coupling_x0.5"
    assert set(names) >= {"base", "step_x0.5", "step_x0.25", "mesh_x0.707"}
    assert not any(name.startswith("coupling") for name in (one.name for one in levels(small())))


def test_shorter_windows_exclude_the_error_of_their_steps() -> None:
    """For v = 7 s + 2 w, with steps that fill the windows, the part of the windows is 2 w."""
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


def test_case_without_a_mould_has_no_tolerance_of_its_gap() -> None:
    """Its windows are not repeated: a tolerance would give a warning in each run."""
    slab = load_case(CASES / "slab1200" / "slab.toml")
    assert "coupling.settled" not in sizes.changes(slab, {"coupling": 2.0})
    assert "coupling.settled" in sizes.changes(load_case(TAPERED), {"coupling": 2.0})


# From values at several sizes to an error, and from a requested error to sizes


R = 2.0**0.5


@pytest.mark.parametrize("order", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("sizes", [(2.0, R, 1.0, 1.0 / R), (2.0, 1.0, 0.5), (1.0, 0.5, 0.25)])
def test_pure_power_is_recovered(order: float, sizes: tuple[float, ...]) -> None:
    """For v = 5 + 3 x^p the error at 1 is 3, and the stated one is that times its factor."""
    found = estimate({x: 5.0 + 3.0 * x**order for x in sizes})
    assert found.order == pytest.approx(order)
    assert found.error == pytest.approx(RULES.safety * 3.0)
    assert found.scaled(0.5) == pytest.approx(found.error * 0.5**order)


def test_order_above_that_of_the_schemes_is_capped() -> None:
    """Order 2 is used; and the spread decides if two values agree by accident."""
    some = {x: x**2.5 for x in (R, 1.0, 1.0 / R)}
    assert estimate(some).error > RULES.safety * (some[1.0] - some[1.0 / R]) / (1.0 - 0.5**1.25)
    lucky = estimate({R: 9.0, 1.0: 5.0, 1.0 / R: 4.6})
    assert lucky.order is not None and lucky.order > 2.0
    assert lucky.error == pytest.approx(RULES.least * 4.4)


def test_without_an_order_the_differences_are_stated() -> None:
    found = estimate({R: 4.0, 1.0: 5.0, 1.0 / R: 4.7})
    assert found.order is None
    assert found.error == pytest.approx(max(RULES.few * 0.3, 0.5))
    coarse = estimate({R: 1.0, 1.0: 5.0, 1.0 / R: 4.7})
    assert coarse.error == pytest.approx(2.0)
    slow = estimate({R: 4.0, 1.0: 5.0, 1.0 / R: 6.0})  # changes as fast as before
    assert slow.order is None
    assert slow.error == pytest.approx(RULES.few)
    longest = estimate({1.0: 5.0, 0.5: 4.0, 0.25: 4.5})  # the case has the largest
    assert longest.error == pytest.approx(RULES.few)
    finest = estimate({1.0: 5.0, 2.0: 4.0, 4.0: 4.5})  # the finer run has failed
    assert finest.error == pytest.approx(RULES.few)


def test_few_sizes() -> None:
    assert estimate({1.0: 5.0, 2.0: 5.5}).error == pytest.approx(RULES.few * 0.5)
    assert math.isnan(estimate({1.0: 5.0}).error)
    assert math.isnan(estimate({1.0: math.nan, 2.0: 5.5, 0.5: 5.0}).error)


def test_sizes_may_have_different_ratios() -> None:
    """Meshes have whole numbers of cells."""
    found = estimate({x: 5.0 - 3.0 * x**1.5 for x in (1.9, 1.0, 0.77)})
    assert found.order == pytest.approx(1.5)
    assert found.error == pytest.approx(RULES.safety * 3.0)


def test_equal_values_have_no_error() -> None:
    assert estimate({R: 3.6, 1.0: 3.6, 1.0 / R: 3.6 * (1.0 + 1e-15)}).error == 0.0


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_convergence_index_of_a_pure_power(order: float) -> None:
    """For v = 5 + 3 x^p the error at 1 is 3 with any sizes; two sizes assume order 1."""
    for of in ((1.0, 2 / 3, 5 / 12), (1.5, 1.0, 0.625), (2.4, 1.6, 1.0)):
        found = convergence_index({x: 5.0 + 3.0 * x**order for x in of})
        assert found == pytest.approx(RULES.safety * 3.0)
    assert convergence_index({1.0: 8.0, 0.5: 6.5}) == pytest.approx(RULES.safety * 3.0)


def test_convergence_index_without_an_order() -> None:
    """The finest size decides, or the next coarser one; no finer one is beyond the stated error."""
    assert convergence_index({1.0: 0.0, 0.75: 1.0, 0.5: -1.0}) == pytest.approx(RULES.safety * 2.0)
    assert convergence_index({1.0: 0.0, 0.75: 5.0, 0.5: 1.0}) == 5.0
    assert convergence_index({1.5: 9.0, 1.0: 0.0, 0.5: 1.0}) == pytest.approx(RULES.safety * 2.0)
    assert convergence_index({1.0: 0.0, 1.5: 1.0}) == pytest.approx(RULES.safety * 2.0)
    assert convergence_index({1.0: 0.0, 0.5: math.nan, 2.0: 1.0}) == pytest.approx(RULES.safety)
    assert math.isnan(convergence_index({1.0: 0.0, 0.5: math.nan}))
    assert math.isnan(convergence_index({1.0: math.nan, 0.5: 0.0}))


RUNS = (
    Ran("base", "", 1.0, 10.0),
    Ran("mesh_x0.707", "mesh", 0.5, 40.0),
    Ran("step_x0.5", "step", 0.5, 10.0),
    Ran("coupling_x0.5", "coupling", 0.5, 20.0),
)


def _table(**entries: tuple[float, float, float, float]) -> ErrorTable:
    """Return a table: value 100, errors of mesh (order 2), step, coupling (order 1), the scale."""
    found = {
        name: Entry(
            name, "mm", 100.0,
            {"mesh": Estimate(mesh, 2.0), "step": Estimate(step),
             "coupling": Estimate(coupling, 1.0)},
            scale,
        )
        for name, (mesh, step, coupling, scale) in entries.items()
    }  # fmt: skip
    return ErrorTable("case", "key", {}, RUNS, found)


def test_errors_are_reached_at_the_least_time() -> None:
    table = _table(shell=(4.0, 0.0, 1.0, 100.0))
    found = propose(table, ["shell"], 0.01)
    assert table.quantities["shell"].error(found.factors) <= 1.0
    assert not found.unreached
    for axis in ("mesh", "coupling"):  # one size coarser in either misses it
        coarser = {**found.factors, axis: found.factors[axis] * 2.0**0.25}
        assert table.quantities["shell"].error(coarser) > 1.0
    assert found.factors["step"] == pytest.approx(2.0)  # no error comes from it
    dear = found.factors["mesh"] ** -2 * found.factors["coupling"] ** -1
    assert found.seconds == pytest.approx(10.0 * dear)


def test_excess_accuracy_becomes_cheaper() -> None:
    found = propose(_table(shell=(0.1, 0.1, 0.1, 100.0)), ["shell"], 0.02)
    assert found.seconds < found.now
    assert all(factor >= 1.0 for factor in found.factors.values())


def test_unreachable_result_is_reported_and_ignored() -> None:
    table = _table(shell=(4.0, 0.0, 0.0, 100.0), pressure=(900.0, 0.0, 0.0, 100.0))
    found = propose(table, ["shell", "pressure"], 0.01)
    assert found.unreached == {"pressure": pytest.approx(0.5625)}
    assert table.quantities["shell"].error(found.factors) <= 1.0
    assert found.factors == propose(table, ["shell"], 0.01).factors


def test_result_of_zero_is_left_out() -> None:
    assert propose(_table(gap=(1.0, 0.0, 0.0, 0.0)), ["gap"], 0.01).seconds == 10.0


def test_shares() -> None:
    assert read_share("1%") == pytest.approx(0.01)
    assert read_share(" 0.5 % ") == pytest.approx(0.005)
    for text in ("1", "one%", "0%", "-1 %", "100%", "1% or so", "%"):
        with pytest.raises(InputError, match="--to"):
            read_share(text)
