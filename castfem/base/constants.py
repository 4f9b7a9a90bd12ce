"""Physical constants, and tolerances for equal positions and times."""

from __future__ import annotations

ZERO_CELSIUS = 273.15  # K
STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2K4, CODATA 2018
ZERO_STRENGTH = 0.75
"""Solid fraction at the zero strength temperature of steel [M]."""


ROUNDING = 1e-9
"""Tolerance on lengths or times that were given or written to a file."""
EXACT = 1e-12
"""Tolerance, relative to the whole, on times or positions that castfem has computed."""


def same_instant(one: float, other: float, whole: float) -> bool:
    """Whether two times (or positions) of a run of length `whole` are equal."""
    return abs(one - other) <= EXACT * whole


def same_or_before(time: float, limit: float) -> bool:
    """Whether a time read from a file is not after `limit`, both s."""
    return bool(time <= limit + ROUNDING * max(1.0, abs(limit)))
