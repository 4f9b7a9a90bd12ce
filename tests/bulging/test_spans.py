"""A strip over several rolls against the periodic one, the continuous beam and superposition."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
    NortonCreep,
    ThermoElastic,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.base import Law
from castfem.physics.machine.bulging import CreepingStrip, Rolls, Shell, over_rolls, stiffness

PITCH, PRESSURE, SPEED = 0.31, 0.2e6, 0.02
SHELL = Shell(0.04, lambda depth: 1273.15 + 490.0 * depth / 0.04)
ELASTIC = load_elasticity()


def rolls(places: tuple[int, ...], offsets: dict[int, float] | None = None) -> Rolls:
    given = offsets or {}
    return Rolls(
        tuple(PITCH * k for k in places), tuple(given.get(k, 0.0) for k in places), PRESSURE, SPEED
    )


def three_moments(given: Rolls, bending: float) -> Array:
    """Moments over the rolls of a continuous beam, clamped moments -p L^2/12 at its ends."""
    pitch, w = np.array(given.pitches), np.array(given.offsets)
    n = len(w)
    matrix, load = np.eye(n), np.full(n, -given.pressure * pitch[0] ** 2 / 12.0)
    load[-1] = -given.pressure * pitch[-1] ** 2 / 12.0
    for j in range(1, n - 1):
        a, b = pitch[j - 1], pitch[j]
        matrix[j, j - 1 : j + 2] = a, 2.0 * (a + b), b
        load[j] = -0.25 * given.pressure * (a**3 + b**3)
        load[j] -= 6.0 * bending * ((w[j - 1] - w[j]) / a + (w[j + 1] - w[j]) / b)
    return np.linalg.solve(matrix, load)


@pytest.mark.parametrize(
    "given",
    [
        rolls((0, 1, 2, 3, 4, 5)),
        rolls((0, 1, 2, 4, 5, 6)),
        rolls((0, 1, 2, 3, 4, 5, 6), {3: -0.5e-3}),
    ],
)
def test_elastic_strip_is_a_continuous_beam(given: Rolls) -> None:
    bulge = over_rolls(CreepingStrip(ThermoElastic(ELASTIC)), given, SHELL)
    bending = stiffness(ELASTIC, SHELL.points()).bending
    exact = three_moments(given, bending)
    found = np.interp(given.positions, bulge.z, bulge.moment)
    assert found == pytest.approx(exact, rel=2e-3)
    assert bulge.at(given.positions) == pytest.approx(given.offsets, abs=2e-4 * bulge.largest)
    # In a span: the parabola of the load and the moments at its ends.
    pitch, j = given.pitches, 2
    ends, at = exact[j : j + 2], given.positions[j] + 0.5 * pitch[j]
    middle = 5.0 / 384.0 * PRESSURE * pitch[j] ** 4 + pitch[j] ** 2 / 16.0 * ends.sum()
    lifted = 0.5 * (given.offsets[j] + given.offsets[j + 1])
    assert bulge.at(at) == pytest.approx(middle / bending + lifted, abs=3e-3 * bulge.largest)


@pytest.mark.parametrize("name", ["kozlowski_zhu_signed", "norton_hoff_kozlowski_signed"])
def test_equal_pitches_bulge_as_one(name: str) -> None:
    strip = CreepingStrip(load_law(name, ELASTIC, carbon=0.1))
    given = rolls((0, 1, 2, 3, 4, 5))
    many = over_rolls(strip, given, SHELL)
    one = strip.bulge(given.span(0), SHELL)
    z = np.linspace(0.0, PITCH, 41)
    for start in given.positions[:-1]:
        # A pitch is periodic within 5e-3 of its range of curvature, and these add up.
        assert many.at(start + z) == pytest.approx(one.at(z), abs=1e-2 * one.largest)
    assert many.roll_force == pytest.approx(one.roll_force[0], rel=3e-3)


def test_linear_creep_superposes() -> None:
    """Norton creep with n = 1: what a misaligned roll adds is proportional to the misalignment."""
    law = NortonCreep.constant(Elasticity.constant(10e9, 0.3), 2e-5, 5e6, 1.0)
    strip = CreepingStrip(law)
    places = (0, 1, 2, 3, 4, 5, 6)
    none, once, twice = (
        over_rolls(strip, rolls(places, {3: k * 1e-4}), SHELL) for k in (0.0, 1.0, 2.0)
    )
    added = once.deflection - none.deflection
    assert twice.deflection - none.deflection == pytest.approx(2.0 * added, abs=2e-3 * 1e-4)
    assert twice.moment - none.moment == pytest.approx(
        2.0 * (once.moment - none.moment), abs=2e-3 * np.ptp(once.moment - none.moment)
    )
    # It is felt downstream farther than upstream: what has crept goes on with the strand.
    up, down = (np.abs(added[side]).max() for side in (once.z < 2 * PITCH, once.z > 4 * PITCH))
    assert down > 1.1 * up


@pytest.mark.parametrize("exponent", [None, 1.0, 3.0])
def test_a_lost_roll_has_its_order_in_the_steps(exponent: float | None) -> None:
    """Second, of the bulge and of the forces on rolls: steps of a pitch are its cells in z."""
    shell = Shell(0.03, lambda depth: 1400.0)
    law: Law = ThermoElastic(Elasticity.constant(10e9, 0.3))
    if exponent is not None:  # and no elastic strain to speak of
        law = NortonCreep.constant(Elasticity.constant(1e13, 0.3), 1e-3, 5e6, exponent)
    given, values = rolls((0, 1, 2, 4, 5, 6)), []
    for steps in (32, 64, 128):
        bulge = over_rolls(CreepingStrip(law, steps=steps, layers=12), given, shell)
        values.append([bulge.largest, bulge.roll_force[1] / (PRESSURE * PITCH)])
    (first, _), (second, force) = np.abs(np.diff(np.array(values), axis=0))
    assert np.log2(first / second) > 1.8
    assert second < 1e-3 * values[-1][0]
    assert force < 2e-4  # what one number of steps has is 3e-3 off, of first order


def test_forces_bear_the_pressure() -> None:
    """All forces and the shears at the ends balance the load, and their moments do."""
    law = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1)
    given = rolls((0, 1, 2, 3, 4, 5, 6), {3: -1e-3})
    bulge = over_rolls(CreepingStrip(law), given, SHELL)
    ends = np.interp(given.positions, bulge.z, bulge.moment)
    first = (ends[1] - ends[0]) / PITCH + 0.5 * PRESSURE * PITCH
    last = -(ends[-1] - ends[-2]) / PITCH + 0.5 * PRESSURE * PITCH
    total = bulge.roll_force.sum() + first + last
    assert total == pytest.approx(PRESSURE * given.positions[-1], rel=1e-9)
    # Pressed inwards it bears more, its neighbours less.
    assert bulge.roll_force[2] > 1.1 * PRESSURE * PITCH > PRESSURE * PITCH > bulge.roll_force[3]


def test_a_lost_roll_is_felt_no_farther_than_the_rolls_that_are_counted() -> None:
    law = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1)
    strip, stiff = CreepingStrip(law), Shell(0.07, lambda depth: 1173.15 + 590.0 * depth / 0.07)
    few = over_rolls(strip, rolls((0, 1, 2, 4, 5, 6)), stiff)
    more = over_rolls(strip, rolls((0, 1, 2, 3, 5, 6, 7, 8)), stiff)
    assert few.largest == pytest.approx(more.largest, rel=2e-2)
    assert more.extremes()[1] / PITCH == pytest.approx(4.0, abs=0.4)
    single = strip.bulge(rolls((0, 1, 2, 3)).span(0), stiff).largest
    assert few.largest > 8.0 * single


def test_what_is_no_row_of_rolls_is_refused() -> None:
    with pytest.raises(ValueError, match="needs four"):
        Rolls((0.0, 0.3, 0.6), (0.0, 0.0, 0.0), PRESSURE, SPEED)
    with pytest.raises(ValueError, match="must increase"):
        Rolls((0.0, 0.3, 0.3, 0.6), (0.0,) * 4, PRESSURE, SPEED)
    with pytest.raises(ValueError, match="4 rolls, but 3 offsets"):
        Rolls((0.0, 0.3, 0.6, 0.9), (0.0,) * 3, PRESSURE, SPEED)
