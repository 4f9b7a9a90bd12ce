"""Parameters of the derivatives of a run: keys of its case, and properties of its steel.

A parameter is a number in the unit of the resolved case, however the user has written it: both
"1600 W/(m^2 K)" and "1.6 kW/(m^2 K)" are 1600, and derivatives are per W/(m^2 K). A table is
multiplied as a whole by a factor of 100 per cent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError, choices
from castfem.model import key_names
from castfem.model.case import Case
from castfem.model.load import changed

if TYPE_CHECKING:
    import numpy.typing as npt

    from castfem.base.types import Array
    from castfem.physics.constitutive.base import Law
    from castfem.physics.materials import Steel
    from castfem.physics.materials.expansion import Expansion
    from castfem.physics.materials.iron_carbon import Side
    from castfem.physics.materials.properties import Property

SCALED = ("density", "specific_heat", "conductivity", "emissivity")
"""Properties of a steel that are multiplied as a whole."""
EXPANSION = "thermal_expansion"
ELASTIC = ("youngs_modulus", "poisson_ratio")
STRAINED = (EXPANSION, *ELASTIC)
"""Such properties that only affect the mechanics."""
LEVELS = {"degC", "degF", "°C", "°F"}
"""Temperature units that do not begin at absolute zero."""
_LAW = "law.", "mechanics.law."  # the second is the name of inputs of an optimum
_BY_CARBON = "name steel.composition.C instead"


@dataclass(frozen=True, slots=True)
class DifferenceSteps:
    """Half the distance of the difference quotients by a parameter."""

    temperature: float = 1e-3  #: for a temperature, in its unit
    share: float = 1e-5  #: for anything else, relative to the number
    #: for numbers of the mould: taper moves the wall by less than its position is rounded
    mould: float = 1e-4
    length: float = 1e-6  #: for its lengths, relative


STEPS = DifferenceSteps()
_HELD = {
    "section": "it changes the mesh",
    "mesh": "it changes the mesh",
    "thermal": "it changes the steps, which are held",
    "output": "it changes what is written, not what is computed",
    "reference": "it is a published value",
    "verification": "it belongs to the closed form",
    "optimise": "a run does not use it",
    "title": "it is not a number",
}


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a case."""

    name: str  #: name as written by the user
    key: str  #: dotted key of the number; "" for a property of the steel
    value: float  #: in `unit`
    unit: str  #: unit of the resolved case; "percent" for a table that is multiplied, "" for none
    spread: float  #: its uncertainty, in `unit`, for the bars of the figure
    steel: str = ""  #: multiplied property of the steel; "" for none
    law: str = ""  #: multiplied parameter of the constitutive law; "" for none
    table: Mapping[str, Any] | None = None  #: table at `key`, if it is one
    step: float = 0.0  #: half the distance of the difference quotients of laws, in `unit`

    @property
    def has_zero(self) -> bool:
        """Whether percentages of it have a meaning, unlike those of degrees Celsius."""
        return self.unit not in LEVELS and self.value != 0.0

    def case_at(self, case: Case, value: float) -> Case:
        """The case with another value."""
        if not self.key:
            return case
        written: Any = f"{value!r} {self.unit}" if self.unit else value
        if self.table is not None:
            written = dict(self.table)
            if self.unit == "percent":
                written["value"] = [value / 100.0 * one for one in self.table["value"]]
            else:
                written["value"] = [one + value for one in self.table["value"]]
        try:
            return changed(case, {self.key: written}, self.name)
        except InputError as error:
            raise InputError(
                f"--to {self.name}: a derivative needs valid cases on both sides of the value; "
                f"with {value:.8g} {self.unit}".rstrip()
                + f" it is invalid: compare runs (castfem sweep) instead. {error.problems[0]}"
            ) from None

    @property
    def of_mechanics(self) -> bool:
        """Whether the temperatures do not depend on it."""
        return bool(self.law) or self.steel in STRAINED

    @property
    def moves_front(self) -> bool:
        """Whether the shell growth depends on it directly; the mould only acts through its gap."""
        return not self.of_mechanics and not self.key.startswith("mould.")

    def law_at(self, law: Law, value: float) -> Law:
        """The constitutive law with another value."""
        if not self.law:
            return law
        given: Any = law
        return given.with_curve(self.law, _Multiplied(given.given_curve(self.law), value / 100.0))

    def steel_at(self, steel: Steel, value: float) -> Steel:
        """The steel with another value."""
        if not self.steel:
            return steel
        if self.steel == EXPANSION:
            assert steel.expansion is not None, "it has been looked at"
            law = steel.expansion
            more = _MoreExpansion(law, value / 100.0, law.kinks, law.curved)
            return replace(steel, expansion=more)
        scaled = _Scaled.of(steel.properties[self.steel], value / 100.0)
        return replace(steel, properties=MappingProxyType({**steel.properties, self.steel: scaled}))


