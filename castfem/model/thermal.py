"""The table [thermal]: how the heat equation is solved."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from castfem.base.quantities import PositiveDifference, Time
from castfem.model.base import TableModel, written
from castfem.model.checks import Faults, check, one_of
from castfem.model.cooling import PrescribedTemperature
from castfem.model.section import Strip

if TYPE_CHECKING:
    from castfem.model.case import Case


def _scalar(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("a PETSc option is a text, a number, true or false")
    return value


PetscOption = Annotated[
    Any, AfterValidator(_scalar), WithJsonSchema({"type": ["string", "number", "boolean"]})
]


_BOUNDED = "rtol", "atol", "stol", "max_it", "max_funcs"
"""Ends of the names of PETSc's tolerances and counts; of a negative one it takes one of its own."""


def negative_options(options: Mapping[str, Any]) -> Faults:
    """Yield the tolerances and counts in a table `solver` that are negative."""
    for name, value in options.items():
        if not name.endswith(_BOUNDED):
            continue
        with suppress(ValueError):  # PETSc says what is no number
            if float(value) < 0.0:
                fix = "leave it out, or give a positive number"
                yield f"solver.{name}", f"({value}): must not be negative; {fix}"


class Adaptive(TableModel):
    """Steps chosen from an estimate of the error in time."""

    tolerance: PositiveDifference = written("0.5 K")
    """error allowed in one step"""
    first: Time = written("1 ms")
    """first step, and after each change of zone"""
    smallest: Time = written("0.01 ms")
    """smallest step; the run fails below it"""
    largest: Time = written("0.5 s")
    """largest step"""


class Stepping(TableModel):
    """Steps in time: `step` for fixed ones or [thermal.time.adaptive], the default."""

    scheme: Literal["sdirk2", "backward_euler"] = "sdirk2"
    """second-order L-stable scheme, or first-order backward Euler"""
    step: Time | None = Field(None, examples=["50 ms"])
    """fixed step"""
    adaptive: Adaptive | None = None
    """bounds of steps that adapt themselves"""

    @model_validator(mode="before")
    @classmethod
    def _adapt_by_default(cls, given: Any) -> Any:
        if isinstance(given, dict) and not {"step", "adaptive"} & given.keys():
            return given | {"adaptive": {}}
        return given


class Thermal(TableModel):
    """The thermal problem."""

    form: Literal["enthalpy"] = "enthalpy"
    """form of the heat equation"""
    solver: dict[str, PetscOption] = Field(default_factory=dict)
    """PETSc options of the nonlinear solver, merged over ours"""
    time: Stepping = Field(default_factory=lambda: Stepping.model_validate({}))
    """steps in time"""


@check("thermal")
def _solver(case: Any, thermal: Thermal) -> Faults:
    yield from negative_options(thermal.solver)


@check("thermal.time")
def _one_stepping(case: Any, time: Stepping) -> Faults:
    yield from one_of(time, {"step": '"50 ms"', "adaptive": "{}"})


@check("thermal.time.adaptive")
def _bounds(case: Any, bounds: Adaptive) -> Faults:
    if not bounds.smallest <= bounds.first <= bounds.largest:
        ends = f"smallest ({bounds.smallest:g} s) <= first ({bounds.first:g} s)"
        yield "", f"{ends} <= largest ({bounds.largest:g} s) does not hold"


class Verification(TableModel):
    """A closed form: the run ends with what it expects and how far off the run is."""

    closed_form: Literal["alloy_similarity", "neumann", "weiner_boley"]
    """half-space chilled to one temperature, of constant properties: an alloy with a solid fraction
    linear in temperature; a melt that freezes at one temperature; stress in the elastic, perfectly
    plastic shell of Weiner and Boley"""


@check("verification")
def _is_that_case(case: Case, table: Verification) -> Faults:
    """Yield what makes the case another one than that of its closed form."""
    key, name = "closed_form", table.closed_form
    if not isinstance(case.section, Strip):
        yield key, f'("{name}") is of a half-space: give section.shape = "strip"'
    laws = [law for zone in case.cooling for law in zone.surface]
    if len(laws) != 1 or not isinstance(laws[0], PrescribedTemperature):
        fix = 'give one cooling zone with one law = "temperature"'
        yield key, f'("{name}") is of a surface held at one temperature: {fix}'
    if name != "weiner_boley":
        return
    if case.mechanics is None:
        yield key, f'("{name}") is of stress: give the table [mechanics]'
    elif case.mechanics.law != name:
        yield key, f'("{name}") is of its own law: give mechanics.law = "{name}"'
    elif case.mechanics.strain != "small":
        yield key, f'("{name}") is of small strains: give mechanics.strain = "small"'
    elif case.coupling.follow_shape:
        yield key, f'("{name}") is of the slice as it was cast: give coupling.follow_shape = false'
    elif case.coupling.dissipation:
        yield key, f'("{name}") has no heat of flow: give coupling.dissipation = 0'
