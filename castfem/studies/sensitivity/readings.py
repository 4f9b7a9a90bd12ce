"""Derivatives of a run's results, from samples on both sides of each parameter.

A result is sampled as in every run (`castfem.runs.results`), from the temperatures plus or minus
their derivative times the step of the difference quotient, with the steel, machine and cooling of
that side.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from castfem.base import units
from castfem.base.constants import EXACT
from castfem.base.errors import InputError
from castfem.base.result_registry import QuantityDefinition
from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.model.build.simulation import Simulation
from castfem.physics.coupling.staggered import StrandState
from castfem.runs.results.labels import STAIR
from castfem.runs.results.needs import CRITERIA, fault_of
from castfem.runs.results.registry import columns_of, results_of
from castfem.runs.results.sample import Sample
from castfem.runs.results.thermal import Sampler
from castfem.studies.sensitivity.followed_run import Derivatives
from castfem.studies.sensitivity.fronts import LEVELS, Fronts, Scatter
from castfem.studies.sensitivity.result import Derivative

_OF_STEPS = (
    "step", "newton", "newton_mechanics", "energy_error", "force_error", "solidus_cell",
    "colder_than_data", "hotter_than_data", "faster_than_data",
    "error_temperature", "error_temperature_max", "error_stress",
)  # fmt: skip
"""Results on steps, cells and points, which are kept fixed."""
_OF_POINTS = ("contact_share", "contact_sticking", "mould_contact_least")
"""Results that count points of the surface, whose contact status is kept fixed."""
_OF_TEMPERATURE = ("metallurgical_length", "liquid_end", "mould_mean_flux")
"""Results over the whole history that only depend on the temperatures."""
_USUAL = ("heat_removed", "shell", "surface_temperature")
"""Default results."""

Asked = dict[str, tuple[QuantityDefinition, str]]


def asked_quantities(simulation: Simulation, names: Sequence[str]) -> Asked:
    """Return the results of `--of`, each with its definition and probe."""
    having: Asked = {}
    refused: dict[str, str] = {}
    for definition, probe in (*columns_of(simulation), *results_of(simulation)):
        name, why = definition.named(probe), _refusal(definition)
        if why:
            refused[name] = why
        else:
            having[name] = definition, probe
    wanted = [part.strip() for name in names for part in name.split(",")]
    if not wanted:
        wanted = [name for name, (one, _) in having.items() if one.name in _USUAL]
    problems = []
    for name in wanted:
        if name not in having:
            fault = refused.get(name) or fault_of(simulation.case, name)
            near = units.nearest(name, having)
            problems.append(f"--of {name}: {fault or f'is not a result of this run{near}'}")
    if problems:
        raise InputError(problems)
    return {name: having[name] for name in dict.fromkeys(wanted)}


def _refusal(definition: QuantityDefinition) -> str:
    """Why a result is not differentiated; "" if it is."""
    if definition.name in _OF_STEPS:
        return "it describes steps or cells, which are held fixed"
    if definition.name in _OF_POINTS:
        return (
            "it counts points of the surface; what touches and what sticks is held; compare runs "
            "(castfem sweep)"
        )
    if "quality" in definition.needs and not _hangs_on_tearing(definition):
        return (
            "crack indexes and soft reduction are not differentiated, criteria of hot tearing on "
            "the way alone (way_won_front_max); compare runs (castfem sweep)"
        )
    return ""


def _hangs_on_tearing(definition: QuantityDefinition) -> bool:
    """Whether a result is that of a hot tearing criterion."""
    return definition.of_way and not {*CRITERIA}.isdisjoint(definition.needs)


class Readings:
    """Computes the derivatives of results; their errors need further readings."""

    def __init__(
        self,
        simulation: Simulation,
        derivatives: Derivatives,
        asked: Asked,
        *,
        errors: bool = True,
    ) -> None:
        self._simulation, self._derivatives, self.asked = simulation, derivatives, asked
        timed = [v.parameter.name for v in derivatives.variations if not v.above.same_times]
        for name in self.of_tearing() if timed else ():
            raise InputError(
                f"--of {name}: with {timed[0]} the ends of the steps change, on which the first "
                "skin hangs more than on it; compare runs (castfem sweep)"
            )
        way = [one.name for one, _ in asked.values() if one.of_way]
        self._follows_heat = bool(way)
        self._follows_all = any(name not in _OF_TEMPERATURE for name in way)
        depths = [(one.name, probe) for one, probe in asked.values() if one.name in LEVELS]
        self.fronts = Fronts(derivatives.thermal, depths)
        self.scatter = Scatter() if errors else None
        self._samplers = [
            (Sampler(v.above.simulation), Sampler(v.below.simulation))
            for v in derivatives.variations
        ]

    @property
    def reads_all(self) -> bool:
        """Whether samples of all steps are needed, not only of the last."""
        return self._follows_heat or bool(self.fronts.fronts) or self.scatter is not None

    def follow(self, sample: Sample) -> None:
        """Record a committed state, for results that depend on the history (collective)."""
        state = sample.state.thermal
        zone = self._zone(state.time)
        self.fronts.follow(zone, sample)
        probe = next(iter(sample.shell))
        depth, cell = sample.shell[probe], sample.cell[probe]
        if self.scatter is not None and self.scatter.due(zone, depth, cell):
            found = [0.5 * (below + above) for _, below, above in self._slopes(sample)]
            self.scatter.add(depth, cell, found)
        elif self._follows_all:
            for number in range(len(self._samplers)):
                self._sides(number, sample)
        elif self._follows_heat:
            alone = StrandState(state, None, np.zeros(0))
            for number, pair in enumerate(self._samplers):
                for sampler, its in zip(pair, self._ends(number, alone), strict=True):
                    sampler.follow(its.thermal)

    def _sides(self, number: int, sample: Sample) -> tuple[Sample, Sample]:
        """Samples above and below a parameter, recorded by their samplers (collective)."""
        ends = zip(self._samplers[number], self._ends(number, sample.state), strict=True)
        above, below = (sampler.read(its, None) for sampler, its in ends)
        return above, below

    def _zone(self, time: float) -> int:
        """The zone of a step that ends at a time (s); the first at the meniscus."""
        hair = EXACT * self._simulation.control.end
        starts = self._simulation.zones.starts
        return max(bisect_left(starts, time - hair) - 1, 0)

    def _ends(self, number: int, state: StrandState) -> list[StrandState]:
        """The state above and below a parameter, each at its own time (collective)."""
        slopes, coupled = self._derivatives.thermal, self._derivatives.coupled
        variation, here, found = slopes.variations[number], state.thermal, []
        step = variation.parameter.step
        for end, by in ((variation.above, step), (variation.below, -step)):
            end.enter(self._zone(here.time))
            thermal = end.simulation.stepper.state_from(
                end.time(here.time),
                here.enthalpy + by * slopes.enthalpy[number],
                here.rate + by * slopes.rate[number],
                here.removed + by * float(slopes.removed[number]),
                here.generated,
            )
            strained = state.mechanical if coupled is not None else None
            if coupled is not None and strained is not None:
                strained = coupled.mechanical.moved(number, strained, by)
                strained = replace(strained, time=end.time(strained.time))
            found.append(StrandState(thermal, strained, np.zeros(0)))
        return found

    def read(self, sample: Sample) -> tuple[dict[str, Quantity], list[Derivative]]:
        """The results of a sample and their derivatives (collective)."""
        values = {
            name: definition.result(_number(definition.value(sample, probe)), probe)
            for name, (definition, probe) in self.asked.items()
        }
        slopes = list(self._slopes(sample))
        errors = self._errors(len(slopes))
        found: list[Derivative] = []
        for (name, below, above), scattered in zip(slopes, errors, strict=True):
            definition, probe = self.asked[name]
            number = len(found) // len(self.asked)
            parameter = self._derivatives.variations[number].parameter
            evened = self._evened(definition.name, probe, number)
            error = float("nan") if definition.of_way else float(scattered)
            if evened is not None:
                stairs = STAIR * sample.cell[probe] / parameter.spread
                error = float(np.fmin(error, np.hypot(2.0 * evened[1], stairs)))
            found.append(Derivative(name, parameter.name, below, above, evened, error))
        return values, found

    def _slopes(self, sample: Sample) -> Iterator[tuple[str, float, float]]:
        """Each result, and its one-sided derivatives by each parameter (collective)."""
        here = {name: _number(d.value(sample, probe)) for name, (d, probe) in self.asked.items()}
        for number, variation in enumerate(self._derivatives.variations):
            above, below = self._sides(number, sample)
            step = variation.parameter.step
            for name, (definition, probe) in self.asked.items():
                ends = [_number(definition.value(s, probe)) for s in (below, above)]
                yield name, (here[name] - ends[0]) / step, (ends[1] - here[name]) / step

    def _errors(self, count: int) -> Array:
        if self.scatter is None:
            return np.full(count, np.nan)
        return self.scatter.errors(count)

    def _evened(self, name: str, probe: str, number: int) -> tuple[float, float] | None:
        """Smoothed derivative of a depth, and its standard error; None for all others."""
        front = self.fronts.fronts.get((name, probe))
        if front is None:
            return None
        found = front.evened()
        if found is None:
            return float("nan"), float("nan")
        return float(found[0][number]), float(found[1][number])

    def of_tearing(self) -> list[str]:
        """Requested results of hot tearing, whose derivatives are not in checkpoints."""
        return [name for name, (one, _) in self.asked.items() if _hangs_on_tearing(one)]

    def memory(self) -> dict[str, Any]:
        """Data of the steps so far, for a checkpoint."""
        noted = [[sampler.memory() for sampler in pair] for pair in self._samplers]
        found = {"results": list(self.asked), "noted": noted, "fronts": self.fronts.memory()}
        if self.scatter is not None:
            found["scatter"] = [self.scatter.zone, self.scatter.rows]
        return found

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Restore `memory`."""
        self.fronts.recall(memory["fronts"])
        if self.scatter is not None and "scatter" in memory:
            zone, rows = memory["scatter"]
            self.scatter = Scatter(int(zone), [list(row) for row in rows])
        for pair, its in zip(self._samplers, memory["noted"], strict=True):
            for sampler, known in zip(pair, its, strict=True):
                sampler.recall(dict(known))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
