"""The columns of history.csv and their values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.results.thermal import CELSIUS, Sample

if TYPE_CHECKING:
    from castfem.results.mechanical import MechanicalSample
    from castfem.results.run_state import RunState
    from castfem.simulation.simulation import Simulation


def columns(simulation: Simulation) -> list[tuple[str, str]]:
    """Names and units of the history's columns: those of what the simulation has."""
    found = [("time", "s"), ("position", "m"), ("step", "s"), ("newton", "-")]
    for name in simulation.probes.lines:
        found += [
            (f"surface_temperature_{name}", "degC"),
            (f"shell_{name}", "mm"),
            (f"solidus_cell_{name}", "mm"),
            (f"liquidus_depth_{name}", "mm"),
            (f"heat_flux_{name}", "kW/m^2"),
        ]
    return [
        *found,
        ("heat_removed", "J/m"),
        ("cooling_power", "kW"),
        ("temperature_core", "degC"),
        ("temperature_min", "degC"),
        ("temperature_max", "degC"),
        ("energy_error", "-"),
        *(_mechanical_columns(simulation) if simulation.mechanics is not None else ()),
    ]


def _mechanical_columns(simulation: Simulation) -> list[tuple[str, str]]:
    found = [("newton_mechanics", "-"), ("von_mises_max", "MPa")]
    for name in simulation.probes.lines:
        found += [(f"von_mises_{name}", "MPa"), (f"displacement_{name}", "mm")]
    found += [(f"size_{name}", "mm") for name in simulation.centred_probes]
    found += [("axial_strain", "-"), ("axial_force", "kN"), ("force_error", "-")]
    if simulation.case.mould is not None:
        for name in simulation.probes.lines:
            found += [(f"gap_{name}", "mm"), (f"contact_pressure_{name}", "MPa")]
        found += [("gap_max", "mm"), ("mean_contact_pressure_max", "MPa")]
        found += [("contact_pressure_max", "MPa"), ("penetration", "um")]
        found += [("contact_share", "percent"), ("friction_force", "kN/m"), ("friction_pull", "kN")]
        if _rubs(simulation):
            found += [("contact_sticking", "percent"), ("mould_friction", "kN/m")]
            found.append(("mould_pull", "kN"))
    return found


def _rubs(simulation: Simulation) -> bool:
    """Whether the mould has friction: without it nothing sticks."""
    contact = None if simulation.mechanics is None else simulation.mechanics.problem.slice.contact
    return contact is not None and contact.friction is not None


def row(run: RunState, sample: Sample) -> dict[str, float]:
    """One row of the history in its units."""
    simulation = run.simulation
    speed, whole = simulation.machine.mean_speed(sample.time), simulation.section.multiplicity
    cells = {
        "time": sample.time,
        "position": sample.position,
        "step": sample.step,
        "newton": float(sample.newton),
    }
    for name, profile in sample.profiles.items():
        cells[f"surface_temperature_{name}"] = float(profile.temperature[0]) - CELSIUS
        cells[f"shell_{name}"] = 1e3 * sample.shell[name]
        cells[f"solidus_cell_{name}"] = 1e3 * sample.cell[name]
        cells[f"liquidus_depth_{name}"] = 1e3 * sample.liquidus[name]
        cells[f"heat_flux_{name}"] = 1e-3 * sample.flux[name]
    core = next((float(p.temperature[-1]) for p in sample.profiles.values()), np.nan)
    low, high = sample.temperature_range
    return {
        **cells,
        "heat_removed": sample.removed,
        "cooling_power": 1e-3 * sample.removed * speed,
        "temperature_core": core - CELSIUS,
        "temperature_min": low - CELSIUS,
        "temperature_max": high - CELSIUS,
        "energy_error": sample.balance,
        **({} if sample.mechanics is None else _mechanical_cells(sample.mechanics, whole)),
    }


def _mechanical_cells(sample: MechanicalSample, whole: int) -> dict[str, float]:
    """Those of the strained slice; `whole` parts like the modelled one make the section."""
    balance = sample.balance
    cells = {
        "newton_mechanics": float(sample.newton),
        "von_mises_max": 1e-6 * sample.peak,
        "axial_strain": sample.strain,
        "axial_force": 0.0 if balance is None else 1e-3 * float(balance.axial[0]),
        "force_error": 0.0 if balance is None else max(balance.forces_error, balance.axial_error),
    }
    for name, stress in sample.surface_stress.items():
        cells[f"von_mises_{name}"] = 1e-6 * stress
        cells[f"displacement_{name}"] = 1e3 * sample.moved[name]
    cells |= {f"size_{name}": 1e3 * size for name, size in sample.across.items()}
    for name, gap in sample.gap.items():
        cells[f"gap_{name}"] = 1e3 * gap
        cells[f"contact_pressure_{name}"] = 1e-6 * sample.pressure[name]
    if (contact := sample.contact) is not None:
        cells |= {
            "gap_max": 1e3 * contact.gap,
            "mean_contact_pressure_max": 1e-6 * contact.mean_pressure,
            "contact_pressure_max": 1e-6 * contact.pressure,
            "penetration": 1e6 * contact.penetration,
            # At the meniscus nothing has been pressed against anything yet.
            "contact_share": 1e2 * contact.share if balance is not None else np.nan,
            "friction_force": 1e-3 * contact.axial,
            "friction_pull": 1e-3 * sample.pull,
        }
        if contact.sticking is not None:
            sticking = 1e2 * contact.sticking
            cells["contact_sticking"] = sticking if balance is not None else np.nan
            cells["mould_friction"] = -1e-3 * contact.axial * whole
            cells["mould_pull"] = 1e-3 * sample.pull * whole
    return cells
