"""Derivatives of depths of a front, smoothed over its cells, and their errors.

On a mesh a front advances in steps: a vertex cools fast once all its neighbours are solid, then the
next. A depth is a staircase, accurate to a sixth of a cell, but its slope is that of a tread or of
a riser, with respect to a parameter as well as in time. Averaged over whole cells the slope is that
of the front. So the derivative of a depth is recorded from step to step, and a straight line over
the depth is fitted to those of the last cells; its value at the end is reported
(docs/sensitivity.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from castfem.base.types import Array
from castfem.fem.probes import LineProbes, Profile
from castfem.physics.materials import Steel
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.perturbed_simulation import Variation
from castfem.studies.sensitivity.thermal import ThermalDerivatives

LEVELS = {"shell": "solidus", "liquidus_depth": "liquidus"}
"""Results that are depths of an isotherm, with that isotherm."""


@dataclass(frozen=True, slots=True)
class FrontLimits:
    """Settings of the smoothing of fronts and the scatter of readings."""

    cells: float = 12.0  #: cells over which a line is fitted
    least: float = 4.0  #: smallest number of cells that the front must have passed
    fewest: int = 8  #: smallest number of steps, or readings, for a line
    apart: float = 0.25  #: growth of the shell between two readings, in cells
    times: float = 2.5  #: error over the scatter (rms): nine of ten differences of runs are within
    powers: int = 2  #: degree of the smooth curve


FRONTS = FrontLimits()


@dataclass(slots=True)
class Front:
    """A depth in the steps of one zone."""

    zone: int = -1  #: index of the cooling zone
    #: depth, size of the cell there (m), and derivatives by each parameter, of each step
    rows: list[list[float]] = field(default_factory=list)

    def add(self, zone: int, depth: float, cell: float, slopes: Sequence[float]) -> None:
        """Process a step; steps too far back are dropped."""
        if zone != self.zone:
            self.zone, self.rows = zone, []
        if not np.isfinite(cell) or not np.isfinite(slopes).all():
            self.rows = []  # there is no front
            return
        self.rows.append([depth, cell, *slopes])
        self.rows = [row for row in self.rows if abs(row[0] - depth) <= FRONTS.cells * cell]

    def evened(self) -> tuple[Array, Array] | None:
        """Derivatives by each parameter and their standard errors; None with too few cells."""
        table = np.array(self.rows)
        if len(table) < FRONTS.fewest:
            return None
        depth, cell, slopes = table[:, 0], table[-1, 1], table[:, 2:]
        if np.ptp(depth) < FRONTS.least * cell:
            return None
        line = np.column_stack([np.ones(len(table)), (depth - depth[-1]) / cell])
        found = np.linalg.lstsq(line, slopes, rcond=None)[0]
        rest = slopes - line @ found
        free = max(np.ptp(depth) / cell - 2.0, 1.0)  # steps on one tread are not independent
        scatter = np.sqrt(np.mean(rest**2, axis=0) * np.linalg.inv(line.T @ line)[0, 0])
        return found[0], scatter * np.sqrt(len(table) / free)


class Fronts:
    """Records the requested depths.

    Args:
        derivatives: Derivatives of the temperatures.
        wanted: Kind of depth, from `LEVELS`, and probe of each.
    """

    def __init__(self, derivatives: ThermalDerivatives, wanted: Sequence[tuple[str, str]]) -> None:
        self._derivatives = derivatives
        self.fronts = {one: Front() for one in wanted}

    def follow(self, zone: int, sample: Sample) -> None:
        """Process a committed step in a zone (collective)."""
        if not self.fronts:
            return
        probes = sample.simulation.probes
        variations = self._derivatives.variations
        warming = [
            self._along(probes, sample, its)
            for its in self._derivatives.warming(sample.state.thermal)
        ]
        for (kind, probe), front in self.fronts.items():
            profile = sample.profiles[probe]
            level = _level(sample.simulation.steel, kind)
            slopes = [
                _slope(profile, level, along[probe], _level_slope(v, kind))
                for v, along in zip(variations, warming, strict=True)
            ]
            front.add(zone, profile.isotherm_depth(level), profile.cell_at(level), slopes)

    def _along(self, probes: LineProbes, sample: Sample, warming: Array) -> dict[str, Array]:
        """Derivative of the temperature along every line, interpolated like conduction."""
        state = sample.state.thermal
        law = probes.conducts
        if law is None or law.even:
            return probes.along(warming)
        k = sample.simulation.problem.curve.conductivity
        along = probes.along(k(state.point.temperature) * warming)
        return {name: v / k(sample.profiles[name].temperature) for name, v in along.items()}

    def memory(self) -> list[list[object]]:
        """Data for a checkpoint."""
        return [[front.zone, front.rows] for front in self.fronts.values()]

    def recall(self, memory: Sequence[Sequence[object]]) -> None:
        """Restore `memory`."""
        for front, (zone, rows) in zip(self.fronts.values(), memory, strict=True):
            front.zone, front.rows = int(zone), [list(row) for row in rows]  # type: ignore


def _level(steel: Steel, kind: str) -> float:
    return float(getattr(steel, LEVELS[kind]))


def _level_slope(variation: Variation, kind: str) -> float:
    """Derivative of the level itself, K per unit."""
    above, below = (_level(s.simulation.steel, kind) for s in (variation.above, variation.below))
    return (above - below) / variation.span


def _slope(profile: Profile, level: float, warming: Array, of_level: float) -> float:
    """Derivative of the depth of a level along a line, m per unit; NaN if it is not on it."""
    hot = profile.temperature >= level
    i = int(np.argmax(hot))
    if i == 0:
        return float("nan")
    x0, x1 = profile.depth[i - 1 : i + 1]
    t0, t1 = profile.temperature[i - 1 : i + 1]
    d0, d1 = warming[i - 1 : i + 1]
    share = (level - t0) / (t1 - t0)
    return float((x1 - x0) / (t1 - t0) * (of_level - d0 - share * (d1 - d0)))


@dataclass(slots=True)
class Scatter:
    """The error of a derivative: its scatter while the shell grows through the cells.

    Shell, temperatures, stress and gap vary with the steps of a front, and their derivatives rise
    and fall from cell to cell. Runs with different parameters have their fronts at different places
    within a cell, so that a difference of two runs has about the scatter of a single run along its
    way. The derivatives are read each time the shell has grown by a part of a cell; their deviation
    from a smooth curve over the last cells is their scatter (docs/sensitivity.md compares it with
    differences of runs).
    """

    zone: int = -1  #: index of the cooling zone
    #: depth of the shell, size of the cell there (m), and all derivatives, of each reading
    rows: list[list[float]] = field(default_factory=list)

    def due(self, zone: int, depth: float, cell: float) -> bool:
        """Whether the shell has grown enough for another reading."""
        if zone != self.zone or not np.isfinite(cell):
            self.zone, self.rows = zone, []
        if not np.isfinite(cell):
            return False
        return not self.rows or abs(depth - self.rows[-1][0]) >= FRONTS.apart * cell

    def add(self, depth: float, cell: float, slopes: Sequence[float]) -> None:
        """Add a reading; readings too far back are dropped."""
        self.rows.append([depth, cell, *slopes])
        self.rows = [row for row in self.rows if abs(row[0] - depth) <= FRONTS.cells * cell]

    def errors(self, count: int) -> Array:
        """Errors of all derivatives (count,), NaN with too few readings of one."""
        found = np.full(count, np.nan)
        if len(self.rows) < FRONTS.fewest:
            return found
        table = np.array(self.rows)
        depth, slopes = table[:, 0], table[:, 2:]
        curve = np.vander((depth - depth[-1]) / table[-1, 1], FRONTS.powers + 1)
        known = np.isfinite(slopes).all(axis=0)
        rest = slopes[:, known] - curve @ np.linalg.lstsq(curve, slopes[:, known], rcond=None)[0]
        free = len(table) - FRONTS.powers - 1
        found[known] = FRONTS.times * np.sqrt((rest**2).sum(axis=0) / free)
        return found
