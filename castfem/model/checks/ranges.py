"""Compares the values of a case with their usual and possible ranges (`castfem.base.ranges`)."""

from __future__ import annotations

import math
import typing
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from castfem.base import ranges
from castfem.base.errors import Path, dotted, grouped
from castfem.base.quantities import Kind, Notation
from castfem.base.ranges import Bounds
from castfem.base.tables import ARGUMENTS, Table
from castfem.base.units import convert, format
from castfem.model.base import Faults, TableModel, Unreadable, Variants
from castfem.model.case import Case
from castfem.model.checks.registry import caution, check
from castfem.model.mechanics import Way


class Given(NamedTuple):
    """A number of a case, or a table of numbers."""

    path: Path  #: its dotted key
    value: float | Table  #: in SI
    kind: Kind  #: its unit
    bounds: Bounds  #: its usual and possible range

    @property
    def values(self) -> tuple[float, ...]:
        """Its numbers; those of a table in order."""
        return self.value.values if isinstance(self.value, Table) else (self.value,)

    def place(self, row: int) -> str:
        """Position of a row in its table, for a message."""
        if not isinstance(self.value, Table):
            return ""
        over = ARGUMENTS[self.value.over]
        at = convert(self.value.arguments[row], over.unit, over.shown)
        return f"at {at:g} {over.shown}: "


def _beyond(case: TableModel, text_of: Callable[[Given, float], str]) -> Faults:
    """Report the numbers for which `text_of` gives a text; of a table only the first."""
    for given in numbers(case):
        for row, value in enumerate(given.values):
            if text := text_of(given, value):
                yield dotted(given.path), given.place(row) + text
                break


@check()
def impossible(case: TableModel, _: object) -> Faults:
    """Report impossible values; of a faulty case only those that could be read."""
    yield from _beyond(case, lambda given, value: given.bounds.impossible(value, given.kind))


@caution()
def unusual(case: TableModel, _: object) -> Faults:
    """Report unusual values, which are probably mistakes."""
    yield from _beyond(case, _unusual)


@caution()
def _far(case: TableModel, _: object) -> Faults:
    """Report tables over position with rows beyond the strand, such as metres written for mm."""
    reach = ranges.RANGES["casting.length"]
    for given in numbers(case):
        table = given.value
        if not isinstance(table, Table) or table.over != "position":
            continue
        if text := reach.unusual(table.arguments[-1], ARGUMENTS["position"]):
            yield dotted(given.path), f"last position: {text}"


def _unusual(given: Given, value: float) -> str:
    text = given.bounds.unusual(value, given.kind)
    if text and given.path[-1] == "coefficient" and "friction" in given.path:
        near = f"; did you mean {0.01 * value:.3g}?" if 5.0 <= value <= 100.0 else ""
        return f"({value:g}) is more than {given.bounds.usual[1]:g} times the pressure{near}"
    absolute = given.kind.unit == "K" and not given.kind.difference
    if text and absolute and 0.0 < value < 200.0 and value.is_integer():
        # A whole number of kelvins this low was probably meant in degC.
        text = f"({value:g} K) is {convert(value, 'K', 'degC'):.4g} degC; did you mean "
        text += f'"{value:g} degC"?'
    return text


def numbers(table: TableModel, path: Path = (), key: str = "") -> Iterator[Given]:
    """Yield every number of a case that has a range; `table` is at `path`."""
    for name in type(table).model_fields:
        yield from _below(table, getattr(table, name), (*path, name), key)
    if path == ("machine",):
        yield from _rolls(getattr(table, "rolls", None))


def _below(table: TableModel, value: Any, path: Path, key: str) -> Iterator[Given]:
    """Yield the numbers below a value of a table, whose own key is `key`."""
    name = str(path[-1])
    own = f"{key}.{name}" if key else name
    if isinstance(value, TableModel):
        yield from numbers(value, path, own)
    elif isinstance(value, tuple):
        for index, entry in enumerate(value):
            if isinstance(entry, TableModel):
                yield from numbers(entry, (*path, index), own)
            elif isinstance(entry, float) and (bounds := ranges.of(own)) is not None:
                yield Given((*path, index), entry, _kind(type(table), name), bounds)
    elif isinstance(value, float | Table):
        tag = f"{key}.{table.tag}.{name}" if isinstance(table, Variants) else own
        if (bounds := ranges.of(tag) or ranges.of(own)) is not None:
            yield Given(path, value, _kind(type(table), name), bounds)


def _rolls(rolls: Any) -> Iterator[Given]:
    if rolls is None or isinstance(rolls, Unreadable):
        return
    from castfem.physics.machine.roll_table import KINDS

    path = ("machine", "rolls")
    narrow = () if rolls.edges is None else rolls.edges.pairs
    for pair in (*rolls.pairs, *narrow):
        for key, kind in KINDS.items():
            bounds, value = ranges.of(f"machine.rolls.{key}"), getattr(pair, key)
            if value is not None and math.isfinite(value) and bounds is not None:
                yield Given(path, value, kind, bounds)


def _kind(model: type[TableModel], name: str) -> Kind:
    field = model.model_fields[name]
    return next(_kinds([field.annotation, *field.metadata]))


def _kinds(annotations: typing.Iterable[Any]) -> Iterator[Kind]:
    """Yield the kinds of quantity in annotations, at any depth."""
    for one in annotations:
        if isinstance(one, Notation):
            yield from () if one.quantity is None else (one.quantity,)
        else:
            yield from _kinds([*typing.get_args(one), *getattr(one, "__metadata__", ())])


