"""What pairs of rolls resist with: friction (45)-(47), pressure (319), bending (320)-(321).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.physics.machine.extraction.resistance import (
    bending_force,
    friction,
    hinge_force,
    pair_resistances,
    pressed,
    steps_of,
    tributary_lengths,
)

AXIS, SURFACE = 0.015, 0.30


def test_a_roll_turns_unless_it_is_locked_or_its_axis_resists_more_than_its_surface() -> None:
    assert friction(AXIS, SURFACE, [False, True]).tolist() == [AXIS, SURFACE]
    assert pytest.approx(20.0) == SURFACE / AXIS  # (328)
    assert friction(0.5, SURFACE, [False, True]).tolist() == [SURFACE, SURFACE]


def test_bending_adds_to_bulging_whichever_roll_it_presses_on() -> None:
    steps = pair_resistances(
        friction(AXIS, SURFACE, [False, False, True]),
        np.array([500e3, 500e3, 500e3]),
        np.array([100e3, -100e3, 100e3]),
    )
    assert steps == pytest.approx([9e3, 9e3, 180e3])


def test_the_rolls_carry_the_pressure_of_all_of_the_strand() -> None:
    """Both faces, no more and no less, however the pitches are cut: p L, not p times 10 mm."""
    cuts = [0.0, 0.2, 0.5, 0.7, 1.1, 1.3]
    lengths = tributary_lengths(cuts)
    assert lengths.sum() == pytest.approx(1.3 + 0.5 * (0.2 + 0.2))
    assert pressed(2e5, lengths, 1.0).sum() == pytest.approx(2.0 * 2e5 * lengths.sum())
    assert tributary_lengths([0.3]).tolist() == [0.0]


def test_the_resistance_of_48_as_statics_has_it_is_the_makers() -> None:
    """0.7 MPa, a pitch of 335 mm, 1 m of liquid: 0.72 t, the thesis has 0.75 (15 t locked)."""
    force = float(pressed(0.7e6, 0.335, 1.0))
    assert force == pytest.approx(469e3)
    assert AXIS * force / 9.80665e3 == pytest.approx(0.72, abs=0.005)


def bending_forces(positions: Array, moments: Array) -> Array:
    """What each pair bears by bending (n,), N, of a strand without moment beyond first and last."""
    shear = np.diff(moments) / np.diff(positions)
    return -np.diff(np.concatenate([[0.0], shear, [0.0]]))


def test_rolls_that_bend_are_in_equilibrium() -> None:
    """Forces and moments about any point vanish; a moment that stays presses on no roll."""
    places = np.array([0.0, 0.3, 0.7, 0.9, 1.3, 1.6])
    moments = np.array([0.0, 90e3, 130e3, 130e3, 20e3, 0.0])
    found = bending_forces(places, moments)
    assert found.sum() == pytest.approx(0.0, abs=1e-6)
    assert found @ places == pytest.approx(0.0, abs=1e-6)
    # Statics of the part above a cut: its forces make the moment there.
    for i in range(1, 6):
        lever = places[i] - places[:i]
        assert -(found[:i] @ lever) == pytest.approx(moments[i], abs=1e-6)
    whole = bending_forces(np.arange(4.0), np.full(4, 5.0))
    assert whole.tolist() == [0.0, 0.0, 0.0, 0.0]
    single = [
        bending_force(moments[i - 1 : i + 2].tolist(), np.diff(places)[i - 1 : i + 1].tolist())
        for i in range(1, 5)
    ]
    assert single == pytest.approx(found[1:-1])


def test_hinges_press_where_equilibrium_leaves_nothing() -> None:
    """(320) gives each pair M/L; between equal moments the rolls bear none of it."""
    assert hinge_force(110e3, 0.32) == pytest.approx(344e3, rel=2e-3)
    assert bending_force([110e3, 110e3, 110e3], [0.32, 0.32]) == 0.0
    # A single hinge: the pair bears M/L of both of its pitches.
    assert bending_force([0.0, 110e3, 0.0], [0.32, 0.32]) == pytest.approx(
        2.0 * hinge_force(110e3, 0.32)
    )


def test_steps_add_up_to_the_curve() -> None:
    curve = Table("position", (1.0, 2.0, 4.0), (7e3, 10e3, 30e3))
    steps = steps_of(curve, [1.0, 3.0, 3.5, 5.0])
    assert steps == pytest.approx([7e3, 13e3, 5e3, 5e3])
    assert steps.sum() == 30e3
