"""Units in which numbers are shown: plant units, SI, or a choice of the user.

Results are computed in SI and written to files in the units given in docs/output.md. Everything
shown to a person (tables, figures, the report) is converted by the choice made here:

    with shown_in(ShownUnits.read("si")):
        scale = scale_of("mm", "shell_mid_face")
        scale(4.75), scale.unit          # 0.00475, "m"

The outermost choice holds: inside another `shown_in` it changes nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from castfem.base import units
from castfem.base.quantities import Notation

SYSTEMS = ("plant", "si")
KINDS: Mapping[str, str] = {
    "temperature": "K",
    "length": "m",
    "time": "s",
    "speed": "m/s",
    "stress": "Pa",
    "force": "N",
    "force_per_length": "N/m",
    "moment": "N m",
    "heat": "J",
    "heat_per_length": "J/m",
    "power": "W",
    "power_per_length": "W/m",
    "heat_flux": "W/m^2",
    "rate": "1/s",
    "curvature": "1/m",
    "volume_flow": "m^3/s",
}
"""Physical quantities with their SI unit; pressure is a stress."""
_NONE = ("-", "", "1", "percent", "%")
_DIFFERENCE = "delta_"  # prefix of the unit of a temperature difference
_IN_WORDS = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?) (mm|m|degC|MPa)(?![\w/])")
_PLACE = re.compile(r"x = (\S+), y = (\S+) mm")
_FAR, _BELOW = 10.0, "below the meniscus"
_PREFIXED = re.compile(r"[kMGmu]?((?:N|J|W|Pa|m|s|K)(?:[ /^].*)?)")


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion of a value to the shown one: factor * value - zero, with its unit."""

    unit: str  #: shown unit
    factor: float = 1.0  #: factor on the value in its documented unit
    zero: float = 0.0  #: offset that is subtracted

    def __call__(self, value: Any) -> Any:
        """Convert a value, or an array of them."""
        return self.factor * value - self.zero

    def back(self, shown: Any) -> Any:
        """Inverse conversion."""
        return (shown + self.zero) / self.factor


@dataclass(frozen=True, slots=True)
class ShownUnits:
    """A choice of units."""

    system: str = "plant"  #: "plant" for the documented units (mm, degC, MPa ...), or "si"
    #: units of physical quantities (`KINDS`) and of results by name, which take precedence; a name
    #: without its probe (shell) holds at all probes
    own: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, given: object) -> ShownUnits:
        """Read "plant", "si", or a table of units by quantity or name, also with the key `system`.

        Raises:
            ValueError: It is none of these, or a unit has another dimension.
        """
        if isinstance(given, ShownUnits):
            return given
        table = {"system": given} if isinstance(given, str) else given
        if not isinstance(table, Mapping):
            raise ValueError('"plant", "si", or a table such as {temperature = "degF"} is needed')
        system = table.get("system", "plant")
        if system not in SYSTEMS:
            near = units.nearest(str(system), SYSTEMS)
            raise ValueError(f'"{system}" is not a system of units; use "plant" or "si"{near}')
        own = {str(key): unit for key, unit in table.items() if key != "system"}
        for key, unit in own.items():
            if not isinstance(unit, str):
                raise ValueError(f"{key}: the name of a unit is needed (given: {unit!r})")
            if key in KINDS:
                check(key, KINDS[key], unit)
        return cls(str(system), own)

    @property
    def written(self) -> str | dict[str, str]:
        """Return the choice in the form that `read` takes."""
        return {"system": self.system, **self.own} if self.own else self.system

    @property
    def names(self) -> tuple[str, ...]:
        """Names of results with a unit of their own."""
        return tuple(key for key in self.own if key not in KINDS)

    def of(self, usual: str, name: str = "") -> str:
        """The unit in which a quantity is shown.

        Args:
            usual: Its documented unit. "K" is a temperature difference, as temperatures are in
                degC.
            name: Name of the quantity, if it has one.
        """
        if (self.system == "plant" and not self.own) or usual in _NONE:
            return usual
        if coherent(usual) == "K" and usual.endswith("K"):
            absolute = self.of("degC", name)
            return usual if absolute == "degC" else difference_of(absolute)
        parts = name.split("_")
        for count in range(len(parts), 0, -1):
            unit = self.own.get("_".join(parts[:count]))
            if unit is not None and _measures(unit, usual):
                return unit
        kind = next((k for k, si in KINDS.items() if si == coherent(usual)), "")
        usual = coherent(usual) if self.system == "si" else usual
        return self.own.get(kind, usual)


class UnitsNotation(Notation):
    """Notation of a choice of units in a case file."""

    __slots__ = ()
    takes = '`"plant"`, `"si"`, or a table of units'

    def read(self, given: object) -> ShownUnits:
        """Return the choice, or raise ValueError."""
        return ShownUnits.read(given)

    def write(self, value: ShownUnits) -> str | dict[str, str]:
        """Return the choice in the form that `read` takes."""
        return value.written

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        system = {"enum": list(SYSTEMS), "type": "string"}
        return {
            "anyOf": [
                system,
                {
                    "type": "object",
                    "properties": {"system": system} | {k: {"type": "string"} for k in KINDS},
                    "additionalProperties": {"type": "string"},
                },
            ]
        }


