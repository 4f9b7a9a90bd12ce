"""The resistance of rolls, (45)-(47), (319)-(321), and its shares of the drives (VI.4.2.1).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rolls_of_file import rolls_of

from castfem.base.csv_files import read_csv
from castfem.base.errors import RunFailure
from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.model import load_case
from castfem.physics.machine.extraction.drives import (
    Shares,
    StrandStopsError,
    refuse_standstill,
    share,
    taken,
)
from castfem.physics.machine.extraction.resistance import (
    bending_force,
    friction,
    hinge_force,
    pair_resistances,
    pressed,
    steps_of,
    tributary_lengths,
)
from castfem.physics.machine.rolls import Rolls

FOLDER = Path(__file__).parents[2] / "cases" / "slab1200"
TONNE = 9.80665e3  # N


@pytest.fixture(scope="module")
def rolls() -> Rolls:
    return rolls_of(load_case(FOLDER / "thermal.toml"))


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
    """Return the steps with some pairs locked."""
    locked = np.isin(np.arange(1, len(steps) + 1), numbers)
    return steps * friction(0.015, 0.30, locked) / 0.015


def test_drives_have_the_loads_of_the_thesis(
    rolls: Rolls, normal: Shares, capacities: Array
) -> None:
    """Each drive takes all resistance above it; about 5 t above, 5 to 15 t below."""
    driven = np.flatnonzero(capacities)
    assert {26, 44, 50, 55} < {*(driven + 1)}
    assert capacities.sum() / TONNE == pytest.approx(175.0, abs=1e-3)
    assert normal.drive.sum() / TONNE == pytest.approx(70.0, abs=1e-3)
    assert np.allclose(normal.drive[driven], normal.effort[driven], rtol=1e-9)  # none is exceeded
    place = np.array([pair.position for pair in rolls.pairs])
    before = normal.effort[driven] / TONNE
    above, straightening = before[place[driven] < 14.0], before[(place > 14.0)[driven]][:3]
    assert (np.abs(above - 5.0) < 1.0).all()
    assert ((straightening > 5.0) & (straightening < 15.0)).all()
    assert (before[-4:] > 2.9).all()  # in the horizontal strand
    assert (normal.effort >= 0.0).all()


def test_locked_48_saturates_50_and_loads_55(
    steps: Array, capacities: Array, normal: Shares
) -> None:
    """Of +15 t #50 takes its remaining 7.38 t; the excess is in the strand down to #55."""
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


def test_locked_48_and_52_saturate_several(steps: Array, capacities: Array, normal: Shares) -> None:
    """#52 has almost three times the step of #48: all below are at their limit, #44 pushes."""
    assert 2.8 < steps[51] / steps[47] < 3.0
    found = share(lock(steps, 48, 52), capacities)
    saturated = np.flatnonzero((capacities > 0.0) & (found.drive >= capacities * (1.0 - 1e-12))) + 1
    assert saturated.tolist() == [50, 55, 60, 67, 74, 80, 87]
    assert found.drive.sum() == pytest.approx(lock(steps, 48, 52).sum(), rel=1e-12)
    assert (found.drive <= capacities * (1.0 + 1e-12)).all()
    pushed = (found.drive - normal.drive)[43]
    assert 3.0 < pushed / TONNE < 4.0
    assert (found.effort - normal.effort).max() / TONNE == pytest.approx(
        (19.0 * (steps[47] + steps[51]) - pushed) / TONNE - 7.38, abs=1e-3
    )


def test_drives_share_in_order() -> None:
    """The first drive takes what it can, the next one the rest; none takes resistance below it."""
    found = share([1.0, 1.0, 1.0, 1.0, 1.0], [0.0, 1.5, 0.0, 9.0, 9.0])
    assert found.drive.tolist() == [0.0, 1.5, 0.0, 2.5, 1.0]
    assert found.effort.tolist() == [1.0, 2.0, 1.5, 2.5, 1.0]
    assert (taken(-3.0, 5.0), taken(3.0, 5.0), taken(7.0, 5.0)) == (0.0, 3.0, 5.0)


@pytest.mark.parametrize(
    ("at", "effort"),
    [
        (3, [1.0, 2.0, 3.0, 4.0]),  # a single locomotive pulls all wagons: Fig. 38
        (0, [1.0, -2.0, -1.0, 0.0]),  # it pushes them: Fig. 40
        (2, [1.0, 2.0, 3.0, 0.0]),
    ],
)
def test_single_drive_takes_all(at: int, effort: list[float]) -> None:
    found = share(np.ones(4), np.where(np.arange(4) == at, math.inf, 0.0))
    assert found.drive.tolist() == [4.0 if i == at else 0.0 for i in range(4)]
    assert found.effort == pytest.approx(effort)


def test_excess_of_the_last_drive_is_pushed_by_those_above() -> None:
    found = share([2.0, 2.0, 2.0], [0.0, 5.0, 2.0])
    assert found.drive.tolist() == [0.0, 4.0, 2.0]
    found = share([2.0, 2.0, 3.0], [0.0, 5.0, 2.0])
    assert found.drive.tolist() == [0.0, 5.0, 2.0]
    assert found.effort.tolist() == [2.0, 4.0, 2.0]


