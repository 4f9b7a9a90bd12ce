"""The table [thermal]: how the heat equation is solved."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from castfem.base.quantities import PositiveDifference, Time
from castfem.model.base import TableModel, written
from castfem.model.checks import Faults, check, one_of


def _scalar(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("a PETSc option is a text, a number, true or false")
    return value


PetscOption = Annotated[
    Any, AfterValidator(_scalar), WithJsonSchema({"type": ["string", "number", "boolean"]})
]


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


@check("thermal.time")
def _one_stepping(case: Any, time: Stepping) -> Faults:
    yield from one_of(time, {"step": '"50 ms"', "adaptive": "{}"})


@check("thermal.time.adaptive")
def _bounds(case: Any, bounds: Adaptive) -> Faults:
    if not bounds.smallest <= bounds.first <= bounds.largest:
        yield (
            "",
            f"smallest ({bounds.smallest:g} s) <= first ({bounds.first:g} s) <= largest "
            f"({bounds.largest:g} s) does not hold",
        )
