"""References and units of results: permitted names, and outdated references."""

from __future__ import annotations

from pathlib import Path

import pytest
from runs.billet_runs import FED, billet, run_in_memory

import castfem
from castfem.base.errors import InputError
from castfem.base.result_registry import unit_of
from castfem.base.shown_quantity import si_unit
from castfem.model import load_any, load_case
from castfem.model.case import Case
from castfem.model.shipped_cases import find
from castfem.model.shown_units import read_choice

REFERENCE = '\n[[reference]]\nquantity = "{}"\nvalue = "{}"\nsource = "a book"\n'


@pytest.mark.parametrize(
    ("quantity", "value", "message"),
    [
        ("shell_mid_face", "4 kg", r'reference\.0\.value: \("4 kg"\) does not measure.*"mm"'),
        ("shell_mid_face", "4", r"reference\.0\.value"),
        ("axial_strain", "1 mm", "a plain number"),
        ("shel_mid_face", "4 mm", r"reference\.0\.quantity.*did you mean shell_mid_face"),
        ("shell", "4 mm", r"reference\.0\.quantity"),
        ("gap_mid_faces", "4 mm", r"reference\.0\.quantity.*did you mean gap_mid_face\?"),
    ],
)
def test_invalid_references_are_refused(write, sound, quantity, value, message):
    with pytest.raises(InputError, match=message):
        load_case(write(sound + REFERENCE.format(quantity, value)))


def test_other_units_and_images_of_symmetry(write, sound):
    for quantity, value in (
        ("shell_mid_face", "0.2 inch"),
        ("surface_temperature_corner_intrados", "900 degC"),
        ("contact_share", "80 percent"),
        ("axial_strain", "-0.002"),
    ):
        load_case(write(sound + REFERENCE.format(quantity, value)))


def test_all_results_of_a_run_are_known():
    friction = 'mould.friction={law="coulomb", coefficient=0.3}'
    half = "section.symmetry=half"
    case = billet("taper_1", *FED, "casting.length=20 mm", friction, half)
    summary = run_in_memory(case).summary
    for name, quantity in summary.quantities.items():
        unit = unit_of(name)
        assert unit is not None, name
        assert si_unit(unit) == si_unit(quantity.shown_unit), name
    assert len(summary.quantities) > 40


THERMAL = find("billet125/thermal")


def marks(case: Case) -> set[tuple[str, ...]]:
    return {r.changed or () for r in case.reference}


@pytest.mark.parametrize(
    ("change", "keys"),
    [
        ('casting.speed="3 m/min"', ("casting.speed",)),
        ('cooling.mould.surface.0.wall="120 degC"', ("cooling.mould.surface.0.wall",)),
        ('casting.temperature="1500 degC"', ("casting.superheat", "casting.temperature")),
        ('casting.speed="60 mm/s"', ()),  # the same value
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


def test_inherited_numbers_are_marked_as_changed(tmp_path: Path) -> None:
    text = f'extends = "{THERMAL}"\n[casting]\nspeed = "3 m/min"\n'
    own = '[[reference]]\nquantity = "time"\nvalue = "12 s"\nsource = "arithmetic"\n'
    (tmp_path / "slow.toml").write_text(text, encoding="utf-8")
    (tmp_path / "own.toml").write_text(text + own, encoding="utf-8")
    assert marks(load_case(tmp_path / "slow.toml")) == {("casting.speed",)}
    assert marks(load_case(tmp_path / "own.toml")) == {()}


def test_number_at_the_end_belongs_to_its_length(tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ('"imperial"', 'output.units: "imperial" is not a system of units'),
        ('{ shell = "MPa" }', "output.units.shell: 'MPa' is the unit of a pressure"),
        ('{ shel = "mm" }', "output.units.shel: .*did you mean shell"),
        ('{ length = "ells" }', "output.units: length: unit 'ells' is not known"),
        ("3", "output.units: .*is needed"),
    ],
)
def test_invalid_units_are_refused(write, sound, value: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_case(write(f"{sound}\n[output]\nunits = {value}\n"))
    assert len(caught.value.problems) == 1


def test_choice_of_units_is_written_as_read(write, sound) -> None:
    case = load_case(write(f'{sound}\n[output]\nunits = {{ system = "si", length = "inch" }}\n'))
    assert case.document()["output"]["units"] == {"system": "si", "length": "inch"}
    assert case.physics_hash() == load_case(write(sound)).physics_hash()
    assert "units" not in load_case(write(sound)).document()["output"]


@pytest.mark.parametrize("given", ["imperial", "length=degF", "shel=mm"])
def test_invalid_units_on_the_command_line(given: str) -> None:
    with pytest.raises(InputError, match="--units"):
        read_choice([given])
