"""Analytical answers of a bar that is pulled, pressed and released at constant rates.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from castfem.constitutive.base import Array, Law
from castfem.constitutive.curves import modified_norton_hoff
from castfem.constitutive.flow_laws import NortonHoff, PerfectlyPlastic, ThermoElastic

FlowCurve = Callable[[Array, float], Array]


def flow_curve(law: Law, temperature: float) -> FlowCurve | None:
    """Stress (Pa) that flow at a constant rate follows, over strain and rate (1/s).

    Args:
        law: Constitutive law.
        temperature: K.

    Returns:
        (163) for the modified Norton-Hoff law with its yield limit found automatically, the yield
        stress of the perfectly plastic one, infinity without flow; None for laws whose strain at
        constant rate has no closed form.
    """
    t = np.full(1, temperature)
    if isinstance(law, NortonHoff) and law.yield_limit is None:
        strength, p1, p3, p4 = (float(f(t)[0]) for f in (law.strength, law.p1, law.p3, law.p4))
        most = law.largest_strain

        def curve(strain: Array, rate: float) -> Array:
            with np.errstate(divide="ignore"):
                return modified_norton_hoff(np.minimum(strain, most), rate, strength, p1, p3, p4)

        return curve
    if isinstance(law, PerfectlyPlastic | ThermoElastic):
        limit = float(law.yield_stress(t)[0]) if isinstance(law, PerfectlyPlastic) else np.inf
        return lambda strain, rate: np.full_like(strain, limit)
    return None


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
        curve: From `flow_curve`.
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
