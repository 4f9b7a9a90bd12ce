"""Constitutive laws from parameter files: sets shipped with castfem, and the user's own.

A file names its law and gives each parameter as a single value or as a table over temperature:

    law = "norton_hoff"
    yield_limit = "automatic"
    [strength]
    temperature = [900, 1100, 1300]
    temperature_unit = "degC"
    value = [76.4, 40.6, 22.5]
    unit = "MPa"
    [p3]
    value = 0.13

Every parameter may have its `source`, a `status` (F read in the source, M from memory and not yet
checked, C computed, U the user's own) and a `note`. A table [data] gives the temperatures and
strain rates of the underlying data, lowest and highest; a run reports how much of its shell is
outside.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from castfem.base import ranges
from castfem.base.csv_files import unreadable
from castfem.base.errors import InputError, choices, shown
from castfem.base.quantities import Kind
from castfem.base.table_notation import Curve as TableReader
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.base.units import nearest
from castfem.physics.constitutive.base import DataRange, Law, Parameter
from castfem.physics.constitutive.elasticity import Curve, Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import RadialReturn

FOLDER = Path(__file__).parent / "data"

_YOUNG = Parameter(Kind("Pa", "GPa", above=0.0, label="Young's modulus", sample="20 GPa"))
_POISSON = Parameter(Kind("1", least=0.0, most=0.499, label="Poisson's ratio", sample="0.3"))
_CARBON = Kind("1", least=0.0, most=2.11, label="carbon content in wt%", sample="0.1")
FROM_MEMORY = "M"  # status of a number that was not compared with its source
_TEXTS = ("law", "description", "source", "status", "note", "data")
_DATA = {
    "temperature": Kind("K", "degC"),
    "rate": Kind("1/s", "1/s", least=0.0, label="strain rate", sample="1e-3 1/s"),
}
_NOTES = ("source", "status", "note")


@dataclass
class _Reader:
    """Reads parameters and collects errors; see `base.Given`."""

    data: Mapping[str, Any]  #: content of the file
    label: str  #: its name in messages
    carbon: float | None = None  #: carbon of the steel of the case, wt%
    #: delta ferrite in its solid over temperature
    delta_share: Callable[[Array], Array] | None = None
    problems: list[str] = field(default_factory=list)  #: errors found so far

    def fail(self, key: str, text: str) -> None:
        """Record an error in a key, once."""
        problem = f"{self.label}: {key}: {text}"
        self.problems += [] if problem in self.problems else [problem]

    def curves(self, known: Mapping[str, Parameter]) -> dict[str, Any]:
        """See `base.Given`."""
        return {
            key: None
            if parameter.word and self.data.get(key, parameter.word) == parameter.word
            else self.curve(key, parameter)
            for key, parameter in known.items()
        }

    def numbers(self, known: Mapping[str, Kind]) -> dict[str, Any]:
        """See `base.Given`."""
        found = {key: self.number(key, kind) for key, kind in known.items() if key in self.data}
        return {key: value for key, value in found.items() if value is not None}

    def words(self, known: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
        """See `base.Given`."""
        given = {key: self.data[key] for key in known if key in self.data}
        for key, word in given.items():
            if word not in known[key]:
                near = nearest(str(word), known[key])
                self.fail(key, f"({shown(word)}) must be one of {choices(known[key])}{near}")
        return {key: word for key, word in given.items() if word in known[key]}

    def steel(self) -> tuple[float, Callable[[Array], Array]]:
        """See `base.Given`."""
        carbon, delta_share = self.carbon, self.delta_share
        if "carbon" in self.data or carbon is None:
            if "carbon" not in self.data:
                self.fail(
                    "carbon",
                    "is missing, in weight percent; write composition = { C = 0.12 } in the file "
                    "of the steel, or carbon = 0.12 in a file of the law",
                )
            carbon, delta_share = self.number("carbon", _CARBON), None
            carbon = 0.1 if carbon is None else carbon
        return carbon, delta_share or delta_share_of(carbon)

    def curve(self, key: str, parameter: Parameter) -> Curve:
        """Return a parameter over temperature; a substitute if it is faulty."""
        given = self.data.get(key)
        if given is None:
            if parameter.default is None:
                sample = parameter.kind.example
                self.fail(key, f'is missing; the {parameter.kind.name}, such as "{sample}"')
            return Constant(parameter.default if parameter.default is not None else 1.0)
        if isinstance(given, Mapping):
            given = {k: v for k, v in given.items() if k not in _NOTES}
            if set(given) == {"value"}:
                given = given["value"]
        try:
            found = TableReader(parameter.kind, over="temperature").read(given)
        except ValueError as error:
            self.fail(key, str(error))
            return Constant(1.0)
        if (bounds := ranges.of(f"law.{key}")) is not None:
            values = found.values if isinstance(found, Table) else (found,)
            beyond = (bounds.impossible(value, parameter.kind) for value in values)
            if text := next(filter(None, beyond), ""):
                self.fail(key, text)
        if isinstance(found, Table):
            return replace(found, logarithmic=parameter.logarithmic)
        return Constant(found)

    def number(self, key: str, kind: Kind) -> float | None:
        """Return a single number; None if it is not given, or faulty."""
        if key not in self.data:
            return None
        try:
            return kind.read(self.data[key])
        except ValueError as error:
            self.fail(key, f"{error} ({shown(self.data[key])})")
            return None

    def data_range(self) -> DataRange | None:
        """Return the range of the data of the law: the table [data]."""
        given = self.data.get("data")
        if given is None:
            return None
        if not isinstance(given, Mapping) or set(given) - set(_NOTES) != set(_DATA):
            self.fail("data", f"must be a table with {choices(_DATA)}, each lowest and highest")
            return None
        ends: dict[str, tuple[float, float]] = {}
        for key, kind in _DATA.items():
            try:
                low, high = (kind.read(value) for value in given[key])
            except (TypeError, ValueError) as error:
                self.fail(f"data.{key}", f"must be lowest and highest: {error}")
                continue
            if not low < high:
                self.fail(f"data.{key}", "the lowest must be below the highest")
            ends[key] = low, high
        return DataRange(**ends) if len(ends) == len(_DATA) else None

    def lacking(self, law: type[RadialReturn]) -> None:
        """Refuse a file that lacks a required number or word of its law.

        Raises:
            InputError: Names each of them.
        """
        needed = [f.name for f in fields(law) if f.default is f.default_factory is MISSING]
        known = {**law.numbers, **law.words}
        for key in (lacking := [key for key in needed if key in known and key not in self.data]):
            kind, words = law.numbers.get(key), law.words.get(key, ())
            what = f'the {kind.name}, such as "{kind.example}"' if kind else choices(words)
            self.fail(key, f"is missing; {what}")
        if lacking:
            raise InputError(self.problems)

    def unknown(self, allowed: tuple[str, ...]) -> None:
        """Report keys that this law does not have."""
        for key in self.data:
            if key not in allowed:
                self.fail(key, f"unknown key; allowed: {choices(allowed)}{nearest(key, allowed)}")


def available_laws() -> dict[str, str]:
    """Return the names of the sets shipped with castfem, with their descriptions."""
    found = {}
    for path in sorted(FOLDER.glob("*.toml")):
        data = tomllib.loads(path.read_text("utf-8"))
        if "law" in data:
            found[path.stem] = str(data.get("description", ""))
    return found


def load_law(
    name: str,
    elasticity: Elasticity,
    base_dir: str | os.PathLike[str] | None = None,
    *,
    carbon: float | None = None,
    delta_share: Callable[[Array], Array] | None = None,
) -> RadialReturn:
    """Load a law.

    Args:
        name: A set shipped with castfem, or the path of a TOML file (ends in .toml or has a slash),
            relative to `base_dir`.
        elasticity: Elastic part, with the solidus.
        base_dir: Folder of the case file; by default the working folder.
        carbon: Carbon content, wt%, for laws that depend on it and do not state it.
        delta_share: Delta ferrite in the solid over temperature in K, for the same laws.

    Raises:
        InputError: The set is faulty; all problems, one line each.
    """
    data, label = _parse(name, Path(base_dir or "."), "law")
    return law_from(data, elasticity, label, carbon=carbon, delta_share=delta_share)


def unchecked(name: str, base_dir: str | os.PathLike[str] | None = None) -> dict[str, str]:
    """Parameters of a law with status M (quoted from memory), each with its source.

    Raises:
        InputError: As for `load_law`.
    """
    data, _ = _parse(name, Path(base_dir or "."), "law")
    found = {"law": str(data.get("source", ""))} if data.get("status") == FROM_MEMORY else {}
    for key, given in data.items():
        if isinstance(given, Mapping) and given.get("status") == FROM_MEMORY:
            found[key] = str(given.get("source", ""))
    return found


def law_carbon(name: str, base_dir: str | os.PathLike[str] | None = None) -> float | None:
    """Carbon of the steel to which a law was fitted, wt%; None if it uses that of the case.

    Raises:
        InputError: As for `load_law`.
    """
    data, label = _parse(name, Path(base_dir or "."), "law")
    return _Reader(data, label).number("carbon", _CARBON)


def law_from(
    data: Mapping[str, Any],
    elasticity: Elasticity,
    label: str = "law",
    *,
    carbon: float | None = None,
    delta_share: Callable[[Array], Array] | None = None,
) -> RadialReturn:
    """Build the law of a parsed parameter file, see `load_law`; `label` is its name in messages."""
    name, known = str(data.get("law", "")), RadialReturn.laws
    if name not in known:
        found = f"({shown(data['law'])}) is not known" if "law" in data else "is missing"
        raise InputError(f"{label}: law: {found}; one of {choices(known)}{nearest(name, known)}")
    law, reader = known[name], _Reader(data, label, carbon, delta_share)
    reader.unknown((*_TEXTS, "carbon", *law.parameters, *law.numbers, *law.words))
    reader.number("carbon", _CARBON)
    reader.lacking(law)
    made = replace(law.from_parameters(elasticity, reader), data=reader.data_range())
    if reader.problems:
        raise InputError(reader.problems)
    return made


def unusual(name: str, law: Law, base_dir: str | os.PathLike[str] | None = None) -> str:
    """Return a warning about an implausible parameter of a law; "" if there is none.

    Raises:
        InputError: As for `load_law`.
    """
    if not isinstance(law, RadialReturn):
        return ""
    data, _ = _parse(name, Path(base_dir or "."), "law")
    for key, parameter in law.parameters.items():
        curve, bounds = law.given_curve(key), ranges.of(f"law.{key}")
        if key not in data or curve is None or bounds is None:
            continue
        for value in getattr(curve, "values", ()):
            if text := bounds.unusual(float(value), parameter.kind):
                return f"{key}: {text}"
    return ""


def delta_share_of(carbon: float) -> Callable[[Array], Array]:
    """Delta ferrite in the solid by the lever rule of plain iron-carbon, over temperature in K."""
    from castfem.physics.materials.iron_carbon import IronCarbon

    return DeltaShare(IronCarbon(carbon))


@dataclass(frozen=True, slots=True)
class DeltaShare:
    """Fraction of delta ferrite in the solid; above the liquidus that at the liquidus."""

    diagram: Any  #: iron-carbon equilibrium of the steel (`castfem.physics.materials.IronCarbon`)

    def __call__(self, temperature: Array) -> Array:
        """Return the fraction, 0 to 1, at temperatures in K."""
        import numpy as np

        phases = self.diagram.phases(np.minimum(temperature, self.diagram.liquidus - 1e-3))
        return np.asarray(phases.delta / np.maximum(phases.delta + phases.gamma, 1e-300))


def load_elasticity(name: str = "elastic_steel", solidity: Solidity | None = None) -> Elasticity:
    """Load the elastic part of a shipped set or a file of the same form (`young`, `poisson`).

    Raises:
        InputError: The set is faulty; all problems, one line each.
    """
    data, label = _parse(name, Path("."), "young")
    reader = _Reader(data, label)
    reader.unknown(("description", "young", "poisson"))
    young = reader.curve("young", _YOUNG)
    poisson = reader.curve("poisson", _POISSON)
    if reader.problems:
        raise InputError(reader.problems)
    return Elasticity(young, poisson, solidity or Solidity())


def given_set(name: str) -> dict[str, Any]:
    """Return the tables of a shipped set or a user's file, of either kind, as written.

    Raises:
        InputError: It cannot be read.
    """
    data, _ = _parse(name, Path("."), "young" if name == "elastic_steel" else "law")
    return data


def problems_at(where: str, error: InputError) -> InputError:
    """Return the problems of a parameter set as problems of the key that names it."""
    return InputError([f"{where}: {problem.removeprefix('law: ')}" for problem in error.problems])


def _label(path: Path) -> str:
    """Return the name of a file in messages: relative to the working folder, if it is inside."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _parse(name: str, base: Path, holds: str) -> tuple[dict[str, Any], str]:
    """Read the file of a set; return it with its name in messages.

    Args:
        name: A shipped set or a path, relative to `base`.
        base: Folder.
        holds: Key of shipped sets of the wanted kind: "law" or "young".
    """
    own = name.endswith(".toml") or "/" in name or os.sep in name
    if own:
        path, label = base / name, _label(base / name)
    else:
        path, label = FOLDER / f"{name}.toml", f"law {name}"
    shipped = {p.stem: p for p in sorted(FOLDER.glob("*.toml"))}
    try:
        if own or name in shipped:
            data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
            if own or holds in data:
                return data, label
        names = [n for n, p in shipped.items() if holds in tomllib.loads(p.read_text("utf-8"))]
        raise InputError(
            f'law: "{name}" {"holds none" if name in shipped else "not found"}; '
            f"one of {choices(names)}, or the path of a TOML file{nearest(name, names)}"
        )
    except OSError as error:
        raise InputError(f'law: "{label}": {unreadable(path, error)}') from None
    except UnicodeDecodeError:
        raise InputError(f"{label}: is not UTF-8 text; save it in that encoding") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{label}: {error}") from None
