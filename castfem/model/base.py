"""What all tables of a case file have in common."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NoReturn

from pydantic import (
    BaseModel,
    ConfigDict,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)

from castfem.base.units import nearest

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic_core import CoreSchema

LENIENT: dict[str, bool] = {"lenient": True}
"""Validation context in which a bad value becomes `UNREADABLE` instead of an error.

With it the checks across keys can still run on the sound part of a faulty case, so that all
problems are reported at once.
"""


class FaultyError(Exception):
    """A check has asked for a value that could not be read."""


class Unreadable:
    """Stands for a value that could not be read; to ask it for anything raises `FaultyError`."""

    def _refuse(self, *_: object) -> NoReturn:
        raise FaultyError

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        raise FaultyError

    __hash__ = object.__hash__
    __eq__ = __lt__ = __le__ = __gt__ = __ge__ = _refuse  # type: ignore[assignment]
    __bool__ = __len__ = __iter__ = __contains__ = __getitem__ = __call__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = _refuse
    __rtruediv__ = __neg__ = __abs__ = __float__ = __int__ = __str__ = __format__ = _refuse
    __mod__ = _refuse


UNREADABLE = Unreadable()


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
                return UNREADABLE
            raise


@dataclass(frozen=True, slots=True)
class OneWord:
    """Annotation of a table that a single word may stand for: that word under its main key.

    Attributes:
        key: The main key.
        words: What it may be where nothing else has to be given.
        example: The table written out; "" where the table itself refuses other words.
    """

    key: str
    words: tuple[str, ...]
    example: str = ""

    def _table(self, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        if self.example and given not in self.words:
            raise ValueError(
                f"must be {' or '.join(self.words)}, or a table with '{self.key}', such as "
                f"{self.example}{nearest(given, self.words)}"
            )
        return {self.key: given}

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self._table, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"enum": list(self.words)}, handler(schema)]}


@cache
def meaning(model: type[BaseModel]) -> dict[str, str]:
    """Return what each key of a table means: the docstring of the attribute, or of its Field."""
    found: dict[str, str] = {}
    for base in (base for base in reversed(model.__mro__) if issubclass(base, TableModel)):
        found |= _attribute_docstrings(base.__module__).get(base.__name__, {})
    own = {name: field.description for name, field in model.model_fields.items()}
    return {name: text or found.get(name, "") for name, text in own.items()}


@cache
def _attribute_docstrings(module: str) -> dict[str, dict[str, str]]:
    """Return the docstrings of the attributes of the table models of a module, by class."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, SyntaxError):  # without source, such as in an interactive session
        return {}
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef))
    return {node.name: dict(_documented(node.body)) for node in classes}


def _documented(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for key, text in pairwise(body):
        if (
            isinstance(key, ast.AnnAssign)
            and isinstance(key.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
        ):
            yield key.target.id, " ".join(str(text.value.value).split())