@dataclass(frozen=True, slots=True)
class _Scaled:
    """A property times a factor."""

    law: Property
    factor: float
    kinks: tuple[float, ...]
    jumps: tuple[float, ...]
    curved: bool
    span: tuple[float, float]

    @classmethod
    def of(cls, law: Property, factor: float) -> _Scaled:
        return cls(law, factor, law.kinks, law.jumps, law.curved, law.span)

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        return self.factor * self.law(temperature, side)


@dataclass(frozen=True, slots=True)
class _MoreExpansion:
    """A thermal contraction times a factor."""

    law: Expansion
    factor: float
    kinks: tuple[float, ...]
    curved: bool

    def strain(self, temperature: npt.ArrayLike, reference: float) -> Array:
        return self.factor * self.law.strain(temperature, reference)


@dataclass(frozen=True, slots=True)
class _Multiplied:
    """A number of a law over temperature, times a factor."""

    of: Callable[[Array], Array]
    factor: float

    def __call__(self, temperature: Array) -> Array:
        return self.factor * self.of(temperature)


def read_parameters(case: Case, steel: Steel, texts: Iterable[str]) -> list[Parameter]:
    """Return the parameters from `--to`: KEY or KEY=SPREAD, several separated by commas."""
    found: dict[str, Parameter] = {}
    problems: list[str] = []
    for text in (part.strip() for given in texts for part in given.split(",")):
        name, _, spread = (part.strip() for part in text.partition("="))
        try:
            parameter = _read(case, steel, name, spread)
            if name in found:
                raise ValueError("it is given twice")
            found[name] = parameter
        except ValueError as error:
            problems.append(f"--to {text}: {error}")
        except InputError as error:
            problems += [f"--to {text}: {line}" for line in error.problems]
    if problems or not found:
        raise InputError(problems or "--to: no parameter is named; such as casting.superheat")
    return list(found.values())


def _read(case: Case, steel: Steel, name: str, spread: str) -> Parameter:
    if not name:
        raise ValueError("a key of the case is needed, such as casting.superheat")
    table, _, entry = name.partition(".")
    if table == "steel" and entry and "." not in entry:
        parameter = _of_steel(steel, name, entry, strained=case.mechanics is not None)
    elif entry and name.startswith(_LAW):
        parameter = _of_law(case, steel, name, name.rpartition("law.")[2])
    else:
        parameter = _of_case(case, steel, name)
    temperature = parameter.unit in LEVELS or parameter.unit == "K"
    usual = 10.0 if temperature else 0.01 * abs(parameter.value)
    wide = _spread(spread, parameter, temperature) if spread else usual
    if spread and not wide > 0.0:
        raise ValueError("its spread must be above 0")
    if not wide > 0.0:
        raise ValueError(f"it is 0; give its spread: {name}=SPREAD")
    size = _share(parameter) * max(abs(parameter.value), wide)
    return replace(parameter, spread=wide, step=STEPS.temperature if temperature else size)


def _share(parameter: Parameter) -> float:
    """Half the distance of the difference quotients, relative to the number."""
    if not parameter.key.startswith("mould."):
        return STEPS.share
    return STEPS.length if units.parse_any(f"1 {parameter.unit}")[1] == "m" else STEPS.mould


def _spread(text: str, parameter: Parameter, temperature: bool) -> float:
    number, unit = units.split(text)
    if unit in ("%", "percent"):
        return 0.01 * float(number) * (100.0 if parameter.table else abs(parameter.value))
    if temperature and unit in {"K", *LEVELS}:
        return float(number)
    si = units.parse_any(f"1 {parameter.unit}")[1]
    return units.convert(units.parse(text, si), si, parameter.unit or "1")