def test_sums_and_limits_hold_for_any_machine() -> None:
    chance = np.random.default_rng(8)
    for _ in range(50):
        count = int(chance.integers(1, 30))
        steps = chance.uniform(0.0, 2.0, count)
        most = np.where(chance.random(count) < 0.4, chance.uniform(0.0, 9.0, count), 0.0)
        most[chance.integers(count)] += steps.sum()
        found = share(steps, most)
        assert found.drive.sum() == pytest.approx(steps.sum(), rel=1e-12)
        assert (found.drive >= 0.0).all() and (found.drive <= most + 1e-12).all()
        below = np.cumsum(steps - found.drive)
        assert found.effort == pytest.approx(below + found.drive, abs=1e-12)
        assert below[-1] == pytest.approx(0.0, abs=1e-12)


def test_strand_that_would_stop_is_reported(steps: Array, capacities: Array) -> None:
    """Ten locked rolls exceed drives of 175 t."""
    with pytest.raises(StrandStopsError, match=r"^the strand would stop: its rolls resist with"):
        share(lock(steps, *range(44, 54)), capacities)
    share(lock(steps, *range(44, 48)), capacities)
    assert issubclass(StrandStopsError, RunFailure)
    refuse_standstill(1716.1637e3, np.array([1716.1637e3]))
    with pytest.raises(StrandStopsError, match=r"with 1800 kN, all .* with 1716\.2 kN at most"):
        refuse_standstill(1800e3, np.array([1716.1637e3, 0.0]))


AXIS, SURFACE = 0.015, 0.30


def test_roll_turns_unless_locked_or_its_axis_resists_more() -> None:
    assert friction(AXIS, SURFACE, [False, True]).tolist() == [AXIS, SURFACE]
    assert pytest.approx(20.0) == SURFACE / AXIS  # (328)
    assert friction(0.5, SURFACE, [False, True]).tolist() == [SURFACE, SURFACE]


def test_bending_adds_to_bulging_for_either_direction() -> None:
    steps = pair_resistances(
        friction(AXIS, SURFACE, [False, False, True]),
        np.array([500e3, 500e3, 500e3]),
        np.array([100e3, -100e3, 100e3]),
    )
    assert steps == pytest.approx([9e3, 9e3, 180e3])


def test_rolls_carry_the_pressure_of_the_complete_strand() -> None:
    """On both faces p L for any pitches."""
    cuts = [0.0, 0.2, 0.5, 0.7, 1.1, 1.3]
    lengths = tributary_lengths(cuts)
    assert lengths.sum() == pytest.approx(1.3 + 0.5 * (0.2 + 0.2))
    assert pressed(2e5, lengths, 1.0).sum() == pytest.approx(2.0 * 2e5 * lengths.sum())
    assert tributary_lengths([0.3]).tolist() == [0.0]


def test_resistance_of_48_by_statics_is_that_of_the_thesis() -> None:
    """0.7 MPa, a pitch of 335 mm, 1 m of liquid: 0.72 t; the thesis has 0.75 t (15 t locked)."""
    force = float(pressed(0.7e6, 0.335, 1.0))
    assert force == pytest.approx(469e3)
    assert AXIS * force / 9.80665e3 == pytest.approx(0.72, abs=0.005)


def bending_forces(positions: Array, moments: Array) -> Array:
    """Return the forces on pairs by bending (n,), N, without moment beyond the first and last."""
    shear = np.diff(moments) / np.diff(positions)
    return -np.diff(np.concatenate([[0.0], shear, [0.0]]))


def test_bending_forces_are_in_equilibrium() -> None:
    """Forces and moments about any point vanish; a constant moment loads no roll."""
    places = np.array([0.0, 0.3, 0.7, 0.9, 1.3, 1.6])
    moments = np.array([0.0, 90e3, 130e3, 130e3, 20e3, 0.0])
    found = bending_forces(places, moments)
    assert found.sum() == pytest.approx(0.0, abs=1e-6)
    assert found @ places == pytest.approx(0.0, abs=1e-6)
    # Statics of the part above a cut: its forces give the moment at the cut.
    for i in range(1, 6):
        lever = places[i] - places[:i]
        assert -(found[:i] @ lever) == pytest.approx(moments[i], abs=1e-6)
    constant = bending_forces(np.arange(4.0), np.full(4, 5.0))
    assert constant.tolist() == [0.0, 0.0, 0.0, 0.0]
    single = [
        bending_force(moments[i - 1 : i + 2].tolist(), np.diff(places)[i - 1 : i + 1].tolist())
        for i in range(1, 5)
    ]
    assert single == pytest.approx(found[1:-1])


def test_hinges_give_forces_also_at_constant_moment() -> None:
    """(320) gives each pair M/L; by equilibrium rolls between equal moments have no force."""
    assert hinge_force(110e3, 0.32) == pytest.approx(344e3, rel=2e-3)
    assert bending_force([110e3, 110e3, 110e3], [0.32, 0.32]) == 0.0
    # A single hinge: the pair carries M/L of both of its pitches.
    assert bending_force([0.0, 110e3, 0.0], [0.32, 0.32]) == pytest.approx(
        2.0 * hinge_force(110e3, 0.32)
    )


def test_steps_add_up_to_the_curve() -> None:
    curve = Table("position", (1.0, 2.0, 4.0), (7e3, 10e3, 30e3))
    steps = steps_of(curve, [1.0, 3.0, 3.5, 5.0])
    assert steps == pytest.approx([7e3, 13e3, 5e3, 5e3])
    assert steps.sum() == 30e3
