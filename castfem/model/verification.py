"""The table [verification]: the closed form that a case is held against."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from castfem.model.base import TableModel
from castfem.model.checks import Faults, check
from castfem.model.cooling import PrescribedTemperature
from castfem.model.section import Strip

if TYPE_CHECKING:
    from castfem.model.case import Case


class Verification(TableModel):
    """A closed form: the run ends with what it expects and how far off the run is."""

    closed_form: Literal["alloy_similarity", "neumann", "weiner_boley"]
    """half-space chilled to one temperature, of constant properties: an alloy with a solid fraction
    linear in temperature; a melt that freezes at one temperature; stress in the elastic, perfectly
    plastic shell of Weiner and Boley"""


@check("verification")
def _is_that_case(case: Case, table: Verification) -> Faults:
    """Yield what makes the case another one than that of its closed form."""
    key, name = "closed_form", table.closed_form
    if not isinstance(case.section, Strip):
        yield key, f'("{name}") is of a half-space: give section.shape = "strip"'
    laws = [law for zone in case.cooling for law in zone.surface]
    if len(laws) != 1 or not isinstance(laws[0], PrescribedTemperature):
        yield (
            key,
            f'("{name}") is of a surface held at one temperature: give one cooling zone with one '
            'law = "temperature"',
        )
    if name != "weiner_boley":
        return
    if case.mechanics is None:
        yield key, f'("{name}") is of stress: give the table [mechanics]'
    elif case.mechanics.law != name:
        yield key, f'("{name}") is of its own law: give mechanics.law = "{name}"'
    elif case.mechanics.strain != "small":
        yield key, f'("{name}") is of small strains: give mechanics.strain = "small"'
    elif case.coupling.follow_shape:
        yield key, f'("{name}") is of the slice as it was cast: give coupling.follow_shape = false'
    elif case.coupling.dissipation:
        yield key, f'("{name}") has no heat of flow: give coupling.dissipation = 0'
