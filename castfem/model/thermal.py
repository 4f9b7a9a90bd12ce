"""The table [thermal]: how the heat equation is solved."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from castfem.base.quantities import PositiveDifference, Time
from castfem.model.base import TableModel, written


def _scalar(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("a PETSc option is a text, a number, true or false")
    return value


PetscOption = Annotated[
    Any, AfterValidator(_scalar), WithJsonSchema({"type": ["string", "number", "boolean"]})
]


class Adaptive(TableModel):
    """Steps chosen from an estimate of the error in time."""

    tolerance: PositiveDifference = Field(written("0.5 K"), description="error allowed in one step")
    first: Time = Field(written("1 ms"), description="first step, and after each change of zone")
    smallest: Time = Field(written("0.01 ms"), description="smallest step; the run fails below it")
    largest: Time = Field(written("0.5 s"), description="largest step")


class Stepping(TableModel):
    """Steps in time: `step` for fixed ones or [thermal.time.adaptive], the default."""

    scheme: Literal["sdirk2", "backward_euler"] = Field(
        "sdirk2", description="second-order L-stable scheme, or first-order backward Euler"
    )
    step: Time | None = Field(None, description="fixed step", examples=["50 ms"])
    adaptive: Adaptive | None = Field(None, description="bounds of steps that adapt themselves")

    @model_validator(mode="before")
    @classmethod
    def _adapt_by_default(cls, given: Any) -> Any:
        if isinstance(given, dict) and not {"step", "adaptive"} & given.keys():
            return given | {"adaptive": {}}
        return given


class Thermal(TableModel):
    """The thermal problem."""

    form: Literal["enthalpy"] = Field("enthalpy", description="form of the heat equation")
    solver: dict[str, PetscOption] = Field(
        default_factory=dict, description="PETSc options of the nonlinear solver, merged over ours"
    )
    time: Stepping = Field(
        default_factory=lambda: Stepping.model_validate({}), description="steps in time"
    )
