"""Which quantities a case can have, told from the case alone, before anything is built or run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from castfem.base.messages import choices
from castfem.base.result_registry import AT_FRACTION, declared, find
from castfem.base.units import in_mm, nearest
from castfem.model.section import meshing
from castfem.runs.results.needs import NEEDS

if TYPE_CHECKING:
    from castfem.model.case import Case

_EVERYWHERE = "mid_face"  # a place that every section has


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
    missing = (table for need in definition.needs for table in NEEDS[need].missing(case))
    if tables := " and ".join(f"[{table}]" for table in dict.fromkeys(missing)):
        return f"is none of this case, for it has no {tables}; add it, or name another result"
    strained = definition.of_strained or "throughout" in definition.needs
    if strained and (end := case.mechanics_end()) is not None:
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
