"""The values of a case against what they usually are and can be (`castfem.base.ranges`)."""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from castfem.base import ranges
from castfem.base.messages import Path, dotted
from castfem.base.quantities import Kind
from castfem.base.ranges import Bounds
from castfem.base.table_notation import Curve
from castfem.base.tables import ARGUMENTS, Table
from castfem.base.units import convert, format
from castfem.model.base import TableModel, Unreadable
from castfem.model.checks import Faults, caution, check
from castfem.model.variants import Variants

_COLDEST = 200.0  # K; what is colder was mostly meant in degC


class Given(NamedTuple):
    """A number of a case, or a table of them.

    Attributes:
        path: Where it stands.
        value: In SI.
        kind: Its unit.
        bounds: What it usually is, and can be.
    """

    path: Path
    value: float | Table
    kind: Kind
    bounds: Bounds

    def rows(self) -> Iterator[tuple[str, float]]:
        """Yield its values, each with where it stands in a table."""
        if not isinstance(self.value, Table):
            yield "", self.value
            return
        over = ARGUMENTS[self.value.over]
        for at, value in zip(self.value.arguments, self.value.values, strict=True):
            yield f"at {convert(at, over.unit, over.shown):g} {over.shown}: ", value


def _beyond(case: TableModel, text_of: Callable[[Given, float], str]) -> Faults:
    """Yield the numbers for which there is a text; of a table the first."""
    for given in numbers(case):
        for where, value in given.rows():
            if text := text_of(given, value):
                yield dotted(given.path), where + text
                break


@check()
def impossible(case: TableModel, _: object) -> Faults:
    """Yield the values that cannot be, of a faulty case those that are sound in form."""
    yield from _beyond(case, lambda given, value: given.bounds.impossible(value, given.kind))


@caution()
def unusual(case: TableModel, _: object) -> Faults:
    """Yield the values that were probably not meant."""
    yield from _beyond(case, _unusual)


def _unusual(given: Given, value: float) -> str:
    text = given.bounds.unusual(value, given.kind)
    if text and given.path[-1] == "coefficient" and "friction" in given.path:
        near = f"; did you mean {0.01 * value:.3g}?" if 5.0 <= value <= 100.0 else ""
        return f"({value:g}) is more than {given.bounds.usual[1]:g} times the pressure{near}"
    if text and given.kind.unit == "K" and not given.kind.difference and value < _COLDEST:
        written = format(value, "K", "K").removesuffix(" K")
        text = f"({written} K) is {convert(value, 'K', 'degC'):.4g} degC; did you mean "
        text += f'"{written} degC"?'
    return text


def numbers(table: TableModel, path: Path = (), key: str = "") -> Iterator[Given]:
    """Yield every number of a case that has bounds, `table` being that at `path`."""
    for name in type(table).model_fields:
        yield from _below(table, getattr(table, name), (*path, name), key)
    if path == ("machine",):
        yield from _rolls(getattr(table, "rolls", None))


def _below(table: TableModel, value: Any, path: Path, key: str) -> Iterator[Given]:
    """Yield those of a value of a table, the table's own key being `key`."""
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
    """Yield the numbers of a table of rolls."""
    if rolls is None or isinstance(rolls, Unreadable):
        return
    from castfem.physics.machine.rolls import KINDS

    path = ("machine", "rolls")
    for pair in rolls.pairs:
        for key, kind in KINDS.items():
            bounds, value = ranges.of(f"machine.rolls.{key}"), getattr(pair, key)
            if value is not None and math.isfinite(value) and bounds is not None:
                yield Given(path, value, kind, bounds)


def _kind(model: type[TableModel], name: str) -> Kind:
    """Return the unit of a key."""
    field = model.model_fields[name]
    return next(_kinds([field.annotation, *field.metadata]))


def _kinds(annotations: typing.Iterable[Any]) -> Iterator[Kind]:
    """Yield the kinds of quantity in annotations, at any depth."""
    for one in annotations:
        if isinstance(one, Curve):
            yield one.kind
        elif isinstance(one, Kind):
            yield one
        else:
            yield from _kinds([*typing.get_args(one), *getattr(one, "__metadata__", ())])
