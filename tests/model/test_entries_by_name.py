"""A file that extends another changes single zones by their names."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_case import SMALL

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.load import from_document

ZONES = """

[[cooling.surface]]
law = "radiation"
ambient = "60 degC"

[[cooling]]
name = "spray"

[[cooling.surface]]
law = "spray"
correlation = "nozaki"
water = "3 L/(m^2 s)"
water_temperature = "25 degC"

[[cooling.surface]]
law = "radiation"
ambient = "60 degC"

[thermal.time]"""


def base(folder: Path) -> None:
    text = SMALL.replace('name = "mould"', 'name = "mould"\nto = "30 mm"')
    (folder / "base.toml").write_text(text.replace("\n\n[thermal.time]", ZONES, 1))


def extended(folder: Path, more: str) -> Path:
    base(folder)
    path = folder / "own.toml"
    path.write_text(f'extends = "base.toml"\n{more}')
    return path


def test_one_zone_changes_and_the_others_stay(tmp_path: Path) -> None:
    more = '[cooling.mould]\nto = "40 mm"\n[cooling.spray]\nwater = "5 L/(m^2 s)"\n'
    found, old = load_case(extended(tmp_path, more)), load_case(tmp_path / "base.toml")
    assert [zone.to for zone in found.cooling] == [pytest.approx(0.04), None]
    assert found.cooling[1].surface[0].water == pytest.approx(5.0)  # type: ignore[attr-defined]
    assert found.cooling[1].surface[1] == old.cooling[1].surface[1]
    assert found.cooling[0].surface == old.cooling[0].surface
    document = old.document()
    document["cooling"][0]["to"] = "40 mm"
    document["cooling"][1]["surface"][0]["water"] = "5 L/(m^2 s)"
    assert from_document(document).physics_hash() == found.physics_hash()


def test_law_is_named_by_its_kind(tmp_path: Path) -> None:
    more = '[cooling.spray.radiation]\nambient = "80 degC"\nemissivity = 0.7\n'
    law = load_case(extended(tmp_path, more)).cooling[1].surface[1]
    assert (law.ambient, law.emissivity) == (pytest.approx(353.15), 0.7)  # type: ignore[attr-defined]


def test_later_keys_exclude_the_inherited_ones(tmp_path: Path) -> None:
    more = '[cooling.mould.contact]\nflux = "2 MW/m^2"\n'
    law = load_case(extended(tmp_path, more)).cooling[0].surface[0]
    assert law.flux == 2e6 and law.coefficient is None  # type: ignore[attr-defined]


def test_scripts_change_zones_by_name(tmp_path: Path) -> None:
    base(tmp_path)
    case = load_case(tmp_path / "base.toml").with_({"cooling": {"mould": {"to": "20 mm"}}})
    assert [zone.to for zone in case.cooling] == [pytest.approx(0.02), None]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[cooling.spry]\nto = "1 m"\n', "'spry' is not an entry of cooling.*did you mean spray"),
        ('[cooling]\nspray = "1 m"\n', r"cooling.spray: keys of this entry are needed"),
        ("[cooling.mould]\nwater = 5\n", "water"),
        (
            "[cooling.spray]\nto = 5\n",
            r'own.toml: cooling.1.to \(zone "spray"\): a length needs its unit',
        ),
    ],
)
def test_invalid_entries_are_refused(tmp_path: Path, more: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_case(extended(tmp_path, more))


def test_key_of_several_laws_is_refused(tmp_path: Path) -> None:
    more = '[cooling.mould]\non = ["corner"]\n'
    path = extended(tmp_path, more)
    text = (tmp_path / "base.toml").read_text()
    two = text.replace('law = "contact"', 'law = "contact"\non = ["corner"]').replace(
        'law = "radiation"', 'law = "radiation"\non = ["corner"]'
    )
    (tmp_path / "base.toml").write_text(two)
    with pytest.raises(InputError, match=r"mould.on: several heat laws .* \(contact, radiation\)"):
        load_case(path)


def test_full_array_still_replaces(tmp_path: Path) -> None:
    more = '[[cooling]]\nname = "all"\n[[cooling.surface]]\nlaw = "flux"\nvalue = "1 MW/m^2"\n'
    assert [zone.name for zone in load_case(extended(tmp_path, more)).cooling] == ["all"]
