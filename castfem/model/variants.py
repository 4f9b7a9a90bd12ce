"""Tables of which there are several kinds, told apart by one key: surface laws, section shapes.

A kind is a subclass of the table's base that gives that key one value, `law: Literal["spray"]`.
By this it is known wherever the base stands in a case: it is read, checked, written, and described
in the JSON schema and on the reference page.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from pydantic_core import PydanticKnownError, core_schema

from castfem.model.base import TableModel

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
    from pydantic_core import CoreSchema


class Variants(TableModel):
    """Base of a table that is of one of several kinds.

    A base names its key and has an empty dict for its kinds; its subclasses enter it by themselves.
    """

    tag_key: ClassVar[str]
    kinds: ClassVar[dict[str, Any]]
    """Models of the kinds by the value of the key, in the order of their definition."""

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Enter a kind under its value of the key.

        Raises:
            TypeError: It leaves out what the base asks of all kinds (its abstract methods): told
                where the kind is defined, not in the middle of a run.
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
        """Which kind this is, as a case file names it."""
        return str(getattr(self, self.tag_key))

    @classmethod
    def variants(cls) -> list[type[TableModel]]:
        """Return the kinds of a base; a kind has none."""
        return list(cls.kinds.values()) if cls._is_base() else []

    @classmethod
    def _is_base(cls) -> bool:
        return "kinds" in vars(cls)

    @classmethod
    def _chosen(cls, given: Any, info: ValidationInfo) -> Self:
        """Return the kind that is asked for, validated."""
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
        """Return the schema of a kind; that of a base looks for the kind when it is given one."""
        if cls._is_base():
            return core_schema.with_info_plain_validator_function(cls._chosen)
        return handler(source)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema: of a base, that of any of its kinds."""
        if not cls._is_base():
            return handler(schema)
        choices = {tag: model.__pydantic_core_schema__ for tag, model in cls.kinds.items()}
        found = handler(core_schema.tagged_union_schema(choices, discriminator=cls.tag_key))
        found.pop("discriminator", None)  # no word of JSON schema
        return found


def tag_of(model: type[TableModel]) -> str | None:
    """Return the value of the key that a kind stands for; None for a base and other tables."""
    field = model.model_fields.get(model.tag_key) if issubclass(model, Variants) else None
    if field is None or typing.get_origin(field.annotation) is not Literal:
        return None
    return str(typing.get_args(field.annotation)[0])
