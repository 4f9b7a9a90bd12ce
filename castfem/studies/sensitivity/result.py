"""Sensitivities of a run: reporting, writing and reading."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from castfem.base.atomic_files import plain, saving, write_json, write_text
from castfem.base.shown_quantity import Quantity, from_si, si_unit, to_si, unit_of_difference
from castfem.base.shown_units import Scale, scale_of
from castfem.runs.output.folder import DERIVATIVES_NAME
from castfem.studies.sensitivity.parameters import LEVELS, Parameter

JSON_NAME, CSV_NAME = "sensitivity.json", "sensitivity.csv"
_DIFFERENCE = "delta_"  # prefix of the unit of a temperature difference
_OF_TABLE = ("percent", "%")
REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Derivative:
    """The derivative of a result by a parameter, in SI per unit of the parameter."""

    quantity: str  #: name of the result
    parameter: str  #: name of the parameter
    below: float  #: towards smaller values of the parameter; NaN if the result does not exist
    above: float  #: towards larger ones
    #: for a depth of a front, smoothed over the cells behind it, with its standard error
    #: (`castfem.studies.sensitivity.fronts`); NaN with too few cells; None for anything else
    evened: tuple[float, float] | None = None
    #: typical deviation of differences of runs from `value` (`fronts.Scatter`); NaN if unknown
    error: float = math.nan

    @property
    def of_mesh(self) -> float:
        """Derivative of the discrete run: mean of both sides, which agree where it is smooth."""
        return 0.5 * (self.below + self.above)

    @property
    def value(self) -> float:
        """The reported value: smoothed if necessary, otherwise that of the discrete run."""
        return self.of_mesh if self.evened is None else self.evened[0]


@dataclass(frozen=True, slots=True)
class Kink:
    """Points of the surface whose contact status is about to change with a parameter."""

    parameter: str  #: its name
    position: float  #: position of the slice below the meniscus, m
    points: int  #: number of points
    place: tuple[float, float]  #: place of the outermost of them, (x, y), m


@dataclass(frozen=True, slots=True)
class Row:
    """A derivative for display."""

    quantity: Quantity
    name: str  #: name of the result
    parameter: Parameter
    value: float  #: derivative, in `unit`
    unit: str  #: unit of the result over that of the parameter
    #: relative change of the result over that of the parameter; NaN if either has an arbitrary
    #: zero, or is 0
    elasticity: float
    #: change of the result by the spread of the parameter, in the unit of its differences
    change: float
    #: one-sided derivatives, in `unit`, if they differ; None where it is smooth
    sides: tuple[float, float] | None
    #: typical deviation of differences of runs from it, in `unit`; NaN if unknown
    error: float = math.nan


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Results of a run and their derivatives by parameters of its case."""

    title: str  #: title of the case
    position: float  #: position of the results, m below the meniscus
    quantities: dict[str, Quantity]  #: results by name
    parameters: tuple[Parameter, ...]  #: parameters of the derivatives
    derivatives: tuple[Derivative, ...]  #: each result by each parameter
    steps: int  #: thermal steps of the run
    #: places where contact is about to change, so that derivatives are one-sided
    kinks: tuple[Kink, ...] = ()
    #: whether the run had mechanics, whose derivatives vary as the shell grows cell by cell
    strained: bool = False
    windows: int = 0  #: number of coupling windows
    #: number of times one was shortened for the error of its gap; with sufficiently different
    #: parameters the shortened length would differ, but the derivatives keep it fixed
    cut: int = 0

    @property
    def gradient(self) -> dict[str, dict[str, float]]:
        """Derivatives by result and parameter: SI (K) per `unit` of the parameter."""
        found: dict[str, dict[str, float]] = {name: {} for name in self.quantities}
        for one in self.derivatives:
            found[one.quantity][one.parameter] = one.value
        return found

    def rows(self) -> Iterator[Row]:
        """The derivatives for display, result by result."""
        parameters = {p.name: p for p in self.parameters}
        for name in self.quantities:
            for one in self.derivatives:
                if one.quantity == name:
                    yield self._row(one, parameters[one.parameter])

    def _row(self, one: Derivative, parameter: Parameter) -> Row:
        quantity = self.quantities[one.quantity]
        unit = unit_of_difference(quantity.shown_unit)
        slope, *sides = (from_si(x, unit) for x in (one.value, one.below, one.above))
        relative = math.nan
        absolute = quantity.shown_unit not in LEVELS and si_unit(quantity.shown_unit) != "K"
        if absolute and parameter.has_zero and quantity.value:
            relative = one.value * parameter.value / quantity.value
        apart = abs(one.above - one.below)
        noise = 1e-11 * abs(quantity.value) / parameter.step
        kinked = apart > 1e-2 * max(abs(one.below), abs(one.above)) + noise
        kinked = kinked and one.evened is None
        return Row(
            quantity, one.quantity, parameter, slope, per(unit, parameter.unit), relative,
            slope * parameter.spread, (sides[0], sides[1]) if kinked else None,
            from_si(one.error, unit),
        )  # fmt: skip

    def write(self, folder: Path) -> None:
        """Write the derivatives as JSON and as CSV.

        Raises:
            RunFailure: A file cannot be written.
        """
        with saving(folder):
            folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / JSON_NAME, plain(self.to_json()))
        write_text(folder / CSV_NAME, self.to_csv())

    def to_json(self) -> dict[str, Any]:
        """The whole content, every number with its unit."""
        return {
            "title": self.title,
            "position": {"value": self.position, "unit": "m"},
            "quantities": {
                name: {"value": q.shown, "unit": q.shown_unit, "label": q.label}
                for name, q in self.quantities.items()
            },
            "parameters": {
                p.name: {"value": p.value, "unit": p.unit, "spread": p.spread}
                for p in self.parameters
            },
            "derivatives": [
                {
                    "quantity": row.name,
                    "parameter": row.parameter.name,
                    "value": row.value,
                    "unit": row.unit,
                    "elasticity": row.elasticity,
                    "error": row.error,
                    "sides": row.sides,
                }
                for row in self.rows()
            ],
            "kinks": [asdict(kink) for kink in self.kinks],
            "windows": self.windows,
            "windows_cut_for_error": self.cut,
        }

    def to_csv(self) -> str:
        """One row for each derivative."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(
            ("quantity", "value", "unit", "parameter", "at", "unit of parameter", "derivative",
             "unit of derivative", "error", "elasticity", "spread", "change")
        )  # fmt: skip
        for row in self.rows():
            p, q = row.parameter, row.quantity
            writer.writerow(
                (row.name, repr(q.shown), q.shown_unit, p.name, repr(p.value), p.unit,
                 repr(row.value), row.unit, repr(row.error), repr(row.elasticity), repr(p.spread),
                 repr(row.change))
            )  # fmt: skip
        return text.getvalue()


def per(unit: str, other: str, *, level: bool = True) -> str:
    """The unit of a derivative.

    Args:
        unit: Unit of the result.
        other: Unit of the parameter.
        level: Whether degrees Celsius are a temperature level, whose differences are in K.
    """
    other = "K" if level and other in LEVELS else other
    own = "1" if unit in ("-", "") else unit
    if not other:
        return own
    return f"{own}/({other})" if any(sign in other for sign in " /") else f"{own}/{other}"


@dataclass(frozen=True, slots=True)
class ShownRow:
    """A derivative in the chosen units."""

    at: float  #: value of the parameter, in `at_unit`
    at_unit: str
    spread: float  #: spread of the parameter, in `spread_unit`
    spread_unit: str
    value: float  #: derivative, in `unit` like all below
    error: float  #: its error
    sides: tuple[float, float] | None
    unit: str

    @classmethod
    def of(cls, row: Row) -> ShownRow:
        """Convert a derivative for display."""
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
    """Conversions of the value of a parameter, and of a difference of it, to the shown units."""
    unit = parameter.unit
    difference = "K" if unit in LEVELS else unit
    plain = Scale(unit), Scale(difference)
    if not unit or unit in _OF_TABLE:
        return plain
    try:
        return scale_of(unit), scale_of(difference)
    except ValueError:  # such as in a user's property file
        return plain


@dataclass(frozen=True, slots=True)
class Slope:
    """The derivative of a result by a parameter."""

    value: float  #: in SI (K) per `unit` of the parameter; NaN if the result does not exist
    at: float  #: the parameter, in `unit`; 100 for a multiplied table or property
    unit: str  #: "percent" for a multiplied table or property, "" for none


Slopes = Mapping[str, Mapping[str, Slope]]
"""Derivatives by name of the result and of the parameter."""


def read_slopes(folder: Path) -> Slopes | None:
    """Return the derivatives that a run has computed, empty if it could have none.

    None for a run without derivatives, or if the file cannot be read.
    """
    try:
        content = json.loads((folder / DERIVATIVES_NAME).read_text(encoding="utf-8"))
        if REFUSED in content:
            return {}
        units = {name: one["unit"] for name, one in content["quantities"].items()}
        parameters = content["parameters"]
        found: dict[str, dict[str, Slope]] = {name: {} for name in units}
        for one in content["derivatives"]:
            name, its = one["quantity"], parameters[one["parameter"]]
            value = to_si(one["value"], unit_of_difference(units[name]))
            found[name][one["parameter"]] = Slope(value, its["value"], its["unit"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return found
