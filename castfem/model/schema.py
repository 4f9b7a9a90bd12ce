"""What is written from the models: docs/case_files.md, and the JSON schema for editors."""

from __future__ import annotations

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

_HEAD = """\
# Case files

A case is one TOML file. This page is written by `castfem schema --markdown`; `castfem schema`
prints the JSON schema, by which editors complete case files, and `castfem init NAME` writes a
commented case to start from. `castfem check CASE` tells all problems of a file at once. Equation
numbers are those of [Pascon2003](references.md).

## Quantities

A quantity is a text of a number and its unit: `"3.6 m/min"`, `"1600 W/(m^2 K)"`, `"5 L/(m^2 s)"`.
Any unit of the right dimension will do (`"0.125 m"`, `"4.92 inch"`); a number without unit is
accepted only where there is none. A divisor of several units stands in brackets: `W/(m^2 K)`, not
`W/m^2 K`. Temperatures are `"160 degC"`, `"433.15 K"` or `"320 degF"`; a *difference* of
temperatures is written in kelvin, `"40 K"`.

Where a quantity may depend on temperature, time or position, a table may stand in its place: two
columns, their units named once (or a unit in each entry, `["20 degC", "100 degC"]`),

```toml
[cooling.surface.coefficient]
temperature = [700, 900, 1100]
temperature_unit = "degC"
value = [400, 300, 250]
unit = "W/(m^2 K)"
```

or a CSV file, `coefficient = { file = "spray.csv" }`, its path relative to the case file, that
begins with a line such as `temperature [degC], value [W/(m^2 K)]`
(the second column may have any name); lines that begin with `#` are
skipped, and so are empty rows and columns and a first line `sep=;`. Commas, semicolons or tabs
separate columns; between the latter two numbers may have decimal commas. All numbers of a file
have the same decimal mark and no thousands separators; a file in which `1,200` may be 1200 or 1.2
is refused, with the line. A table has at least two rows in increasing order; it is linear between
them and constant beyond.

## Inheriting and changing

`extends = "base.toml"` takes over another case file (relative to this one), which may extend a
third; `extends = "billet125/thermal"` a shipped case, by its name in `castfem cases`. Tables merge
key by key; arrays, `[[cooling]]` among them, are replaced as a whole. Single entries of an
inherited array change by their names: `[cooling.spray]` with `to = "6 m"` and `flow = "200 L/min"`
changes the zone `spray` and its heat law that has a `flow`, `[cooling.spray.radiation]` the law of
that name, `[[cooling.spray.surface]]` gives the zone other laws. Of two keys that exclude each
other (`superheat` and `temperature`, `step` and `adaptive`) the later one wins; a `[section]` of
another `shape` replaces the inherited one, and so does any `mould.taper`. What was inherited and
the new shape does not know (`mesh.corner_size`, sizes and tapers of the `[mould]`) is left out, and
`castfem check` says so: any shipped case with mechanics may become a round by
`--set 'section={shape="round", diameter="125 mm"}'`. Of the name of the steel and its
composition the later one wins, too: a steel that is named does away with an inherited
`[steel.composition]`, unless it is computed from one and has none of its own; a composition that
comes after a steel of fixed numbers is that of `plain_carbon`. `[steel.overrides]` stay, whatever
the steel.

On the command line `--set key=value` changes single keys, `--set casting.length="20 m"`. An entry
of an array is addressed by its index or, if it has one, by its name:
`--set cooling.mould.surface.0.coefficient="1200 W/(m^2 K)"`. The heat law of a zone may be left
out where one alone has the key, `--set cooling.mould.coefficient="1200 W/(m^2 K)"`, or be named,
`--set cooling.spray.radiation.emissivity=0.7`; a key without dots is looked for in all tables,
`--set superheat="25 K"`.

## The folder of a run

`castfem run` writes to `results/<family>/<name>`, or to the folder given with `-o`: the case as
resolved (`case.toml`, it runs again by itself), `fields.xdmf` with `fields.h5`, `history.csv`,
`summary.json`, `run.json`, `run.log`, `checkpoint.h5` and `figures/`. It never touches a file of
another name. A new run into the folder of a run with the same physics replaces that run; a run of
other physics is refused unless `--overwrite` is given, files of these names that castfem has not
written are refused in any case. `--resume` goes on from the last
checkpoint; output settings (other than which fields are written), title, references and
`casting.length` may have changed since, all else must be the same.

## Keys
"""

_TOP = """
### top of the file

| key | takes | default | meaning |
|---|---|---|---|
| `title` | text | required | one line that says what the case is |
| `extends` | text | none | case this one adds to: a file, relative to this one, or a shipped case |
"""


def markdown_page() -> str:
    """Return the whole reference page."""
    parts = [_HEAD, _TOP]
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
    """Return whether a key only tells which table of several this is; the heading shows it."""
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
    """Return the default of a key as it would be written."""
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

    A file that extends another may leave out what the other has, so nothing is required in the
    tables that merge; the entries of arrays, which are replaced, must be whole.
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
    """Take out of a schema what TOML does not have (null) and what editors do not need (titles)."""
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
    """Return the schema as it is printed."""
    return json.dumps(case_schema(), indent=2) + "\n"
