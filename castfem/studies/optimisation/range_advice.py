"""Whether a wider range may help where the constraints cannot be met."""

from __future__ import annotations

import math

from castfem.studies.optimisation.optimum import ConstraintStatus, Optimum, Value

_SIGMAS = 3.0  # of noise: two runs differ by that much of it in one case of thirty
_ROUNDING = 1e-9  # of a bound


def promising_ends(optimum: Optimum) -> tuple[Value, ...]:
    """The variables at an end of their range beyond which all missed constraints may be met.

    Towards such an end the violation of a missed constraint falls by more than noise, and none
    grows; and each missed constraint falls towards one of them.
    """
    missed = [(number, one) for number, one in enumerate(optimum.constraints) if not one.met]
    falls = {
        value.key: [_falls(optimum, value, number, one) for number, one in missed]
        for value in optimum.values
        if value.at_end in ("lowest", "highest")
    }
    found = {key: signs for key, signs in falls.items() if any(signs) and min(signs) >= 0}
    if not all(any(signs[i] > 0 for signs in found.values()) for i in range(len(missed))):
        return ()
    return tuple(value for value in optimum.values if value.key in found)


def _falls(optimum: Optimum, value: Value, number: int, one: ConstraintStatus) -> int:
    """1 if the violation falls from the next run inwards to the end, -1 if it grows, else 0."""
    steps = [a for a in optimum.away if a.key == value.key and math.isfinite(a.objective)]
    if not steps:
        return 0
    inward = min(steps, key=lambda step: abs(step.value - value.value))
    gained = one.left - inward.left[number]
    noise = _SIGMAS * one.result.noise + _ROUNDING * abs(one.bound)
    return 0 if abs(gained) <= noise else int(math.copysign(1, gained))
