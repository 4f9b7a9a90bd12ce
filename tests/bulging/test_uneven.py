"""Pitches near lost or misaligned rolls against the single pitch and the strip over all rolls."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import ThermoElastic, load_elasticity, load_law
from castfem.physics.machine.bulging import CreepingStrip, Rolls, Shell, Span, over_rolls
from castfem.physics.machine.bulging.uneven import ABOVE, BELOW, UnevenRolls

PITCH, PRESSURE, SPEED = 0.31, 0.2e6, 0.02
LOAD = PITCH * PRESSURE
SHELL = Shell(0.05, lambda depth: 1223.15 + 540.0 * depth / 0.05)
ELASTIC = CreepingStrip(ThermoElastic(load_elasticity()))
PLACES = PITCH * np.arange(12)
NONE = np.zeros(12)
COUNT = 81


def uneven(strip: CreepingStrip, places: Array, offsets: Array, *marks: int) -> UnevenRolls:
    return UnevenRolls(strip, places, offsets, marks, (PITCH, PITCH), COUNT)


def span(places: Array, pitch: int) -> Span:
    return Span(float(places[pitch + 1] - places[pitch]), PRESSURE, SPEED)


def test_where_the_rolls_are_alike_it_is_the_single_pitch() -> None:
    strip = CreepingStrip(load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1))
    found = uneven(strip, PLACES, NONE, 5).bulge(5, span(PLACES, 5), SHELL, 1.0)
    one = strip.bulge(span(PLACES, 5), SHELL)
    assert found.bulge.z == pytest.approx(one.z, rel=1e-12)
    assert found.bulge.deflection == pytest.approx(one.deflection, abs=1e-2 * one.largest)
    swing = np.ptp(one.curvature)
    assert found.bulge.curvature == pytest.approx(one.curvature, abs=1e-2 * swing)
    assert found.bulge.roll_force[0] == pytest.approx(LOAD, rel=3e-3)
    assert found.added == pytest.approx(np.zeros(3), abs=3e-3 * LOAD)


def test_a_lost_roll_is_that_of_the_strip_over_all_rolls_and_fades() -> None:
    """What is added is told alike from pitch to pitch, and the rolls bear the pressure of all."""
    places = np.delete(PLACES, 6)
    rolls = uneven(ELASTIC, places, NONE[:-1], 5)
    near = [k for k in range(len(places) - 1) if rolls.near(k)]
    assert near == list(range(5 - ABOVE, 5 + BELOW + 1))
    whole = over_rolls(ELASTIC, Rolls(tuple(places), (0.0,) * 11, PRESSURE, SPEED), SHELL)
    found = {k: rolls.bulge(k, span(places, k), SHELL, 1.0) for k in near}
    for k, one in found.items():
        expected = whole.at(places[k] + one.bulge.z)
        assert one.bulge.deflection == pytest.approx(expected, abs=1e-2 * whole.largest)
        # Roll k is the (k-1)th that has a span to each side.
        assert one.bulge.roll_force[0] == pytest.approx(whole.roll_force[k - 1], abs=2e-2 * LOAD)
        if k + 1 in found:
            assert found[k + 1].added[:2] == pytest.approx(one.added[1:], abs=1e-3 * LOAD)
    single = ELASTIC.bulge(span(PLACES, 5), SHELL).largest
    assert found[5].bulge.largest > 5.0 * single
    # Beside the long pitch more than the half of it that statics gives, beyond them less.
    added = np.array([found[k].added[0] for k in near])
    assert added[2] > 0.1 * LOAD > 0.0 > added[1] and abs(added[0]) < abs(added[1])
    assert added.sum() + found[near[-1]].added[1] == pytest.approx(0.0, abs=0.03 * LOAD)


def test_a_roll_that_is_off_presses_one_face_and_leaves_the_other() -> None:
    offsets = NONE.copy()
    offsets[6] = 1e-3  # far beyond what the elastic shell bulges
    rolls = uneven(ELASTIC, PLACES, offsets, 5, 6)
    inner, outer = (rolls.bulge(6, span(PLACES, 6), SHELL, side) for side in (1.0, -1.0))
    # The extrados is pressed in; the intrados does not touch: as if its roll were lost.
    assert outer.bulge.roll_force[0] > 2.0 * LOAD
    assert outer.added[0] == pytest.approx(outer.bulge.roll_force[0] - LOAD, rel=1e-12)
    assert inner.bulge.roll_force[0] == 0.0 and inner.added[0] == pytest.approx(-LOAD)
    without = np.delete(PLACES, 6)
    lost = uneven(ELASTIC, without, NONE[:-1], 5).bulge(5, span(without, 5), SHELL, 1.0)
    there = 0.5 * lost.bulge.z[-1] + inner.bulge.z
    expected = np.interp(there, lost.bulge.z, lost.bulge.deflection)
    # Deflections are told from the line between the rolls, which falls by 1 mm here.
    found = inner.bulge.deflection + 1e-3 * (1.0 - inner.bulge.z / PITCH)
    assert found == pytest.approx(expected, abs=2e-2 * lost.bulge.largest)
    small = offsets * 1e-2
    for side in (1.0, -1.0):
        one = uneven(ELASTIC, PLACES, small, 5, 6).bulge(6, span(PLACES, 6), SHELL, side)
        assert one.bulge.roll_force[0] > 0.0
        assert one.added[0] * side < 0.0
        assert one.bulge.deflection[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-7)


def test_at_the_ends_of_a_machine_its_rolls_are_taken_to_go_on() -> None:
    places = np.delete(PLACES, 1)
    first = uneven(ELASTIC, places, NONE[:-1], 0).bulge(0, span(places, 0), SHELL, 1.0)
    inside = np.delete(PLACES, 6)
    other = uneven(ELASTIC, inside, NONE[:-1], 5).bulge(5, span(inside, 5), SHELL, 1.0)
    assert first.bulge.deflection == pytest.approx(other.bulge.deflection, rel=1e-6, abs=1e-9)
    assert first.added == pytest.approx(other.added, rel=1e-6)


def test_neighbouring_defects_share_a_strip() -> None:
    rolls = uneven(ELASTIC, PLACES, NONE, 2, 5, 12)
    assert rolls.around(3) == rolls.around(0) == rolls.around(7) == (-1, 10)
    assert rolls.around(11) == (9, 17) and not rolls.near(9)
