"""Notation of a taper: one value, segments, a parabola or a table; for all faces or by face."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from castfem.base.constants import ROUNDING
from castfem.base.quantities import Kind, Notation
from castfem.base.table_notation import Curve
from castfem.base.tables import Table
from castfem.base.units import nearest
from castfem.physics.mould.taper import Displaced, Taper, TaperProfile, TaperSegment

TAPER = Kind("1/m", "%/m", label="taper", sample="1 %/m")
_SLOPE = re.compile(r"[-+]?(\d+\.?\d*|\.\d+) *mm */ *m")  # as some mould makers write it
_END = Kind("m", "mm", above=0.0)
_CLOSING = Curve(Kind("m", "mm", label="displacement", sample="0.5 mm"), over="position")
_FORMS = (
    '"1 %/m", segments [{ to = "300 mm", taper = "2 %/m" }, { taper = "1 %/m" }], a parabola '
    '{ top = "2 %/m", exit = "0.4 %/m" }, or a table over position of how far the wall has moved in'
)


@dataclass(frozen=True, slots=True)
class Given:
    """A taper as given; `castfem.physics.mould.taper` defines it."""

    segments: tuple[TaperSegment, ...] = ()  #: in casting order; the last one may have no end
    closing: Table | None = None  #: displacement of the wall over position instead of segments

    def profile(self, length: float) -> TaperProfile:
        """Return the profile along a mould of this length, m.

        Raises:
            ValueError: The segments do not fill the mould, or close it completely.
        """
        if self.closing is not None:
            return Displaced(self.closing)
        *before, last = self.segments
        end = length if last.end is None else last.end
        inner = before[-1].end if before else 0.0
        assert inner is not None
        if inner >= length:
            raise ValueError(
                f"a segment of the taper ends {1e3 * inner:g} mm below the meniscus, where the "
                f"mould has ended ({1e3 * length:g} mm)"
            )
        if abs(end - length) > ROUNDING * length:
            raise ValueError(
                f"the last segment of the taper ends {1e3 * end:g} mm below the meniscus, the "
                f"mould {1e3 * length:g} mm; leave out its 'to'"
            )
        return Taper((*before, TaperSegment(length, last.top, last.bottom)))


@dataclass(frozen=True, slots=True)
class Perimeter:
    """Tapers around the section; None for those not given."""

    face: Given | None = None  #: of all faces (for a round, of its wall)
    narrow_face: Given | None = None  #: of the narrow faces, which sets the width
    wide_face: Given | None = None  #: of the wide faces, which sets the height
    corner: Given | None = None  #: of the section at its corners; without it the faces stay plane

    @property
    def parts(self) -> dict[str, Given]:
        """The given tapers, by key."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: taper for name, taper in found.items() if taper is not None}


PARTS = tuple(f.name for f in fields(Perimeter))
"""Keys of a taper given by face or corner."""


@dataclass(frozen=True, slots=True)
class TaperMark(Notation):
    """Annotation of a field that takes a taper."""

    takes: str = 'taper: `"1 %/m"`, or segments, a parabola, a table over position'

    def read(self, given: object) -> Perimeter:
        """Return the tapers, or raise ValueError."""
        if isinstance(given, Perimeter):
            return given
        if isinstance(given, Mapping) and set(given) & set(PARTS):
            for key in given:
                if key not in PARTS:
                    raise ValueError(
                        f"unknown key '{key}' beside {', '.join(k for k in given if k in PARTS)}; "
                        f"allowed: {', '.join(PARTS)}{nearest(str(key), PARTS)}"
                    )
            return Perimeter(**{key: _named(key, value) for key, value in given.items()})
        return Perimeter(face=_read(given))

    def write(self, value: Perimeter) -> Any:
        """Return what reads back to the same tapers."""
        parts = {key: _write(given) for key, given in value.parts.items()}
        return parts["face"] if list(parts) == ["face"] else parts

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        value, end = TAPER.json_schema(), _END.json_schema()
        parabola = {"top": value, "exit": value}
        segment = _object({"to": end, "taper": value, **parabola})
        one = [
            value,
            {"type": "array", "items": segment, "minItems": 1},
            _object(parabola, required=["top", "exit"]),
            *_CLOSING.json_schema()["anyOf"][1:],
        ]
        parts = _object({key: {"anyOf": one} for key in PARTS})
        return {
            "anyOf": [*one, parts],
            "description": "taper of the mould, as [Pascon2003] (300) defines it",
        }


