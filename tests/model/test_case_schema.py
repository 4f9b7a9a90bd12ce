"""The JSON schema and the reference page agree with the models and with the shipped cases."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from castfem.cli.app import starter
from castfem.model import load_any, load_case
from castfem.model.base import tag_of
from castfem.model.case import Case
from castfem.model.casting import CONTACT_FIELDS
from castfem.model.problems import submodels
from castfem.model.schema import case_schema, markdown_page
from castfem.model.shipped_cases import shipped
from castfem.model.tensile import TensileCase

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "cases").glob("*/*.toml"))


def _references(node):
    if isinstance(node, dict):
        if "$ref" in node:
            yield node["$ref"]
        for inner in node.values():
            yield from _references(inner)
    elif isinstance(node, list):
        for inner in node:
            yield from _references(inner)


def test_references_are_defined():
    schema = case_schema()
    found = set(_references(schema))
    assert found
    assert all(ref.removeprefix("#/$defs/") in schema["$defs"] for ref in found)


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(case_schema())
    return jsonschema.Draft202012Validator(case_schema())


def test_schema_accepts_the_shipped_cases(validator):
    for path in FILES:
        assert not list(validator.iter_errors(tomllib.loads(path.read_text()))), path


@pytest.mark.parametrize(
    "change",
    [
        {"titel": "x"},
        {"casting": {"speed": 3.6}},
        {"section": {"shape": "square"}},
        {"cooling": [{"name": "x", "surface": [{"law": "contact"}]}]},
        {"cooling": []},
        {"tensile": {"material": 3}},
    ],
)
def test_schema_refuses(change, validator):
    with pytest.raises(pytest.importorskip("jsonschema").ValidationError):
        validator.validate({"extends": "base.toml", **change})


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_shipped_cases_are_valid_and_resolve(path, tmp_path):
    case = load_any(path)
    copy = tmp_path / "case.toml"
    copy.write_text(case.resolved_toml())
    assert load_any(copy) == case


def test_one_key_extends_the_billet_to_a_full_caster():
    case = load_case(shipped()["billet125/thermal"], ["casting.length=20 m"])
    spans = case.zones()
    assert [span.name for span in spans] == ["mould", "foot spray", "spray 1", "spray 2", "air"]
    assert spans[-1].end == 20.0
    assert [r.si for r in load_case(shipped()["billet125/thermal"]).expected()] == [
        0.00475,
        0.0099,
        1515.15,
        1328.15,
        142700.0,
    ]


def test_starter_has_a_mould_in_comments(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        starter("mine.toml", "mine")
        .replace("# [m", "[m")
        .replace("# law", "law")
        .replace("# length", "length")
        .replace("# taper", "taper")
    )
    case = load_case(path)
    assert case.mechanics is not None and case.mould is not None
    assert case.mould.length == pytest.approx(0.8)
    assert {"temperature", "displacement", "von_mises"} <= set(case.output_fields)
    assert set(CONTACT_FIELDS) <= set(case.output_fields)


def test_reference_page_is_up_to_date():
    page = (ROOT / "docs" / "case_files.md").read_text(encoding="utf-8")
    assert page == markdown_page(), "regenerate it: make pages"


def test_reference_page_has_every_table_and_key():
    missing, todo, seen = [], [Case, TensileCase], set()
    page = markdown_page()
    while todo:
        model = todo.pop()
        for key, field in model.model_fields.items():
            inner = submodels(field.annotation)
            todo += [m for m in inner if m not in seen]
            seen.update(inner)
            tag = tag_of(model) is not None and key in ("law", "shape")
            if not (inner or tag) and f"| `{key}` |" not in page:
                missing.append(f"{model.__name__}.{key}")
        first = (model.__doc__ or "").strip().splitlines()[0]
        if model not in (Case, TensileCase) and first not in page:
            missing.append(model.__name__)
    assert not missing
    assert "| `law` |" in page
