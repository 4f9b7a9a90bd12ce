"""Physical quantities as types of pydantic models: `Length`, `Speed`, `Temperature` ...

A field of such a type is a float in SI. It is read from a text with unit, checked for dimension and
bounds, and written back with its unit by `model_dump(mode="json")`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

from castfem.base import units

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic_core import CoreSchema


class Notation(ABC):
    """Notation of a value in a file, as an annotation of the fields of pydantic models.

    A model reads it in SI; `model_dump(mode="json")` writes what reads back to the same value.

    Attributes:
        takes: Description of valid input for the reference page.
    """

    __slots__ = ()
    takes = ""

    @property
    def quantity(self) -> Kind | None:
        """The physical quantity of the value; None if it has none, or several."""
        return None

    @abstractmethod
    def read(self, given: object) -> Any:
        """Return the value in SI, or raise ValueError."""

    @abstractmethod
    def write(self, value: Any) -> Any:
        """Return what `read` reads back to the same value."""

    @abstractmethod
    def json_schema(self) -> dict[str, Any]:
        """Return the JSON schema of the written value."""

    def described(self, example: object = None) -> str:
        """Return the description of valid input for the reference page, with an example."""
        return self.takes

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return self.json_schema()

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.write, when_used="json"
            ),
        )


@dataclass(frozen=True, slots=True)
class NameOf(Notation):
    """Annotation of a field that takes a name from a register, which may grow."""

    register: Mapping[str, Any] = field(hash=False)  #: names and their objects

    def read(self, given: object) -> str:
        """Return the name, or raise the error of an invalid literal."""
        if isinstance(given, str) and given in self.register:
            return given
        from pydantic_core import PydanticKnownError

        *others, last = (f"'{name}'" for name in self.register)
        expected = f"{', '.join(others)} or {last}" if others else last
        raise PydanticKnownError("literal_error", {"expected": expected})

    def write(self, value: str) -> str:
        """Return the name."""
        return value

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        return {"enum": list(self.register), "type": "string"}

    def described(self, example: object = None) -> str:
        """See `Notation.described`."""
        return ", ".join(f'`"{name}"`' for name in self.register)


@dataclass(frozen=True, slots=True)
class Kind(Notation):
    """A physical quantity as pydantic annotation: `Annotated[float, Kind("m", "mm")]`."""

    unit: str  #: SI unit of the value
    shown: str = ""  #: unit in which it is written back
    difference: bool = False  #: a difference of temperatures
    above: float | None = None  #: the value must be larger, in SI
    least: float | None = None  #: the value must be at least this, in SI
    most: float | None = None  #: the value must be at most this, in SI

    label: str = ""  #: name of the quantity, if the unit alone is not enough
    sample: str = ""  #: example of a value, if the unit alone is not enough

    @property
    def quantity(self) -> Kind:
        """See `Notation`: the kind itself."""
        return self

    @property
    def name(self) -> str:
        """Name of the quantity, such as "length"."""
        return self.label or units.describe(self.unit, self.difference)[0]

    @property
    def example(self) -> str:
        """Example of a value as a user may write it."""
        return self.sample or units.describe(self.unit, self.difference)[1]

    def read(self, given: object) -> float:
        """Return the value in SI, or raise ValueError (unit, dimension, bounds)."""
        kind = (self.label, self.sample) if self.label else None
        return self.bounded(units.parse(given, self.unit, difference=self.difference, kind=kind))

    def bounded(self, value: float) -> float:
        """Return the SI value if it is within the bounds; otherwise raise ValueError."""
        if self.above is not None and not value > self.above:
            raise ValueError(f"must be above {self._text(self.above)}")
        if self.least is not None and value < self.least:
            raise ValueError(f"must not be below {self._text(self.least)}")
        if self.most is not None and value > self.most:
            raise ValueError(f"must not be above {self._text(self.most)}")
        return value

    def write(self, value: float) -> str | float:
        """Return the text that reads back to the same value; a plain number stays a number."""
        if self.unit == "1":
            return value
        return units.format(value, self.unit, self.shown, difference=self.difference)

    def number(self, value: float) -> float:
        """Return an SI value in the unit in which it is shown."""
        if self.unit == "1":
            return value
        return units.convert(value, self.unit, self.shown or self.unit, difference=self.difference)

    @property
    def suffix(self) -> str:
        """Unit after that number, with a blank before it; "" without one."""
        return "" if self.unit == "1" else f" {self.shown or self.unit}"

    def _text(self, bound: float) -> str:
        if self.unit == "1":
            percent = self.shown == "percent" and bound
            return f"{bound:g}" + (f" ({100.0 * bound:g} percent)" if percent else "")
        return f"{round(self.number(bound), 9) + 0.0:g}{self.suffix}"

    def json_schema(self) -> dict[str, Any]:
        """Return the JSON schema of the text (or number) that a user may write."""
        text = {
            "type": "string",
            "pattern": r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*\S.*$",
            "examples": [self.example],
            "description": f'{self.name} with its unit, such as "{self.example}"',
        }
        if self.unit != "1":
            return text
        number: dict[str, Any] = {"type": "number"}
        if self.above is not None:
            number["exclusiveMinimum"] = self.above
        if self.least is not None:
            number["minimum"] = self.least
        if self.most is not None:
            number["maximum"] = self.most
        percent = {
            "type": "string",
            "pattern": r"^\s*[+-]?[\d.]+([eE][+-]?\d+)?\s*(%|percent|ppm)?\s*$",
        }
        return {"anyOf": [number, percent], "description": self.name}

    def described(self, example: object = None) -> str:
        """See `Notation.described`."""
        single = None if isinstance(example, Mapping) else example  # of a table in a file
        text = str(single or self.example)
        return f"{self.name}: `{text}`" if self.unit == "1" else f'{self.name}: `"{text}"`'


@dataclass(frozen=True, slots=True)
class OrWord(Notation):
    """Annotation of a field that takes a quantity, a table of it, or one of some words."""

    inner: Notation  #: notation of the quantity
    words: Collection[str] = field(hash=False)  #: the words; a register of them may grow
    called: str = ""  #: what the words stand for, if there are several

    @property
    def quantity(self) -> Kind | None:
        """See `Notation`."""
        return self.inner.quantity

    def read(self, given: object) -> Any:
        """Return the word or the quantity; raise ValueError if it is neither."""
        if isinstance(given, str) and given in self.words:
            return given
        try:
            return self.inner.read(given)
        except ValueError as error:
            if isinstance(given, Mapping):
                raise
            names = ", ".join(self.words if self.called else (f'"{word}"' for word in self.words))
            near = units.nearest(given, self.words) if isinstance(given, str) else ""
            raise ValueError(f"{error}; or {self.called}{names}{near}") from None

    def write(self, value: Any) -> Any:
        """Return what reads back to the same value."""
        return value if isinstance(value, str) else self.inner.write(value)

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        found, words = self.inner.json_schema(), list(self.words)
        of_words: dict[str, Any] = {"enum": words} if self.called else {"const": words[0]}
        if (others := found.pop("anyOf", None)) is None:
            return {"anyOf": [of_words, found]}
        return {"anyOf": [of_words, *others], **found}

    def described(self, example: object = None) -> str:
        """See `Notation.described`."""
        words = ", ".join(f'`"{word}"`' for word in self.words)
        return f"{self.inner.described(None if example in self.words else example)}, or {words}"


@dataclass(frozen=True, slots=True)
class WaterKind(Kind):
    """Water on a surface, kg/(m2 s); may be given as a volume, at 1 kg per litre."""

    def read(self, given: object) -> float:
        """Return the flow in kg/(m2 s), or raise ValueError."""
        kind = (self.label, self.sample)
        try:
            return self.bounded(1e3 * units.parse(given, "m/s", kind=kind))
        except ValueError as volume:
            try:
                mass = units.parse(given, self.unit, kind=kind)
            except ValueError:
                raise volume from None
            return self.bounded(mass)

    def number(self, value: float) -> float:
        """See `Kind.number`; a litre is a kilogram."""
        return value

    def write(self, value: float) -> str:
        """Return the text that reads back to the same value."""
        litres = f"{value:.12g} {self.shown}"
        return litres if self.read(litres) == value else f"{value!r} {self.unit}"


@dataclass(frozen=True, slots=True)
class PercentKind(Kind):
    """A share in per cent: a plain number, `0.18`, or with a sign, `"0.18 %"`."""

    def read(self, given: object) -> float:
        """Return the percentage, or raise ValueError."""
        share = units.parse(given, "1", kind=(self.label, self.sample))
        signed = isinstance(given, str) and units.split(given)[1]
        return self.bounded(100.0 * share if signed else share)


Length = Annotated[float, Kind("m", "mm", above=0.0)]
Distance = Annotated[float, Kind("m", "mm", least=0.0)]
Speed = Annotated[float, Kind("m/s", "m/min", above=0.0)]
WaterFlow = Annotated[
    float,
    WaterKind(
        "kg/(m^2 s)", "L/(m^2 s)", least=0.0, label="water flow per area", sample="5 L/(m^2 s)"
    ),
]
Time = Annotated[float, Kind("s", "s", above=0.0)]
Temperature = Annotated[float, Kind("K", "degC")]
# Temperatures of liquid water at atmospheric pressure.
WaterTemperature = Annotated[
    float,
    Kind("K", "degC", least=273.15, most=373.15, label="temperature of water", sample="25 degC"),
]
PositiveDifference = Annotated[float, Kind("K", "K", difference=True, above=0.0)]
HeatTransferCoefficient = Annotated[float, Kind("W/(m^2 K)", "W/(m^2 K)", least=0.0)]
Conductivity = Annotated[float, Kind("W/(m K)", "W/(m K)", above=0.0)]
PositiveNumber = Annotated[float, Kind("1", above=0.0)]
PERCENT = PercentKind("1", label="weight percent", sample="0.42")
"""Weight percent without bounds, for fields that check bounds with a message of their own."""
Percent = Annotated[float, replace(PERCENT, least=0.0, most=100.0)]
InverseLength = Annotated[
    float, Kind("1/m", "1/m", least=0.0, label="absorption per length", sample="400 1/m")
]
