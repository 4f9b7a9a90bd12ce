"""The spray water of a case as a plant tells it: of each zone and circuit, L/min and L/kg."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.model.check_cooling import law_groups
from castfem.model.cooling import Spray
from castfem.model.water import PER_LITRE_AND_KG, Supply, steel_per_length
from castfem.physics.thermal.sprays import WATER_DENSITY

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh
    from castfem.model import Case
    from castfem.physics.materials import Steel

LITRES_A_MINUTE = 6e4  # in a m3/s


def water_flows(case: Case, supply: Supply, mesh: SectionMesh) -> list[tuple[str, float]]:
    """Return name and flow, m3/s, of all zones and circuits with sprays, each at its largest.

    Args:
        case: A sound case.
        supply: Of water.
        mesh: Of its section.
    """
    found: list[tuple[str, float]] = []
    start = 0.0
    for zone in case.cooling:
        end = case.casting.length if zone.to is None else zone.to
        sprays = [law for law in zone.surface if isinstance(law, Spray)]
        if sprays and end > start:  # a run may end above a zone that has no end
            flows = [_flow(case, supply, mesh, law, end - start) for law in sprays]
            found.append((zone.name, sum(flows)))
        start = end
    circuits = () if case.secondary is None else case.secondary.circuit
    return [*found, *((c.name, supply.most(c)) for c in circuits)]


def _flow(case: Case, supply: Supply, mesh: SectionMesh, law: Spray, length: float) -> float:
    """Water of a spray in its whole zone, m3/s."""
    if law.water is None:
        return supply.most(law)
    perimeter = mesh.perimeter(law_groups(case.section, law))
    return law.water / WATER_DENSITY * perimeter * length


def water_lines(case: Case, steel: Steel, mesh: SectionMesh) -> list[str]:
    """Return the table of the water, flows and what they are per mass of steel, and the sum.

    They are the largest flows, over the steel that passes at the fastest casting speed.
    """
    casting = case.casting
    supply = Supply(steel_per_length(mesh, steel), casting.travel, case.water, casting.clock)
    found = water_flows(case, supply, mesh)
    cast = supply.mass * supply.travel.fastest
    rows = [*found, ("in all", sum(flow for _, flow in found))]
    widest = max(len(name) for name, _ in rows)
    lines = [f"spray water at most, of {3.6 * cast:.4g} t/h of steel:"]
    for name, flow in rows:
        per_mass = PER_LITRE_AND_KG * flow / cast
        flows = f"{LITRES_A_MINUTE * flow:8.4g} L/min  {per_mass:7.3g} L/kg"
        lines.append(f"  {name:{widest}}  {flows}")
    return lines
