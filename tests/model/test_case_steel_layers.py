"""Name and composition of the steel from several layers: the later one decides."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case, read_case
from castfem.physics.materials import load_steel
from castfem.physics.materials.library import FOLDER

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
