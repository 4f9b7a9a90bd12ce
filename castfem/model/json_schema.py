"""The JSON schema of case files, by which editors complete and check them while they are typed."""

from __future__ import annotations

import json
from typing import Any

from castfem.model.case import Case
from castfem.model.section import Section
from castfem.model.tensile import TABLE, TensileCase

_INHERITED = (
    *(
        "Case",
        "Casting",
        "Steel",
        "Mesh",
        "Mould",
        "Machine",
        "Quality",
        "Optimise",
        "Thermal",
        "Stepping",
        "Adaptive",
    ),
    "Output",
)


def case_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a case file.

    A file that extends another may leave out what the other has, so nothing is required in the
    tables that merge; the entries of arrays, which are replaced, must be whole.
    """
    schema = Case.model_json_schema()
    tables = schema["$defs"]
    test = TensileCase.model_json_schema()
    for name in ("Tensile", "Segment"):
        tables[name] = test["$defs"][name]
    tables["Tensile"].pop("required", None)
    schema["properties"][TABLE] = test["properties"][TABLE]
    _plain(schema)
    for name in _INHERITED:
        tables.get(name, schema if name == "Case" else {}).pop("required", None)
    for name in _shapes():
        tables[name].pop("required", None)
    schema["properties"]["section"] = _section(tables)
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


def _shapes() -> list[str]:
    """Return the names of the models of all shapes of section."""
    return [model.__name__ for model in Section.variants()]


def _section(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of [section]: any shape, known or inherited."""
    shapes = _shapes()
    for name in shapes:
        tables[name]["properties"]["shape"].pop("default", None)
    return {"anyOf": [{"$ref": f"#/$defs/{name}"} for name in shapes]}


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
