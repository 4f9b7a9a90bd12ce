"""A steel of the user's own: his numbers stay, and its carbon is stated in its file."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.build.law import build_law
from castfem.physics.materials import load_steel

NUMBERS = """
description = "own"
{more}
solidus = {{ value = "1490 degC", source = "own" }}
liquidus = {{ value = "1520 degC", source = "own" }}
latent_heat = {{ value = "265 kJ/kg", source = "own" }}
density = {{ value = "7350 kg/m^3", source = "own" }}
specific_heat = {{ value = "700 J/(kg K)", source = "own" }}
conductivity = {{ value = "30 W/(m K)", source = "own" }}
emissivity = {{ value = 0.8, source = "own" }}
"""
CASE = 'extends = "billet125/taper_1"\n[steel]\nname = "./own.toml"\n'


def write(folder: Path, more: str = "") -> Path:
    (folder / "own.toml").write_text(NUMBERS.format(more=more))
    (folder / "case.toml").write_text(CASE + '[mechanics]\nlaw = "kozlowski_zhu"\n')
    return folder / "case.toml"


def test_a_composition_does_not_throw_it_away(tmp_path: Path) -> None:
    case = load_case(write(tmp_path), ["steel.composition.C=0.12"])
    assert case.steel.name.endswith("own.toml")
    with pytest.raises(InputError, match="write the composition into the file of your own steel"):
        load_steel(case.steel.name, composition=case.steel.composition)


def test_the_carbon_that_a_law_needs_is_stated_in_the_file(tmp_path: Path) -> None:
    case = load_case(write(tmp_path))
    assert case.mechanics is not None
    with pytest.raises(InputError, match=r"carbon: is missing.*composition = \{ C = 0.12 \}"):
        build_law(case.mechanics, load_steel(case.steel.name))
    case = load_case(write(tmp_path, "composition = { C = 0.12 }"))
    assert case.mechanics is not None
    steel = load_steel(case.steel.name)
    assert steel.composition["C"] == 0.12 and steel.solidus == pytest.approx(1763.15)
    build_law(case.mechanics, steel)
