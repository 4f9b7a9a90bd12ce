"""Problems of a case file as one-line messages: where, what, what is allowed, what was meant."""

from __future__ import annotations

import difflib
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from castfem.base.errors import Path, choices, dotted, shown, written
from castfem.base.quantities import Notation
from castfem.base.units import nearest
from castfem.model.base import TableModel, Variants, meaning, tag_of

_MISSING = object()
# similarity limits of misspelt keys: in the same table, and elsewhere
_BESIDE, _ELSEWHERE = 0.6, 0.8
NOT_MEANT = ("reference", "optimise")
"""Tables with results of a run: none of their keys is a setting."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Something wrong with a case."""

    path: Path  #: keys and indices of the faulty value; () for the whole case
    text: str  #: what is wrong, what is allowed
    kind: str = ""  #: pydantic's name of the error, empty for castfem's own checks
    inherited: bool = True  #: whether it is also reported for a case that inherits the key
    #: keys that do not go together; the one that was written last is to be corrected
    together: tuple[Path, ...] = ()


def at(data: Any, path: Path) -> Any:
    """Return the value at a path, `_MISSING` where there is none."""
    for part in path:
        within = isinstance(data, Sequence) and isinstance(part, int) and part < len(data)
        if within or (isinstance(data, Mapping) and part in data):
            data = data[part]
        else:
            return _MISSING
    return data


def from_validation(
    error: ValidationError, data: Mapping[str, Any], root: type[TableModel]
) -> list[Problem]:
    """Return the problems that pydantic found in a `root`, with paths as in the document."""
    found = []
    for details in error.errors(include_url=False):
        path, kind = details["loc"], details["type"]
        value = at(data, path)
        if kind == "too_short" and value:  # pydantic counts only the valid entries
            continue
        found.append(Problem(path, _text(details, path, value, root, data), kind))
    return found


def _text(
    details: ErrorDetails, path: Path, value: Any, root: type[TableModel], data: Mapping[str, Any]
) -> str:
    """Return the text of one problem: the fault (value); what is allowed; the nearest name."""
    kind, context = details["type"], details.get("ctx", {})
    given = "" if value is _MISSING else f" ({shown(value)})"
    if kind == "extra_forbidden":
        model = model_at(root, path[:-1], data)
        keys = list(model.model_fields) if model else []
        keys += ["extends"] if len(path) == 1 else []
        return f"unknown key{given}; allowed: {choices(keys)}{_meant(root, path, keys)}"
    if kind == "missing":
        return _missing(model_at(root, path[:-1], data), path)
    if kind == "union_tag_not_found":
        return (
            f"the key '{context['discriminator']}' is missing; one of {choices(_tags(root, path))}"
        )
    if kind == "union_tag_invalid":
        key, name, tags = context["discriminator"], str(context["tag"]), _tags(root, path)
        return f'{key} = "{name}" is not known; one of {choices(tags)}{nearest(name, tags)}'
    if kind == "literal_error":
        # A word that stands for a table is not at the path of its key.
        names, word = _literals(str(context.get("expected"))), details["input"]
        return f"not possible ({shown(word)}); one of {choices(names)}{nearest(str(word), names)}"
    if kind == "value_error":
        text = str(context["error"])
        named = value.get("file") if isinstance(value, Mapping) else value
        again = f"'{named}'" in text or f'"{named}"' in text
        return text if again else f"{text}{given}"
    if kind in ("tuple_type", "list_type") and isinstance(value, Mapping):
        return f"must be a list of tables, each of which begins with {_entry(path)}{given}"
    if kind == "greater_than_equal" and context.get("ge"):
        return f"must be at least {context['ge']}{given}"
    return f"{_PLAIN.get(kind, details['msg'])}{given}"


_PLAIN = {
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "string_type": "must be a text",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
    "too_short": "must not be empty",
    "string_too_short": "must not be empty",
    "greater_than_equal": "must not be negative",
    "string_pattern_mismatch": "takes at most 100 letters, digits, - and _; begins with neither",
}


def _missing(model: type[TableModel] | None, path: Path) -> str:
    """Say what is missing, and how it may be written."""
    field = model.model_fields.get(str(path[-1])) if model else None
    if field is None or model is None:
        return "is missing"
    what = meaning(model)[str(path[-1])]
    for mark in field.metadata:
        if isinstance(mark, Notation) and mark.quantity is not None:
            example = field.examples[0] if field.examples else mark.quantity.example
            return f"is missing; {what}, such as {written(example)}"
    if submodels(field.annotation):
        if _listed(field.annotation):
            return f"is missing; at least one table {_entry(path)} is needed"
        return f"the table [{dotted(path)}] is missing"
    return f"is missing; {what}"


