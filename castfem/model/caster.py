"""The table [caster]: many slices of one strand, each with its own speed, superheat and water.

The plant record is a table over the clock with a column for each quantity that changes. A slice is
the case with these columns in place of its own keys, and with its own start time on that clock
(`casting.start.time`), so that it can also be run by itself.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from castfem.base import units
from castfem.base.constants import ROUNDING
from castfem.base.named_columns import Columns
from castfem.base.quantities import Kind, Length, Notation, Time
from castfem.base.tables import ARGUMENTS, Table
from castfem.base.units import in_mm
from castfem.model.base import TableModel
from castfem.model.casting import Start
from castfem.model.checks import Faults, caution, check
from castfem.model.heat_law import ScaledLaw
from castfem.model.mechanics import Way, WindowMark
from castfem.model.probe import Pyrometer
from castfem.physics.machine.travel import Changing

if TYPE_CHECKING:
    from castfem.model.case import Case

EVENT = "event"
_FLOW = Kind("m^3/s", "L/min", least=0.0, label="water flow", sample="240 L/min")
_KINDS = {
    "time": ARGUMENTS["time"],
    "speed": Kind("m/s", "m/min", least=0.0),
    "superheat": Kind("K", "K", difference=True, least=0.0),
    "mould_heat": Kind("1", least=0.0, label="factor", sample="0.95"),
}
_COLUMNS = Columns(
    _KINDS, {}, "history of the plant",
    "time [min], speed [m/min], superheat [K], mould_heat [-], top [L/min], event",
    optional=("superheat", "mould_heat"), words=(EVENT,), others=_FLOW,
)  # fmt: skip
DIGITS = 6
"""Significant digits of a start time in seconds: the written number is the one computed with."""


@dataclass(frozen=True, slots=True)
class Plant:
    """The plant record."""

    times: tuple[float, ...]  #: by the clock, s, increasing
    values: Mapping[str, tuple[float, ...]]  #: by column, without the events, in SI
    events: tuple[str, ...]  #: the event of each row; "" for none

    def table(self, name: str) -> Table:
        """Return a column over the clock, without rows inside an interval in which it is constant.

        Each row ends a time step of each slice. A constant column keeps one row.
        """
        values = self.values[name]
        around = (values[0], *values, values[-1])  # before the first row its values hold
        kept = [i for i in range(len(values)) if len({*around[i : i + 3]}) > 1] or [0]
        return Table("time", tuple(self.times[i] for i in kept), tuple(values[i] for i in kept))

    def told(self, name: str) -> Any:
        """Return a column as a key of the case takes it: one value if it never changes."""
        table = self.table(name)
        one = len(table.values) == 1
        return _KINDS.get(name, _FLOW).write(table.values[0]) if one else table

    @property
    def water(self) -> list[str]:
        """Names of the circuits and zones whose flow it contains."""
        return [name for name in self.values if name not in _KINDS]


@dataclass(frozen=True, slots=True)
class PlantTable(Notation):
    """Annotation of a field that takes a plant record: a CSV file, or its columns."""

    takes: str = 'CSV file: `{ file = "plant.csv" }`, or its columns'

    def read(self, given: object) -> Plant:
        """Return the history, or raise ValueError."""
        if isinstance(given, Plant):
            return given
        if not isinstance(given, Mapping):
            raise ValueError('a file is needed, plant = { file = "plant.csv" }, or columns')
        return _COLUMNS.read_by_name(given, _plant)

    def write(self, value: Plant) -> Any:
        """Return what reads back to the same history."""
        columns = {"time": value.times, **value.values}
        found: dict[str, Any] = {
            name: [_KINDS.get(name, _FLOW).write(cell) for cell in cells]
            for name, cells in columns.items()
        }
        return found | ({EVENT: list(value.events)} if any(value.events) else {})

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        cells = {"type": "array", "items": {"type": ["number", "string"]}}
        return {
            "type": "object",
            "properties": {"file": {"type": "string"}},
            "additionalProperties": cells,
            "description": "history of the plant, from a file or in columns",
        }


def _plant(columns: Mapping[str, Sequence[Any]], places: Sequence[str]) -> Plant:
    """Return the history in some columns; `places` names each row for messages."""
    times = columns["time"]
    for (before, after), place in zip(itertools.pairwise(times), places[1:], strict=True):
        if not after > before:
            raise ValueError(
                f"{place}: time ({after:g} s) does not exceed that of the previous row"
            )
    if len(times) < 2:
        raise ValueError(f"has one row, two are needed: {_COLUMNS.header}")
    values = {n: tuple(cells) for n, cells in columns.items() if n not in ("time", EVENT)}
    return Plant(tuple(times), values, tuple(columns.get(EVENT, ("",) * len(times))))


Clock = Annotated[float, Kind("s", "s", least=0.0)]


class Caster(TableModel):
    """The whole caster over time: many slices of one strand, which `castfem caster` computes."""

    plant: Annotated[Any, PlantTable()]
    """plant record over the clock, linear between two rows: time, speed, superheat, mould_heat
    (factor on the heat laws of the mould), the flow of circuits and sprayed zones under their
    names, event"""
    cast_from: Clock | None = Field(None, examples=["0 s"])
    """when the cast begins with an empty machine, by the clock of plant: the head of the strand
    leaves the meniscus then; left out: casting has gone on before, with the values of the first row
    """
    cast_until: Clock | None = Field(None, examples=["3000 s"])
    """when the last steel is poured, by the clock of plant: the tail of the strand leaves the
    meniscus then and is withdrawn; left out: casting goes on"""
    start: Clock | None = Field(None, examples=["0 s"])
    """first output of the whole strand, by the clock of plant; left out: its first row, or
    cast_from"""
    end: Clock | None = Field(None, examples=["3600 s"])
    """last output of the whole strand; left out: the last row of plant"""
    spacing: Annotated[float | Way, WindowMark()] = Field(examples=["0.5 m"])
    """distance between two slices: a time, or a length of strand"""
    every: Time = Field(examples=["20 s"])
    """time between two outputs of the whole strand, at whole multiples on the clock; also the
    longest time step of a slice"""
    longest_gap: Time | None = Field(None, examples=["10 min"])
    """longest time allowed between two rows of plant; a longer one is refused as a gap in the
    record; left out: any"""

    moments: tuple[Clock, ...] = Field((), examples=[["0 s", "20 min"]])
    """when the whole strand, bent through its machine, is written for ParaView (strand.pvd) and
    drawn: at the first output time from each of these on"""
    cut: Length | None = Field(None, examples=["8 m"])
    """length of the pieces into which the strand is cut, measured from the steel that leaves the
    meniscus at the first row of plant; with it results name the pieces"""
    pyrometer: tuple[Pyrometer, ...] = ()

    @property
    def window(self) -> tuple[float, float]:
        """First and last output time, s."""
        times = self.plant.times
        start, end = self.start, self.end
        if start is None:
            start = times[0] if self.cast_from is None else self.cast_from
        return start, times[-1] if end is None else end

    @property
    def instants(self) -> list[float]:
        """Output times by the clock, s."""
        (start, end), every = self.window, self.every
        first = math.ceil(start / every * (1.0 - ROUNDING))
        return [i * every for i in range(first, math.floor(end / every * (1.0 + ROUNDING)) + 1)]


class Cast:
    """Length of strand cast over the clock of the plant; before the first row its values hold.

    Args:
        plant: The plant record.
        before: How long before the first row the length is needed, s.
    """

    def __init__(self, plant: Plant, before: float) -> None:
        speed = plant.table("speed")
        self._origin = plant.times[0] - before
        self._travel = Changing([t - self._origin for t in speed.arguments], speed.values)

    def length(self, clock: float) -> float:
        """Length cast until a clock time, m."""
        return self._travel.position(clock - self._origin)

    def when(self, length: float) -> float:
        """Clock time at which a length (m) has been cast, s."""
        return self._travel.time_at(length) + self._origin


def cast_of(case: Case) -> Cast:
    """Return the length cast, from before the oldest slice of the caster leaves the meniscus."""
    assert case.caster is not None
    plant = case.caster.plant
    if case.caster.cast_from is not None:
        return Cast(plant, 0.0)
    early = max(plant.times[0] - case.caster.window[0], 0.0)
    # One slice beyond the end of the machine, so that the end of the liquid core is bracketed.
    return Cast(plant, 2.01 * case.casting.length / plant.values["speed"][0] + early + 1.0)


def starts_of(case: Case) -> list[float]:
    """When each slice leaves the meniscus, by the clock, s: the oldest first.

    The first one is the head of the strand, or has just left the machine at the first output; the
    last one is the tail if casting ends.
    """
    caster = case.caster
    assert caster is not None
    cast, instants, spacing = cast_of(case), caster.instants, caster.spacing
    began, until, speed = caster.cast_from, caster.cast_until, caster.plant.table("speed")
    first = instants[0] if began is None else began
    last = instants[-1] if until is None else min(instants[-1], until)
    here = cast.length(first)
    by_way = isinstance(spacing, Way)
    apart = spacing.length if isinstance(spacing, Way) else spacing
    above = cast.length(last) - here if by_way else last - first
    numbers = range(math.floor(above / apart * (1.0 + ROUNDING)) + 1)
    if began is None:
        length = case.casting.length
        below = length if by_way else first - cast.when(here - length)
        numbers = range(-math.floor(below / apart * (1.0 - ROUNDING)) - 1, numbers.stop)
    found = [cast.when(here + k * apart) if by_way else first + k * apart for k in numbers]
    if not by_way:
        found = [start for start in found if speed(start) > 0.0]
    if began is not None:  # the strand may stand for a while before withdrawal
        found = [began, *(start for start in found if start > began)]
    if until == last and cast.length(until) > cast.length(found[-1]) * (1.0 + ROUNDING):
        found.append(until)
    return [round(start, DIGITS) for start in found]


def ends_with_tail(case: Case) -> bool:
    """Whether the last slice is the tail of the strand."""
    assert case.caster is not None
    until = case.caster.cast_until
    return until is not None and until <= case.caster.instants[-1]


def followed(case: Case) -> list[float]:
    """How long each slice is followed, s: to the end of the machine or of the computed time."""
    assert case.caster is not None
    cast, last, length = cast_of(case), case.caster.instants[-1], case.casting.length
    starts = starts_of(case)
    ends = [cast.when(cast.length(start) + length) for start in starts]
    return [max(min(last, end) - start, 0.0) for start, end in zip(starts, ends, strict=True)]


def by_plant(case: Case) -> Case:
    """Return the case with the plant record in place of its own keys (see `slice_of`)."""
    from castfem.model.load import changed

    caster = case.caster
    assert caster is not None
    plant = caster.plant
    changes: dict[str, Any] = {"output.every": f"{caster.every!r} s", "output.by_clock": True}
    for name in (name for name in ("speed", "superheat") if name in plant.values):
        changes[f"casting.{name}"] = plant.told(name)
    if "mould_heat" in plant.values:
        changes |= {f"{key}.factor": plant.told("mould_heat") for key in _mould_laws(case)}
    changes |= {f"{_sprays(case)[name]}.flow": plant.told(name) for name in plant.water}
    changes["title"] = case.title
    found = changed(case, changes, "caster.plant")
    return found.model_copy(update={"caster": None, "reference": (), "optimise": None})


def slice_of(case: Case, start: float) -> Case:
    """Return the case of one slice from that of all (`by_plant`) and its start on the clock, s."""
    own = case.casting.start or Start.model_validate({})
    casting = case.casting.model_copy(update={"start": own.model_copy(update={"time": start})})
    return case.model_copy(update={"casting": casting})


def _mould_laws(case: Case) -> list[str]:
    """Keys of the heat laws of the mould that a factor may scale."""
    return [
        f"cooling.{i}.surface.{j}"
        for i, zone in enumerate(case.mould_zones())
        for j, law in enumerate(zone.surface)
        if isinstance(law, ScaledLaw)
    ]


def _sprays(case: Case) -> dict[str, str]:
    """Keys of the flows of circuits, and of sprays that are alone in their zone, by name."""
    found = {}
    for i, zone in enumerate(case.cooling):
        sprays = [j for j, law in enumerate(zone.surface) if law.tag == "spray"]
        if len(sprays) == 1:
            found[zone.name] = f"cooling.{i}.surface.{sprays[0]}"
    circuits = () if case.secondary is None else case.secondary.circuit
    return found | {one.name: f"secondary.circuit.{i}" for i, one in enumerate(circuits)}


@check("caster")
def _plant_fits(case: Case, caster: Caster) -> Faults:
    """Report columns that have no key in the case, and values missing from the record."""
    plant, names = caster.plant, _sprays(case)
    speeds, times = plant.values["speed"], plant.times
    if not speeds[0] > 0.0 and caster.cast_from is None:
        fix = "the caster begins with steady casting, or empty with cast_from"
        yield "plant", f"begins with the strand at rest; {fix}"
    if not speeds[-1] > 0.0:
        yield "plant", "ends with the strand at rest, so it never moves again; add a row"
    for name in plant.water:
        if name not in names:
            known = f"a circuit, or a zone with one spray: {', '.join(names) or 'there is none'}"
            yield "plant", f"column '{name}' is not {known}{units.nearest(name, names)}"
    if "mould_heat" in plant.values and not _mould_laws(case):
        yield "plant", "column 'mould_heat': no law of a mould has a coefficient or a flux"
    if caster.longest_gap is not None:
        for before, after in itertools.pairwise(times):
            if after - before > caster.longest_gap * (1.0 + ROUNDING):
                allowed = f"caster.longest_gap allows {caster.longest_gap:g} s"
                yield "plant", f"has no row between {before:g} s and {after:g} s; {allowed}"


@caution("caster")
def _water_off(case: Case, caster: Caster) -> Faults:
    """Report each circuit that has no water while the strand moves, once."""
    plant = caster.plant
    for name in plant.water:
        rows = zip(plant.times, plant.values[name], plant.values["speed"], strict=True)
        if off := [time for time, flow, speed in rows if flow == 0.0 < speed]:
            yield "plant", f"'{name}' has no water at {off[0]:g} s, and the strand moves"


@check("caster")
def _window(case: Case, caster: Caster) -> Faults:
    """Report output times that the record does not cover, and a spacing that leaves no slice."""
    (start, end), times = caster.window, caster.plant.times
    span = f"the plant's history goes from {times[0]:g} s to {times[-1]:g} s"
    if start < times[0]:
        yield "start", f"({start:g} s): {span}"
    if end > times[-1] * (1.0 + ROUNDING):
        yield "end", f"({end:g} s): {span}"
    elif not end > start:
        yield "end", f"({end:g} s) is not after the start ({start:g} s)"
    elif len(caster.instants) < 2:
        yield "every", f"({caster.every:g} s): there are no two such instants in {end - start:g} s"
    length = case.casting.length
    speed = max(caster.plant.values["speed"])
    apart = caster.spacing
    gap = apart.length if isinstance(apart, Way) else apart * speed
    if not gap < length:
        text = f"leaves no slice within casting.length ({in_mm(length)})"
        yield "spacing", f"({in_mm(gap)} at the fastest) {text}"


@check("caster")
def _looks_at(case: Case, caster: Caster) -> Faults:
    """Report pyrometers beyond the strand or with equal names, and moments without an output."""
    (start, end), names = caster.window, [one.name for one in caster.pyrometer]
    for i, one in enumerate(caster.pyrometer):
        if one.at > case.casting.length * (1.0 + ROUNDING):
            text = f"({one.at:g} m): the strand is followed to {case.casting.length:g} m"
            yield f"pyrometer.{i}.at", text
        if one.name in names[:i]:
            yield f"pyrometer.{i}.name", f"'{one.name}' appears twice"
    for moment in caster.moments:
        if not start <= moment <= end:
            yield "moments", f"({moment:g} s): the run goes from {start:g} s to {end:g} s"


@check("caster")
def _ends_of_cast(case: Case, caster: Caster) -> Faults:
    """Report a begin or end of the cast that the record does not cover."""
    begun, until, times = caster.cast_from, caster.cast_until, caster.plant.times
    span = f"the plant's history goes from {times[0]:g} s to {times[-1]:g} s"
    if begun is not None and not times[0] <= begun < times[-1]:
        yield "cast_from", f"({begun:g} s): {span}"
    elif begun is not None and caster.window[0] < begun:
        yield "start", f"({caster.window[0]:g} s): the cast begins at {begun:g} s, cast_from"
    if until is not None and not (times[0] if begun is None else begun) < until <= times[-1]:
        after = "" if begun is None else f", the cast begins at {begun:g} s"
        yield "cast_until", f"({until:g} s): {span}{after}"


@check("caster")
def _goes_with(case: Case, caster: Caster) -> Faults:
    """Report what cannot be combined with a caster, whose slices begin at the meniscus."""
    start = case.casting.start
    if case.verification is not None:
        yield "", "does not go with [verification]: a closed form is of one slice"
    if start is None:
        return
    if start.at != "meniscus" or start.profile is not None:
        yield "/casting.start", "slices of a caster begin at the meniscus, as poured; leave it out"
    elif start.time is not None:
        yield "/casting.start.time", "each slice of a caster has its own; leave it out"
