"""Derivatives in the units that were chosen, for what is printed and drawn."""

from __future__ import annotations

from dataclasses import dataclass

from castfem.base.shown_quantity import unit_of_difference
from castfem.base.shown_units import Scale, scale_of
from castfem.studies.sensitivity.parameters import LEVELS, Parameter
from castfem.studies.sensitivity.result import Row, per

_DIFFERENCE = "delta_"  # before the unit of a difference of two temperatures
_OF_TABLE = ("percent", "%")


@dataclass(frozen=True, slots=True)
class ShownRow:
    """A derivative in the units that were chosen.

    Attributes:
        at: Value of the parameter. at_unit: Its unit.
        spread: By how much it may differ. spread_unit: Its unit.
        value: Derivative. error: Of it. sides: As those of a row. unit: Of these.
    """

    at: float
    at_unit: str
    spread: float
    spread_unit: str
    value: float
    error: float
    sides: tuple[float, float] | None
    unit: str

    @classmethod
    def of(cls, row: Row) -> ShownRow:
        """A derivative as it is shown."""
        up = scale_of(unit_of_difference(row.quantity.shown_unit), row.name)
        level, down = scales_of(row.parameter)
        ratio = up.factor / down.factor
        sides = None if row.sides is None else (ratio * row.sides[0], ratio * row.sides[1])
        up_unit, down_unit = (one.unit.removeprefix(_DIFFERENCE) for one in (up, down))
        return cls(
            at=level(row.parameter.value),
            at_unit=level.unit,
            spread=down.factor * row.parameter.spread,
            spread_unit=down_unit,
            value=ratio * row.value,
            error=ratio * row.error,
            sides=sides,
            unit=per(up_unit, down_unit, level=False),
        )


def scales_of(parameter: Parameter) -> tuple[Scale, Scale]:
    """What turns the value of a parameter, and a difference of it, into what is shown."""
    unit = parameter.unit
    difference = "K" if unit in LEVELS else unit
    plain = Scale(unit), Scale(difference)
    if not unit or unit in _OF_TABLE:
        return plain
    try:
        return scale_of(unit), scale_of(difference)
    except ValueError:  # of an own property file, say
        return plain
