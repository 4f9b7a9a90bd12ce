"""The slices that are inside a caster, taken together from one instant of its clock to the next.

They share mesh, steel, operators and probes, and those of the same superheat a curve T(H) and its
solver; a state is a few arrays a slice. Each takes its own steps, which are those of its own run:
its case writes states at the instants of the clock (`output.by_clock`), so that steps end there.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

from castfem.base.constants import EXACT
from castfem.base.errors import RunFailure
from castfem.model.build.simulation import CurveEnds, Simulation, build, build_beside
from castfem.model.caster import by_plant, cast_of, followed, slice_of, starts_of
from castfem.runs import restart
from castfem.runs.loop import TimeLoop

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.model import Case
    from castfem.physics.thermal.problem import ThermalProblem
    from castfem.runs.interrupt import Interrupt
    from castfem.runs.results.run_state import RunState
    from castfem.runs.results.sample import Sample


class Slice:
    """One slice on its way down.

    Args:
        number: From 1, the oldest first.
        start: When it leaves the meniscus, by the clock, s.
        length: Of strand that it stands for, m.
        simulation: Its own.
    """

    def __init__(self, number: int, start: float, length: float, simulation: Simulation) -> None:
        self.number, self.start, self.length = number, start, length
        self.loop = TimeLoop(simulation, unsampled=self._passes)
        self._until = 0.0
        # Crack indexes and the like grow with each step.
        self._each = simulation.case.quality is not None

    @property
    def run_state(self) -> RunState:
        """Where its run stands."""
        return self.loop.run_state

    @property
    def age(self) -> float:
        """Time since it left the meniscus, s."""
        return self.run_state.state.time

    @property
    def closed(self) -> float:
        """How old it was when it became solid, s; NaN while it is not."""
        length = self.run_state.sampler.metallurgical_length
        return math.nan if length is None else self.loop.simulation.machine.time_at(length)

    @property
    def lasts(self) -> float:
        """How old it is when it leaves the machine, s."""
        return self.loop.simulation.control.end

    @property
    def has_left(self) -> bool:
        """Whether it has come to the end of the machine."""
        return self.age >= self.lasts

    def go_on_in(self, simulation: Simulation) -> None:
        """Go on from the same state in another simulation, whose plant has gone on."""
        run = self.run_state
        self.loop = TimeLoop(simulation, unsampled=self._passes)
        if run.sample is None:
            return
        run.restored = ({}, {})  # results of a slice on its way are asked for by nobody
        simulation.probes.conducts = simulation.problem.curve
        state = {name: values for name, values in restart.arrays(run).items() if values is not None}
        restart.restore(self.run_state, restart.description(run), state)

    def advance(self, clock: float) -> Sample:
        """Go on to an instant of the clock, s, or to where it leaves the machine.

        Raises:
            RunFailure: At the smallest step.
        """
        simulation, run = self.loop.simulation, self.run_state
        simulation.probes.conducts = simulation.problem.curve
        if run.zone >= 0:
            simulation.problem.set_cooling(simulation.zones.cooling(run.zone))
        self._until = min(clock - self.start, self.lasts)
        return self.loop.run(self._until)

    def _passes(self, run: RunState) -> bool:
        """Take in a step without results, but where they are asked for."""
        asked = run.sample is None or run.state.time >= self._until - EXACT * self.lasts
        if asked or self._each:
            return False
        run.sampler.follow(run.state.thermal)
        return True


class Strand:
    """All slices of a caster that are inside at a time.

    Args:
        case: With a table [caster], sound.
        comm: Of one rank.

    Attributes:
        base: The case of each slice but for its start.
        starts: When each slice leaves the meniscus, by the clock, s.
        work: How long each is followed, s.
        inside: Slices that are in the machine, the lowest first.
        closed: How old slices were when they became solid, s, by number; NaN of one that has left
            with liquid.
    """

    def __init__(self, case: Case, comm: MPI.Comm) -> None:
        self.inside: list[Slice] = []
        self._warned: set[tuple[int, bool]] = set()
        self.grow(case)
        self._first = build(slice_of(self.base, self.starts[0]), comm)
        self._problems: WeakValueDictionary[CurveEnds, ThermalProblem] = WeakValueDictionary()
        self.closed: dict[int, float] = {}
        self.begun = 0

    def grow(self, case: Case) -> None:
        """Take in the case with a longer history, which begins as that so far."""
        assert case.caster is not None
        base = by_plant(case)
        self.instants, self.cast = case.caster.instants, cast_of(case)
        self.starts, self.base, self.work = starts_of(case), base, followed(case)
        for one in self.inside:
            new = build_beside(slice_of(base, one.start), self._first, self._problems)
            one.go_on_in(new)
            self._warn_once(one)

    def _warn_once(self, one: Slice) -> None:
        """Let sprays of all slices tell once that they are beyond their table."""
        sprays = one.run_state.sampler.sprays
        if sprays is not None:
            sprays.warned = self._warned

    @property
    def model(self) -> Simulation:
        """The simulation of the first slice, which has what all share."""
        return self._first

    def enter(self, number: int) -> Slice:
        """Let a slice, by number, leave the meniscus."""
        start = self.starts[number - 1]
        simulation = build_beside(slice_of(self.base, start), self._first, self._problems)
        made = Slice(number, start, self.length_of(number), simulation)
        self._warn_once(made)
        self.inside.append(made)
        self.begun = number
        return made

    def length_of(self, number: int) -> float:
        """Length of strand that a slice stands for: to that below, as they leave the meniscus, m.

        That of the lowest is to the next above.
        """
        i = max(number - 1, 1)
        return self.cast.length(self.starts[i]) - self.cast.length(self.starts[i - 1])

    def advance(
        self,
        clock: float,
        interrupt: Interrupt | None = None,
        passed: Container[int] = (),
    ) -> Iterator[Slice]:
        """Take all slices to an instant of the clock, s; yields each that has come there.

        Args:
            clock: The instant.
            interrupt: Asked after each step whether to stop there.
            passed: Numbers of those that are there already.

        Raises:
            RunFailure: At the smallest step of one of them.
        """
        while self.begun < len(self.starts) and self.starts[self.begun] <= clock:
            self.enter(self.begun + 1)
        for one in self.inside:
            if one.number in passed:
                continue
            one.loop.interrupt = interrupt
            try:
                one.advance(clock)
            except RunFailure as error:
                start = f"the slice that left the meniscus at {one.start:g} s"
                raise RunFailure(f"{start}: {error}") from None
            self.closed[one.number] = one.closed
            yield one

    def release(self) -> None:
        """Let go of the slices that have left the machine."""
        self.inside = [one for one in self.inside if not one.has_left]
        lowest = self.inside[0].number if self.inside else self.begun + 1
        self.closed = {n: age for n, age in self.closed.items() if n >= lowest - 1}

    def pool_end(self, clock: float) -> float:
        """Where the liquid ends, m below the meniscus; NaN where it is not within the machine.

        The strand between the lowest slice with liquid and the next, which is solid, takes as long
        to become solid as that one did.
        """
        liquid = next((one for one in self.inside if math.isnan(one.closed)), None)
        if liquid is None:
            return math.nan
        age = self.closed.get(liquid.number - 1, math.nan)
        if math.isnan(age):
            return math.nan
        position = self.cast.length(clock) - self.cast.length(clock - age)
        below = next((one for one in self.inside if one.number == liquid.number - 1), None)
        if below is None and position > self.base.casting.length:
            return math.nan
        end = math.inf if below is None else below.run_state.position
        return min(max(position, liquid.run_state.position), end)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self.inside = []
        self._first.destroy()