def _object(properties: dict[str, Any], required: Sequence[str] = ()) -> dict[str, Any]:
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**found, "required": list(required)} if required else found


def _named(key: str, given: object) -> Given:
    try:
        return _read(given)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def _read(given: object) -> Given:
    if isinstance(given, Given):
        return given
    if isinstance(given, str):
        value = _value(given)
        return Given((TaperSegment(None, value, value),))
    if isinstance(given, Mapping):
        if set(given) & {"position", "file", "value"}:
            table = _CLOSING.read(given)
            assert isinstance(table, Table)
            return Given(closing=table)
        return Given((_segment(given, ("top", "exit"), ends=False),))
    if isinstance(given, Sequence) and given:
        return Given(_segments(given))
    raise ValueError(f"a taper is needed: {_FORMS}")


def _segments(given: Sequence[Any]) -> tuple[TaperSegment, ...]:
    found: list[TaperSegment] = []
    for number, entry in enumerate(given, start=1):
        try:
            if not isinstance(entry, Mapping):
                raise ValueError('must be a table such as { to = "300 mm", taper = "2 %/m" }')
            keys = ("taper",) if "taper" in entry else ("top", "exit")
            segment = _segment(entry, keys, ends=True)
            above = found[-1].end if found else 0.0
            if segment.end is None and number < len(given):
                raise ValueError("'to' is missing; only the last segment may leave it out")
            if segment.end is not None and above is not None and segment.end <= above:
                raise ValueError(
                    f"'to' ({1e3 * segment.end:g} mm) does not lie beyond the end of the "
                    f"previous segment ({1e3 * above:g} mm)"
                )
        except ValueError as error:
            raise ValueError(f"segment {number}: {error}") from None
        found.append(segment)
    return tuple(found)


def _segment(given: Mapping[str, Any], keys: tuple[str, ...], *, ends: bool) -> TaperSegment:
    """Read one segment: `keys` name its single taper, or those at its top and exit."""
    allowed = (*(("to",) if ends else ()), *keys)
    for key in given:
        if key not in allowed:
            known = ("to", "taper", "top", "exit") if ends else (*keys, *PARTS, "position", "file")
            raise ValueError(f"unknown key '{key}'{nearest(str(key), known)}; a taper is {_FORMS}")
    values = []
    for key in keys:
        if key not in given:
            raise ValueError(f"'{key}' is missing; a taper is {_FORMS}")
        try:
            values.append(_value(given[key]))
        except ValueError as error:
            raise ValueError(f"{key}: {error}") from None
    try:
        end = _END.read(given["to"]) if "to" in given else None
    except ValueError as error:
        raise ValueError(f"to: {error}") from None
    return TaperSegment(end, values[0], values[-1])


def _value(given: object) -> float:
    """Return a taper, 1/m; values far beyond a few percent per metre are refused as mistakes."""
    if slope := _SLOPE.fullmatch(str(given)):
        size = f"{abs(float(slope[1])) * 100.0:g} mm"
        raise ValueError(
            "write it in percent of the section's size per metre: "
            f"{slope[1]} mm/m is 1 %/m of a section of {size}"
        )
    value = TAPER.read(given)
    if abs(value) > 0.5:
        fix = "allowed: at most 50 %/m either way"
        raise ValueError(f"is {100.0 * value:g} %/m; {fix}")
    return value


def _write(given: Given) -> Any:
    if given.closing is not None:
        return _CLOSING.write(given.closing)
    if len(given.segments) == 1 and given.segments[0].end is None:
        entry = _entry(given.segments[0])
        return entry.get("taper", entry)
    return [_entry(segment) for segment in given.segments]


def _entry(segment: TaperSegment) -> dict[str, Any]:
    end = {} if segment.end is None else {"to": _END.write(segment.end)}
    if segment.top == segment.bottom:
        return {**end, "taper": TAPER.write(segment.top)}
    return {**end, "top": TAPER.write(segment.top), "exit": TAPER.write(segment.bottom)}
