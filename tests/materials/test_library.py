"""Material files: shipped sets, overrides of a case, and errors of invalid files."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.physics.materials import available_steels, load_steel
from castfem.physics.materials.library import FOLDER
from castfem.physics.materials.schema import KINDS

VALID = """
description = "a steel"
[composition]
C = 0.2
[solidus]
value = "1460 degC"
[liquidus]
value = "1510 degC"
[latent_heat]
value = "270 kJ/kg"
[density]
value = "7200 kg/m^3"
[specific_heat]
temperature = [20, 1000, 1500]
temperature_unit = "degC"
value = [500, 650, 750]
unit = "J/(kg K)"
[conductivity]
temperature = ["20 degC", "1500 degC"]
value = ["50 W/(m K)", "30 W/(m K)"]
"""


def problems(*arguments, **named) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        load_steel(*arguments, **named)
    assert all("\n" not in line for line in caught.value.problems)
    return caught.value.problems


def only_problem(*arguments, **named) -> str:
    found = problems(*arguments, **named)
    assert len(found) == 1, found
    return found[0]


@pytest.fixture
def write(tmp_path):
    def written(text: str) -> tuple[str, Path]:
        (tmp_path / "own.toml").write_text(text)
        return "own.toml", tmp_path

    return written


def changed(old: str, new: str) -> str:
    assert old in VALID
    return VALID.replace(old, new)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda p: p.stem)
def test_every_shipped_number_has_source_and_status(path):
    data = tomllib.loads(path.read_text("utf-8"))
    assert data["description"]
    amounts = dict.fromkeys(data.get("from_composition", ()), 0.2)
    origins = load_steel(path.stem, composition=amounts or None).origins
    for key in KINDS:
        if key in data:
            assert origins[key].source, key
            assert origins[key].status in ("F", "M", "C"), key


@pytest.mark.parametrize("name", sorted(available_steels()))
def test_every_shipped_set_loads_and_makes_a_curve(name):
    composition = {"C": 0.2, "Mn": 0.8} if name.startswith("plain") else None
    steel = load_steel(name, composition=composition)
    assert steel.solidus <= steel.liquidus
    curve = steel.thermal_curve(200.0, 2300.0)
    assert curve.knots[0] == 200.0 and curve.knots[-1] == 2300.0


def test_plain_carbon_takes_alloying_elements():
    plain = load_steel("plain_carbon", composition={"C": 0.2})
    steel = load_steel("plain_carbon", composition={"C": 0.2, "Si": 0.3, "Mn": 1.0})
    assert plain.liquidus - steel.liquidus == pytest.approx(
        0.3 * (9.55 + 2.74 * 0.2 + 1.05 * 0.3) + (5.08 - 0.21 * 0.2) + 0.94 * 0.3
    )
    straight = [
        load_steel("plain_carbon", composition=one.composition, overrides={"diagram": "pascon"})
        for one in (plain, steel)
    ]
    assert straight[0].liquidus - straight[1].liquidus == pytest.approx(0.3 * 7.5 + 4.9)
    assert steel.composition == {"C": 0.2, "Si": 0.3, "Mn": 1.0}


@pytest.mark.parametrize("carbon", [0.0, 0.002, 0.01, 0.09, 0.17, 0.53, 1.0, 1.5])
@pytest.mark.parametrize("others", [{}, {"Mn": 2.0, "Si": 0.6}, {"Si": 3.0}, {"Cr": 5.0, "P": 0.1}])
def test_steels_of_any_composition_have_finite_properties(carbon, others):
    steel = load_steel("plain_carbon", composition={"C": carbon, **others})
    assert steel.solidus <= steel.liquidus
    t = np.union1d(np.linspace(900.0, 1900.0, 400), steel.diagram.kinks)
    for key in ("density", "specific_heat", "conductivity", "solid_fraction", "thermal_strain"):
        for side in ("above", "below"):
            value = getattr(steel, key)(t, *([] if key == "thermal_strain" else [side]))
            assert np.all(np.isfinite(value)), key
    enthalpy = steel.thermal_curve(900.0, 1900.0).enthalpy(np.linspace(901.0, 1899.0, 500))
    assert np.all(np.diff(enthalpy) > 0.0)


def test_source_of_the_limits_is_that_of_the_diagram():
    for diagram, source, status in (("assessed", "Povoden", "C"), ("pascon", "Pascon", "F")):
        change = {"diagram": diagram}
        for name in ("plain_carbon", "plain_carbon_linear"):
            steel = load_steel(name, composition={"C": 0.2}, overrides=change)
            key = "solid_fraction" if name == "plain_carbon" else "solidus"
            assert source in steel.origins[key].source and steel.origins[key].status == status


def test_plain_carbon_linear_has_the_limits_of_the_diagram():
    lever = load_steel("plain_carbon", composition={"C": 0.15, "Mn": 0.8})
    steel = load_steel("plain_carbon_linear", composition={"C": 0.15, "Mn": 0.8})
    assert (steel.solidus, steel.liquidus) == (lever.solidus, lever.liquidus)
    middle = 0.5 * (steel.solidus + steel.liquidus)
    assert float(steel.solid_fraction(middle)) == pytest.approx(0.5)
    assert steel.latent_heat == 272e3


def test_regressions_for_solidus_and_liquidus():
    limits = {"solidus": {"formula": "regression"}, "liquidus": {"formula": "regression"}}
    steel = load_steel("plain_carbon_linear", composition={"C": 0.1, "S": 0.01}, overrides=limits)
    assert steel.liquidus - 273.15 == pytest.approx(1536 - 7.8 - 0.38)
    assert steel.solidus - 273.15 == pytest.approx(1536 - 20 - 11)


def test_own_file_with_tables_is_read(write):
    steel = load_steel(*write(VALID))
    assert steel.name == "own"
    assert float(steel.specific_heat(1250 + 273.15)) == pytest.approx(700.0)
    assert float(steel.conductivity(2000.0)) == 30.0
    assert steel.origins["density"].status == "U"


def test_own_file_with_a_csv_is_read(write, tmp_path):
    (tmp_path / "k.csv").write_text("temperature [degC], value [W/(m K)]\n20, 50\n1520, 20\n")
    text = VALID[: VALID.index("[conductivity]")] + '[conductivity]\nfile = "k.csv"\n'
    steel = load_steel(*write(text))
    assert float(steel.conductivity(770 + 273.15)) == pytest.approx(35.0)


def test_solid_fraction_table_brings_solidus_and_liquidus(write):
    table = '[solid_fraction]\ntemperature = ["1440 degC", "1500 degC"]\nvalue = [1, 0]\n'
    start, end = VALID.index("[solidus]"), VALID.index("[latent_heat]")
    steel = load_steel(*write(VALID[:start] + VALID[end:] + table))
    assert (steel.solidus - 273.15, steel.liquidus - 273.15) == pytest.approx((1440, 1500))


def test_expansion_tables_are_read(write):
    columns = 'temperature = ["20 degC", "1400 degC"]\nvalue = ["12e-6 1/K", "18e-6 1/K"]\n'
    mean = f'[thermal_expansion]\ncoefficient = "mean"\norigin = "20 degC"\n{columns}'
    steel = load_steel(*write(VALID + mean))
    assert float(steel.thermal_strain(293.15)) == pytest.approx(1 / (1 + 18e-6 * 1440) - 1)
    slope = f'[thermal_expansion]\ncoefficient = "differential"\n{columns}'
    steel = load_steel(*write(VALID + slope))
    assert float(steel.thermal_strain(293.15)) == pytest.approx(
        math.expm1(-15e-6 * 1380 - 18e-6 * 60)
    )
    assert "origin: is missing" in only_problem(*write(VALID + f"[thermal_expansion]\n{columns}"))


def test_values_and_parameters_can_be_overridden():
    steel = load_steel("carbon_042", overrides={"conductivity": "33 W/(m K)"})
    assert float(steel.conductivity(1500.0)) == 33.0
    assert steel.origins["conductivity"].source == "set in the case"
    stirred = {"conductivity": {"parameters": {"liquid_factor": 4.0}}}
    steel = load_steel("plain_carbon", composition={"C": 0.1}, overrides=stirred)
    assert float(steel.conductivity(1900.0)) == 156.0
    renamed = {"conductivity": {"source": "ours", "status": "U"}}
    steel = load_steel("plain_carbon", composition={"C": 0.1}, overrides=renamed)
    origin = steel.origins["conductivity"]
    assert (origin.law, origin.source) == ("formula harste_conductivity", "ours")


def test_override_replaces_excluded_entries():
    fraction = {"temperature": ["1440 degC", "1500 degC"], "value": [1, 0]}
    steel = load_steel("carbon_042", overrides={"solid_fraction": fraction})
    assert steel.solidus - 273.15 == pytest.approx(1440)
    changes = {"latent_heat": "260 kJ/kg"}
    steel = load_steel("plain_carbon", composition={"C": 0.2}, overrides=changes)
    assert steel.latent_heat == 260e3 and not steel.has("enthalpy")


def test_unknown_name_is_rejected_with_the_nearest():
    line = only_problem("carbon_42", origin="billet.toml: steel")
    assert line.startswith('billet.toml: steel.name ("carbon_42"): no such steel; one of')
    assert line.endswith("did you mean carbon_042?")
    assert 'for a grade by its analysis "plain_carbon" with a composition' in line


def test_own_file_without_path_is_rejected(tmp_path):
    (tmp_path / "mine.toml").write_text(VALID)
    assert 'written "./mine.toml"' in only_problem("mine", tmp_path)


def test_missing_file_is_rejected(tmp_path):
    (tmp_path / "mine.toml").write_text(VALID)
    line = only_problem("./mime.toml", tmp_path)
    assert line == 'steel.name ("./mime.toml"): file not found; did you mean mine.toml?'
    line = only_problem("./none/mime.toml", tmp_path)
    assert line.endswith(f"there is no folder {tmp_path}/none: correct the path")


def test_syntax_error_names_the_line(write):
    line = only_problem(*write('description = "x"\n[density\nvalue = 3\n'))
    assert "own.toml: line 2" in line


def test_file_that_is_not_utf8_is_rejected(tmp_path):
    (tmp_path / "own.toml").write_bytes(b'description = "a"\n# \xff\n')
    assert "own.toml: line 2: is not UTF-8 text" in only_problem("own.toml", tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"7200 kg/m^3"', '"7200 kg/m^2"', "density:"),
        ('"7200 kg/m^3"', "nan", "density: a finite density is needed (nan)"),
        ('"7200 kg/m^3"', "7200", 'density: a density needs its unit, such as "7400 kg/m^3"'),
        ('"1460 degC"', '"1520 degC"', "solidus: (1520 degC) lies above the liquidus (1510 degC)"),
        ("[500, 650, 750]", "[500, -650, 750]", "specific_heat: 'value' row 2 (-650)"),
        ("[500, 650, 750]", "[500, 650]", "3 rows of temperature, but 2 of value"),
        ("[20, 1000, 1500]", "[20, 1500, 1000]", "row 3 does not exceed row 2"),
        ('unit = "J/(kg K)"', 'unit = "W/(kg K)"', "specific_heat: 'value' row 1"),
        ("[latent_heat]", "[latentheat]", "did you mean latent_heat?"),
        ("C = 0.2", "C = 2.5", "composition.C: (2.5) is out of range; 0 to 2.11"),
        ("C = 0.2", 'C = "0.2 kg"', 'composition.C: ("0.2 kg") must be weight percent: a plain'),
        ('description = "a steel"', "description = 3", "description: must be a text (3)"),
    ],
)
def test_invalid_entries_of_a_file_are_rejected(write, old, new, message):
    found = problems(*write(changed(old, new)))
    assert any("own.toml" in line and message in line for line in found), found


def test_percent_sign_in_a_composition_is_accepted(write):
    plain, signed = (load_steel(*write(changed("C = 0.2", f"C = {c}"))) for c in (0.3, '"0.3 %"'))
    assert dict(signed.composition) == dict(plain.composition) == {"C": 0.3}


def test_elements_without_data_are_omitted():
    plain = load_steel("plain_carbon", composition={"C": 0.2, "Mn": 0.6})
    steel = load_steel("plain_carbon", composition={"C": 0.2, "Mn": 0.6, "V": 0.05, "N": 0.01})
    assert steel.left_out == ("V", "N") and plain.left_out == ()
    assert dict(steel.composition) == {"C": 0.2, "Mn": 0.6}
    assert steel.liquidus == plain.liquidus
    assert "composition.V: (-1) is out of range" in only_problem(
        "plain_carbon", composition={"C": 0.2, "V": -1}
    )


def test_ambiguous_entries_are_rejected(write):
    both = changed(
        'value = "7200 kg/m^3"', 'value = "7200 kg/m^3"\nformula = "jimbo_cramb_density"'
    )
    assert "density: value and formula exclude each other" in only_problem(*write(both))
    assert "density: is empty" in only_problem(
        *write(changed('value = "7200 kg/m^3"', 'note = "x"'))
    )
    strange = changed('value = "7200 kg/m^3"', 'value = "7200 kg/m^3"\nparameters = { a = 1 }')
    assert "density.parameters: only a formula has parameters" in only_problem(*write(strange))


def test_all_problems_are_reported_at_once(write):
    text = changed('"7200 kg/m^3"', '"7200 m"').replace('"270 kJ/kg"', '"270 kJ"')
    text = text.replace('"1460 degC"', '"1560 degC"').replace("[500, 650", "[-5, 650")
    found = problems(*write(text + '[conductivty]\nvalue = "1 W/(m K)"\n[emissivity]\nvalue = 3\n'))
    keys = ("density", "latent_heat", "solidus", "specific_heat", "conductivty", "emissivity")
    assert len(found) == len(keys)
    assert all(any(f": {key}: " in line for line in found) for key in keys)


def test_problems_of_overrides_name_the_case():
    changes = {"conductivty": "3 W/(m K)", "density": {"vlaue": "7000 kg/m^3"}}
    found = problems("carbon_042", overrides=changes, origin="a.toml: steel")
    assert any(
        line.startswith("a.toml: steel.overrides.conductivty: unknown key")
        and line.endswith("did you mean conductivity?")
        for line in found
    )
    assert any("steel.overrides.density.vlaue: unknown key" in line for line in found)


def test_unknown_formulas_and_parameters_are_rejected():
    change = {"conductivity": {"formula": "harste_conductivty"}}
    assert only_problem("plain_carbon", composition={"C": 0.1}, overrides=change).endswith(
        "did you mean harste_conductivity?"
    )
    change = {"conductivity": {"parameters": {"liquid_facter": 2}}}
    assert only_problem("plain_carbon", composition={"C": 0.1}, overrides=change).endswith(
        "unknown parameter; allowed: liquid_factor, liquid_conductivity; "
        "did you mean liquid_factor?"
    )
    change = {"conductivity": {"parameters": {"liquid_factor": -2}}}
    assert "must not be below 0.1 (-2)" in only_problem(
        "plain_carbon", composition={"C": 0.1}, overrides=change
    )


def test_formula_negative_in_its_range_is_rejected(monkeypatch):
    from castfem.physics.materials import build
    from castfem.physics.materials.formulas import Formula

    falling = Formula("falling", "density", lambda t: 5.0 * (1773.15 - t), "test", "C")
    monkeypatch.setattr(build, "FORMULAS", {**build.FORMULAS, "falling": falling})
    line = only_problem("carbon_042", overrides={"density": {"formula": "falling"}})
    assert line.startswith("steel.overrides.density: ")
    assert "kg/m^3 at 1500 degC: must be above 0" in line


def test_invalid_compositions_are_rejected():
    assert only_problem("plain_carbon", origin="a.toml: steel").startswith(
        "a.toml: steel.composition.C: is needed by plain_carbon"
    )
    found = problems("plain_carbon", composition={"C": 0.2, "Mu": 0.1, "mn": 1.0, "Si": -1.0})
    assert [line.split(":")[0] for line in found] == [
        "steel.composition.Mu",
        "steel.composition.mn",
        "steel.composition.Si",
    ]
    assert found[1].endswith("did you mean Mn?")
    assert "is not computed from a composition" in only_problem(
        "carbon_042", composition={"C": 0.3}
    )


def test_formula_without_carbon_is_rejected(write):
    text = changed("C = 0.2", "Mn = 0.5")
    line = only_problem(*write(text + '[thermal_expansion]\nformula = "chandra"\n'))
    assert "thermal_expansion: chandra needs the carbon content, composition.C" in line


def test_enthalpy_excludes_what_it_replaces(write):
    text = VALID + '[enthalpy]\nformula = "harste_enthalpy"\n'
    assert "latent_heat: is in the enthalpy already" in only_problem(*write(text))
    start, end = text.index("[latent_heat]"), text.index("[density]")
    assert "enthalpy: freezes by the lever rule" in only_problem(*write(text[:start] + text[end:]))


def test_lever_rule_excludes_a_solidus(write):
    line = only_problem(*write(VALID + '[solid_fraction]\nformula = "lever_rule"\n'))
    assert "solidus: follows from solid_fraction" in line


def test_carbon_042_has_its_values():
    steel = load_steel("carbon_042")
    assert (steel.solidus, steel.liquidus) == (1725.15, 1775.65)
    assert steel.latent_heat == 270e3
    for name, value in {"density": 7400, "specific_heat": 700, "conductivity": 30}.items():
        assert float(getattr(steel, name)(1500.0)) == value
    assert float(steel.thermal_expansion(1300.0)) == pytest.approx(13.5e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "limits", "values"),
    [
        ("alloy_similarity", (1723.15, 1773.15), (7200, 700, 30)),
        ("neumann_steel", (1767.55, 1767.55), (7500, 661, 33)),
        ("weiner_boley", (1767.5, 1767.6), (7500, 661, 33)),
        ("weiner_boley_5k", (1765.05, 1770.05), (7500, 661, 33)),
    ],
)
def test_verification_sets_have_their_values(name, limits, values):
    steel = load_steel(name)
    assert (steel.solidus, steel.liquidus) == limits
    assert steel.latent_heat == 272e3
    found = tuple(
        float(law(1500.0)) for law in (steel.density, steel.specific_heat, steel.conductivity)
    )
    assert found == values
