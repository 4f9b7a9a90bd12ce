"""Inputs that are not known exactly: the table [[optimise.input]].

A `range` holds values of a key. What is `relative` is multiplied: a number or a table of the case,
a property of the steel (`steel.conductivity`), a parameter of the constitutive law or of the
elasticity (`mechanics.law.strength`, `mechanics.elasticity.young`). For the latter a parameter file
with the changed numbers is written; a run copies it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError
from castfem.model.load import value_of
from castfem.model.optimise import Input
from castfem.physics.constitutive.parameters import given_set
from castfem.physics.materials.library import given_steel

if TYPE_CHECKING:
    from castfem.model import Case

_SETS = {"mechanics.law.": "law", "mechanics.elasticity.": "elasticity"}
_STEEL = "steel."
_ELASTICITY = "elastic_steel"  # by default
_FOLDER = "castfem_inputs"
_ABSOLUTE = ("degC", "degF", "°C", "°F")  # scales that do not begin at zero


@dataclass(frozen=True, slots=True)
class UncertainInput:
    """An input of which only a range is known."""

    key: str
    low: float  #: lowest value, or factor
    high: float
    unit: str  #: of a value, "" for none
    relative: bool  #: whether it is a factor

    @classmethod
    def of(cls, table: Input) -> UncertainInput:
        """The input of a table."""
        if table.relative is not None:
            low, high = (1.0 + units.parse(end, "1") for end in table.relative)
            return cls(table.key, low, high, "", True)
        assert table.range is not None
        unit = units.split(table.range[0])[1]
        ends = [units.parse_any(end) for end in table.range]
        low, high = (units.convert(end, si, unit or "1") for end, si in ends)
        return cls(table.key, low, high, unit, False)

    @property
    def label(self) -> str:
        """Its name in tables."""
        unit = "times" if self.relative else self.unit
        return f"{self.key} [{unit}]" if unit else self.key

    def value(self, share: float) -> float:
        """The value at a share of the range, to six digits."""
        return float(f"{self.low + share * (self.high - self.low):.6g}")

    def changes(self, case: Case, value: float) -> dict[str, Any]:
        """Keys and values of the case with this value, as `Case.with_` takes them."""
        if not self.relative:
            return {self.key: f"{value:.12g} {self.unit}" if self.unit else value}
        for prefix, key in _SETS.items():
            if self.key.startswith(prefix) and case.mechanics is not None:
                name = getattr(case.mechanics, key) or _ELASTICITY
                return {f"mechanics.{key}": self._file(name, self.key.removeprefix(prefix), value)}
        name = self.key.removeprefix(_STEEL)
        if self.key.startswith(_STEEL) and "." not in name:
            tables = {**given_steel(case.steel.name), **case.steel.changes}
            return {f"steel.overrides.{name}": self._scaled(tables.get(name), value)}
        try:
            return {self.key: self._scaled(value_of(case, self.key), value)}
        except ValueError as error:
            raise InputError(f"{self.key}: {error}") from None

    def _file(self, name: str, key: str, factor: float) -> str:
        """Path of a parameter set with one of its parameters multiplied."""
        import tomli_w

        tables = dict(given_set(name))
        tables[key] = self._scaled(tables.get(key), factor)
        text = tomli_w.dumps(tables)
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        path = Path(gettempdir()) / _FOLDER / f"{Path(name).stem}_{digest}.toml"
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)
        return str(path)

    def _scaled(self, written: Any, factor: float) -> Any:
        """A value, text or table as a file has it, times a factor."""
        if isinstance(written, bool) or written is None:
            raise InputError(f"{self.key}: there is no number that could be multiplied")
        if isinstance(written, int | float):
            return written * factor
        if isinstance(written, Mapping):
            if "value" not in written or written.get("unit") in _ABSOLUTE:
                raise InputError(f"{self.key}: has no value that could be multiplied; give range")
            return {**written, "value": self._scaled(written["value"], factor)}
        if isinstance(written, list | tuple):
            return [self._scaled(one, factor) for one in written]
        try:
            number, unit = units.split(str(written))
        except ValueError:
            raise InputError(f'{self.key}: ("{written}") is no number; give range') from None
        if unit in _ABSOLUTE:
            raise InputError(f"{self.key}: a temperature is not multiplied; give range")
        return f"{float(number) * factor:.12g} {unit}".strip()
