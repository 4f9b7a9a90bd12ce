"""Writes docs/case_files.md, and the JSON schema for editors, from the models."""

from __future__ import annotations

import importlib.resources
import json
import types
import typing
from collections.abc import Iterator
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from castfem.base.quantities import Notation
from castfem.model.base import Variants, meaning, tag_of
from castfem.model.case import Case
from castfem.model.problems import Table, submodels, tables
from castfem.model.section import Section
from castfem.model.tensile import TABLE, TensileCase, TensileOutput


def markdown_page() -> str:
    """Return the whole reference page."""
    head = importlib.resources.files("castfem.model").joinpath("case_files.md")
    parts = [head.read_text(encoding="utf-8")]
    parts += ["".join(_table(one)) for one in tables(Case) if one.path]
    parts += ["".join(_table(one)) for one in tables(TensileCase) if one.path != ("reference",)]
    return "".join(parts) + "".join(_groups())


def _table(table: Table) -> Iterator[str]:
    model, name = table.model, table.heading
    if model is TensileCase:
        return
    if (tag := tag_of(model)) is not None and issubclass(model, Variants):
        name += f', {model.tag_key} = "{tag}"'
    name += ", of a tensile test" if model is TensileOutput else ""
    text = (model.__doc__ or "").strip().splitlines()[0]
    yield f"\n### `{name}`\n\n{text}\n\n"
    yield "| key | takes | default | meaning |\n|---|---|---|---|\n"
    for key, field in model.model_fields.items():
        if _is_tag(key, field) or _is_table(field):
            continue
        yield f"| `{key}` | {_takes(field)} | {_default(field)} | {meaning(model)[key]} |\n"


def _is_tag(key: str, field: FieldInfo) -> bool:
    """Return whether a key only selects the kind of its table; the heading shows it."""
    return key in ("law", "shape") and typing.get_origin(field.annotation) is typing.Literal


def _is_table(field: FieldInfo) -> bool:
    return bool(submodels(field.annotation))


def _takes(field: FieldInfo) -> str:
    example = field.examples[0] if field.examples else None
    marks = (mark for mark in field.metadata if isinstance(mark, Notation))
    mark = next(marks, None)
    return _type(field.annotation, example) if mark is None else mark.described(example)


_WORDS = {str: "text", bool: "`true` or `false`", int: "whole number", Any: "values"}


def _type(annotation: Any, example: object = None) -> str:
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        marks = [mark for mark in inner[1:] if isinstance(mark, Notation)]
        return marks[0].described(example) if marks else _type(inner[0])
    if origin is typing.Literal:
        return ", ".join(f"`{value!r}`".replace("'", '"') for value in inner)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_type(part, example) for part in inner if part is not type(None))
    if origin is tuple:
        return f"list of {_type(inner[0])}"
    if origin is dict:
        return f"table of {_type(inner[1], example)}"
    return _WORDS[annotation]


def _default(field: FieldInfo) -> str:
    """Return the default of a key as written in a case file."""
    if field.is_required():
        return "required"
    if field.default_factory is not None:
        return "empty"
    value = field.default
    if value is None or value is PydanticUndefined or value in ("", ()):
        return "none"
    if isinstance(value, tuple):
        return "`[" + ", ".join(f'"{entry}"' for entry in value) + "]`"
    if isinstance(value, list):
        return f"`{json.dumps(value)}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value:g}`"


def _groups() -> Iterator[str]:
    yield "\n## Boundary groups\n\n"
    yield (
        "The names `on` may take; a name also stands for all groups that begin with it. Without\n"
        "`on` a law holds on all of them, on a strip on `surface` alone. Lines of symmetry are no\n"
        "surface. A sharp rectangle has no corner groups.\n\n"
    )
    yield "| section | part | groups |\n|---|---|---|\n"
    for section in _examples():
        names = ", ".join(f"`{name}`" for name in section.outer_groups())
        part = getattr(section, "symmetry", "")
        yield f"| {section.tag} | {part} | {names} |\n"


def _examples() -> Iterator[Section]:
    """Yield a section of each shape and, where it has symmetry, each part of it."""
    for tag, model in Section.kinds.items():
        symmetry = model.model_fields.get("symmetry")
        for part in typing.get_args(symmetry.annotation) if symmetry else ("",):
            yield model.model_construct(shape=tag, symmetry=part, corner_radius=1.0)


def case_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a case file.

    A file that extends another may leave out inherited keys, so nothing is required in tables that
    merge; array entries are replaced and must be complete.
    """
    schema, test = Case.model_json_schema(), TensileCase.model_json_schema()
    found = schema["$defs"]
    for name in ("Tensile", "Segment"):
        found[name] = test["$defs"][name]
    schema["properties"][TABLE] = test["properties"][TABLE]
    _plain(schema)
    for root in (Case, TensileCase):
        for table in tables(root):
            node = schema if table.model is Case else found.get(table.model.__name__, {})
            for key, text in meaning(table.model).items():
                if text and key in node.get("properties", {}):
                    node["properties"][key]["description"] = text
            merges = not table.listed and not issubclass(table.model, Variants)
            if merges or issubclass(table.model, Section):
                node.pop("required", None)
    shapes = [model.__name__ for model in Section.variants()]
    for name in shapes:
        found[name]["properties"]["shape"].pop("default", None)
    schema["properties"]["section"] = {"anyOf": [{"$ref": f"#/$defs/{name}"} for name in shapes]}
    schema["properties"]["extends"] = {
        "type": "string",
        "description": "case this one adds to: a file, relative to this one, or a shipped case",
        "examples": ["base.toml", "billet125/thermal"],
    }
    whole = ["title", "casting", "steel", "section", "mesh", "cooling"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "castfem case",
        **{key: value for key, value in schema.items() if key != "title"},
        "anyOf": [
            {"required": ["extends"]},
            {"required": whole},
            {"required": ["title", TABLE]},
        ],
    }


def _plain(node: Any) -> None:
    """Remove from a schema what TOML does not have (null) and editors do not need (titles)."""
    if isinstance(node, list):
        for inner in node:
            _plain(inner)
        return
    if not isinstance(node, dict):
        return
    node.pop("title", None) if isinstance(node.get("title"), str) else None
    if node.get("default", 0) is None:
        del node["default"]
    options = node.get("anyOf")
    if isinstance(options, list) and {"type": "null"} in options:
        options.remove({"type": "null"})
        if len(options) == 1:
            del node["anyOf"]
            for key, value in options[0].items():
                node.setdefault(key, value)
    for inner in node.values():
        _plain(inner)


def schema_text() -> str:
    """Return the schema as text."""
    return json.dumps(case_schema(), indent=2) + "\n"
