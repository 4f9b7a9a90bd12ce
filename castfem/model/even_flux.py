"""Zones in which a given flux cools a corner as much as the middle of the faces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from castfem.model.check_cooling import law_groups
from castfem.model.mould_laws import Contact, Flux

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.heat_law import HeatLaw

TOLD = "the same flux everywhere round the section: no gap opens at the corner without [mould]"


def even_zones(case: Case) -> Iterator[str]:
    """Yield the zones that have a flux at corners and beside them, and no gap that lowers it."""
    start = 0.0
    for zone in case.cooling:
        if start < case.casting.length and any(is_even(case, law) for law in zone.surface):
            yield zone.name
        start = case.casting.length if zone.to is None else zone.to


def is_even(case: Case, law: HeatLaw) -> bool:
    """Whether a law is a given flux at corners and beside them, and no gap can lower it there."""
    given = law.flux if isinstance(law, Contact) else law.value if isinstance(law, Flux) else None
    if given is None or case.mould is not None:
        return False
    if isinstance(law, Contact) and law.gap is not None:
        return False
    groups = law_groups(case.section, law)
    if getattr(case.section, "corner_radius", None) == 0.0:
        return {"narrow", "wide"} <= {name.partition("_")[0] for name in groups}
    corners = {name for name in groups if name.startswith("corner")}
    return bool(corners) and corners != groups


def mend(case: Case) -> str:
    """What helps: less for the corner, where the section has it as a group of its own."""
    if getattr(case.section, "corner_radius", None) == 0.0:
        return "give the section its corner_radius, and its corner less heat"
    return 'give the corner less by a law of its own, on = ["corner"]'
