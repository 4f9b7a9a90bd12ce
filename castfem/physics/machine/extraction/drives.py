"""What each driven pair takes of the resistance of the rolls (thesis III.1.3.2, VI.4.2.1)."""

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
    """The rolls resist with more than all drives can pull."""


@dataclass(frozen=True, slots=True)
class Shares:
    """How the drives share the resistance, at each pair (n,), N."""

    drive: Array  #: what the pair pulls with; 0 of one that is not driven
    #: axial effort in the strand as it comes to the pair, which has resisted already and not yet
    #: pulled; negative where the strand is pushed
    effort: Array


def taken(effort: float, capacity: float) -> float:
    """What a drive takes of the effort that has come down to it, N: all of it, as far as it can."""
    return min(max(effort, 0.0), capacity)


def share(resistances: Sequence[float] | Array, capacities: Sequence[float] | Array) -> Shares:
    """Let each drive take what came before it, as far as it can, the next the rest.

    That is the least favourable of the ways in which drives of one speed may share: the strand is
    pulled as much as can be. What the last drive leaves, and what pairs below it resist, is pushed
    by the drives that have something left, the lowest first.

    Args:
        resistances: Of each pair (n,), N.
        capacities: Of each pair (n,), N: 0 of one that is not driven, inf where it is not known.

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
    """Refuse a resistance (N) beyond what all drives (n,) can pull.

    Raises:
        StrandStopsError: It is.
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
