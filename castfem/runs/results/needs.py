"""Conditions of the results on case and simulation, which determine what results a case has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from castfem.base.errors import choices
from castfem.base.result_registry import AT_FRACTION, declared, find
from castfem.base.units import in_mm, nearest

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.model.case import Case
    from castfem.model.quality import Quality
    from castfem.physics.mechanics.slice_definition import Slice


@dataclass(frozen=True, slots=True)
class Need:
    """A condition of a result."""

    tables: tuple[str, ...]  #: required tables of the case
    #: further condition on the simulation; None for none
    also: Callable[[Simulation], bool] | None = None

    def missing(self, case: Case) -> list[str]:
        """Missing tables of a case; [mould.oscillation] is missing, too, without [mould]."""
        return [table for table in self.tables if not _has_table(case, table)]

    def is_met(self, simulation: Simulation) -> bool:
        """Whether a simulation meets the condition."""
        return not self.missing(simulation.case) and (self.also is None or self.also(simulation))


def are_met(needs: Iterable[str], simulation: Simulation) -> bool:
    """Whether a simulation meets all conditions, given by name."""
    return all(NEEDS[name].is_met(simulation) for name in needs)


def _has_table(case: Case, table: str) -> bool:
    outer, _, inner = table.partition(".")
    found = getattr(case, outer)
    return found is not None and (not inner or getattr(found, inner) is not None)


def _slice(simulation: Simulation) -> Slice:
    assert simulation.strained is not None, "of a case with [mechanics]"
    return simulation.strained.slice


def _is_free(simulation: Simulation, strain: str) -> bool:
    """Whether a generalized strain is free (not that of a bent strand)."""
    return not simulation.case.bends and strain in _slice(simulation).planes.free


def _bulges(simulation: Simulation) -> bool:
    mechanics = simulation.case.mechanics
    return mechanics is not None and mechanics.bulging is not None and mechanics.bulging.bears


def _bears_edges(simulation: Simulation) -> bool:
    """Whether rolls support the narrow faces, in addition to the wide ones."""
    if not _bulges(simulation):
        return False
    from castfem.physics.contact.roll_support import RollSupport

    return sum(isinstance(one, RollSupport) for one in _slice(simulation).interactions) > 1


def _quality(simulation: Simulation) -> Quality:
    assert simulation.case.quality is not None, "of a case with [quality]"
    return simulation.case.quality


def _is_followed(criterion: str, simulation: Simulation) -> bool:
    """Whether a hot tearing criterion is evaluated."""
    return criterion in (_quality(simulation).hot_tearing or ())


_ROLLED = ("mechanics", "machine")
CRITERIA = ("won", "clyne_davies", "rdg")
NEEDS: Mapping[str, Need] = {
    "mechanics": Need(("mechanics",)),
    "throughout": Need(  # mechanics to the end of the strand
        ("mechanics",), lambda simulation: simulation.case.mechanics_end() is None
    ),
    "smooth": Need(("mechanics",), lambda simulation: bool(simulation.case.output.smooth)),
    "law_data": Need(("mechanics",), lambda simulation: _slice(simulation).law.data is not None),
    "tilt_x": Need(("mechanics",), lambda simulation: _is_free(simulation, "a1")),
    "tilt_y": Need(("mechanics",), lambda simulation: _is_free(simulation, "a2")),
    "mould": Need(("mechanics", "mould")),
    "given_heat": Need(("cooling",), lambda simulation: simulation.zones.has_given_heat),
    "oscillation": Need(("mould.oscillation",)),
    "friction": Need(
        ("mechanics",),
        lambda simulation: any(one.has_friction for one in _slice(simulation).interactions),
    ),
    "bulging": Need(_ROLLED, _bulges),
    "edge_rolls": Need(_ROLLED, _bears_edges),
    "machine": Need(("machine",)),
    "quality": Need(("quality",)),
    **{name: Need(("quality",), partial(_is_followed, name)) for name in CRITERIA},
    "ductility": Need(("quality",), lambda simulation: _quality(simulation).ductility is not None),
    "bending": Need(_ROLLED, lambda simulation: simulation.case.bends),
    "extraction": Need(
        _ROLLED, lambda simulation: getattr(_slice(simulation).planes, "effort", None) is not None
    ),
    "closed_form": Need(("verification",)),
}
STRAINED = NEEDS.keys() - {
    "law_data",
    "given_heat",
    "oscillation",
    "machine",
    "quality",
    "ductility",
    "closed_form",
    *CRITERIA,
}
"""Conditions of all results of the strained slice, except those `of_way`."""


def faults_of(case: Case, names: Sequence[str]) -> list[str]:
    """Return why no run of a case has some results, and what to do; "" for results it may have.

    The section is meshed only for a result at a place that not every section has.
    """
    places: list[str] = []

    def known() -> list[str]:
        if not places:
            from castfem.meshes import build
            from castfem.model.section import meshing

            with meshing():
                places.extend(build(**case.mesh_parameters()).probes)
        return places

    return [_fault(case, name, known) for name in names]


def fault_of(case: Case, name: str) -> str:
    """Return the same for a single result."""
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
    followed = [round(100.0 * part) for part in case.output.shell_at or ()]
    if fraction is not None and int(fraction[1]) not in followed:
        return f"is not followed; give output.shell_at = [{int(fraction[1]) / 100:g}]"
    if definition.each and probe != "mid_face" and probe not in places():
        near = nearest(probe, places())
        if not near:  # perhaps a result without a place is meant
            near = nearest(name, [one.name for one in declared() if not one.each])
        return f'has no place "{probe}" on this section; allowed: {choices(places())}{near}'
    return ""
