"""What all tables of a case file have in common."""

from __future__ import annotations

from typing import Any

from pydantic import (
    BaseModel,
    ConfigDict,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)

LENIENT: dict[str, bool] = {"lenient": True}
"""Validation context in which a bad value becomes None instead of an error.

With it the checks across keys can still run on the sound part of a faulty case, so that all
problems are reported at once.
"""


def written(default: str) -> Any:
    """Return a default as a user would write it; it is validated into SI like any other value."""
    return default


class TableModel(BaseModel):
    """A table of the case file: unknown keys are refused, values cannot be changed."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        validate_default=True,
        protected_namespaces=(),
        defer_build=True,  # a table is built as part of the whole case, and not by itself before
    )

    def __setstate__(self, state: dict[Any, Any]) -> None:
        """Build the table, which another process has validated, so that it can be written here."""
        if not type(self).__pydantic_complete__:
            type(self).model_rebuild()
        super().__setstate__(state)

    @field_validator("*", mode="wrap")
    @classmethod
    def _keep_going(
        cls, value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> Any:
        try:
            return handler(value)
        except ValidationError:
            if info.context and info.context.get("lenient"):
                return None
            raise
