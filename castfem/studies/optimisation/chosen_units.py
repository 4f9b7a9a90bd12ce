"""Results of a search in the units that were chosen, for what is printed and drawn."""

from __future__ import annotations

from castfem.base.shown_quantity import unit_of_difference
from castfem.base.shown_units import Scale, scale_of
from castfem.studies.optimisation.front import Front, Weighed
from castfem.studies.optimisation.optimum import Known, Optimum

_DIFFERENCE = "delta_"


def scale(result: Known | Weighed) -> Scale:
    """What turns a result in its documented unit into what is shown."""
    return scale_of(result.shown_unit, result.name)


def difference_scale(result: Known | Weighed) -> Scale:
    """The same of a difference."""
    return scale_of(unit_of_difference(result.shown_unit), result.name)


def value_in(result: Known | Weighed, value: float) -> float:
    """A value in SI as it is shown."""
    return float(scale(result)(result.shown(value)))


def difference_in(result: Known | Weighed, value: float) -> float:
    """A difference in SI as it is shown."""
    return float(difference_scale(result)(result.shown_difference(value)))


def spread_scale(optimum: Optimum, number: int) -> Scale:
    """What turns the changes of a row of a spread into what is shown; a variable's stay as asked.

    Args:
        optimum: Has the spread.
        number: Of the row: the objective, the constraints, the variables.
    """
    assert optimum.spread is not None
    row = optimum.spread.rows[number]
    if row.error is None or optimum.objective is None:
        return Scale(row.unit)
    known = (optimum.objective, *(kept.known for kept in optimum.constraints))[number]
    return scale_of(row.unit, known.name)


def unit_name(unit: str) -> str:
    """A unit as tables of a search have it; empty for none."""
    return {"-": "", "percent": "%"}.get(unit, unit.removeprefix(_DIFFERENCE))


def heading(result: Known | Weighed) -> str:
    """The name of a result with the unit in which it is shown."""
    unit = scale(result).unit
    return result.name if unit == "-" else f"{result.name} [{unit}]"


def in_words(result: Known | Weighed) -> str:
    """What a figure calls a result, with the unit in which it is shown."""
    unit = unit_name(scale(result).unit)
    return f"{result.label} [{unit}]" if unit else result.label


def price_heading(front: Front) -> str:
    """What heads the price of a front."""
    units = [difference_scale(one).unit for one in (front.first, front.second)]
    named = ["1" if unit == "-" else unit.removeprefix(_DIFFERENCE) for unit in units]
    return f"price [{' per '.join(named)}]"


def price_in(front: Front, price: float) -> float:
    """A price in SI as it is shown."""
    return difference_in(front.first, price) / difference_in(front.second, 1.0)
