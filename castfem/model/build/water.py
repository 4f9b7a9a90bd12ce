"""What the spray water of a case is shared from, and the steel that it cools."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.model.water import Supply, steel_per_length

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.fem.section import Section
    from castfem.physics.materials import Steel


def water_supply(case: Case, steel: Steel, section: Section) -> Supply:
    """Return what turns water per mass of steel, or shares, into flows (collective)."""
    casting = case.casting
    mass = None if section.source is None else steel_per_length(section.source, steel)
    return Supply(section.comm.bcast(mass), casting.travel, case.water, casting.clock)
