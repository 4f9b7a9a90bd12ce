"""Constants of nature and of units; when two positions or instants are the same."""

from __future__ import annotations

ZERO_CELSIUS = 273.15  # K
STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2K4, CODATA 2018
ZERO_STRENGTH = 0.75
"""Solid fraction at which steel has no strength yet, at its zero strength temperature [M]."""


ROUNDING = 1e-9
"""Of a length or a time: how far two that were given or written down as one may differ."""
EXACT = 1e-12
"""Of the whole: how far two that castfem computed as one may differ."""


def same_instant(one: float, other: float, whole: float) -> bool:
    """Whether two instants of a run, or positions in it, of length `whole` are the same."""
    return abs(one - other) <= EXACT * whole


def same_or_before(time: float, limit: float) -> bool:
    """Whether a time that was read from a file is not after `limit`, both s."""
    return bool(time <= limit + ROUNDING * max(1.0, abs(limit)))
