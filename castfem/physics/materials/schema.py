"""Structure of a material file: its keys and the quantities they hold.

`castfem.physics.materials.build` makes the steel from it.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from castfem.base.errors import choices, shown
from castfem.base.quantities import Kind
from castfem.base.units import nearest

Keys = tuple[str | int, ...]

TEMPERATURE = Kind("K", "degC", above=0.0)
# Every property with the unit and the bounds of its values.
KINDS: Mapping[str, Kind] = {
    "solidus": TEMPERATURE,
    "liquidus": TEMPERATURE,
    "latent_heat": Kind("J/kg", "kJ/kg", least=0.0),
    "solid_fraction": Kind("1", least=0.0, most=1.0, label="solid fraction", sample="0.5"),
    "density": Kind("kg/m^3", "kg/m^3", above=0.0),
    "specific_heat": Kind("J/(kg K)", "J/(kg K)", above=0.0),
    "enthalpy": Kind("J/kg", "kJ/kg", label="enthalpy", sample="1200 kJ/kg"),
    "conductivity": Kind("W/(m K)", "W/(m K)", above=0.0),
    "emissivity": Kind("1", above=0.0, most=1.0, label="emissivity", sample="0.8"),
    "thermal_expansion": Kind("1/K", "1/K"),
    "youngs_modulus": Kind("Pa", "GPa", above=0.0, label="Young's modulus", sample="40 GPa"),
    "poisson_ratio": Kind("1", least=0.0, most=0.499, label="Poisson's ratio", sample="0.3"),
}
# Keys that determine the form of an entry: an override with one of these replaces the whole entry.
FORMS = ("value", "temperature", "file", "formula")


class Entry(BaseModel):
    """One property: a constant `value`, a table, or a `formula`; with its source.

    A plain text, `density = "7400 kg/m^3"`, is short for `value`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: Any = None
    unit: Any = None
    temperature: Any = None
    temperature_unit: Any = None
    file: str | None = None
    outside: Literal["constant", "refuse"] = "constant"
    formula: str | None = None
    parameters: dict[str, Any] = {}
    source: str = ""
    status: Literal["F", "M", "C", "U"] = "U"
    note: str = ""

    @model_validator(mode="before")
    @classmethod
    def _short(cls, given: Any) -> Any:
        return given if isinstance(given, Mapping) else {"value": given}

    @property
    def forms(self) -> tuple[str, ...]:
        """Forms of the entry (constant, table, file, formula); a valid one has exactly one."""
        table = self.temperature is not None
        return tuple(
            form
            for form in FORMS
            if getattr(self, form) is not None and not (form == "value" and table)
        )


class ExpansionEntry(Entry):
    """Thermal expansion; a table holds mean coefficients since `origin`, or differential ones."""

    coefficient: Literal["mean", "differential"] = "mean"
    origin: Any = None


class MaterialFile(BaseModel):
    """A material file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    description: str = ""
    from_composition: tuple[str, ...] = ()
    composition: dict[str, Any] = {}
    diagram: Literal["assessed", "pascon", "segregated"] = "assessed"
    solidus: Entry | None = None
    liquidus: Entry | None = None
    latent_heat: Entry | None = None
    solid_fraction: Entry | None = None
    density: Entry | None = None
    specific_heat: Entry | None = None
    enthalpy: Entry | None = None
    conductivity: Entry | None = None
    emissivity: Entry | None = None
    thermal_expansion: ExpansionEntry | None = None
    youngs_modulus: Entry | None = None
    poisson_ratio: Entry | None = None

    def entry(self, key: str) -> Entry | None:
        """Return the entry of a property."""
        found = getattr(self, key)
        return found if isinstance(found, Entry) else None


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem of a material file: its path of keys, and a text."""

    path: Keys
    text: str


def read(data: Mapping[str, Any]) -> tuple[MaterialFile, list[Problem]]:
    """Check the structure of a material file.

    Returns:
        The file without its faulty parts, and one problem for each of them.
    """
    sound: dict[str, Any] = copy.deepcopy(dict(data))
    problems: list[Problem] = []
    while True:
        try:
            return MaterialFile.model_validate(sound), problems
        except ValidationError as error:
            for details in error.errors(include_url=False, include_context=True):
                path = details["loc"]
                problems.append(Problem(path, _text(details, path)))
                _drop(sound, path)


_PLAIN = {
    "string_type": "must be a text",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
}


def _text(details: Any, path: Keys) -> str:
    """Return the fault, what is allowed, and what may have been meant."""
    value = f" ({shown(details['input'])})"
    kind, name = details["type"], str(path[-1])
    if kind == "extra_forbidden":
        model = MaterialFile if len(path) == 1 else type_of(str(path[0]))
        keys = list(model.model_fields)
        return f"unknown key{value}; allowed: {choices(keys)}{nearest(name, keys)}"
    if kind == "literal_error":
        names = {
            "status": ("F", "M", "C", "U"),
            "outside": ("constant", "refuse"),
            "diagram": ("assessed", "pascon", "segregated"),
        }.get(name, ("mean", "differential"))
        return (
            f"not possible{value}; one of {choices(names)}{nearest(str(details['input']), names)}"
        )
    return f"{_PLAIN.get(kind, details['msg'])}{value}"


def type_of(key: str) -> type[Entry]:
    """Return the model of a property's entry."""
    return ExpansionEntry if key == "thermal_expansion" else Entry


def _drop(data: Any, path: Keys) -> None:
    """Remove the key at `path` from nested tables and lists; a missing one is ignored."""
    *above, last = path
    for part in above:
        known = isinstance(data, Mapping) and part in data
        if not known and not (isinstance(data, Sequence) and isinstance(part, int)):
            return
        data = data[part]
    if isinstance(data, dict):
        data.pop(last, None)
    elif isinstance(data, list) and isinstance(last, int) and last < len(data):
        data[last] = ""
