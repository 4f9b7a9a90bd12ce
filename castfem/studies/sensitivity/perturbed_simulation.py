"""A simulation with one number changed slightly: same mesh and matrices, other laws."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from castfem.base.constants import EXACT, same_instant
from castfem.base.errors import InputError
from castfem.base.shown_units import below_meniscus
from castfem.base.types import Array, Indices
from castfem.model import Case
from castfem.model.build.cooling import Zones
from castfem.model.build.simulation import (
    Simulation,
    case_steel,
    starting_temperature,
    stations,
)
from castfem.model.machine_from_case import build_machine
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Cooling
from castfem.physics.thermal.stage import Stage
from castfem.physics.thermal.stepper import ThermalStepper
from castfem.studies.sensitivity.parameters import Parameter

_COOLING = ("cooling", "secondary", "machine", "mould")
"""Tables of a case that define the cooling."""


@dataclass(slots=True)
class Varied:
    """A simulation at one end of a difference quotient."""

    #: with its own laws, steel and times; mesh and matrices are those of the run
    simulation: Simulation
    #: corresponding times of the run and its own (2, n), s; steps are divided proportionally in
    #: between
    instants: Array
    same_curve: bool  #: whether T(H) and theta(H) are those of the run
    same_cooling: bool  #: whether the laws of its cooling are those of the run, and their times
    same_times: bool = False  #: whether its times are those of the run
    #: whether its present cooling laws are those of the run, and their times; see `compare`
    same_laws: bool = False

    def time(self, time: float) -> float:
        """Its own time for a time of the run, s."""
        return self.step(time)[0]

    def step(self, time: float) -> tuple[float, float]:
        """Its own time for a time of the run, s, and the ratio of the step lengths."""
        if self.same_times:
            return time, 1.0
        run, own = self.instants
        hair = EXACT * run[-1]  # steps end at these times up to rounding
        i = int(np.searchsorted(run, time + hair, side="right")) - 1
        i = min(max(i, 0), len(run) - 2)
        pace = (own[i + 1] - own[i]) / (run[i + 1] - run[i])
        return float(own[i] + pace * (time - run[i])), float(pace)

    def enter(self, zone: int) -> None:
        """Cool as zone `zone` does from now on."""
        self.simulation.problem.set_cooling(self.simulation.zones.cooling(zone))

    def compare(self, cooling: Cooling) -> None:
        """Compare its laws with those of the run, which has this cooling from now on."""
        self.same_laws = self.same_times and same_laws(self.simulation.problem.cooling, cooling)

    def add_surface(self, stage: Stage, time: float, weight: float, heat: Array) -> None:
        """Add the heat that leaves each vertex through the surface at its own time (s).

        Args:
            stage: Stage of the run: enthalpies of the vertices, and related values.
            time: Its own time, s.
            weight: Factor.
            heat: Array to which it is added (owned,), W/m.
        """
        for patch, law in self.simulation.problem.cooling.laws:
            if self.same_curve:
                temperature = stage.point.temperature[patch.dofs]
            else:
                temperature = self.simulation.problem.curve.at(
                    stage.enthalpy[patch.dofs]
                ).temperature
            flux = law.flux(temperature, time)[0]
            heat[patch.dofs] += weight * patch.weights * flux


class CurveDifference:
    """Difference of T(H) and theta(H) between two steels.

    For two steels with piecewise linear curves the difference is piecewise linear, too, and is set
    up once: it takes one look-up, and avoids cancellation of two large numbers.

    Args:
        above: First curve. below: Curve that is subtracted.
    """

    def __init__(self, above: ThermalCurve, below: ThermalCurve) -> None:
        self._curves = above, below
        lines = above.lines(), below.lines()
        self._starts: Array = np.zeros(0)
        if lines[0] is None or lines[1] is None:
            return
        both = lines[0], lines[1]
        self._starts = np.union1d(both[0][0], both[1][0])
        met = [_piece(starts, self._starts) for starts, _, _ in both]
        self._at_zero = both[0][1][:, met[0]] - both[1][1][:, met[1]]
        self._slopes = both[0][2][:, met[0]] - both[1][2][:, met[1]]

    def temperature(self, enthalpy: Array) -> Array:
        """Difference of T, K, at `enthalpy` (n,), J/m3."""
        if len(self._starts):
            return self._line(0, enthalpy)
        above, below = (curve.at(enthalpy).temperature for curve in self._curves)
        return np.asarray(above - below)

    def conduction(self, enthalpy: Array) -> Array:
        """Difference of theta, W/m, at `enthalpy` (n,), J/m3."""
        if len(self._starts):
            return self._line(1, enthalpy)
        above, below = (curve.at(enthalpy).conduction for curve in self._curves)
        return np.asarray(above - below)

    def _line(self, row: int, enthalpy: Array) -> Array:
        i = _piece(self._starts, enthalpy)
        return np.asarray(self._at_zero[row].take(i) + self._slopes[row].take(i) * enthalpy)


def _piece(starts: Array, enthalpy: Array) -> Indices:
    return np.asarray(starts.searchsorted(enthalpy, side="right") - 1)


@dataclass(frozen=True, slots=True)
class Variation:
    """A parameter with the simulations on both sides of it."""

    parameter: Parameter  #: with the step used
    below: Varied  #: simulation at `value - step`
    above: Varied  #: simulation at `value + step`
    #: difference of their T(H) and theta(H); None if they are those of the run
    curves: CurveDifference | None

    def lateness(self, time: float) -> float:
        """Derivative of the time that corresponds to a time of the run (s), s per unit."""
        return (self.above.time(time) - self.below.time(time)) / self.span

    @property
    def span(self) -> float:
        """Distance of the two sides, in the unit of the parameter."""
        return 2.0 * self.parameter.step


def vary(simulation: Simulation, parameter: Parameter) -> Variation:
    """Build the simulations on both sides of a parameter (collective)."""
    for finer in (1.0, 0.1, 0.01):  # where tables are divided differently
        step = finer * parameter.step
        tried = replace(parameter, step=step)
        below, above = (_varied(simulation, tried, sign * step) for sign in (-1.0, 1.0))
        curves = [end.simulation.problem.curve for end in (above, below)]
        if curves[0].divided == curves[1].divided:
            _check_effect(tried, below, above)
            alike = below.same_curve and above.same_curve
            return Variation(tried, below, above, None if alike else CurveDifference(*curves))
    raise InputError(
        f"{parameter.name}: a small change of it changes how the tables of the steel are "
        "subdivided, so that no derivative can be taken; use a slightly different value"
    )


def _varied(simulation: Simulation, parameter: Parameter, by: float) -> Varied:
    case = parameter.case_at(simulation.case, parameter.value + by)
    steel = simulation.steel
    if case.steel != simulation.case.steel:
        steel = case_steel(case)
    steel = parameter.steel_at(steel, parameter.value + by)
    machine = build_machine(case)
    start = starting_temperature(case, steel)
    zones = Zones(case, machine, steel, simulation.zones.surface)
    zones.sides = simulation.zones.sides
    held = simulation.problem.curve
    same = steel is simulation.steel or parameter.of_mechanics
    # Its ends and its zero are those of the run: values outside its temperatures do not matter, and
    # the zero of enthalpy is a convention.
    datum, ends = simulation.start_temperature, (held.knots[0], held.knots[-1])
    # A moving slice keeps its mass: its enthalpy depends on the pouring temperature.
    poured = None if simulation.problem.shape is None else start
    if poured is not None and start != datum and np.ptp(steel.density(held.knots)) > 0.0:
        same = False
    curve = held if same else steel.thermal_curve(*ends, datum, poured)
    problem = simulation.problem.of_curve(curve)
    stepper = ThermalStepper(problem, simulation.stepper.scheme)
    other = replace(
        simulation, case=case, machine=machine, steel=steel, zones=zones, stepper=stepper,
        start_temperature=start, probes=simulation.probes.of_curve(curve),
    )  # fmt: skip
    instants = _instants(simulation, other, parameter)
    timed_alike = bool(np.array_equal(*instants))
    cooled_alike = same and timed_alike and _same_tables(case, simulation.case)
    return Varied(other, instants, same, cooled_alike, timed_alike)


def _same_tables(one: Case, other: Case) -> bool:
    """Whether two cases have the same cooling."""
    return all(getattr(one, name) == getattr(other, name) for name in _COOLING)


def _places(simulation: Simulation) -> list[float]:
    """Times that depend on the case: start, changes of cooling and speed, stations, end, s."""
    machine, case = simulation.machine, simulation.case
    found = [*simulation.zones.starts, *simulation.zones.changes, *machine.kinks]
    found += [machine.time_at(position) for position in stations(case)]
    return [0.0, case.casting.duration, *found]


def _instants(simulation: Simulation, other: Simulation, parameter: Parameter) -> Array:
    """Times of the run, and the corresponding ones of another (2, n), s."""
    run, own = _places(simulation), _places(other)
    end = run[1]
    if len(run) != len(own) or len(simulation.zones.starts) != len(other.zones.starts):
        raise InputError(
            f"{parameter.name}: a change of the cooling lies exactly at the end of the run, where "
            "a small change of it adds or removes that; move it, or the end of the run, slightly"
        )
    kept: list[tuple[float, float]] = []
    for one, its in sorted(zip(run, own, strict=True)):
        if not 0.0 <= one <= end * (1.0 + 1e-12):
            continue
        if kept and same_instant(kept[-1][0], one, end):
            if not same_instant(kept[-1][1], its, end):
                raise InputError(
                    f"{parameter.name}: it moves one of two changes that meet "
                    f"{below_meniscus(simulation.machine.position(one))}: the run has no "
                    "derivative there; move one of them, or the end of the run"
                )
            continue
        kept.append((one, its))
    return np.array(kept).T


def _check_effect(parameter: Parameter, below: Varied, above: Varied) -> None:
    """Refuse a parameter without effect on the run."""
    if parameter.of_mechanics:
        return
    one, other = below.simulation.case, above.simulation.case
    same = one.casting == other.casting and _same_tables(one, other)
    same = same and below.simulation.steel is above.simulation.steel
    if same:
        raise InputError(
            f"{parameter.name}: nothing that this run computes depends on it (its steps and "
            "coupling windows are held as they are)"
        )


def same_laws(one: Cooling, other: Cooling) -> bool:
    """Whether two coolings certainly remove the same heat at the same temperature and time.

    Laws are compared by their numbers; one that cannot be compared counts as different. Gaps that
    the mechanics set later are not compared.
    """
    if len(one.laws) != len(other.laws):
        return False
    return all(
        _alike(its, law)
        and np.array_equal(here.dofs, there.dofs)
        and np.array_equal(here.weights, there.weights)
        for (here, its), (there, law) in zip(one.laws, other.laws, strict=True)
    )


def _alike(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, int | float | str):
        return bool(one == other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if not is_dataclass(one):
        return one is other
    return all(_alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
