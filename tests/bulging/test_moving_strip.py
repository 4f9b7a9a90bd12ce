"""The creeping strip against a plane continuum that its rolls move along."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.moving_strip import AUSTENITE, SPEED, MovingStrip, shell_of, single
from castfem.physics.constitutive import Elasticity, ThermoElastic
from castfem.physics.machine.bulging import CreepingStrip, ElasticStrip, Shell, Span


@pytest.mark.parametrize("thickness", [0.02, 0.04])
def test_elastic_it_is_the_strip_and_its_shear(thickness: float) -> None:
    """Wherever the roll is."""
    elastic, shell = Elasticity.constant(10e9, 0.3), Shell(thickness, lambda depth: 1400.0)
    span = Span(0.25, 0.2e6, SPEED)
    moving = MovingStrip(ThermoElastic(elastic), shell, span, (32, 4))
    largest = []
    for roll in (0, 5, 4):
        moving.step(roll, 1.0)
        largest.append(float(moving.profile(roll).middle.max()))
    shear = 0.2e6 * 0.25**2 / (8.0 * 5.0 / 6.0 * 10e9 / 2.6 * thickness)
    strip = ElasticStrip(elastic).bulge(span, shell).largest
    assert largest == pytest.approx([largest[0]] * 3, rel=1e-6)
    assert largest[0] == pytest.approx(strip + shear, rel=3e-2 * thickness / 0.02)
    assert largest[0] > strip + 0.8 * shear


def test_creeping_it_bulges_as_the_strip_and_a_little_more() -> None:
    shell, span = shell_of(0.04, 1000.0), Span(0.5, 0.25e6, SPEED)
    strip = CreepingStrip(AUSTENITE).bulge(span, shell)
    top, at, low = strip.extremes()
    coarse, fine = single(AUSTENITE, shell, span, (12, 24))
    found = 2.0 * fine.middle.max() - coarse.middle.max()
    assert 1.0 < found / top < 1.12
    assert fine.z[fine.middle.argmax()] == pytest.approx(at, abs=0.05 * span.length)
    least = 2.0 * fine.middle.min() - coarse.middle.min()
    assert least == pytest.approx(low, rel=0.15)
    # More creep than elastic bulge, 0.64 mm, and both with memory.
    assert np.abs(fine.surface - fine.middle).max() < 0.05 * top
