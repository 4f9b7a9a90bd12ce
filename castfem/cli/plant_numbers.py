"""Mould heat and spray water of a case in plant units."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.base.tables import Table
from castfem.model.checks.cooling import law_groups
from castfem.model.checks.shared_heat import EVEN_FLUX, fix, fixed_heat, is_even
from castfem.model.cooling import Contact, Spray, Zone
from castfem.model.heat_law import Extent, ScaledLaw, Surroundings
from castfem.model.machine_from_case import build_machine
from castfem.model.water import PER_LITRE_AND_KG, Supply, steel_per_length
from castfem.physics.thermal.mould_flux import MOULD_FLUXES, heat_to_mould
from castfem.physics.thermal.spray_correlations import WATER_DENSITY

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh
    from castfem.model import Case
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel

LITRES_A_MINUTE = 6e4  # converts m3/s to L/min
_FAR = 3.0  # ratio to a published flux above or below which a wrong unit is suspected


def heat_lines(case: Case, steel: Steel, mesh: SectionMesh) -> list[str]:
    """Return the total heat of the fluxes of a valid case without a gap, a line for each law."""
    machine, start, lines = build_machine(case), 0.0, list[str]()
    fixed = {one.where for one in fixed_heat(case)}
    for zone in case.cooling:
        end = case.casting.length if zone.to is None else zone.to
        if start >= case.casting.length:
            break
        for law in zone.surface:
            given = law.curve if isinstance(law, ScaledLaw) else None
            if not isinstance(law, ScaledLaw) or given is None or end <= start:
                continue
            if isinstance(given, Table) and given.over == "temperature":
                continue
            extent = Extent(start, end, mesh.perimeter(law_groups(case.section, law)))
            around = Surroundings(steel, machine, extent=extent, clock=case.casting.clock)
            lines += _lines(zone, law, given, around)
            if zone.name + _on(law) in fixed:
                lines.append(
                    "  the same at every casting speed; before speeds are compared give "
                    "measured_at, the speed at which it was measured, or a table over speed"
                )
            if is_even(case, law):
                lines.append(f"  {EVEN_FLUX}; {fix(case)}")
        start = end
    return lines


def _on(law: ScaledLaw) -> str:
    """The groups of a law as text after a blank; "" for the whole surface."""
    return "" if law.on is None else f" on {', '.join(law.on)}"


def _lines(
    zone: Zone, law: ScaledLaw, given: str | float | Table, around: Surroundings
) -> list[str]:
    """Heat of a law over its whole zone, in total and per area, beside published fluxes."""
    extent, machine = around.extent, around.machine
    assert extent is not None
    between = machine.time_at(extent.start), machine.time_at(extent.end)
    value = law.scaled(given, around)
    kinks = (*law.kinks(given, around), *machine.kinks)
    mean = heat_to_mould(value, machine.speed, between, kinks) / (extent.end - extent.start)
    heat = mean * extent.perimeter * (extent.end - extent.start)
    least = " without a gap" if isinstance(law, Contact) else ""
    line = f"{zone.name}{_on(law)}: {1e-3 * heat:.4g} kW in all{least}"
    line += f", {1e-6 * mean:.3g} MW/m^2 on average"
    usual = _published(machine, between) if extent.start == 0.0 else {}
    if not usual:
        return [line]
    lines = [line, "  published averages for this time in the mould, MW/m^2: "
             + ", ".join(f"{name} {1e-6 * flux:.3g}" for name, flux in usual.items())]  # fmt: skip
    if mean > _FAR * max(usual.values()) or mean * _FAR < min(usual.values()):
        lines.append("  that is far from the published ones: check numbers and units")
    return lines


def _published(machine: Machine, between: tuple[float, float]) -> dict[str, float]:
    """Published fluxes averaged along the strand, W/m2, by name, as far as they are valid."""
    start, end = between
    length = machine.position(end) - machine.position(start)
    return {
        name: heat_to_mould(flux.formula, machine.speed, between, flux.kinks) / length
        for name, flux in MOULD_FLUXES.items()
        if end <= flux.until
    }


def water_flows(case: Case, supply: Supply, mesh: SectionMesh) -> list[tuple[str, float]]:
    """Return name and largest flow, m3/s, of all zones and circuits with sprays."""
    found: list[tuple[str, float]] = []
    start = 0.0
    for zone in case.cooling:
        end = case.casting.length if zone.to is None else zone.to
        sprays = [law for law in zone.surface if isinstance(law, Spray)]
        if sprays and end > start:  # a run may end above a zone without end
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
    """Return the table of the water: flows, water per mass of steel, and their sums.

    Both are for the largest flows at the highest casting speed.
    """
    casting = case.casting
    supply = Supply(steel_per_length(mesh, steel), casting.travel, case.water, casting.clock)
    found = water_flows(case, supply, mesh)
    cast = supply.mass * supply.travel.fastest
    rows = [*found, ("in all", sum(flow for _, flow in found))]
    widest = max(len(name) for name, _ in rows)
    lines = [f"largest flow of spray water, for {3.6 * cast:.4g} t/h of steel:"]
    for name, flow in rows:
        per_mass = PER_LITRE_AND_KG * flow / cast
        flows = f"{LITRES_A_MINUTE * flow:8.4g} L/min  {per_mass:7.3g} L/kg"
        lines.append(f"  {name:{widest}}  {flows}")
    return lines
