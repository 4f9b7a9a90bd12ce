"""Samples the points of [[output.probe]]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.base.units import factor_and_zero
from castfem.fem.probes import PointProbes
from castfem.model.probe import outside
from castfem.physics.constitutive.base import equivalent_stress
from castfem.runs.output.folder import PROBES_NAME
from castfem.runs.results.mechanical import MechanicalSampler, in_components

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.physics.coupling.staggered import StrandState
    from castfem.physics.mechanics.state import MechanicalState
    from castfem.runs.results.sample import Sample

_TENSOR = ("xx", "yy", "zz", "xy")
PLACE = (("time", "s"), ("position", "m"))
HEAT = (("temperature", "degC"), ("solid_fraction", "-"))
PHASES = (("delta_ferrite", "-"), ("austenite", "-"))
MECHANICS = (
    *((f"displacement_{i}", "mm") for i in "xy"),
    *((f"stress_{i}", "MPa") for i in _TENSOR),
    ("von_mises", "MPa"),
    *((f"strain_{i}", "-") for i in _TENSOR),
    *((f"strain_rate_{i}", "1/s") for i in _TENSOR),
    ("viscoplastic_strain", "-"),
)
_SCALES = {"degC": factor_and_zero("K", "degC"), "mm": (1e3, 0.0), "MPa": (1e-6, 0.0)}


def probe_file(name: str) -> str:
    """Return the file of a probe within the folder of a run."""
    return f"{PROBES_NAME}/{name}.csv"


class ProbeSampler:
    """Reads the probes of a case after each step.

    Temperature and displacement are interpolated between vertices, as are averages of stress,
    strains and rates over the quadrature points around each vertex, which are those of the fields.

    Raises:
        InputError: A probe is outside the section, or below a place that the section does not have.
    """

    def __init__(self, simulation: Simulation, mechanics: MechanicalSampler | None) -> None:
        self._simulation, self._mechanics = simulation, mechanics
        given = simulation.case.output.probe
        self.names = tuple(probe.name for probe in given)
        self.places = np.array([probe.place(simulation.probes.lines) for probe in given]).reshape(
            -1, 2
        )
        for name, place in zip(self.names, self.places, strict=True):
            _within(simulation, name, place)
        self._points = PointProbes(simulation.section, self.places)
        phases = () if simulation.steel.diagram is None else PHASES
        self.columns = [*PLACE, *HEAT, *phases, *(() if mechanics is None else MECHANICS)]

    def rows(self, strand: StrandState, sample: Sample) -> dict[str, dict[str, float]]:
        """Return a row for the file of each probe, in its units, by file (collective)."""
        kelvin = strand.thermal.point.temperature
        temperature = self._points.at(kelvin[:, None])[:, 0]
        columns = [temperature, *self._phases(temperature)]
        if self._mechanics is not None:
            if strand.strained is None:  # after the end of the mechanics
                columns += [np.full(len(self.names), np.nan)] * len(MECHANICS)
            else:
                columns += list(self._points.at(_strained(self._mechanics, strand.strained)).T)
        found = {}
        for i, name in enumerate(self.names):
            values = [sample.time, sample.position, *(float(column[i]) for column in columns)]
            found[probe_file(name)] = {
                column: _shown(value, unit)
                for (column, unit), value in zip(self.columns, values, strict=True)
            }
        return found

    def _phases(self, temperature: Array) -> list[Array]:
        """Mass fractions: solid and, for a steel of known carbon content, its phases."""
        steel = self._simulation.steel
        solid = np.asarray(steel.solid_fraction(temperature))
        if steel.diagram is None:
            return [solid]
        phases = steel.diagram.phases(temperature)
        # The solid fraction follows the steel's own law; the diagram gives the fraction of delta in
        # it.
        both = phases.delta + phases.gamma
        delta = np.divide(phases.delta, both, out=np.zeros_like(both), where=both > 0.0)
        return [solid, solid * delta, solid * (1.0 - delta)]


def _strained(sampler: MechanicalSampler, state: MechanicalState) -> Array:
    """Mechanical values at the owned vertices, in the order of `MECHANICS` (owned, k)."""
    points = sampler.strained.points
    recovered = points.recovered(state.stress)
    flowed = sampler.strained.slice.law.strain(state.internal[: points.deviator_points])
    parts = [
        in_components(recovered),
        equivalent_stress(recovered)[:, None],
        in_components(sampler.strain(state)),
        in_components(sampler.strain_rate(state)),
        flowed[:, None],
    ]
    moved = points.moved(state.displacement, state.generalized_strains)
    return np.column_stack([moved, points.at_vertices(np.column_stack(parts))])


def _within(simulation: Simulation, name: str, place: Array) -> None:
    """Refuse a point outside the section, by its name (collective)."""
    try:
        PointProbes(simulation.section, place[None, :])
    except ValueError:
        raise outside(simulation.case.section, name, place) from None


def _shown(value: float, unit: str) -> float:
    """Convert a value from SI to the unit of its column."""
    factor, zero = _SCALES.get(unit, (1.0, 0.0))
    return factor * value - zero
