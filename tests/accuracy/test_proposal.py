"""Sizes for an error: small enough, and no finer than they must be."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.studies.accuracy.proposal import propose, read_share
from castfem.studies.accuracy.table import Entry, ErrorTable, Part, Ran

RUNS = (
    Ran("base", "", 1.0, 10.0),
    Ran("mesh_x0.707", "mesh", 0.5, 40.0),
    Ran("step_x0.5", "step", 0.5, 10.0),
    Ran("coupling_x0.5", "coupling", 0.5, 20.0),
)


def _table(**entries: tuple[float, float, float, float]) -> ErrorTable:
    """Value 100, errors from mesh (second order), step, coupling (first order), and the scale."""
    found = {
        name: Entry(
            name, "mm", 100.0,
            {"mesh": Part(mesh, 2.0, {}), "step": Part(step, None, {}),
             "coupling": Part(coupling, 1.0, {})},
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
    for axis in ("mesh", "coupling"):  # one size coarser in either and it is not reached
        coarser = {**found.factors, axis: found.factors[axis] * 2.0**0.25}
        assert table.quantities["shell"].error(coarser) > 1.0
    assert found.factors["step"] == pytest.approx(2.0)  # no error comes from it
    dear = found.factors["mesh"] ** -2 * found.factors["coupling"] ** -1
    assert found.seconds == pytest.approx(10.0 * dear)


def test_what_is_good_enough_becomes_cheaper() -> None:
    found = propose(_table(shell=(0.1, 0.1, 0.1, 100.0)), ["shell"], 0.02)
    assert found.seconds < found.now
    assert all(factor >= 1.0 for factor in found.factors.values())


def test_a_number_out_of_reach_is_told_and_holds_nothing_up() -> None:
    table = _table(shell=(4.0, 0.0, 0.0, 100.0), pressure=(900.0, 0.0, 0.0, 100.0))
    found = propose(table, ["shell", "pressure"], 0.01)
    assert found.unreached == {"pressure": pytest.approx(0.5625)}
    assert table.quantities["shell"].error(found.factors) <= 1.0
    assert found.factors == propose(table, ["shell"], 0.01).factors


def test_a_number_that_is_nothing_is_left_out() -> None:
    assert propose(_table(gap=(1.0, 0.0, 0.0, 0.0)), ["gap"], 0.01).seconds == 10.0


def test_shares() -> None:
    assert read_share("1%") == pytest.approx(0.01)
    assert read_share(" 0.5 % ") == pytest.approx(0.005)
    for text in ("1", "one%", "0%", "-1 %", "100%", "1% or so", "%"):
        with pytest.raises(InputError, match="--to"):
            read_share(text)