def _listed(annotation: Any) -> bool:
    """Return whether an annotation stands for a list."""
    inner = typing.get_args(annotation)
    return typing.get_origin(annotation) in (tuple, list) or any(map(_listed, inner))


def _entry(path: Path) -> str:
    """Return the heading of an entry of an array of tables, `[[cooling.surface]]`."""
    return f"[[{dotted(tuple(part for part in path if isinstance(part, str)))}]]"


def _literals(expected: str) -> list[str]:
    """Return the names in pydantic's "'a', 'b' or 'c'"."""
    return [name.strip(" '") for name in expected.replace(" or ", ",").split(",")]


def submodels(annotation: Any) -> list[type[TableModel]]:
    """Return the table models that an annotation allows, in order."""
    if isinstance(annotation, type) and issubclass(annotation, TableModel):
        kinds = annotation.variants() if issubclass(annotation, Variants) else []
        return kinds or [annotation]
    origin = typing.get_origin(annotation)
    if origin is typing.Annotated:
        return submodels(typing.get_args(annotation)[0])
    if origin in (tuple, list, typing.Union, types.UnionType):
        return [m for inner in typing.get_args(annotation) for m in submodels(inner)]
    return []


class Table(NamedTuple):
    """A table that a case may have."""

    path: tuple[str, ...]  #: its keys
    model: type[TableModel]  #: its model; for a table of several kinds one for each
    listed: bool  #: whether it is, or lies in, an entry of an array
    heading: str  #: heading in a file, [[cooling]]


def tables(root: type[TableModel]) -> Iterator[Table]:
    """Yield the tables of a kind of case, the root first and inner tables after outer ones."""

    def within(table: Table) -> Iterator[Table]:
        yield table
        for key, field in table.model.model_fields.items():
            path, listed = (*table.path, key), _listed(field.annotation)
            heading = f"[[{dotted(path)}]]" if listed else f"[{dotted(path)}]"
            for model in submodels(field.annotation):
                yield from within(Table(path, model, listed or table.listed, heading))

    yield from within(Table((), root, False, ""))


def _meant(root: type[TableModel], path: Path, keys: list[str]) -> str:
    """Return "; did you mean X?" for an unknown key: one of its table, or of another one."""
    name = str(path[-1])
    if len(path) == 1 and (found := below(root, name)):
        return f"; did you mean {' or '.join(found)}?"
    here = tuple(part for part in path[:-1] if isinstance(part, str))
    homes: dict[str, dict[str, None]] = {}
    for table in tables(root):
        inner = [key for key in table.model.model_fields if key not in keys]
        for key in inner if table.path and table.path[0] not in NOT_MEANT else ():
            where = f"{key} of {table.heading}" if table.listed else dotted((*table.path, key))
            if table.path == here and issubclass(table.model, Variants):
                where = f'{key} of {table.model.tag_key} = "{tag_of(table.model)}"'
            homes.setdefault(key, {})[where] = None
    others = difflib.get_close_matches(name, homes, n=1, cutoff=_ELSEWHERE)
    own = difflib.get_close_matches(name, keys, n=1, cutoff=_BESIDE)
    if not others or difflib.get_close_matches(name, keys, n=1, cutoff=_ELSEWHERE):
        return nearest(name, keys)
    return f"; did you mean {' or '.join([*own, *list(homes[others[0]])[:3]])}?"


def below(root: type[TableModel], name: str) -> list[str]:
    """Return the keys of this name that tables of the top level have: `mould.friction`."""
    return [
        f"{table}.{name}"
        for table, field in root.model_fields.items()
        if any(name in model.model_fields for model in submodels(field.annotation))
    ]


def _tags(root: type[TableModel], path: Path) -> list[str]:
    model, field = root, None
    for part in path:
        if isinstance(part, str):
            field = model.model_fields[part]
            inner = submodels(field.annotation)
            model = inner[0] if inner else model
    found = submodels(field.annotation) if field is not None else []
    return [tag for tag in (tag_of(m) for m in found) if tag]


def model_at(
    root: type[TableModel], path: Path, data: Mapping[str, Any]
) -> type[TableModel] | None:
    """Return the table model at a path of the document, None if there is none."""
    model: type[TableModel] | None = root
    candidates: list[type[TableModel]] = [root]
    value: Any = data
    for part in path:
        value = at(value, (part,))
        if isinstance(part, str):
            field = model.model_fields.get(part) if model else None
            candidates = submodels(field.annotation) if field else []
        model = _chosen(candidates, value)
    return model


def _chosen(candidates: list[type[TableModel]], value: Any) -> type[TableModel] | None:
    """Return the model of a union that the tag in the value selects."""
    if len(candidates) == 1:
        return candidates[0]
    for model in candidates:
        if not (issubclass(model, Variants) and isinstance(value, Mapping)):
            continue
        if value.get(model.tag_key) == tag_of(model):
            return model
    return None
