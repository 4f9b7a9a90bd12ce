"""The table [thermal]: how the heat equation is solved."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from castfem.base.quantities import PositiveDifference, Time
from castfem.model.base import Faults, TableModel, written


def _scalar(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("a PETSc option is a text, a number, true or false")
    return value


PetscOption = Annotated[
    Any, AfterValidator(_scalar), WithJsonSchema({"type": ["string", "number", "boolean"]})
]


_BOUNDED = "rtol", "atol", "stol", "max_it", "max_funcs"
"""Endings of PETSc's tolerances and limits; PETSc replaces negative values by its defaults."""


def negative_options(options: Mapping[str, Any]) -> Faults:
    """Report negative tolerances and limits in a table `solver`."""
    for name, value in options.items():
        if not name.endswith(_BOUNDED):
            continue
        with suppress(ValueError):  # PETSc reports what is not a number
            if float(value) < 0.0:
                fix = "leave it out, or give a positive number"
                yield f"solver.{name}", f"({value}): must not be negative; {fix}"


class Adaptive(TableModel):
    """Adaptive time steps from an estimate of the time discretisation error."""

    tolerance: PositiveDifference = written("0.5 K")
    """allowed error of one step"""
    first: Time = written("1 ms")
    """shortest first step, at the meniscus and after each change of cooling; longer where the
    expected error allows"""
    smallest: Time = written("0.01 ms")
    """smallest step; the run fails below it"""
    largest: Time = written("2 s")
    """largest step"""


class Stepping(TableModel):
    """Time steps: `step` for fixed ones, or [thermal.time.adaptive], the default."""

    scheme: Literal["sdirk2", "backward_euler"] = "sdirk2"
    """second-order L-stable scheme, or first-order backward Euler"""
    step: Time | None = Field(None, examples=["50 ms"])
    """fixed step"""
    adaptive: Adaptive | None = None
    """settings of adaptive steps"""

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
    """PETSc options of the nonlinear solver; they take precedence over castfem's"""
    time: Stepping = Field(default_factory=lambda: Stepping.model_validate({}))
    """time steps"""


class Verification(TableModel):
    """A closed form with which the run is compared at its end."""

    closed_form: Literal["alloy_similarity", "neumann", "weiner_boley"]
    """a half-space of constant properties chilled to one temperature. alloy_similarity: an alloy
    whose solid fraction is linear in temperature; neumann: a melt that freezes at one temperature;
    weiner_boley: stress in the elastic, perfectly plastic shell"""
