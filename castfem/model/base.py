"""Base classes of the tables of a case file, including tables that come in several kinds."""

from __future__ import annotations

import ast
import inspect
import sys
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NoReturn, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic_core import PydanticKnownError, core_schema

from castfem.base.units import nearest

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
    from pydantic_core import CoreSchema


PROPERTY_FILES: tuple[tuple[str, str], ...] = (
    ("steel", "name"),
    ("mechanics", "law"),
    ("mechanics", "elasticity"),
    ("tensile", "material"),
    ("tensile", "elasticity"),
)
"""Tables and keys that name a property set, shipped or of a file."""
LENIENT: dict[str, bool] = {"lenient": True}
"""Validation context in which a bad value becomes `UNREADABLE` instead of an error.

This lets the checks across keys run on the sound part of a faulty case, so that all problems are
reported at once.
"""


Faults = Iterator[tuple[str, str]]
"""Faults of a table: the key within it, and what is wrong with its value."""


def is_path(name: str) -> bool:
    """Return whether the name of a property set is a file, not a shipped set."""
    return name.endswith(".toml") or "/" in name or name.startswith(".")


class FaultyError(Exception):
    """A check has requested a value that could not be read."""


class Unreadable:
    """Stands for a value that could not be read; any operation on it raises `FaultyError`."""

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
        defer_build=True,  # validated as part of the whole case, not on import
    )

    def __setstate__(self, state: dict[Any, Any]) -> None:
        """Restore a table that another process has validated, so that it can be written here."""
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
    """Annotation of a table that one word may replace: the value of its main key."""

    key: str  #: the main key
    words: tuple[str, ...]  #: allowed values of the main key if no other key has to be given
    example: str = ""  #: the table written out; "" if the table itself refuses other words

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
    """Return the description of each key of a table: the docstring of its attribute or Field."""
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


class Variants(TableModel):
    """Base of a table that comes in several kinds.

    A base names its key and has an empty dict for its kinds; each subclass registers itself.
    """

    tag_key: ClassVar[str]
    kinds: ClassVar[dict[str, Any]]
    """Models of the kinds by the value of the key, in the order of their definition."""

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Register a kind under its value of the key.

        Raises:
            TypeError: It lacks an abstract method of the base; raised where the kind is defined,
                not in the middle of a run.
        """
        super().__pydantic_init_subclass__(**kwargs)
        tag = tag_of(cls)
        if tag is None:
            return
        if inspect.isabstract(cls):
            missing = ", ".join(sorted(cls.__abstractmethods__))
            raise TypeError(f'{cls.__name__} ({cls.tag_key} = "{tag}") does not define {missing}')
        cls.kinds[tag] = cls

    @property
    def tag(self) -> str:
        """Name of this kind in a case file."""
        return str(getattr(self, self.tag_key))

    @classmethod
    def variants(cls) -> list[type[TableModel]]:
        """Return the kinds of a base; a kind itself has none."""
        return list(cls.kinds.values()) if cls._is_base() else []

    @classmethod
    def _is_base(cls) -> bool:
        return "kinds" in vars(cls)

    @classmethod
    def _chosen(cls, given: Any, info: ValidationInfo) -> Self:
        """Return the selected kind, validated."""
        if isinstance(given, cls):
            return given
        tag = given.get(cls.tag_key) if isinstance(given, Mapping) else None
        if tag is None:
            raise PydanticKnownError("union_tag_not_found", {"discriminator": cls.tag_key})
        model = cls.kinds.get(tag) if isinstance(tag, str) else None
        if model is None:
            known = ", ".join(f"'{name}'" for name in cls.kinds)
            raise PydanticKnownError(
                "union_tag_invalid",
                {"discriminator": cls.tag_key, "tag": str(tag), "expected_tags": known},
            )
        found: Self = model.model_validate(given, context=info.context)
        return found

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a kind; the schema of a base selects the kind from the input."""
        if cls._is_base():
            return core_schema.with_info_plain_validator_function(cls._chosen)
        return handler(source)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema; for a base, any of the schemas of its kinds."""
        if not cls._is_base():
            return handler(schema)
        choices = {tag: model.__pydantic_core_schema__ for tag, model in cls.kinds.items()}
        found = handler(core_schema.tagged_union_schema(choices, discriminator=cls.tag_key))
        found.pop("discriminator", None)  # not a JSON schema keyword
        return found


def tag_of(model: type[TableModel]) -> str | None:
    """Return the value of the key that a kind stands for; None for a base and other tables."""
    field = model.model_fields.get(model.tag_key) if issubclass(model, Variants) else None
    if field is None or typing.get_origin(field.annotation) is not Literal:
        return None
    return str(typing.get_args(field.annotation)[0])
