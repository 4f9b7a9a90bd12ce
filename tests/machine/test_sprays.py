"""Stretches from roll to roll, and what a nozzle reaches between two rolls.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from castfem.physics.machine.rolls import Segment, expand
from castfem.physics.machine.sprays import (
    Row,
    footprint,
    gap_below,
    longest_spray,
    scale_water,
    stretches,
)

ROWS = (Row("a", 1, 1.10, 1.16), Row("a", 2, 1.35, 1.41), Row("b", 2, 1.33, 1.39))
CONTACTS = ((0.99, 1.01), (1.24, 1.26), (1.49, 1.51))


def test_the_sprayed_width() -> None:
    assert footprint(0.21, math.radians(90.0)) == pytest.approx(0.42)


def test_the_longest_spray_is_that_of_the_thesis() -> None:
    """Between rolls #7 and #8: 72 mm (306)."""
    assert longest_spray(0.035, 0.210, 0.215) == pytest.approx(0.0717, abs=5e-5)
    rolls = expand([Segment(2, 0.25, 0.215)], 2.0)
    gap = gap_below(rolls, 1, 0.22)
    assert (gap.middle, gap.clear) == pytest.approx((2.125, 0.035))


@pytest.mark.parametrize(("clear", "off", "diameter"), [(0.035, 0.21, 0.215), (0.06, 0.3, 0.13)])
def test_the_longest_spray_just_passes_the_rolls(clear: float, off: float, diameter: float) -> None:
    """A ray to its end passes the height of the axes where the rolls come nearest."""
    half = 0.5 * longest_spray(clear, off, diameter)
    at_axes = half * (off - 0.5 * diameter) / off
    assert at_axes == pytest.approx(0.5 * clear)


def test_a_nozzle_below_the_axes_of_the_rolls() -> None:
    with pytest.raises(ValueError, match="between the rolls"):
        longest_spray(0.035, 0.1, 0.215)


def test_what_recurs_from_roll_to_roll() -> None:
    met = stretches(CONTACTS, ROWS, 0.8, 2.0, gathers=lambda above: above != 1)
    assert [(s.kind, s.gap) for s in met] == [
        ("shade", 0), ("contact", 1), ("shade", 1), ("spray", 1), ("shade", 1),
        ("contact", 2), ("shade", 2), ("spray", 2), ("spray", 2), ("spray", 2), ("run_off", 2),
        ("contact", 3), ("shade", 3),
    ]  # fmt: skip
    assert (met[0].start, met[-1].end) == (0.8, 2.0)
    assert all(a.end == b.start for a, b in itertools.pairwise(met))
    assert [s.rows for s in met if s.kind == "spray"] == [(0,), (2,), (1, 2), (1,)]


def test_a_face_without_rolls_has_no_contact() -> None:
    places = [(1.0, 1.0), (1.25, 1.25), (1.5, 1.5)]
    met = stretches(places, ROWS[:1], 0.8, 1.4, gathers=lambda above: False)
    assert [s.kind for s in met] == ["shade", "shade", "spray", "shade", "shade"]
    assert sum(s.end - s.start for s in met) == pytest.approx(0.6)


def test_water_of_some_nozzles_is_scaled() -> None:
    scaled = scale_water(ROWS, "a", 2, 3, 0.66)
    assert [row.share for row in scaled] == [1.0, 0.66, 1.0]
    again = scale_water(scaled, "a", 1, 3, 0.5)
    assert [row.share for row in again] == pytest.approx([0.5, 0.33, 1.0])
    assert np.array_equal([r.start for r in again], [r.start for r in ROWS])
    with pytest.raises(ValueError, match="no nozzles between rolls 2 and 3"):
        scale_water(ROWS, "c", 2, 3, 0.66)
    with pytest.raises(ValueError, match="negative"):
        scale_water(ROWS, "a", 2, 3, -0.1)
