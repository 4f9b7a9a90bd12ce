"""The drives share the resistance: each what came before it, the next the rest (VI.4.2.1)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from castfem.base.csv_files import read_csv
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.model import load_case
from castfem.physics.machine.extraction.drives import (
    Shares,
    StrandStopsError,
    refuse_standstill,
    share,
    taken,
)
from castfem.physics.machine.extraction.resistance import friction, steps_of
from castfem.physics.machine.rolls import Rolls

FOLDER = Path(__file__).parents[2] / "cases" / "slab1200"
TONNE = 9.80665e3  # N


@pytest.fixture(scope="module")
def rolls() -> Rolls:
    table = load_case(FOLDER / "thermal.toml").machine
    assert table is not None
    found = table.pairs()
    assert found is not None
    return found


@pytest.fixture(scope="module")
def steps(rolls: Rolls) -> Array:
    rows = [[float(c) for c in row.cells] for row in read_csv(FOLDER / "resistance.csv").rows]
    place, total = np.array(rows).T
    return steps_of(
        lambda s: np.interp(s, 1e-3 * place, 1e3 * total), [p.position for p in rolls.pairs]
    )


@pytest.fixture(scope="module")
def capacities(rolls: Rolls) -> Array:
    return np.array([(p.capacity or 0.0) if p.driven else 0.0 for p in rolls.pairs])


@pytest.fixture(scope="module")
def normal(steps: Array, capacities: Array) -> Shares:
    return share(steps, capacities)


def lock(steps: Array, *numbers: int) -> Array:
    """The steps with some pairs locked."""
    locked = np.isin(np.arange(1, len(steps) + 1), numbers)
    return steps * friction(0.015, 0.30, locked) / 0.015


def test_the_caster_of_the_thesis(rolls: Rolls, normal: Shares, capacities: Array) -> None:
    """Each drive takes all that came before it; about 5 t above, 5 to 15 t below."""
    driven = np.flatnonzero(capacities)
    assert capacities.sum() / TONNE == pytest.approx(175.0, abs=1e-3)
    assert normal.drive.sum() / TONNE == pytest.approx(70.0, abs=1e-3)
    assert np.allclose(normal.drive[driven], normal.effort[driven], rtol=1e-9)  # none is exceeded
    place = np.array([pair.position for pair in rolls.pairs])
    before = normal.effort[driven] / TONNE
    above, round_about = before[place[driven] < 14.0], before[(place > 14.0)[driven]][:3]
    assert (np.abs(above - 5.0) < 1.0).all()
    assert ((round_about > 5.0) & (round_about < 15.0)).all()
    assert (before[-4:] > 2.9).all()  # where the strand is level again
    assert (normal.effort >= 0.0).all()


def test_a_locked_48_fills_50_and_the_rest_goes_to_55(
    steps: Array, capacities: Array, normal: Shares
) -> None:
    """+15 t; #50 has 7.38 t left, and what it cannot take is in the strand down to #55."""
    found = share(lock(steps, 48), capacities)
    more = (found.drive - normal.drive) / TONNE
    assert more.sum() == pytest.approx(15.0, abs=0.05)
    assert more[49] == pytest.approx(7.38, abs=1e-3)
    assert more[54] == pytest.approx(15.01 - 7.38, abs=1e-2)
    assert np.flatnonzero(np.abs(more) > 1e-6).tolist() == [49, 54]
    effort = (found.effort - normal.effort) / TONNE
    assert effort[:47] == pytest.approx(0.0, abs=1e-9)
    assert effort[47:50] == pytest.approx([more.sum()] * 3)
    assert effort[50:55] == pytest.approx([more[54]] * 5)
    assert effort[55:] == pytest.approx(0.0, abs=1e-9)


