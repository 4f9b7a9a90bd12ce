"""Initial state of a run: position at the meniscus or below the mould, temperature or profile."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.physics.coupling.subcycling import ThermalSteps

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.build.simulation import Simulation
    from castfem.physics.thermal.stepper import ThermalState


def given_profile(case: Case) -> Table | None:
    """Return the initial temperature over the depth below the surface, if given."""
    start = case.casting.start
    profile = None if start is None else start.profile
    return profile if isinstance(profile, Table) else None


def starting_enthalpy(simulation: Simulation) -> float | Array:
    """Reference H of the heat balance, one or of the owned vertices, J/m3 (collective).

    It is the steel as poured, or the given profile.
    """
    curve, profile = simulation.problem.curve, given_profile(simulation.case)
    if profile is None:
        return float(curve.enthalpy(simulation.start_temperature))
    return np.asarray(curve.enthalpy(profile(depth_below_surface(simulation.section))))


def starting_time(simulation: Simulation) -> float:
    """Start time of the run, s after the slice has left the meniscus."""
    case, start = simulation.case, simulation.case.casting.start
    below = start is not None and start.at == "mould_exit"
    exit_ = case.mould_exit() if below else None
    return 0.0 if exit_ is None else simulation.machine.time_at(exit_)


def starting_state(simulation: Simulation) -> ThermalState:
    """Initial temperatures of a run (collective)."""
    stepper, time = simulation.stepper, starting_time(simulation)
    if given_profile(simulation.case) is not None:
        enthalpy = np.asarray(starting_enthalpy(simulation))
        return stepper.state_from(time, enthalpy, np.zeros_like(enthalpy), 0.0)
    state, start = stepper.initial(simulation.start_temperature), simulation.case.casting.start
    if start is not None and start.meniscus is not None:
        met = through_mould(simulation, state, simulation.machine.time_at(start.meniscus))
        return replace(met, time=0.0)
    return through_mould(simulation, state, time) if time > 0.0 else state


def through_mould(simulation: Simulation, state: ThermalState, end: float) -> ThermalState:
    """Advance the temperatures alone from the meniscus to a time, s, with the zones' cooling.

    The slice keeps its shape: the mould strains nothing of the run ([Pascon2003] VI.3.1).
    """
    from castfem.model.build.simulation import step_control

    zones = simulation.zones
    stops = sorted({t for t in (*zones.changes, *simulation.machine.kinks) if 0.0 < t < end})
    steps = ThermalSteps(simulation.stepper, step_control(simulation.case, stops, end))
    entered, length = -1, steps.control.first
    for stop in (*stops, end):
        zone = zones.index(state.time)
        if zone != entered:
            simulation.problem.set_cooling(zones.cooling(zone))
            state = replace(state, cooling_changed=True)
            entered = zone
        taken = steps.to(state, length, stop)
        state, length = taken.state, taken.length
    return state


def depth_below_surface(section: Section) -> Array:
    """Distance of each owned vertex from the strand's surface (owned,), m (collective)."""
    source = section.source
    if section.comm.rank != 0 or source is None:
        return section.scatter(None)
    outer = [i for i, name in enumerate(source.groups) if name in section.outer_groups]
    facets = source.facets[np.isin(source.facet_group, outer)]
    points = np.asarray(source.points)[:, :2]
    nearest = np.full(len(points), np.inf)
    for a, b in np.asarray(source.points)[facets][:, :, :2]:
        along = b - a
        share = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
        away = np.linalg.norm(points - a - share[:, None] * along, axis=1)
        nearest = np.minimum(nearest, away)
    return section.scatter(nearest)
