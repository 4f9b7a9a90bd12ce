"""Builds the machine that the slice passes from the tables of a case."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.model.machine import thickness_of
from castfem.physics.machine import Machine

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.machine import Extraction
    from castfem.model.machine import Machine as MachineTable
    from castfem.physics.machine.extraction.effort import KnownResistance, Pairs
    from castfem.physics.machine.rolls import Rolls


def build_machine(case: Case) -> Machine:
    """Return the machine of a sound case."""
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None:
        return Machine(case.casting.travel, mould_length=case.mould_exit())
    thickness = thickness_of(case.section)
    assert thickness is not None
    return Machine(case.casting.travel, rolls.line(thickness), case.mould_exit())


def capacities(rolls: Rolls) -> Array:
    """Return the capacity of each pair (n,), N: 0 without a drive, inf for an unlimited drive."""
    return np.array(
        [
            0.0
            if not pair.driven or pair.locked or pair.lost
            else math.inf
            if pair.capacity is None
            else pair.capacity
            for pair in rolls.pairs
        ]
    )


def coupled_pairs(table: Extraction, rolls: Rolls) -> Pairs:
    """The pairs of rolls in the form that a coupled resistance needs."""
    from castfem.physics.machine.extraction.effort import Pairs
    from castfem.physics.machine.extraction.resistance import friction

    there = rolls.there
    pairs = [rolls.pairs[i] for i in there]
    locked = [pair.locked for pair in pairs]
    return Pairs(
        there,
        np.array([pair.position for pair in pairs]),
        friction(table.friction_axis, table.friction_surface, locked),
        capacities(rolls)[list(there)],
    )


def known_resistance(table: Extraction, machine: MachineTable) -> KnownResistance | None:
    """Resistance from a maker's curve, shared by the drives; None if the run computes it.

    The curve is that of a machine without defects; each defect changes it in its own way.

    Raises:
        StrandStopsError: The drives cannot overcome the resistance of the rolls.
    """
    from castfem.physics.machine.extraction.effort import KnownResistance
    from castfem.physics.machine.extraction.resistance import friction, steps_of

    normal, rolls = machine.normal(), machine.pairs()
    if not isinstance(table.resistance, Table) or normal is None or rolls is None:
        return None
    places = [pair.position for pair in rolls.pairs]
    steps = steps_of(table.resistance, places)
    turning, sliding = friction(table.friction_axis, table.friction_surface, [False, True])
    for defect in machine.defect or ():
        steps = defect.resisting(steps, normal, rolls, float(sliding / turning))
    return KnownResistance(places, steps, capacities(rolls))
