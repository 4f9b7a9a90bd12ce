"""From lost and misaligned rolls to the strip of the pitches near them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.physics.machine.bulging import CreepingStrip
from castfem.physics.machine.bulging.uneven import UnevenRolls
from castfem.physics.constitutive import ThermoElastic
from castfem.physics.machine.defects import out_of_line

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.bulging import Bulging
    from castfem.physics.constitutive.base import Law
    from castfem.physics.machine.rolls import Rolls
    from castfem.base.types import Array


def build_uneven_rolls(
    case: Case, table: Bulging, rolls: Rolls, law: Law, count: int
) -> tuple[UnevenRolls | None, Array]:
    """Return the rolls near which strips go over several pitches, and all rolls' offsets.

    Args:
        case: A sound one with lost or misaligned rolls.
        table: Its [mechanics.bulging].
        rolls: With their defects.
        law: Of the slice.
        count: Nodes of a bulge.

    Returns:
        None for the thesis' plate, each of which is by itself; the offsets are those of the rolls
        that are there, m (`out_of_line`).
    """
    normal = None if case.machine is None else case.machine.normal()
    assert normal is not None, "the case was checked"
    there, lines = rolls.there, out_of_line(normal, rolls)
    if table.model == "thesis":
        return None, lines
    marks = {k for k in range(len(there) - 1) if there[k + 1] - there[k] > 1}
    for k, i in enumerate(there):
        if rolls.pairs[i].offset:
            marks |= {k - 1, k} & set(range(len(there) - 1))
    places = [pair.position for pair in normal.pairs]
    steel = law if table.model == "creep" else ThermoElastic(law.elasticity)
    strip = CreepingStrip(steel, shear=bool(table.shear))
    return UnevenRolls(
        strip,
        np.array([rolls.pairs[i].position for i in there]),
        lines,
        frozenset(marks),
        (places[1] - places[0], places[-1] - places[-2]),
        count,
    ), lines
