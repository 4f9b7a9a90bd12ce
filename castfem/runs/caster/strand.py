"""The slices inside a caster, advanced together from one output time to the next.

They share mesh and steel; without mechanics also operators and probes, and with equal superheat the
curve T(H) and its solver, so that a state is a few arrays per slice. Each slice takes the time
steps of its own run: its case has outputs at the clock times (`output.by_clock`), so that steps end
there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

from mpi4py import MPI

from castfem.base.constants import EXACT, ROUNDING
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.model.build.simulation import (
    CurveEnds,
    Simulation,
    build,
    build_beside,
    starting_temperature,
)
from castfem.model.caster_slices import (
    by_plant,
    cast_of,
    ends_with_tail,
    followed,
    slice_of,
    starts_of,
)
from castfem.runs import restart
from castfem.runs.caster.alike import Alike, Seen
from castfem.runs.caster.look import Look
from castfem.runs.caster.plant_file import recent
from castfem.runs.caster.pyrometers import Passing
from castfem.runs.loop import TimeLoop

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.probe import Pyrometer
    from castfem.physics.thermal.problem import ThermalProblem
    from castfem.runs.interrupt import Interrupt
    from castfem.runs.results.run_state import RunState
    from castfem.runs.results.sample import Sample

RowOf = Callable[["Sample"], dict[str, float]]
"""Makes the row of the history from a sample."""


class Slice:
    """One slice of the strand.

    Args:
        number: Number, from 1 for the oldest.
        start: When it leaves the meniscus, by the clock, s.
        length: Length of strand that it represents, m.
        simulation: Its simulation.
    """

    def __init__(self, number: int, start: float, length: float, simulation: Simulation) -> None:
        self.number, self.start, self.length = number, start, length
        self.loop = TimeLoop(simulation, unsampled=self._passes)
        self._until = 0.0
        self.passing: Passing | None = None
        self._taken_over: Seen | None = None  # state of another slice, while its own loop is behind
        # Crack indexes and extremes of the mechanics accumulate with each step.
        self._each = simulation.case.quality is not None or simulation.mechanics is not None

    @property
    def run_state(self) -> RunState:
        """State of its run."""
        if (seen := self._taken_over) is not None:
            assert seen.state is not None
            self.restore(*seen.state)
        return self.loop.run_state

    @property
    def age(self) -> float:
        """Time since it left the meniscus, s."""
        seen = self._taken_over
        return self.loop.run_state.state.time if seen is None else seen.age

    @property
    def lasts(self) -> float:
        """Its age when it leaves the machine, s."""
        return self.loop.simulation.control.end

    @property
    def has_left(self) -> bool:
        """Whether it has reached the end of the machine."""
        return self.age >= self.lasts

    def go_on_in(self, simulation: Simulation) -> None:
        """Continue from the same state in another simulation, with a longer plant record."""
        state = None if self._taken_over is not None else self.state()
        self.loop = TimeLoop(simulation, unsampled=self._passes)
        if state is not None:
            self.restore(*state)

    def state(self) -> tuple[dict[str, Any], dict[str, Array]] | None:
        """Return its state for a checkpoint; None at the meniscus."""
        if self._taken_over is not None:
            return self._taken_over.state
        run = self.run_state
        if run.sample is None:
            return None
        run.restored = ({}, {})  # results before this state are not needed
        arrays = {name: kept for name, kept in restart.arrays(run).items() if kept is not None}
        return restart.description(run), arrays

    def restore(self, described: dict[str, Any], arrays: dict[str, Array]) -> None:
        """Restore what `state` has returned."""
        self._taken_over = None
        run = self.loop.run_state
        restart.restore(run, described, arrays)
        if self.passing is not None:
            self.passing.go_on(run)

    def advance(
        self, clock: float, interrupt: Interrupt | None = None, age: float | None = None
    ) -> Sample:
        """Advance to a clock time, s, or to the end of the machine.

        Args:
            clock: Clock time, s.
            interrupt: Checked before each step.
            age: The same time as an age, s, if it is known exactly.

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        simulation, run = self.loop.simulation, self.run_state
        if run.zone >= 0:
            simulation.problem.set_cooling(simulation.zones.cooling(run.zone))
        self._until = min(clock - self.start if age is None else age, self.lasts)
        self.loop.interrupt = interrupt
        try:
            return self.loop.run(self._until)
        except RunFailure as error:
            start = f"the slice that left the meniscus at {self.start:g} s"
            raise RunFailure(f"{start}: {error}") from None

    def seen(self, row: dict[str, float]) -> Seen:
        """Return its present state, with a row of its history."""
        run, simulation = self.run_state, self.loop.simulation
        solid = run.sampler.metallurgical_length
        thermal = run.state.thermal
        gained = run.sampler.heat_gained(thermal) - thermal.generated - thermal.fed
        return Seen(
            self.age, run.position,
            solid=math.nan if solid is None else solid,
            closed=math.nan if solid is None else simulation.machine.time_at(solid),
            removed=thermal.removed, gained=gained, row=row,
        )  # fmt: skip

    def look(self, seen: Seen) -> Look:
        """Return its part in the state of the strand."""
        whole = self.length * self.loop.simulation.section.multiplicity
        return Look(
            self.number, self.start, self.length, seen.age, self.lasts, seen.position,
            seen.solid, seen.closed, whole * seen.removed, whole * seen.gained, seen.row,
            passed=self.take_passed(),
        )  # fmt: skip

    def take_over(self, seen: Seen) -> None:
        """Take over the state of another slice with the same history."""
        self._taken_over = seen
        if self.passing is not None:
            self.passing.passed += [list(one) for one in seen.passed]

    def go_to(self, clock: float, alike: Alike, row_of: RowOf, interrupt: Interrupt | None) -> Look:
        """Advance to a clock time, s, and return the state there.

        Args:
            clock: Clock time, s.
            alike: States of other slices, which are taken over where the history is the same.
            row_of: Makes the row of the history from a sample.
            interrupt: See `advance`.

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        if not alike.meets_the_same(self.number, clock):
            return self.look(self.seen(row_of(self.advance(clock, interrupt))))
        last = min(round(clock - self.start, 9), self.lasts)
        for age in self._ages(last, after=self.age):
            self._to_age(age, alike, row_of, interrupt)
        return self.look(self._to_age(last, alike, row_of, interrupt))

    def _to_age(self, age: float, alike: Alike, row_of: RowOf, interrupt: Interrupt | None) -> Seen:
        """Take over a state at an age, s, or advance to it and keep the state for others."""
        stops = self.loop.simulation.control.stops_until(age)
        found = alike.find(self.number, age, stops)
        if found is not None:
            self.take_over(found)
            return found
        seen = self.seen(row_of(self.advance(age + self.start, interrupt, age)))
        passed: list[list[float]] = []
        if self.passing is not None:
            before = max(self._ages(age, after=0.0), default=0.0)
            passed = [one for one in self.passing.passed if one[1] > before]
        seen = replace(seen, age=age, stops=stops, state=self.state(), passed=passed)
        alike.keep(self.number, seen)
        return seen

    def _ages(self, last: float, after: float) -> list[float]:
        """Ages of its output times between two ages, s."""
        times = self.loop.simulation.case.output_times()
        between = ROUNDING * self.lasts
        return [age for age in times if after + between < age < last - between]

    def watch(self, places: Sequence[Pyrometer], passed: Sequence[Sequence[float]] = ()) -> None:
        """Record passing pyrometers from now on; `passed` are readings not written yet."""
        if places:
            self.passing = Passing(places, self.run_state, passed)

    def take_passed(self) -> list[list[float]]:
        """Return the pyrometer readings since the last call."""
        if self.passing is None:
            return []
        found, self.passing.passed = self.passing.passed, []
        return found

    def _passes(self, run: RunState) -> bool:
        """Process a step; sample it only where results are needed."""
        if self.passing is not None:
            self.passing.note(run)
        asked = run.sample is None or run.state.time >= self._until - EXACT * self.lasts
        if asked or self._each:
            return False
        run.sampler.follow(run.state.thermal)
        return True


class Strand:
    """The slices of a caster in the machine, as far as they belong to this rank.

    Slices are dealt out to the ranks in turn, since neighbours take about equally long.

    Args:
        case: A valid case with a table [caster].
        rank: This rank. ranks: Number of ranks.

    Attributes:
        base: Case of every slice, except for its start.
        starts: When each slice leaves the meniscus, by the clock, s.
        work: Time over which each slice is followed, s.
        inside: Slices of this rank in the machine, the lowest first.
    """

    def __init__(self, case: Case, rank: int = 0, ranks: int = 1) -> None:
        assert case.caster is not None
        self.inside: list[Slice] = []
        self._rank, self._ranks, self._begun = rank, ranks, 0
        self._warned: set[tuple[int, bool]] = set()
        self._places = case.caster.pyrometer
        self._alike = Alike()
        self.grow(case)
        self._first = build(slice_of(self.base, self.starts[0]), MPI.COMM_SELF)
        self._problems: WeakValueDictionary[CurveEnds, ThermalProblem] = WeakValueDictionary()

    def grow(self, case: Case) -> None:
        """Continue with a longer plant record that begins with the previous one."""
        assert case.caster is not None
        since = self.inside[0].start if self.inside else -math.inf
        base = by_plant(recent(case, since))  # may raise
        self.instants, self.cast = case.caster.instants, cast_of(case)
        self.starts, self.base, self.work = starts_of(case), base, followed(case)
        self._tail, self._caster = ends_with_tail(case), case.caster
        numbers = range(self._rank + 1, len(self.starts) + 1, self._ranks)
        self._to_come = [number for number in numbers if number > self._begun]
        for one in self.inside:
            new = build_beside(slice_of(base, one.start), self._first, self._problems)
            one.go_on_in(new)
            one.length = self.length_of(one.number)  # the next slice may have been unknown before
            self._warn_once(one)
        # With mechanics the simulation depends on the future mean speed.
        if base.mechanics is None:
            inside = [one.number for one in self.inside]
            self._alike.grow(base, self.starts, [*inside, *self._to_come])

    def _warn_once(self, one: Slice) -> None:
        """Let all slices together warn once that sprays leave their table."""
        sprays = one.loop.run_state.sampler.sprays
        if sprays is not None:
            sprays.warned = self._warned

    @property
    def model(self) -> Simulation:
        """The simulation of the first slice, which holds all shared objects."""
        return self._first

    def holds(self, number: int) -> bool:
        """Whether a slice belongs to this rank."""
        return (number - 1) % self._ranks == self._rank

    def pass_by(self, gone: int) -> None:
        """Drop the first slices, which left the machine before the run was resumed."""
        self._to_come, self._begun = [n for n in self._to_come if n > gone], gone

    def enter(self, number: int) -> Slice:
        """Start a slice of this rank at the meniscus."""
        start = self.starts[number - 1]
        simulation = build_beside(slice_of(self.base, start), self._first, self._problems)
        made = Slice(number, start, self.length_of(number), simulation)
        self._warn_once(made)
        made.watch(self._places)
        self.inside.append(made)
        self._to_come.remove(number)
        self._begun = max(self._begun, number)
        return made

    def length_of(self, number: int) -> float:
        """Length of strand that a slice represents: the distance to the next at the meniscus, m.

        The tail of the strand represents none.
        """
        if number == len(self.starts):
            if self._tail:
                return 0.0
            number = max(number - 1, 1)  # as long as that of the slice before
        ends = [self.cast.length(start) for start in self.starts[number - 1 : number + 1]]
        return ends[-1] - ends[0]

    def poured(self, clock: float) -> float | None:
        """Temperature of the steel at the meniscus at a clock time, K.

        None while the strand stands, and after its tail.
        """
        until = self._caster.cast_until
        if not self._caster.plant.table("speed")(clock) > 0.0 or (until or clock) < clock:
            return None
        return starting_temperature(slice_of(self.base, clock), self._first.steel)

    def waiting(self, clock: float, passed: Container[int] = ()) -> list[Slice]:
        """Return the slices to be advanced to a clock time, s.

        Args:
            clock: Clock time; slices that leave the meniscus before it are started.
            passed: Numbers of the slices that are already there.
        """
        while self._to_come and self.starts[self._to_come[0] - 1] <= clock:
            self.enter(self._to_come[0])
        return [one for one in self.inside if one.number not in passed]

    def take(
        self, one: Slice, clock: float, row_of: RowOf, interrupt: Interrupt | None = None
    ) -> Look:
        """Advance a slice to a clock time, s, and return its state; see `Slice.go_to`."""
        return one.go_to(clock, self._alike, row_of, interrupt)

    def release(self, clock: float) -> None:
        """Release the slices that have left the machine by a clock time, s."""
        self._alike.forget(clock)
        for one in self.inside:
            if one.has_left:
                self._free(one)
        self.inside = [one for one in self.inside if not one.has_left]

    def _free(self, one: Slice) -> None:
        """Free what belongs to one slice only: without mechanics just its arrays."""
        if self.base.mechanics is not None:
            one.loop.simulation.destroy()

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for one in self.inside:
            self._free(one)
        self.inside = []
        self._first.destroy()
