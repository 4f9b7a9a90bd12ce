"""Implausible material data: values of no metal, heat counted twice; the shipped copper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_library import VALID, only_problem

import castfem
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.ranges import RANGES
from castfem.physics.materials import available_steels, load_steel
from castfem.physics.materials.plausible import unusual
from castfem.physics.materials.schema import KINDS

PEAK = """
temperature = [20, 1000, 1449, 1450, 1500, 1501, 1700]
temperature_unit = "degC"
value = [500, 650, 700, 6000, 6000, 800, 830]
unit = "J/(kg K)"
"""
ENTHALPY = """
[enthalpy]
temperature = [20, 1460, 1510, 1600]
temperature_unit = "degC"
value = [0, 1008, 1313, 1376]
unit = "kJ/kg"
"""


def own(folder: Path, text: str) -> tuple[str, Path]:
    (folder / "own.toml").write_text(text)
    return "own.toml", folder


def with_heat(table: str, latent: str = "270 kJ/kg") -> str:
    start, end = VALID.index("[specific_heat]"), VALID.index("[conductivity]")
    text = VALID[:start] + f"[specific_heat]{table}" + VALID[end:]
    return text.replace('"270 kJ/kg"', f'"{latent}"')


def without(*keys: str) -> str:
    text = VALID
    for key in keys:
        start = text.index(f"[{key}]")
        end = text.find("\n[", start)
        text = text[:start] + (text[end + 1 :] if end >= 0 else "")
    return text


@pytest.mark.parametrize(
    ("key", "entry", "message"),
    [
        ("density", '"7 kg/m^3"', "density: (7 kg/m^3) is beyond what metals have, 1000 to 25000"),
        ("latent_heat", '"270 J/kg"', "latent_heat: (0.27 kJ/kg) is beyond what metals have, 10"),
        ("conductivity", '"30 kW/(m K)"', "conductivity: (30000 W/(m K)) is beyond"),
        ("thermal_expansion", '"12 1/K"', "thermal_expansion: (12 1/K) is beyond what metals have"),
        ("youngs_modulus", '"40 Pa"', "youngs_modulus: (4e-08 GPa) is beyond what metals have"),
    ],
)
def test_value_of_no_metal_is_rejected_with_its_key(
    tmp_path: Path, key: str, entry: str, message: str
) -> None:
    text = without(key) if f"[{key}]" in VALID else VALID
    line = only_problem(*own(tmp_path, f"{key} = {entry}\n{text}"))
    assert line.startswith(f"{tmp_path}/own.toml: {message}"), line
    assert line.endswith("; are number and unit right?")
    changes = {key: entry.strip('"') if entry.startswith('"') else float(entry)}
    line = only_problem("carbon_042", overrides=changes, origin="billet.toml: steel")
    assert line.startswith(f"billet.toml: steel.overrides.{message}")


def test_implausible_row_is_named_by_its_line(tmp_path: Path) -> None:
    table = 'temperature = ["20 degC", "1500 degC"]\nvalue = ["7800 kg/m^3", "7.2 kg/m^3"]\n'
    line = only_problem(*own(tmp_path, without("density") + f"[density]\n{table}"))
    assert "own.toml: density: row 2, 1500 degC: (7.2 kg/m^3) is beyond what metals have" in line
    (tmp_path / "rho.csv").write_text(
        "# laboratory\ntemperature [degC], value [g/cm^3]\n20, 7.8\n\n900, 7800\n"
    )
    line = only_problem(*own(tmp_path, without("density") + '[density]\nfile = "rho.csv"\n'))
    assert "own.toml: density: '" in line
    assert "rho.csv' line 5, 900 degC: (7800000 kg/m^3) is beyond what metals have" in line


def test_ambiguous_thousands_separator_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "rho.csv").write_text("temperature [degC];value [kg/m^3]\n20;7,850\n900;7,400\n")
    line = only_problem(*own(tmp_path, without("density") + '[density]\nfile = "rho.csv"\n'))
    assert "own.toml: density: " in line and "rho.csv" in line
    assert 'line 2: "7,850" can be 7850 or 7.850' in line


def test_shipped_values_are_plausible_and_ranges_have_keys() -> None:
    without = {"solid_fraction", "enthalpy", "poisson_ratio"}  # ratios, and a heat without datum
    assert all((f"steel.{key}" in RANGES) != (key in without) for key in KINDS)
    for name in available_steels():
        steel = load_steel(name, composition={"C": 0.2} if name.startswith("plain") else None)
        assert list(unusual(steel)) == []


@pytest.mark.parametrize("rate", ["9e-3 1/K", "-4e-3 1/K"])
def test_differential_coefficient_may_change_steeply(tmp_path: Path, rate: str) -> None:
    table = (
        '[thermal_expansion]\ncoefficient = "differential"\n'
        f'temperature = ["20 degC", "1400 degC"]\nvalue = ["12e-6 1/K", "{rate}"]\n'
    )
    assert load_steel(*own(tmp_path, VALID + table)).expansion is not None
    mean = table.replace('"differential"', '"mean"\norigin = "20 degC"')
    assert "thermal_expansion: row 2, 1400 degC" in only_problem(*own(tmp_path, VALID + mean))


def test_latent_heat_in_specific_heat_and_by_key_is_rejected(tmp_path: Path) -> None:
    line = only_problem(*own(tmp_path, with_heat(PEAK, "260 kJ/kg")))
    assert "own.toml: specific_heat: holds heat of freezing, 2" in line
    assert "and latent_heat (260 kJ/kg) would add it once more" in line
    assert line.endswith('set latent_heat = "0 kJ/kg", or take the peak out of the table')
    line = only_problem(
        "carbon_042",
        overrides={
            "specific_heat": {
                "temperature": ["20 degC", "1400 degC", "1470 degC", "1520 degC"],
                "value": ["600 J/(kg K)", "700 J/(kg K)", "5 kJ/(kg K)", "800 J/(kg K)"],
            }
        },
        origin="billet.toml: steel",
    )
    assert line.startswith("billet.toml: steel.overrides.specific_heat: holds heat of freezing")


@pytest.mark.parametrize("shift", [-40, 0, 40])
def test_peak_need_not_be_at_the_solidus_of_the_file(tmp_path: Path, shift: int) -> None:
    moved = PEAK.replace("1449, 1450, 1500, 1501", ", ".join(
        str(t + shift) for t in (1449, 1450, 1500, 1501)
    ))  # fmt: skip
    assert "holds heat of freezing" in only_problem(*own(tmp_path, with_heat(moved)))


def test_peak_without_latent_heat_contains_all_heat_of_freezing(tmp_path: Path) -> None:
    steel = load_steel(*own(tmp_path, with_heat(PEAK, "0 kJ/kg")))
    t, left, right, latent, _ = steel.enthalpy_knots(1400 + 273.15, 1600 + 273.15)
    heat = float(((0.5 * (left + right) + latent) * np.diff(t)).sum()) / 7200.0
    # Trapezia of the table from 1400 to 1600 degC, by hand.
    at_1400 = 650 + 50 * 400 / 449
    by_hand = 0.5 * (at_1400 + 700) * 49 + 3350 + 6000 * 50 + 3400
    by_hand += 0.5 * (800 + 800 + 30 * 99 / 199) * 99
    assert heat == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    "table",
    [
        "\nvalue = [500, 650, 820]\ntemperature = [20, 1000, 1520]",
        # copper's step from solid to liquid, and a transformation in the solid
        "\nvalue = [500, 650, 5000, 650, 650, 840]\ntemperature = [20, 700, 735, 770, 1480, 1490]",
    ],
)
def test_specific_heats_without_latent_heat_are_accepted(tmp_path: Path, table: str) -> None:
    units = '\ntemperature_unit = "degC"\nunit = "J/(kg K)"\n'
    assert load_steel(*own(tmp_path, with_heat(table + units))).latent_heat == 270e3


def test_table_of_enthalpies_has_the_heat_of_its_rows(tmp_path: Path) -> None:
    steel = load_steel(*own(tmp_path, without("latent_heat", "specific_heat") + ENTHALPY))
    assert float(steel.specific_heat(900.0)) == pytest.approx(700.0)
    assert steel.latent_heat == pytest.approx(305e3 - 700.0 * 50)
    t, left, right, latent, jump = steel.enthalpy_knots(300.0, 2000.0)
    total = np.concatenate([[0.0], np.cumsum((0.5 * (left + right) + latent) * np.diff(t))]) / 7200
    rows = np.array([20, 1460, 1510, 1600, 2000 - 273.15]) + 273.15
    expected = 1e3 * np.array([0, 1008, 1313, 1376, 1376 + 0.7 * (2000 - 273.15 - 1600)])
    assert np.interp(rows[1:], t, total) - np.interp(rows[1], t, total) == pytest.approx(
        expected[1:] - expected[1], rel=1e-12
    )
    assert not jump.any()
    assert (left + latent > 0).all() and (right + latent > 0).all()


def test_solidus_between_two_rows_changes_no_heat(tmp_path: Path) -> None:
    text = without("latent_heat", "specific_heat") + ENTHALPY.replace("1460", "1465")
    steel = load_steel(*own(tmp_path, text))
    curve = steel.thermal_curve(300.0, 2000.0)
    t = np.array([1465, 1480, 1495, 1510]) + 273.15
    gained = np.diff(curve.enthalpy(t)) / 7200
    assert gained == pytest.approx(305e3 * 15 / 45, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1313, 1376", "1313, 1313", "enthalpy: must increase with temperature; row 4 (1600 "),
        ("1008, 1313, 1376", "1.008, 1.313, 1.376", "enthalpy: row 2, 1460 degC: the specific h"),
        ("[20, 1460,", "[20, 1460,", "specific_heat: follows from the enthalpy, which is a table"),
    ],
)
def test_invalid_table_of_enthalpies_is_rejected(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    omitted = ("latent_heat",) if message.startswith("spec") else ("latent_heat", "specific_heat")
    text = without(*omitted) + ENTHALPY.replace(old, new)
    assert message in only_problem(*own(tmp_path, text))


def test_enthalpy_of_a_case_replaces_both_heats() -> None:
    table = {
        "temperature": ["20 degC", "1452 degC", "1502.5 degC", "1600 degC"],
        "value": ["0 kJ/kg", "1002.4 kJ/kg", "1307.75 kJ/kg", "1376 kJ/kg"],
    }
    steel = load_steel("carbon_042", overrides={"enthalpy": table})
    assert steel.latent_heat == pytest.approx(270e3, rel=1e-6)
    assert steel.origins["specific_heat"].source == "set in the case"


MELTING = 1083.0 + ZERO_CELSIUS


def test_copper_freezes_at_one_temperature() -> None:
    copper = load_steel("copper")
    assert copper.solidus == copper.liquidus == pytest.approx(MELTING)
    assert copper.diagram is None
    assert copper.latent_heat * 63.546e-3 == pytest.approx(13590.0, rel=1e-4)  # J/mol


def test_mean_specific_heats_of_copper_match_a_handbook() -> None:
    """Fabian (1997), not used in the set: 0.411 J/(g K) from 0 to 300 degC, 0.437 to 1000 degC."""
    copper = load_steel("copper")
    for end, mean in ((300.0, 411.0), (1000.0, 437.0)):
        t = np.linspace(20.0, end, 2001) + ZERO_CELSIUS
        found = np.trapezoid(copper.specific_heat(t), t) / (t[-1] - t[0])
        assert found == pytest.approx(mean, rel=0.04)


def test_copper_round_has_the_flux_of_its_curve_and_one_front() -> None:
    """Computed through its mould on a coarse mesh."""
    case = castfem.load("copper200/round").with_(
        {
            "casting.length": "150 mm",
            "mesh.surface_size": "5 mm",
            "mesh.core_size": "12 mm",
            "output.fields": [],
            "output.figures": False,
        }
    )
    found = castfem.run(case)
    mean = (0.5 * (2.2 + 1.5) * 40.0 + 0.5 * (1.5 + 0.5) * 110.0) / 150.0
    assert found.quantities["mould_mean_flux"] == pytest.approx(1e6 * mean, rel=2e-3)
    assert found.summary.balances["heat"]["whole"].value < 1e-9
    shell, liquidus = (found.quantities[n] for n in ("shell_mid_face", "liquidus_depth_mid_face"))
    assert 0.03 < shell < 0.05 and abs(liquidus - shell) < 0.012  # one front, within a cell
