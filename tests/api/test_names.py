"""Bare names of keys."""

from __future__ import annotations

import pytest
from small_case import write_small

import castfem


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return castfem.load(write_small(tmp_path_factory.mktemp("case")))


def test_bare_and_dotted_are_one(case):
    assert case.with_(speed="3 m/min") == case.with_({"casting.speed": "3 m/min"})
    assert case.with_(wall="100 degC") == case.with_({"cooling.mould.surface.0.wall": "100 degC"})


def test_key_that_has_its_default(case):
    assert case.mesh.order == 1
    assert case.with_(order=2).mesh.order == 2


def test_key_that_excludes_another(case):
    hot = case.with_(temperature="1600 degC")
    assert hot.casting.superheat is None
    assert hot.casting.temperature == pytest.approx(1873.15)


def test_top_level_wins(case):
    assert case.with_(title="other").title == "other"


def _problem(case, **changes) -> str:
    with pytest.raises(castfem.InputError) as caught:
        case.with_(**changes)
    (line,) = caught.value.problems
    return line


def test_ambiguous_name_lists_the_candidates(case):
    assert _problem(case, name="x") == (
        "with_: name: may stand for steel.name, cooling.mould.name; write one in full"
    )


def test_unknown_name_proposes_the_full_key(case):
    assert _problem(case, sped="3 m/min") == (
        "with_: sped: no table of the case has a key of this name; did you mean casting.speed?"
    )


def test_key_of_a_table_the_case_does_not_have(case):
    assert _problem(case, friction="none").endswith("; did you mean mould.friction?")


def test_references_are_not_meant(case):
    problem = _problem(case, source="x")
    assert "no table" in problem
    assert "reference" not in problem


def test_bad_value_names_the_full_key(case):
    assert _problem(case, speed="3 kg").startswith("with_: casting.speed: ")
