"""Analytical answers of a bar that is pulled, pressed and released at constant rates.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.physics.constitutive.flow_laws import FlowCurve


def axial_stress(strain: Array, rate: Array, modulus: float, curve: FlowCurve) -> Array:
    """Axial stress (n,) of a bar along its history, Pa.

    Loading follows the elastic line until it meets the curve of its rate, then the curve (thesis
    III.2.6); a change of rate changes the curve at once.  Where the direction turns, the bar
    answers along the elastic line through that point; in the opposite direction it flows on the
    curve again, hardened by all it has flowed.  A bar that is held relaxes: from there on the
    answer is NaN.

    Args:
        strain: Axial mechanical strain (n,), from 0.
        rate: Of the step that ends in each point (n,), 1/s; the first is not used.
        modulus: Young's modulus, Pa.
        curve: Of the law, `RadialReturn.flow_curve`.
    """
    found = np.full(len(strain), np.nan)
    found[0] = modulus * strain[0]
    # Strain at which the bar is free of stress, and what it has flowed, when it last turned.
    rest, flowed, direction = 0.0, 0.0, 0.0
    changes = np.flatnonzero(np.diff(rate[1:])) + 2
    for first, last in zip([1, *changes], [*changes, len(strain)], strict=True):
        speed = float(rate[first])
        if speed == 0.0:
            break
        if direction * speed < 0.0:
            released = float(strain[first - 1] - found[first - 1] / modulus)
            rest, flowed = released, flowed + abs(released - rest)
        direction = np.sign(speed)
        reach = direction * (strain[first:last] - rest)
        limit = curve(flowed + np.maximum(reach, 0.0), abs(speed))
        found[first:last] = direction * np.minimum(modulus * reach, limit)
    return found