def test_a_locked_52_as_well_fills_several(steps: Array, capacities: Array, normal: Shares) -> None:
    """Its step is almost three times that of #48: all below work at their limit, #44 pushes."""
    assert 2.8 < steps[51] / steps[47] < 3.0
    found = share(lock(steps, 48, 52), capacities)
    full = np.flatnonzero((capacities > 0.0) & (found.drive >= capacities * (1.0 - 1e-12))) + 1
    assert full.tolist() == [50, 55, 60, 67, 74, 80, 87]
    assert found.drive.sum() == pytest.approx(lock(steps, 48, 52).sum(), rel=1e-12)
    assert (found.drive <= capacities * (1.0 + 1e-12)).all()
    pushed = (found.drive - normal.drive)[43]
    assert 3.0 < pushed / TONNE < 4.0
    assert (found.effort - normal.effort).max() / TONNE == pytest.approx(
        (19.0 * (steps[47] + steps[51]) - pushed) / TONNE - 7.38, abs=1e-3
    )


def test_order_of_the_rule() -> None:
    """Reset by the first drive that can, the rest by the next; none takes for those above it."""
    found = share([1.0, 1.0, 1.0, 1.0, 1.0], [0.0, 1.5, 0.0, 9.0, 9.0])
    assert found.drive.tolist() == [0.0, 1.5, 0.0, 2.5, 1.0]
    assert found.effort.tolist() == [1.0, 2.0, 1.5, 2.5, 1.0]
    assert (taken(-3.0, 5.0), taken(3.0, 5.0), taken(7.0, 5.0)) == (0.0, 3.0, 5.0)


@pytest.mark.parametrize(
    ("at", "effort"),
    [
        (3, [1.0, 2.0, 3.0, 4.0]),  # one locomotive pulls all the wagons: Fig. 38
        (0, [1.0, -2.0, -1.0, 0.0]),  # one pushes them: Fig. 40
        (2, [1.0, 2.0, 3.0, 0.0]),
    ],
)
def test_one_drive_takes_all(at: int, effort: list[float]) -> None:
    found = share(np.ones(4), np.where(np.arange(4) == at, math.inf, 0.0))
    assert found.drive.tolist() == [4.0 if i == at else 0.0 for i in range(4)]
    assert found.effort == pytest.approx(effort)


def test_what_the_last_drive_cannot_take_is_pushed_by_those_above() -> None:
    found = share([2.0, 2.0, 2.0], [0.0, 5.0, 2.0])
    assert found.drive.tolist() == [0.0, 4.0, 2.0]
    found = share([2.0, 2.0, 3.0], [0.0, 5.0, 2.0])
    assert found.drive.tolist() == [0.0, 5.0, 2.0]
    assert found.effort.tolist() == [2.0, 4.0, 2.0]


def test_sums_and_limits_whatever_the_machine() -> None:
    chance = np.random.default_rng(8)
    for _ in range(50):
        count = int(chance.integers(1, 30))
        steps = chance.uniform(0.0, 2.0, count)
        most = np.where(chance.random(count) < 0.4, chance.uniform(0.0, 9.0, count), 0.0)
        most[chance.integers(count)] += steps.sum()
        found = share(steps, most)
        assert found.drive.sum() == pytest.approx(steps.sum(), rel=1e-12)
        assert (found.drive >= 0.0).all() and (found.drive <= most + 1e-12).all()
        left = np.cumsum(steps - found.drive)
        assert found.effort == pytest.approx(left + found.drive, abs=1e-12)
        assert left[-1] == pytest.approx(0.0, abs=1e-12)


def test_the_strand_would_stop(steps: Array, capacities: Array) -> None:
    """Ten locked rolls in a caster with 175 t: a clear end, not a number."""
    with pytest.raises(StrandStopsError, match=r"^the strand would stop: its rolls resist with"):
        share(lock(steps, *range(44, 54)), capacities)
    share(lock(steps, *range(44, 48)), capacities)
    assert issubclass(StrandStopsError, RunFailure)
    refuse_standstill(1716.1637e3, np.array([1716.1637e3]))
    with pytest.raises(StrandStopsError, match=r"with 1800 kN, all .* with 1716\.2 kN at most"):
        refuse_standstill(1800e3, np.array([1716.1637e3, 0.0]))
