"""A steel of the user's own: his numbers stay, and its carbon is stated in its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
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
ROOT = Path(__file__).parents[2] / "cases"
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


def test_each_modulus_of_a_steel_counts_by_itself() -> None:
    """One that is given alone is not dropped; what the steel lacks is that of the named set."""
    kelvin = np.array([1300.0])

    def moduli(name: Path, *changes: str) -> tuple[float, float]:
        case = load_case(name, changes)
        assert case.mechanics is not None
        steel = load_steel(case.steel.name, composition=case.steel.composition or None,
                           overrides=case.steel.overrides or None)  # fmt: skip
        found = build_law(case.mechanics, steel).elasticity
        return float(found.young(kelvin)[0]), float(found.poisson(kelvin)[0])

    stiff, thick = "steel.overrides.youngs_modulus=5 GPa", "steel.overrides.poisson_ratio=0.2"
    for name in (
        ROOT / "billet125/taper_1.toml",
        ROOT / "billet180/peritectic.toml",
    ):  # without moduli, and with
        young, poisson = moduli(name)
        assert moduli(name, stiff) == (pytest.approx(5e9), poisson) and young != 5e9
        assert moduli(name, thick) == (young, pytest.approx(0.2)) and poisson != 0.2
        assert moduli(name, stiff, thick) == (pytest.approx(5e9), pytest.approx(0.2))
        named = moduli(name, stiff, thick, "mechanics.elasticity=elastic_steel")
        assert named == moduli(ROOT / "billet125/taper_1.toml")
