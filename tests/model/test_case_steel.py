"""The steel of a case: the user's own numbers and carbon; of several layers the later decides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.model import load_case, read_case
from castfem.model.build.law import build_law
from castfem.physics.materials import load_steel
from castfem.physics.materials.library import FOLDER

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


COMPUTED = '[steel]\nname = "plain_carbon"\n[steel.composition]\nC = 0.1\nMn = 0.5\n'


@pytest.fixture
def steel_of(write, sound):
    """Return name and amounts of a case that extends another, and what `castfem check` says."""

    def _steel_of(base: str, own: str, overrides: tuple[str, ...] = ()):
        write(sound.replace('[steel]\nname = "carbon_042"\n', base), "base.toml")
        reading = read_case(write(f'extends = "base.toml"\n{own}'), overrides)
        assert not reading.problems
        steel = reading.case.steel
        load_steel(steel.name, composition=steel.composition)  # raises where they do not fit
        return steel.name, steel.composition, reading.warnings

    return _steel_of


@pytest.mark.parametrize("how", ["file", "--set"])
def test_a_steel_that_is_named_does_away_with_an_inherited_composition(steel_of, how):
    own, overrides = '[steel]\nname = "carbon_042"\n', ("steel.name=carbon_042",)
    name, amounts, (said,) = steel_of(COMPUTED, *((own,) if how == "file" else ("", overrides)))
    assert (name, amounts) == ("carbon_042", {})
    assert said.startswith("--set: " if how == "--set" else "/")
    assert "the inherited composition (C = 0.1, Mn = 0.5) is left out" in said


def test_one_that_is_computed_keeps_the_inherited_composition(steel_of, tmp_path):
    """But for one of the user's own that states its composition."""
    own = '[steel]\nname = "plain_carbon_linear"\n'
    assert steel_of(COMPUTED, own) == ("plain_carbon_linear", {"C": 0.1, "Mn": 0.5}, ())
    assert steel_of(COMPUTED, own + "composition.C = 0.3\n")[1] == {"C": 0.3, "Mn": 0.5}
    needs = 'from_composition = ["C"]\n'
    text = (FOLDER / "plain_carbon.toml").read_text()
    text = text.replace(needs, needs + "composition.C = 0.7\n")
    (tmp_path / "mine.toml").write_text(text)
    name, amounts, (said,) = steel_of(COMPUTED, '[steel]\nname = "./mine.toml"\n')
    assert amounts == {} and "is left out" in said
    assert load_steel(name).composition == {"C": 0.7}


def test_a_composition_that_comes_later_is_that_of_a_computed_steel(steel_of):
    fixed = '[steel]\nname = "carbon_042"\n'
    name, amounts, (said,) = steel_of(fixed, "[steel.composition]\nC = 0.2\n")
    assert (name, amounts) == ("plain_carbon", {"C": 0.2})
    assert '"carbon_042" is not computed from a composition; "plain_carbon" is taken' in said
    assert steel_of(fixed, "", ("steel.composition.C=0.2",))[:2] == (name, amounts)


def test_both_in_one_file_are_held_against_each_other(write, sound):
    """What stands side by side was meant: no layer, nothing is left out."""
    path = write(sound.replace("[section]", "[steel.composition]\nC = 0.2\n\n[section]"))
    case = load_case(path)
    assert (case.steel.name, case.steel.composition) == ("carbon_042", {"C": 0.2})
    write('extends = "case.toml"\n[steel]\nname = "copper"\ncomposition.C = 0.3\n', "top.toml")
    case = load_case(path.with_name("top.toml"))
    with pytest.raises(InputError, match="is not computed from a composition"):
        load_steel(case.steel.name, composition=case.steel.composition)
