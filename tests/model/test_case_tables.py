"""Tables of numbers: columns with units, CSV files, and mistakes in them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.model import Table, load_case, read_case
from castfem.model.build.law import build_law
from castfem.physics.materials import load_steel
from castfem.physics.materials.library import FOLDER

ROWS = """
[cooling.surface.emissivity]
temperature = [20, 900, 1500]
temperature_unit = "degC"
value = [0.8, 0.85, 0.9]
"""


def test_columns_with_units_once(write, sound):
    table = load_case(write(sound + ROWS)).cooling[1].surface[0].emissivity
    assert table == Table("temperature", (293.15, 1173.15, 1773.15), (0.8, 0.85, 0.9))


def test_linear_between_and_constant_beyond():
    table = Table("time", (0.0, 2.0, 4.0), (1.0, 3.0, 0.0))
    assert [table(t) for t in (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 9.0)] == [1, 1, 2, 3, 1.5, 0, 0]


def test_units_in_the_cells_and_over_time(write, sound):
    text = sound + (
        '[[cooling.surface]]\nlaw = "flux"\n'
        'value = { time = ["0 s", "50 ms"], value = ["2 MW/m^2", "1500 kW/m^2"] }\n'
    )
    assert load_case(write(text)).cooling[1].surface[1].value == Table(
        "time", (0.0, 0.05), (2e6, 1.5e6)
    )


def test_csv_next_to_the_file_that_names_it(write, sound, tmp_path, monkeypatch):
    write("# measured\ntemperature [degC], value\n20, 0.8\n1500, 0.9\n", "data/e.csv")
    write(sound + 'emissivity = { file = "e.csv" }\n', "data/base.toml")
    path = write('extends = "data/base.toml"\n')
    monkeypatch.chdir("/")
    table = load_case(path).cooling[1].surface[0].emissivity
    assert table == Table("temperature", (293.15, 1773.15), (0.8, 0.9))


def test_semicolons_and_units(write, sound):
    write("time [ms];value [kW/m^2]\n0;5\n20;6\n", "q.csv")
    text = sound.replace(
        'law = "radiation"\nambient = "25 degC"', 'law = "flux"\nvalue.file = "q.csv"'
    )
    assert load_case(write(text)).cooling[1].surface[0].value == Table(
        "time", (0.0, 0.02), (5e3, 6e3)
    )


def test_cells_of_a_file_may_have_their_own_unit(write, sound):
    """Cells without a unit have that of the column, which may be missing if all cells have one."""
    write("time [ms], value [kW/m^2]\n0, 5\n20, 0.006 MW/m^2\n", "q.csv")
    text = sound.replace(
        'law = "radiation"\nambient = "25 degC"', 'law = "flux"\nvalue.file = "q.csv"'
    )
    table = Table("time", (0.0, 0.02), (5e3, 6e3))
    assert load_case(write(text)).cooling[1].surface[0].value == table
    write("time, value\n0 s, 5 kW/m^2\n20 ms, 6 kW/m^2\n", "q.csv")
    assert load_case(write(text)).cooling[1].surface[0].value == table
    write("time, value [kW/m^2]\n0 s, 5\n20, 6\n", "q.csv")
    with pytest.raises(InputError, match="time has no unit; write it in the header"):
        load_case(write(text))


def test_hundred_rows_survive_the_resolved_case(write, sound):
    rows = [(20 + 14.7 * i, 0.1 + i / 137) for i in range(100)]
    path = write(name="e.csv", text="")
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("temperature [degC]", "value"), *rows])
    case = load_case(write(sound + 'emissivity.file = "e.csv"\n'))
    again = load_case(write(case.resolved_toml(), "again/case.toml"))
    assert again == case
    assert len(again.cooling[1].surface[0].emissivity.arguments) == 100


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('{ temperature = [], temperature_unit = "degC", value = [] }', "'temperature' is empty"),
        (
            '{ temperature = [900, 20], temperature_unit = "degC", value = [0.8, 0.9] }',
            "must increase from row to row; row 2 does not exceed row 1",
        ),
        (
            '{ temperature = [20, nan], temperature_unit = "degC", value = [0.8, 0.9] }',
            "'temperature' row 2 (nan): a finite number",
        ),
        (
            '{ temperature = [20, 30], temperature_unit = "degC", value = [0.8, 1.3] }',
            "'value' row 2 (1.3): must not be above 1",
        ),
        (
            '{ temperature = [20, 30], temperature_unit = "degC", value = [0.8] }',
            "2 rows of temperature, but 1 of value",
        ),
        (
            "{ temperature = [20, 30], value = [0.8, 0.9] }",
            'name the unit of the column once, temperature_unit = "degC"',
        ),
        ('{ temperature = ["20 degC", "30 degC"] }', "needs the column 'value'"),
        (
            '{ temprature = ["0 s", "1 s"], value = [0.8, 0.9] }',
            "did you mean temperature?",
        ),
        ('{ file = "missing.csv" }', "missing.csv': file not found; correct the path"),
    ],
)
def test_bad_table(write, sound, table, message):
    with pytest.raises(InputError) as caught:
        load_case(write(sound + f"emissivity = {table}\n"))
    assert len(caught.value.problems) == 1
    assert "cooling.1.surface.0.emissivity" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ('[machine]\nrolls = "own.csv"', "machine.rolls: '{0}/own.csv'"),
        ('[quality]\nductility = { file = "own.csv" }', "quality.ductility: the table of "),
        (
            '[mould]\nlength = "1 m"\ndisplacement = { file = "own.csv" }',
            "mould.displacement: the ",
        ),
    ],
)
def test_missing_file_is_named_once_with_its_key(write, sound, table, key):
    base = write(f'{sound}[quality]\nductility = {{ file = "base.csv" }}\n', "base.toml")
    path = write(f'extends = "base.toml"\n{table}\n')
    for fix in ("file not found; correct the path", "file not found; did you mean ownn.csv?"):
        with pytest.raises(InputError) as caught:
            load_case(path)
        (line,) = (one for one in caught.value.problems if "own.csv" in one)
        assert line.startswith(f"{path}: {key.format(base.parent)}") and line.endswith(fix)
        assert line.count(f"{base.parent}/own.csv") == 1
        write("", "ownn.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("T [degC], value\n20, 0.8\n30, 0.9\n", "the first line of"),
        ("temperature [degC], value\n20, 0.8\n30\n", "line 3"),
        ("# dry\n\ntemperature [degC], value\n20, 0.8\n# wet\nx, 0.9\n", "line 6"),
        ("temperature [degC], value\n# one\n20, 0.8\n20, 0.9\n", "line 4 does not exceed line 3"),
        ("temperature [degC], value\n\n20, nan\n30, 0.9\n", "'value' line 3 (nan): a finite"),
        ('temperature [degC], value\n"1,200", 0.8\n1300, 0.9\n', "no thousands separators"),
    ],
)
def test_bad_csv(write, sound, text, message):
    write(text, "e.csv")
    with pytest.raises(InputError) as caught:
        load_case(write(sound + 'emissivity = { file = "e.csv" }\n'))
    assert message in str(caught.value)


# The steel of a case: the user's own numbers and carbon; the last of several layers decides.


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


def test_composition_keeps_an_own_steel(tmp_path: Path) -> None:
    case = load_case(write(tmp_path), ["steel.composition.C=0.12"])
    assert case.steel.name.endswith("own.toml")
    with pytest.raises(InputError, match="write the composition into the file of your own steel"):
        load_steel(case.steel.name, composition=case.steel.composition)


def test_carbon_of_a_law_is_stated_in_the_file(tmp_path: Path) -> None:
    case = load_case(write(tmp_path))
    assert case.mechanics is not None
    with pytest.raises(InputError, match=r"carbon: is missing.*composition = \{ C = 0.12 \}"):
        build_law(case.mechanics, load_steel(case.steel.name))
    case = load_case(write(tmp_path, "composition = { C = 0.12 }"))
    assert case.mechanics is not None
    steel = load_steel(case.steel.name)
    assert steel.composition["C"] == 0.12 and steel.solidus == pytest.approx(1763.15)
    build_law(case.mechanics, steel)


def test_each_modulus_of_a_steel_counts_separately() -> None:
    """A single modulus is used; one that the steel lacks is that of the named set."""
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
    """Return a function: name and composition of a case that extends another, and its warnings."""

    def _steel_of(base: str, own: str, overrides: tuple[str, ...] = ()):
        write(sound.replace('[steel]\nname = "carbon_042"\n', base), "base.toml")
        reading = read_case(write(f'extends = "base.toml"\n{own}'), overrides)
        assert not reading.problems
        steel = reading.case.steel
        load_steel(steel.name, composition=steel.composition)  # raises where they do not fit
        return steel.name, steel.composition, reading.warnings

    return _steel_of


@pytest.mark.parametrize("how", ["file", "--set"])
def test_named_steel_drops_an_inherited_composition(steel_of, how):
    own, overrides = '[steel]\nname = "carbon_042"\n', ("steel.name=carbon_042",)
    name, amounts, (message,) = steel_of(COMPUTED, *((own,) if how == "file" else ("", overrides)))
    assert (name, amounts) == ("carbon_042", {})
    assert message.startswith("--set: " if how == "--set" else "/")
    assert "the inherited composition (C = 0.1, Mn = 0.5) is left out" in message


def test_computed_steel_keeps_the_inherited_composition(steel_of, tmp_path):
    """Except an own steel that states its composition."""
    own = '[steel]\nname = "plain_carbon_linear"\n'
    assert steel_of(COMPUTED, own) == ("plain_carbon_linear", {"C": 0.1, "Mn": 0.5}, ())
    assert steel_of(COMPUTED, own + "composition.C = 0.3\n")[1] == {"C": 0.3, "Mn": 0.5}
    needs = 'from_composition = ["C"]\n'
    text = (FOLDER / "plain_carbon.toml").read_text()
    text = text.replace(needs, needs + "composition.C = 0.7\n")
    (tmp_path / "mine.toml").write_text(text)
    name, amounts, (message,) = steel_of(COMPUTED, '[steel]\nname = "./mine.toml"\n')
    assert amounts == {} and "is left out" in message
    assert load_steel(name).composition == {"C": 0.7}


def test_later_composition_selects_a_computed_steel(steel_of):
    fixed = '[steel]\nname = "carbon_042"\n'
    name, amounts, (message,) = steel_of(fixed, "[steel.composition]\nC = 0.2\n")
    assert (name, amounts) == ("plain_carbon", {"C": 0.2})
    assert '"carbon_042" is not computed from a composition; "plain_carbon" is taken' in message
    assert steel_of(fixed, "", ("steel.composition.C=0.2",))[:2] == (name, amounts)


def test_both_in_one_file_exclude_each_other(write, sound):
    """Keys of one file are intended: there is no layer, and nothing is omitted."""
    path = write(sound.replace("[section]", "[steel.composition]\nC = 0.2\n\n[section]"))
    case = load_case(path)
    assert (case.steel.name, case.steel.composition) == ("carbon_042", {"C": 0.2})
    write('extends = "case.toml"\n[steel]\nname = "copper"\ncomposition.C = 0.3\n', "top.toml")
    case = load_case(path.with_name("top.toml"))
    with pytest.raises(InputError, match="is not computed from a composition"):
        load_steel(case.steel.name, composition=case.steel.composition)
