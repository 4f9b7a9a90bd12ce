"""Whether a wider range may help where the constraints cannot be met."""

from __future__ import annotations

import math
from collections.abc import Sequence

from castfem.studies.optimisation.optimum import Away, Kept, Optimum, Value

_SIGMAS = 3.0  # of noise: two runs differ by that much of it in one case of thirty
_ROUNDING = 1e-9  # of a bound


def promising_ends(optimum: Optimum) -> tuple[Value, ...]:
    """The variables at an end of their range beyond which all that is missed may be met.

    Towards such an end something that is missed falls, by more than noise, and nothing that is
    missed grows; and each constraint that is missed falls towards one of them. A variable may lie
    at an end and change nothing of what is missed: more of it does not help.
    """
    missed = [(number, kept) for number, kept in enumerate(optimum.constraints) if not kept.met]
    falls = {
        value.key: [_falls(number, kept, _inward(optimum, value)) for number, kept in missed]
        for value in optimum.values
        if value.at_end in ("lowest", "highest")
    }
    found = {key: signs for key, signs in falls.items() if any(signs) and min(signs) >= 0}
    helped = [any(signs[i] > 0 for signs in found.values()) for i in range(len(missed))]
    if not all(helped):
        return ()
    return tuple(value for value in optimum.values if value.key in found)


def _inward(optimum: Optimum, value: Value) -> Sequence[Away]:
    """The run next to the optimum from which a variable at an end was stepped to it; () if none."""
    steps = [a for a in optimum.away if a.key == value.key and math.isfinite(a.objective)]
    return sorted(steps, key=lambda step: abs(step.value - value.value))[:1]


def _falls(number: int, kept: Kept, inward: Sequence[Away]) -> int:
    """1 if what a constraint is missed by falls towards an end, -1 if it grows, 0 if neither."""
    least = _SIGMAS * kept.known.noise + _ROUNDING * abs(kept.bound)
    for step in inward:
        gained = kept.left - step.left[number]
        return 0 if abs(gained) <= least else int(math.copysign(1, gained))
    return 0
