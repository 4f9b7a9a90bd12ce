"""The JSON schema of case files, by which editors complete and check them while they are typed."""

from __future__ import annotations

import json
from typing import Any

from castfem.model.base import meaning
from castfem.model.case import Case
from castfem.model.problems import tables
from castfem.model.section import Section
from castfem.model.tensile import TABLE, TensileCase
from castfem.model.variants import Variants


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
