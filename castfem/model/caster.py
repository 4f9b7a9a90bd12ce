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
from typing import Annotated, Any

from pydantic import Field

from castfem.base.constants import ROUNDING
from castfem.base.named_columns import Columns
from castfem.base.quantities import Kind, Length, Notation, Time
from castfem.base.tables import ARGUMENTS, Table
from castfem.model.base import TableModel
from castfem.model.mechanics import Way, WindowMark
from castfem.model.probe import Pyrometer

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
