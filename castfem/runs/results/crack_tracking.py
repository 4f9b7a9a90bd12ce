"""Follows the crack indexes and the end of the liquid core along the strand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.result_registry import probe_label
from castfem.base.shown_quantity import si_unit
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.model.machine import thickness_of
from castfem.physics.machine.stations import Stations
from castfem.runs.output.surface_maps import (
    DEPTHS,
    SURFACE,
    Heading,
    SurfaceLine,
    SurfaceMap,
)
from castfem.runs.results.crack_index import BENDS, CrackIndex, SliceStep, declared_indexes
from castfem.runs.results.crack_quantities import POOL
from castfem.runs.results.crack_state import QualityState, TimedStrains, Worst
from castfem.runs.results.needs import are_met
from castfem.runs.results.thermal_quantities import temperature_at

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.physics.coupling.staggered import StrandState
    from castfem.runs.results.hot_tearing_tracking import Follower
    from castfem.runs.results.mechanical import MechanicalSampler

EVERY = 4  # the maps over the depth have every fourth sample along a line


class QualitySampler:
    """Computes the indexes after each step (collective).

    Args:
        simulation: A case with the table [quality]. mechanics: Samples its strained slice; None
            without mechanics, or if these end above the end of the strand.

    Attributes:
        state: State after the last step.
    """

    def __init__(self, simulation: Simulation, mechanics: MechanicalSampler | None) -> None:
        case, section = simulation.case, simulation.section
        assert case.quality is not None
        self.simulation, self.settings, self._mechanics = simulation, case.quality, mechanics
        source = section.source
        line: SurfaceLine = section.comm.bcast(None if source is None else SurfaceLine.of(source))
        rolls = None if case.machine is None else case.machine.pairs()
        caster = Stations(rolls, thickness_of(case.section) or 0.0, case.mould_exit())
        self.indexes = tuple(
            index for index in declared_indexes() if are_met(index.needs, simulation)
        )
        self.place = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2].copy()
        self._on_surface = np.isin(section.node_of_owned, line.nodes)
        fractions = {*POOL, *self.settings.brittle, *self.settings.soft_reduction}
        self._levels = {f: temperature_at(simulation.steel, f) for f in sorted(fractions)}
        ends = sorted(self._levels[f] for f in self.settings.brittle)
        self._brittle = ends[0], ends[1]
        strained = None if mechanics is None else simulation.coupling
        window = 0.0 if strained is None else strained.window
        if caster.longest_pitch:  # windows end where the rolls bend or support
            window = min(window, simulation.machine.window_time(caster.longest_pitch))
        # Shortest averaging time of a rate. Where two events are close together, such as a roll and
        # the end of a zone 14 um below it, a window of milliseconds lies between them; a jump
        # there, such as that of the bed of a pitch by 4e-7 of strain, would give a rate larger than
        # any real one.
        self._least = 0.2 * window
        self._follower: Follower | None = None
        if self.settings.hot_tearing:
            from castfem.runs.results.hot_tearing_tracking import Follower

            self._follower = Follower(simulation, mechanics)
        none = np.zeros(section.owned)
        self.state = QualityState(
            line, caster, temperature=none,
            tearing=None if self._follower is None else self._follower.start,
            values={index.name: none for index in self.indexes},
            worst={index.name: Worst() for index in self.indexes},
        )  # fmt: skip

    def note(self, strand: StrandState, position: float, centre: float) -> QualityState:
        """Process a step."""
        old, time = self.state, strand.thermal.time
        kelvin = strand.thermal.point.temperature
        first = not old.time < time  # at the meniscus, or a restored state
        recent = self._recent(time, kelvin, first)
        strain_history = self._strain_history(strand, position, recent[0][0], first)
        step = self._step(strand, recent, strain_history, position)
        tearing = old.tearing
        if self._follower is not None and tearing is not None:
            tearing = self._follower.note(tearing, strand, step.duration)
            step = replace(step, tearing=tearing)
        values = dict(old.values)
        for index in self.indexes:
            if not (first and index.accumulates):
                values[index.name] = index.compute(replace(step, value=old.values[index.name]))
        largest = {i.name: self._largest(i, values[i.name], time, position) for i in self.indexes}
        phase, in_phase = old.caster.phase(position), dict(old.in_phase)
        if phase in BENDS and not first:
            in_phase[phase] = _worse(in_phase.get(phase, {}), largest)
        known = np.isfinite(centre)
        self.state = replace(
            old, time=time, temperature=kelvin, strain_history=strain_history, recent=recent,
            values=values, largest=largest,
            worst=_worse(old.worst, largest), in_phase=in_phase, centre=centre,
            passed=self._passed(centre, time), tearing=tearing,
            solid_fraction=float(self.simulation.steel.solid_fraction(centre)) if known else None,
        )  # fmt: skip
        return self.state

    def _recent(self, time: float, kelvin: Array, first: bool) -> tuple[tuple[float, Array], ...]:
        """The last sample that is old enough for a rate, and all later ones including this."""
        before = self.state.recent[:-1] if first else self.state.recent
        enough = [k for k, one in enumerate(before) if time - one[0] >= self._least]
        return (*before[max(enough, default=0) :], (time, kelvin))

    def _strain_history(
        self, strand: StrandState, position: float, rated_from: float, first: bool
    ) -> tuple[TimedStrains, ...]:
        """Generalized strains over the longest pitch up to now.

        They include the time from which rates are computed.
        """
        if self._mechanics is None or strand.mechanical is None:
            return ()
        a0, a1, a2 = (float(a) for a in strand.mechanical.generalized_strains[:3])
        now = (strand.mechanical.time, a0, a1, a2)
        if first:
            return (*self.state.strain_history[:-1], now)
        longest = self.state.caster.longest_pitch
        since = self.simulation.machine.time_at(max(position - longest, 0.0))
        since, before = min(since, rated_from), self.state.strain_history
        kept = sum(strains[0] <= since for strains in before[:-1])
        return (*before[max(kept - 1, 0) :], now)

    def _step(
        self,
        strand: StrandState,
        recent: tuple[tuple[float, Array], ...],
        strain_history: tuple[TimedStrains, ...],
        position: float,
    ) -> SliceStep:
        old, (since, rated_from), (time, kelvin) = self.state, recent[0], recent[-1]
        none: Array = np.zeros(len(kelvin))
        duration = time - old.time if old.time >= 0.0 else 0.0
        stress, rate, step_rate, pitch_rate = none, none, none, none
        if self._mechanics is not None and strand.mechanical is not None:
            stress = self._mechanics.axial_at_vertices(strand.mechanical)
            if duration > 0.0:
                then = min(strain_history, key=lambda strains: abs(strains[0] - since))
                now = np.array(strain_history[-1])
                rate = self._rate(np.array(then), now)
                step_rate = self._rate(np.array(strain_history[-2]), now)
                pitch_rate = self._over_a_pitch(strain_history, position)
        return SliceStep(
            self.settings, self.simulation.steel, duration, time - since, self.place, kelvin,
            old.temperature if duration > 0.0 else kelvin, rated_from, stress, rate, step_rate,
            pitch_rate, none, self._brittle,
        )  # fmt: skip

    def _rate(self, start: Array, end: Array) -> Array:
        """Axial strain rate between two times (n,), 1/s.

        With large strains it is the rate of the true strain, as in the stress update.
        """
        assert self.simulation.case.mechanics is not None
        before, after = (self._strain(strains) for strains in (start, end))
        if self.simulation.case.mechanics.strain == "large":
            before, after = np.log1p(before), np.log1p(after)
        return np.asarray((after - before) / (end[0] - start[0]))

    def _strain(self, strains: Array) -> Array:
        """Axial strain from generalized strains (n,)."""
        return np.asarray(strains[1] + self.place @ strains[2:])

    def _over_a_pitch(self, strain_history: tuple[TimedStrains, ...], position: float) -> Array:
        """Axial strain rate averaged over the last roll pitch, or so far, (n,)."""
        if not self.state.caster.longest_pitch:
            return np.zeros(len(self.place))
        pitch, table = self.state.caster.pitch(position), np.array(strain_history)
        since = self.simulation.machine.time_at(max(position - pitch, 0.0))
        start = np.array([np.interp(since, table[:, 0], column) for column in table.T])
        return self._rate(start, table[-1])

    def _largest(self, index: CrackIndex, values: Array, time: float, position: float) -> Worst:
        """Return the largest value and its place (collective)."""
        counted = self._on_surface if index.on == "surface" else np.full(len(values), True)
        comm = self.simulation.section.comm
        return Worst(*reductions.peak(comm, values[counted], self.place[counted]), time, position)

    def _passed(self, centre: float, time: float) -> dict[float, float]:
        """Positions where the centre line reached each solid fraction, linear within a step."""
        old, found = self.state, dict(self.state.passed)
        for fraction, level in self._levels.items():
            if not centre < level:
                found.pop(fraction, None)
            elif fraction not in found and 0.0 <= old.time < time:
                share = (old.centre - level) / (old.centre - centre) if old.centre > centre else 1.0
                then = old.time + min(max(share, 0.0), 1.0) * (time - old.time)
                found[fraction] = self.simulation.machine.position(then)
        return found

    def headings(self) -> dict[tuple[str, str], Heading]:
        """Headings of the maps of each kind, by the names of their files."""
        caster, thickness = self.state.caster, thickness_of(self.simulation.case.section)

        def heading(
            line: SurfaceLine, indexes: Sequence[CrackIndex], band: tuple[float, float]
        ) -> Heading:
            maps = [SurfaceMap("temperature", "K", "degC", "temperature")]
            maps += [SurfaceMap(i.name, si_unit(i.unit), i.unit, i.label) for i in indexes]
            return Heading(line, tuple(maps), band, caster.columns(), thickness, caster.mould_exit)

        found = {SURFACE: heading(self.state.line, self._mapped(), self.settings.band)}
        if self._follower is not None:
            found[DEPTHS] = heading(self._lines(), self._mapped(followed=True), self._brittle)
        return found

    def _lines(self) -> SurfaceLine:
        """Points on the probe lines at which criteria are mapped over the depth."""
        probes = self.simulation.probes
        place, depth = [], []
        for name, (start, end) in probes.lines.items():
            way = probes.depth[name][::EVERY]
            along = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
            place.append(np.asarray(start) + way[:, None] * along)
            depth.append(way)
        count = len(place[0])
        return SurfaceLine(
            np.arange(count * len(place)), np.concatenate(place), np.concatenate(depth),
            tuple(probe_label(name) for name in probes.lines),
            np.repeat(np.arange(len(place)), count), np.full(count * len(place), np.inf), False,
        )  # fmt: skip

    def _mapped(self, followed: bool = False) -> list[CrackIndex]:
        return [i for i in self.indexes if i.on == "surface" and (i.followed or not followed)]

    def rows(self) -> list[Array]:
        """A row (maps, places) of each kind of maps on rank 0, empty elsewhere (collective)."""
        gather, state = self.simulation.section.gather, self.state
        owned = [state.temperature, *(state.values[index.name] for index in self._mapped())]
        whole = [values for values in map(gather, owned) if values is not None]
        found = [np.array([values[state.line.nodes] for values in whole])] if whole else []
        if self._follower is not None:
            followed = [state.values[index.name] for index in self._mapped(followed=True)]
            along = map(self.simulation.probes.along, (state.temperature, *followed))
            lines = [np.concatenate([line[::EVERY] for line in one.values()]) for one in along]
            found += [np.array(lines)] if whole else []
        return found

    def arrays(self) -> dict[str, Array]:
        """Arrays for a checkpoint at the owned vertices."""
        kept = (index.name for index in self.indexes if index.accumulates)
        found = {f"quality_{name}": self.state.values[name] for name in kept}
        if self._mechanics is not None:  # the last sample is the state itself
            for k, (_, kelvin) in enumerate(self.state.recent[:-1]):
                found[f"quality_recent_{k}"] = kelvin
        if self._follower is not None and self.state.tearing is not None:
            found |= self._follower.arrays(self.state.tearing)
        return found

    def memory(self) -> dict[str, Any]:
        """Other data for a checkpoint."""
        state = self.state
        return {
            "time": state.time,
            "centre": state.centre if np.isfinite(state.centre) else None,
            "recent": [time for time, _ in state.recent[:-1]],
            "motions": [list(strains) for strains in state.strain_history],
            "worst": _plain(state.worst),
            "in_phase": {phase: _plain(worst) for phase, worst in state.in_phase.items()},
            "passed": [[fraction, position] for fraction, position in state.passed.items()],
        }

    def recall(self, memory: Mapping[str, Any], by_node: Mapping[str, Array]) -> None:
        """Restore `memory` and `arrays`, the latter by node."""
        values, nodes = dict(self.state.values), self.simulation.section.node_of_owned
        for name in values:
            if f"quality_{name}" in by_node:
                values[name] = np.asarray(by_node[f"quality_{name}"], float)[nodes]
        strain_history = (
            (float(t), float(a0), float(a1), float(a2)) for t, a0, a1, a2 in memory["motions"]
        )
        recent = [
            (float(time), np.asarray(by_node[f"quality_recent_{k}"], float)[nodes])
            for k, time in enumerate(memory.get("recent", ()))
            if f"quality_recent_{k}" in by_node
        ]
        recent.append((memory["time"], self.state.temperature))  # replaced by `note`
        self.state = replace(
            self.state, time=memory["time"], values=values, strain_history=tuple(strain_history),
            recent=tuple(recent),
            centre=np.nan if memory["centre"] is None else memory["centre"],
            worst=_named(memory["worst"]),
            in_phase={phase: _named(worst) for phase, worst in memory["in_phase"].items()},
            passed={float(f): float(position) for f, position in memory["passed"]},
            tearing=None if self._follower is None else self._follower.restored(by_node),
        )  # fmt: skip


def _worse(before: Mapping[str, Worst], now: Mapping[str, Worst]) -> dict[str, Worst]:
    """The larger value of each index; of equal ones the earlier."""
    return {
        name: before[name] if name in before and before[name].value >= one.value else one
        for name, one in now.items()
    }


def _plain(worst: Mapping[str, Worst]) -> dict[str, list[float]]:
    return {n: [w.value, w.x, w.y, w.time, w.position] for n, w in worst.items()}


def _named(stored: Mapping[str, list[float]]) -> dict[str, Worst]:
    return {name: Worst(*numbers) for name, numbers in stored.items()}