def _of_law(case: Case, steel: Steel, name: str, entry: str) -> Parameter:
    if case.mechanics is None:
        raise ValueError("the case has no [mechanics]")
    from castfem.model.build.law import build_law

    law = build_law(case.mechanics, steel)
    having = [n for n in law.parameters if law.given_curve(n) is not None]
    if entry not in having:
        near = units.nearest(entry, having)
        those = choices(having) or "no number that is given over temperature"
        raise ValueError(f"law {case.mechanics.law} has {those}{near}")
    return Parameter(name, "", 100.0, "percent", 0.0, law=entry)


def _of_steel(steel: Steel, name: str, entry: str, *, strained: bool) -> Parameter:
    scaled = (*SCALED, *STRAINED) if strained else SCALED
    if entry in scaled:
        if not steel.has(entry):
            raise ValueError(f"{steel.name} has none")
        if entry == "specific_heat" and "enthalpy" in steel.properties:
            raise ValueError(f"{steel.name} is defined by its enthalpy; {_BY_CARBON}")
        return Parameter(name, "", 100.0, "percent", 0.0, entry)
    if entry not in ("solidus", "liquidus", "latent_heat"):
        allowed = (*scaled, "solidus", "liquidus", "latent_heat", "composition.C")
        near = units.nearest(entry, allowed)
        raise ValueError(f"no number of a steel; one of {choices(allowed)}{near}")
    origin = steel.origins.get(entry)
    if entry == "latent_heat" and "enthalpy" in steel.properties:
        raise ValueError(f"{steel.name} is defined by its enthalpy; {_BY_CARBON}")
    if origin is None:
        raise ValueError(f"it follows from the solid fraction of {steel.name}; {_BY_CARBON}")
    if entry == "latent_heat":
        return Parameter(name, "steel.overrides.latent_heat", steel.latent_heat / 1e3, "kJ/kg", 0.0)
    kelvin = steel.solidus if entry == "solidus" else steel.liquidus
    return Parameter(name, f"steel.overrides.{entry}", kelvin - ZERO_CELSIUS, "degC", 0.0)


def _of_case(case: Case, steel: Steel, name: str) -> Parameter:
    document = case.document()
    key = key_names.full_key(Case, document, name)
    table = key.partition(".")[0]
    if table in _HELD:
        raise ValueError(f"a run has no derivative by it: {_HELD[table]}")
    key, value = _found(document, key)
    if value is None and key.startswith("steel.composition."):
        value = steel.composition.get(key.rpartition(".")[2])
        if value is not None:
            _check_composition(case, steel, key, value, name)
    if isinstance(value, Mapping) and isinstance(value.get("value"), list):
        levels = value.get("unit") in LEVELS
        start, unit = (0.0, "K") if levels else (100.0, "percent")
        return Parameter(name, key, start, unit, 0.0, table=value)
    if value is None or isinstance(value, bool | Mapping | list):
        near = units.nearest(name, _numbers(document)) if value is None else ""
        raise ValueError(f"the case has no number there{near}")
    if not isinstance(value, str):
        return Parameter(name, key, float(value), "", 0.0)
    try:
        number, unit = units.split(value)
    except ValueError:
        raise ValueError(f'it is not a number ("{value}")') from None
    return Parameter(name, key, float(number), unit, 0.0)


def _numbers(table: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield the dotted keys of possible numbers of a case, without those in arrays."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{above}{key}.")
        elif not isinstance(value, bool | list) and f"{above}{key}".partition(".")[0] not in _HELD:
            yield f"{above}{key}"


def _check_composition(case: Case, steel: Steel, key: str, value: float, name: str) -> None:
    """Refuse an element missing in the case, for a steel that is not computed from it.

    Raises:
        ValueError: With a composition the case would have another steel.
    """
    from castfem.model.build.simulation import case_steel

    other = case_steel(changed(case, {key: value}, name))
    if (other.name, other.solidus, other.liquidus) != (steel.name, steel.solidus, steel.liquidus):
        raise ValueError(
            f"{steel.name} is not computed from its composition; name steel.solidus, "
            "steel.liquidus or steel.latent_heat"
        )


def _found(document: Mapping[str, Any], key: str) -> tuple[str, Any]:
    """The key and its value; for a table with a value and a source, the value.

    Raises:
        ValueError: The key leads to no array entry.
    """
    if why := key_names.lost(document, key):
        raise ValueError(why)
    value = key_names.value_at(document, key)
    if isinstance(value, Mapping) and "value" in value and not isinstance(value["value"], list):
        return f"{key}.value", value["value"]
    return key, value
