"""Which quantities a case can have, told from the case alone, before anything is built or run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from castfem.base.messages import choices
from castfem.base.units import in_mm, nearest
from castfem.model.section_mesh import meshing
from castfem.runs.results.registry import AT_FRACTION, declared, find

if TYPE_CHECKING:
    from castfem.model.case import Case

_EVERYWHERE = "mid_face"  # a place that every section has
_STRAINED = ("[mechanics]", lambda case: case.mechanics is not None)
_THROUGHOUT = (
    "mechanics without mechanics.until",
    lambda case: case.mechanics is None or case.mechanics.until is None,
)
_IN_MOULD = ("[mould]", lambda case: case.mould is not None)
_OSCILLATES = (
    "[mould.oscillation]",
    lambda case: case.mould is not None and case.mould.oscillation is not None,
)
_ON_ROLLS = ("[machine]", lambda case: case.machine is not None)
_TABLES: Mapping[str, tuple[tuple[str, Callable[[Case], bool]], ...]] = {
    "mechanics": (_STRAINED,),
    "throughout": (_STRAINED, _THROUGHOUT),
    "smooth": (_STRAINED,),
    "law_data": (_STRAINED,),
    "tilt_x": (_STRAINED,),
    "tilt_y": (_STRAINED,),
    "mould": (_STRAINED, _IN_MOULD),
    "oscillation": (_OSCILLATES,),
    "friction": (_STRAINED,),
    "bulging": (_STRAINED, _ON_ROLLS),
    "machine": (_ON_ROLLS,),
    "quality": (("[quality]", lambda case: case.quality is not None),),
    "bending": (_STRAINED, _ON_ROLLS),
    "extraction": (_STRAINED, _ON_ROLLS),
}  # fmt: skip
"""Tables of the case without which nothing of `castfem.runs.results.registry.NEEDS` can be met."""


def faults_of(case: Case, names: Sequence[str]) -> list[str]:
    """Return why no run of a case has results, and what to do; "" for what one may have.

    The section is meshed only where a result is taken at a place that not every section has.

    Args:
        case: The case.
        names: Of results, as in summary.json or history.csv.
    """
    places: list[str] = []

    def known() -> list[str]:
        if not places:
            from castfem.meshes import build

            with meshing():
                places.extend(build(**case.mesh_parameters()).probes)
        return places

    return [_fault(case, name, known) for name in names]


def fault_of(case: Case, name: str) -> str:
    """Return the same of a single result."""
    return faults_of(case, [name])[0]


def _fault(case: Case, name: str, places: Callable[[], list[str]]) -> str:
    found = find(name)
    if found is None:
        return ""
    definition, probe = found
    needed = [table for need in definition.needs for table in _TABLES[need]]
    missing = dict.fromkeys(table for table, has in needed if not has(case))
    if missing:
        tables = " and ".join(missing)
        return f"is none of this case, for it has no {tables}; add it, or name another result"
    if definition.of_strained and (end := case.mechanics_end()) is not None:
        return (
            f"has no value at the end of the run: mechanics.until ends the mechanics at "
            f"{in_mm(end)}; leave that out, or name a result of the way (way_von_mises_max, "
            "mould_gap_max)"
        )
    fraction = AT_FRACTION.fullmatch(name)
    if fraction is not None and int(fraction[1]) not in _percents(case):
        return f"is not followed; give output.shell_at = [{int(fraction[1]) / 100:g}]"
    if definition.each and probe != _EVERYWHERE and probe not in places():
        near = nearest(probe, places())
        if not near:  # meant is perhaps another result, of no place
            near = nearest(name, [one.name for one in declared() if not one.each])
        return f'has no place "{probe}" on this section; allowed: {choices(places())}{near}'
    return ""


def _percents(case: Case) -> list[int]:
    """Solid fractions to which the shell is followed, in percent."""
    return [round(100.0 * fraction) for fraction in case.output.shell_at or ()]