_chosen: ContextVar[ShownUnits | None] = ContextVar("shown_units", default=None)


@contextmanager
def shown_in(choice: ShownUnits) -> Iterator[None]:
    """Show numbers in these units inside the block, unless an outer block has made a choice."""
    if _chosen.get() is not None:
        yield
        return
    token = _chosen.set(choice)
    try:
        yield
    finally:
        _chosen.reset(token)


def is_chosen() -> bool:
    """Whether any number is shown in another unit than its documented one."""
    choice = _chosen.get()
    return choice is not None and (choice.system != "plant" or bool(choice.own))


def scale_of(usual: str, name: str = "") -> Scale:
    """Return the conversion from the documented unit to the shown one; arguments as for `of`."""
    choice = _chosen.get()
    unit = usual if choice is None else choice.of(usual, name)
    return Scale(usual) if unit == usual else _scale(usual, unit)


def said(value: float, unit: str, digits: str, name: str = "") -> str:
    """Format a value in its documented unit as text: number and unit.

    Args:
        value: The value.
        unit: Its documented unit.
        digits: Its format in that unit (".1f"); in another unit it has four digits. Numbers below a
            million have no exponent.
        name: Name of the quantity.
    """
    scale = scale_of(unit, name)
    digits = digits if scale.unit == unit else ("+" if digits.startswith("+") else "") + ".4g"
    number = f"{scale(value):{digits}}"
    if "e+" in number and abs(scale(value)) < 1e6:
        number = f"{float(number):.0f}"
    return f"{number} {plain_unit(scale.unit)}"


def place_said(position: float, *, near: str = ".6g", far: str = ".4g", beyond: float = 2.0) -> str:
    """A position below the meniscus [m] as text: in mm, above a limit in m."""
    if position > beyond:
        return said(position, "m", far, "position")
    return said(1e3 * position, "mm", near, "position")


def below_meniscus(position: float, digits: str = ".4g") -> str:
    """A position [m] for labels and messages, in documented units: mm, from 10 m on m."""
    near = position < _FAR
    return f"{1e3 * position if near else position:{digits}} {'mm' if near else 'm'} {_BELOW}"


def label_shown(label: str) -> str:
    """The label of a result, with places and temperatures in it in the chosen units."""
    if not is_chosen():
        return label.replace(" degC", " °C")
    label = _PLACE.sub(r"x = \1 mm, y = \2 mm", label)
    return _IN_WORDS.sub(lambda found: said(float(found[1]), found[2], ".6g"), label)


def plain_unit(unit: str) -> str:
    """A unit as written in figures."""
    return (
        unit.removeprefix(_DIFFERENCE)
        .replace("degC", "°C")
        .replace("degF", "°F")
        .replace("^2", "²")
        .replace("^3", "³")
        .replace("um", "µm")
        .replace("percent", "%")
    )


def documented(plain: str) -> str:
    """Inverse of `plain_unit`."""
    for written, meant in (("°", "deg"), ("²", "^2"), ("³", "^3"), ("µ", "u"), ("%", "percent")):
        plain = plain.replace(written, meant)
    return plain


def difference_of(unit: str) -> str:
    """Unit of the difference of two values: K for K and degC."""
    if unit in ("degC", "K"):
        return "K"
    return f"{_DIFFERENCE}{unit}" if unit.startswith("deg") and _measures(unit, "K") else unit


def check(what: str, si: str, unit: str) -> None:
    """Refuse a unit of another dimension."""
    try:
        units.convert(1.0, si, unit)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None


@lru_cache(maxsize=256)
def coherent(unit: str) -> str:
    """The usual SI unit of the same dimension: "N" for kN, "N m" for kN m, "1" for none."""
    if unit in _NONE:
        return "1"
    found = _PREFIXED.fullmatch(unit)
    if found is not None and units.parse_any(f"1 {found[1]}")[0] == 1.0:
        return found[1]
    return units.parse_any(f"1 {unit}")[1]


@lru_cache(maxsize=256)
def _measures(unit: str, usual: str) -> bool:
    try:
        units.convert(1.0, coherent(usual), unit)
    except ValueError:
        return False
    return True


@lru_cache(maxsize=256)
def _scale(usual: str, unit: str) -> Scale:
    if coherent(usual) == "K" and usual.endswith("K"):
        size = units.convert(1.0, "K", unit, difference=True)
        return Scale(unit, size / units.convert(1.0, "K", usual, difference=True))
    si = coherent(usual)
    (before, start), (after, zero) = (units.factor_and_zero(si, one) for one in (usual, unit))
    return Scale(unit, after / before, zero - after * start / before)
