"""A reference is a number of the case it was written for, not of one that was changed since."""

from __future__ import annotations

from pathlib import Path

import pytest

import castfem
from castfem.model import load_any, load_case
from castfem.model.case import Case
from castfem.model.shipped_cases import find

THERMAL = find("billet125/thermal")


def marks(case: Case) -> set[tuple[str, ...]]:
    return {r.changed or () for r in case.reference}


@pytest.mark.parametrize(
    ("change", "keys"),
    [
        ('casting.speed="3 m/min"', ("casting.speed",)),
        ('cooling.mould.surface.0.wall="120 degC"', ("cooling.mould.surface.0.wall",)),
        ('casting.temperature="1500 degC"', ("casting.superheat", "casting.temperature")),
        ('casting.speed="60 mm/s"', ()),  # what it was
        ('casting.length="700 mm"', ()),  # the numbers hold at 600 mm
        ("output.figures=false", ()),
    ],
)
def test_change_of_the_physics_is_noted(change: str, keys: tuple[str, ...]) -> None:
    assert marks(load_case(THERMAL, [change])) == {keys}


def test_change_is_remembered_and_followed_by_others(tmp_path: Path) -> None:
    case = castfem.load(THERMAL).with_(speed="3 m/min")
    assert marks(case) == {("casting.speed",)}
    (tmp_path / "case.toml").write_text(case.resolved_toml(), encoding="utf-8")
    again = load_case(tmp_path / "case.toml", ["steel.name=carbon_010"])
    assert marks(again) == {("casting.speed", "steel.name")}


def test_case_that_extends_another_inherits_its_numbers_as_such(tmp_path: Path) -> None:
    text = f'extends = "{THERMAL}"\n[casting]\nspeed = "3 m/min"\n'
    own = '[[reference]]\nquantity = "time"\nvalue = "12 s"\nsource = "arithmetic"\n'
    (tmp_path / "slow.toml").write_text(text, encoding="utf-8")
    (tmp_path / "own.toml").write_text(text + own, encoding="utf-8")
    assert marks(load_case(tmp_path / "slow.toml")) == {("casting.speed",)}
    assert marks(load_case(tmp_path / "own.toml")) == {()}


def test_number_at_the_end_is_of_the_length_it_was_written_for(tmp_path: Path) -> None:
    own = '[[reference]]\nquantity = "time"\nvalue = "10 s"\nsource = "arithmetic"\n'
    (tmp_path / "own.toml").write_text(f'extends = "{THERMAL}"\n{own}', encoding="utf-8")
    case = load_case(tmp_path / "own.toml", ['casting.length="500 mm"'])
    assert marks(case) == {("casting.length",)}


def test_tensile_test_with_another_law() -> None:
    case = load_any(find("tensile/constant_rate"), ['tensile.temperature="1000 degC"'])
    assert {r.changed for r in case.reference} == {("tensile.temperature",)}


def test_shipped_cases_are_unchanged() -> None:
    for file in THERMAL.parents[1].glob("*/*.toml"):
        assert all(r.changed is None for r in load_any(file).reference), file
