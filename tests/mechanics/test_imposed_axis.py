"""A neutral axis on the face that would be compressed stretches the strand (42)-(44).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.physics.mechanics.bent_planes import BentPlanes, ImposedAxis

HALF, MIDDLE = 0.11, 1.0 / (8.006 - 0.11)  # m, 1/m


def extrados(middle: float) -> float:
    return middle / (1.0 + middle * HALF)


def curvature(time: float) -> float:
    """Bent from 1 to 2 s, held to 5 s, straight again at 7 s."""
    return extrados(MIDDLE * float(np.interp(time, [1.0, 2.0, 5.0, 7.0], [0.0, 1.0, 1.0, 0.0])))


def planes(bending: float, straightening: float) -> BentPlanes:
    plain = BentPlanes(curvature, HALF)
    axis = ImposedAxis.alternating(plain.middle, (0.0, 1.0, 2.0, 5.0, 7.0), bending, straightening)
    return BentPlanes(curvature, HALF, neutral_axis=axis)


def thickness(of: BentPlanes, time: float, y: float) -> float:
    a0, _, a2, _ = of.at(time)[0]
    return 1.0 + a0 + a2 * y


def test_the_slab_of_the_thesis_is_stretched_by_almost_three_per_cent() -> None:
    """E of the extrados on the arc, (1 + kH)/(1 - kH), all over the section when it is straight."""
    strand = planes(HALF, -HALF)
    for time in (0.0, 1.0, 1.5, 2.0, 3.0, 5.0):
        assert thickness(strand, time, HALF) == pytest.approx(1.0, abs=1e-15)
    stretched = (1.0 + MIDDLE * HALF) / (1.0 - MIDDLE * HALF)
    for time in (2.0, 5.0, 6.0, 7.0, 9.0):
        assert thickness(strand, time, -HALF) == pytest.approx(stretched, rel=1e-12)
    for y in (-HALF, 0.0, HALF):
        assert thickness(strand, 8.0, y) == pytest.approx(stretched, rel=1e-12)
    assert stretched == pytest.approx(1.028, abs=5e-4)


def test_it_never_jumps() -> None:
    strand = planes(HALF, -HALF)
    times = np.linspace(0.0, 8.0, 8001)
    for y in (-HALF, 0.05, HALF):
        course = np.array([thickness(strand, float(t), y) for t in times])
        assert np.abs(np.diff(course)).max() < 2.0 * 1e-3 * MIDDLE * 2.0 * HALF


def test_one_place_is_the_axis_as_ever() -> None:
    one, other = planes(0.02, 0.02), BentPlanes(curvature, HALF, neutral_axis=0.02)
    for time in (0.0, 1.3, 3.0, 6.1, 9.0):
        assert one.at(time)[0] == pytest.approx(other.at(time)[0], abs=1e-15)
    assert one.free == ()