class Steps(NamedTuple):
    """Cost of steps of one kind."""

    what: str  #: name of the steps
    most: int  #: largest number that is run; the cheapest of them take hours
    much: int  #: number above which a warning is given: about an hour
    each: float  #: work of one step on an ordinary mesh, s, for a first estimate


_THERMAL = Steps("thermal steps", 1_000_000, 100_000, 0.01)
_WINDOWS = Steps("coupling windows", 1_000_000, 36_000, 0.1)
_MECHANICAL = _WINDOWS._replace(what="mechanical steps")
_STATES = Steps("states of the fields", 50_000, 5_000, 0.01)


class Demand(NamedTuple):
    """The steps of one kind that a case needs."""

    key: str  #: key of the step length
    length: float  #: length of one step, s
    steps: Steps  #: their kind
    share: float = 1.0  #: share of the followed length on which these steps are taken

    def number(self, case: Case) -> float:
        """Return the number of steps of the run."""
        return self.share * case.casting.duration / self.length

    def fault(self, count: float, rest: str) -> tuple[str, str]:
        """Return the key and message: the number of steps, followed by `rest`."""
        return (
            self.key,
            f"({format(self.length, 's', 's')}) makes {grouped(count)} {self.steps.what}{rest}",
        )


@check()
def too_many(case: Case, _: object) -> Faults:
    """Report more steps than a run could ever finish.

    If the strand itself is implausibly slow or long, only that is reported, once.
    """
    demands = [(demand, demand.number(case)) for demand in _demands(case)]
    demands = [(demand, count) for demand, count in demands if count > demand.steps.most]
    length, time = case.casting.length, case.casting.duration
    found = []
    if demands and length > 1e4:  # m
        found = [("casting.length", f"({length:.4g} m) is no strand's: give a shorter one")]
    elif demands and length < 0.01 / 60.0 * time:  # 0.01 m/min
        speed = f"({60.0 * length / time:.4g} m/min) takes {_duration(time)} for {length:.4g} m"
        found = [("casting.speed", f"{speed}: give a higher one")]
    for demand, count in demands if not found else ():
        most = f"at most {grouped(demand.steps.most)}: give a longer one"
        found.append(demand.fault(count, f" of the {time:.4g} s that are followed; {most}"))
    known = {key for key, _ in impossible(case, case)}
    yield from (fault for fault in found if fault[0] not in known)


@caution()
def many(case: Case, _: object) -> Faults:
    """Report the steps of a sound case that take long, with a first estimate of the time."""
    for demand in _demands(case):
        if (count := demand.number(case)) > demand.steps.much:
            yield demand.fault(count, f"; {_takes(count, demand.steps)}")


@caution()
def _long_tables(case: Case, _: object) -> Faults:
    """Report tables over time or position with so many rows that their steps take long."""
    what, steps = ("steps", _THERMAL)
    if case.mechanics is not None:
        what, steps = (_WINDOWS.what, _WINDOWS)
    for given in numbers(case):
        table = given.value
        if not isinstance(table, Table) or table.over not in ("time", "position"):
            continue
        if (count := _rows_of_the_run(case, table)) > 1_000:
            text = f"has {grouped(count)} rows in the run, each of which ends one of the {what}"
            text += f"; {_takes(count, steps)}"
            yield dotted(given.path), f"{text}: fewer rows do"


def _rows_of_the_run(case: Case, table: Table) -> int:
    """Number of rows of a table over time or position that lie within the run.

    Time counts from the meniscus or by the clock of the caster, whichever includes more rows.
    """

    def within(start: float, end: float) -> int:
        return bisect_left(table.arguments, end) - bisect_right(table.arguments, start)

    if table.over == "position":
        return within(0.0, case.casting.length)
    end = case.casting.duration
    return max(within(start, start + end) for start in {0.0, case.casting.clock})


def _demands(case: Case) -> Iterator[Demand]:
    """Yield each step length that is given and valid."""
    if math.isinf(case.casting.duration):
        return
    time, coupling, output = case.thermal.time, case.coupling, case.output
    end = case.mechanics_end()
    share = 1.0 if end is None else end / case.casting.length
    found: list[tuple[str, Any, Steps]] = [
        ("thermal.time.step", time.step, _THERMAL),
        ("thermal.time.adaptive.largest", time.adaptive and time.adaptive.largest, _THERMAL),
    ]
    if case.mechanics is not None:
        window = coupling.interval
        if isinstance(window, Way):
            window = window.length / case.casting.length * case.casting.duration
        found.append(("coupling.interval", window, _WINDOWS))
        found.append(("coupling.mechanical_step", coupling.mechanical_step, _MECHANICAL))
    if output.fields != ():
        found.append(("output.every", output.every, _STATES))
    for key, length, steps in found:
        if isinstance(length, float):
            part = share if key.startswith("coupling.") else 1.0
            yield Demand(key, length, steps, part)


def _takes(count: float, steps: Steps) -> str:
    """Return how long this number of steps takes, as a first estimate."""
    return f"at some {1e3 * steps.each:.0f} ms each that takes {_duration(count * steps.each)}"


def _duration(seconds: float) -> str:
    """Return a duration as text."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 60.0:.2g} min"
