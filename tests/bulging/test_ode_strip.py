"""The creeping strip against an ODE solver and a root finder that share nothing with it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.lost_roll import CLAMPED, ELASTIC, PITCH, PRESSURE, SHELL, austenite, kept_curvature
from benchmarks.ode_strip import OdeStrip
from castfem.physics.machine.bulging import CreepingStrip, Rolls, Span, over_rolls
from castfem.physics.machine.bulging.creep import nodes
from castfem.physics.machine.bulging.result import deflected

SPEED = 0.02
STRIP = CreepingStrip(austenite())
OTHER = OdeStrip(ELASTIC, 0.04, 1273.15, 1763.15, panels=4, points=41, tolerance=1e-5)


@pytest.mark.parametrize("speed", [0.02, 0.01])
def test_a_long_pitch_that_repeats_itself(speed: float) -> None:
    found = STRIP.bulge(Span(2 * PITCH, PRESSURE, speed), SHELL)
    other = OTHER.periodic(PRESSURE, 2 * PITCH, speed)
    assert found.largest == pytest.approx(other.w.max(), rel=1e-2)
    assert found.at(other.z) == pytest.approx(other.w, abs=1.5e-2 * found.largest)


@pytest.mark.parametrize("share", [0.7, 0.8, 1.0])
def test_a_moment_that_stays_keeps_a_curvature(share: float) -> None:
    """Steel that hardens and never recovers repeats itself under any moment over its rolls.

    Only the mean curvature that it keeps tells one from the other: so two searches for a pitch that
    repeats itself end at moments of their own (3 % apart here), and agree on the bulge.
    """
    moment, pitches, bulges, kept = share * CLAMPED, 14, [], []
    for steps in (32, 64):
        z = nodes(2 * PITCH, steps)
        bent = kept_curvature(STRIP.law, moment, pitches, SPEED, steps, STRIP.layers)
        kept.append(np.trapezoid(bent, z) / z[-1])
        bulges.append(deflected(z, bent - kept[-1])[0].max())
        assert abs(bent[-1] - bent[0]) < 2e-3 * np.ptp(bent)  # it does repeat itself
    bulge, mean = (2.0 * fine - coarse for coarse, fine in (bulges, kept))
    largest, other = OTHER.kept_at(moment, PRESSURE, 2 * PITCH, SPEED, pitches)
    assert bulge == pytest.approx(largest, rel=5e-3)
    assert mean == pytest.approx(other, rel=2e-2)
    assert (mean > 0.0) == (share < 0.85)
    sought = STRIP.bulge(Span(2 * PITCH, PRESSURE, SPEED), SHELL)
    assert bulge == pytest.approx(sought.largest, rel=5e-3)


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
