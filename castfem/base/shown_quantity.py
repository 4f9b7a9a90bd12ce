"""A result: value in SI, unit in which it is shown, label, error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from castfem.base import units
from castfem.base.shown_units import coherent

_NONE = "-"  # dimensionless


@dataclass(frozen=True, slots=True)
class Quantity:
    """One result."""

    value: float  #: in SI; NaN when it does not exist
    shown_unit: str  #: unit in which it is shown, "-" for none
    label: str  #: label in tables
    #: error of the value, in SI (K for temperatures); None unless computed by `castfem error`
    error: float | None = None
    #: resolution of the value by the cells of the run, in SI (K for temperatures); None if unknown.
    #: It determines the printed digits and is not an error.
    resolution: float | None = None

    @property
    def unit(self) -> str:
        """SI unit of `value`; "-" for none."""
        return si_shown(self.shown_unit)

    @property
    def shown(self) -> float:
        """The value in `shown_unit`."""
        return from_si(self.value, self.shown_unit)

    @property
    def shown_error(self) -> float | None:
        """The error in `unit_of_difference(shown_unit)`."""
        return self._difference_shown(self.error)

    @property
    def shown_resolution(self) -> float | None:
        """The resolution in `unit_of_difference(shown_unit)`."""
        return self._difference_shown(self.resolution)

    def _difference_shown(self, part: float | None) -> float | None:
        return None if part is None else from_si(part, unit_of_difference(self.shown_unit))

    def __repr__(self) -> str:
        shown = f"{self.shown:.6g} {self.shown_unit}"
        return (
            f"Quantity(value={self.value!r}, unit={self.unit!r}, label={self.label!r}, "
            f"shown={shown!r})"
        )


@lru_cache(maxsize=256)
def si_unit(unit: str) -> str:
    """The SI unit of the same dimension as `unit`, "1" for none."""
    return "1" if unit in (_NONE, "", "1") else units.parse_any(f"1 {unit}")[1]


def si_shown(unit: str) -> str:
    """The SI unit by its usual name, "-" for none."""
    found = coherent(unit)
    return _NONE if found == "1" else found


def from_si(value: float, unit: str) -> float:
    """Convert an SI value to a unit; non-finite values are unchanged."""
    if not math.isfinite(value):
        return value
    return units.convert(value, si_unit(unit), "1" if unit in (_NONE, "") else unit)


def to_si(value: float | None, unit: str) -> float:
    """Convert a value to SI; None becomes NaN."""
    if value is None or not math.isfinite(value):
        return math.nan
    return (
        value if si_unit(unit) == unit or unit == _NONE else units.parse_any(f"{value!r} {unit}")[0]
    )


def unit_of_difference(unit: str) -> str:
    """The unit of the difference of two values in `unit`: K for temperatures."""
    return "K" if si_unit(unit) == "K" else unit
