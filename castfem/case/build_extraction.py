"""From [machine.extraction] and the rolls of a case to what resists and what draws."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from castfem.extraction.effort import KnownResistance, Pairs
from castfem.extraction.resistance import friction, steps_of
from castfem.values.tables import Table
from castfem.values.types import Array

if TYPE_CHECKING:
    from castfem.case.extraction import Extraction
    from castfem.machine.rolls import Rolls


def capacities(rolls: Rolls) -> Array:
    """Capacity of each pair (n,), N: 0 of one that cannot draw, inf of a drive without one."""
    most = [math.inf if pair.capacity is None else pair.capacity for pair in rolls.pairs]
    return np.where([pair.driven for pair in rolls.pairs], most, 0.0)


def coupled_pairs(table: Extraction, rolls: Rolls) -> Pairs:
    """The pairs as a coupled resistance needs them."""
    return Pairs(
        tuple(range(len(rolls.pairs))),
        np.array([pair.position for pair in rolls.pairs]),
        friction(table.friction_axis, table.friction_surface, np.zeros(len(rolls.pairs), bool)),
        capacities(rolls),
    )


def known_resistance(table: Extraction, rolls: Rolls) -> KnownResistance | None:
    """Resistance of a maker's curve, shared by the drives; None where it comes with the run.

    Raises:
        StrandStopsError: The drives are weaker than the rolls.
    """
    if not isinstance(table.resistance, Table):
        return None
    places = [pair.position for pair in rolls.pairs]
    curve: Callable[[Array], Array] = table.resistance
    return KnownResistance(places, steps_of(curve, places), capacities(rolls))
