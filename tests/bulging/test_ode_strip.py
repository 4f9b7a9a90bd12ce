"""The creeping strip against an ODE solver and a root finder that share nothing with it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.ode_strip import OdeStrip
from castfem.bulging import CreepingStrip, Rolls, Shell, Span, over_rolls
from castfem.constitutive import load_elasticity, load_law

PITCH, PRESSURE, SPEED = 0.25, 0.25e6, 0.02
SHELL = Shell(0.04, lambda depth: 1273.15 + 490.0 * depth / 0.04)
ELASTIC = load_elasticity()
STRIP = CreepingStrip(
    load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1, delta_share=np.zeros_like)
)
OTHER = OdeStrip(ELASTIC, 0.04, 1273.15, 1763.15, panels=4, points=41, tolerance=1e-5)


@pytest.mark.parametrize("speed", [0.02, 0.01])
def test_a_long_pitch_that_repeats_itself(speed: float) -> None:
    found = STRIP.bulge(Span(2 * PITCH, PRESSURE, speed), SHELL)
    other = OTHER.periodic(PRESSURE, 2 * PITCH, speed)
    assert found.largest == pytest.approx(other.w.max(), rel=1e-2)
    assert found.at(other.z) == pytest.approx(other.w, abs=1.5e-2 * found.largest)
    # Under a back stress a moment and a curvature that stay may change places.
    assert found.moment[0] == pytest.approx(other.moment, rel=5e-2)


def test_one_lost_roll_between_sound_ones() -> None:
    """It bulges 2.6 times as much as where every second roll is lost, by both."""
    rolls = PITCH * np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0])
    found = over_rolls(STRIP, Rolls(tuple(rolls), (0.0,) * 6, PRESSURE, SPEED), SHELL)
    z, w, moment = OTHER.over(rolls, PRESSURE, SPEED)
    assert found.largest == pytest.approx(w.max(), rel=2e-2)
    assert found.at(z) == pytest.approx(w, abs=3e-2 * found.largest)
    moments = np.interp(rolls, found.z, found.moment)
    assert moments == pytest.approx(moment, abs=2e-2 * np.abs(moment).max())
    alternate = STRIP.bulge(Span(2 * PITCH, PRESSURE, SPEED), SHELL).largest
    assert 2.3 < found.largest / alternate < 2.9
