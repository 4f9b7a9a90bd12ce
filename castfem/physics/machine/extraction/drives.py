"""Distribution of the resistance of the rolls over the drives (thesis III.1.3.2, VI.4.2.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from castfem.base.constants import EXACT
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.base.units import convert


class StrandStopsError(RunFailure):
    """The resistance of the rolls exceeds the capacity of all drives."""


@dataclass(frozen=True, slots=True)
class Shares:
    """Distribution of the resistance over the drives, at each pair (n,), N."""

    drive: Array  #: force of the pair's drive; 0 if it is not driven
    #: axial force in the strand at the pair, including its resistance but not its drive; negative
    #: where the strand is pushed
    effort: Array


def taken(effort: float, capacity: float) -> float:
    """Force that a drive takes of the axial force at it, N: all, up to its capacity."""
    return min(max(effort, 0.0), capacity)


def share(resistances: Sequence[float] | Array, capacities: Sequence[float] | Array) -> Shares:
    """Let each drive take the accumulated resistance up to its capacity, the next the rest.

    This is the least favourable distribution among drives of equal speed: the strand is pulled as
    much as possible. What the last drive leaves, and the resistance of pairs below it, is pushed by
    drives with spare capacity, the lowest first.

    Args:
        resistances: Resistance of each pair (n,), N.
        capacities: Capacity of each pair (n,), N: 0 if not driven, inf if unknown.

    Raises:
        StrandStopsError: All drives together are weaker than the rolls.
    """
    steps, most = np.asarray(resistances, float), np.asarray(capacities, float)
    refuse_standstill(float(steps.sum()), most)
    drive, effort = np.zeros(len(steps)), 0.0
    for i, step in enumerate(steps):
        effort += step
        drive[i] = taken(effort, most[i])
        effort -= drive[i]
    for i in range(len(steps) - 1, -1, -1):
        more = min(effort, most[i] - drive[i])
        drive[i] += more
        effort -= more
    return Shares(drive, np.cumsum(steps) - np.cumsum(drive) + drive)


def refuse_standstill(resistance: float, capacities: Array) -> None:
    """Refuse a resistance (N) above the capacity of all drives (n,).

    Raises:
        StrandStopsError: The resistance is too large.
    """
    most = math.fsum(capacities)
    if resistance > most * (1.0 + EXACT):
        raise StrandStopsError(
            f"the strand would stop: its rolls resist with {_in_kn(resistance)}, all its drives "
            f"together pull with {_in_kn(most)} at most; free the rolls that are locked, or check "
            "the capacities of the rolls of [machine]"
        )


def _in_kn(force: float) -> str:
    return f"{convert(force, 'N', 'kN'):.5g} kN"
