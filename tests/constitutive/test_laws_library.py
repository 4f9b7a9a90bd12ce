"""Parameter files: shipped sets agree with their description, invalid files are rejected."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Constant, Table
from castfem.physics.constitutive import (
    NortonCreep,
    NortonHoff,
    PerfectlyPlastic,
    ThermoElastic,
    UnifiedSteel,
    available_laws,
    law_from,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.flow_curves import Austenite, modified_norton_hoff
from castfem.physics.constitutive.parameters import FOLDER, delta_share_of
from castfem.physics.constitutive.uniaxial import pull

from .samples import ZERO

EL = load_elasticity()


def test_every_shipped_law_loads_and_pulls() -> None:
    kinds = {}
    for name in available_laws():
        law: Law = load_law(name, EL, carbon=0.1)
        kinds[name] = type(law)
        found = pull(law, [0.0, 1.0, 2.0], [0.0, 1e-3, 2e-3], 1273.15)
        assert 1e6 < found.axial_stress[-1, 0] < 60e6
    assert kinds == {
        "kozlowski_zhu": UnifiedSteel,
        "kozlowski_zhu_mixed": UnifiedSteel,
        "kozlowski_zhu_signed": UnifiedSteel,
        "norton_hoff_kozlowski": NortonHoff,
        "norton_hoff_kozlowski_p1": NortonHoff,
        "norton_hoff_kozlowski_signed": NortonHoff,
        "weiner_boley": PerfectlyPlastic,
    }


def test_every_shipped_number_has_a_source_and_a_status() -> None:
    for path in FOLDER.glob("*.toml"):
        data = tomllib.loads(path.read_text("utf-8"))
        assert data["description"]
        whole_file = "source" in data and data["status"] in ("F", "M", "C")
        tables = [v for v in data.values() if isinstance(v, dict)]
        assert whole_file or all(t["source"] and t["status"] in ("F", "M", "C") for t in tables)


@pytest.mark.parametrize(
    ("name", "largest", "rms"),
    [
        (
            "norton_hoff_kozlowski",
            [9.3, 11.9, 14.4, 16.6, 18.4, 19.8, 20.6, 20.8],
            [3.0, 3.9, 4.8, 5.5, 6.1, 6.5, 6.6, 6.6],
        ),
        (
            "norton_hoff_kozlowski_p1",
            [5.8, 7.3, 8.5, 9.5, 10.1, 10.3, 10.3, 10.1],
            [2.1, 2.5, 2.8, 3.0, 3.2, 3.2, 3.1, 3.1],
        ),
    ],
)
def test_shipped_fits_have_the_stated_error(
    name: str, largest: list[float], rms: list[float]
) -> None:
    law = load_law(name, EL)
    assert isinstance(law, NortonHoff)
    rate, strain = np.meshgrid(np.geomspace(1e-4, 5e-3, 10), np.linspace(0.002, 0.05, 40))
    for k, celsius in enumerate((800, 900, 1000, 1100, 1200, 1300, 1400, 1450)):
        t = np.full(1, celsius + ZERO)
        own = modified_norton_hoff(strain, rate, law.strength(t), law.p1(t), law.p3(t), law.p4(t))
        error = 100.0 * (own / Austenite.at(celsius + ZERO, 0.10).stress(strain, rate) - 1.0)
        assert np.abs(error).max() == pytest.approx(largest[k], abs=0.15)
        assert np.sqrt(np.mean(error**2)) == pytest.approx(rms[k], abs=0.4)
    text = (FOLDER / f"{name}.toml").read_text("utf-8")
    for a, b in zip(largest, rms, strict=True):
        assert f"{a:g}/{b:g}" in text


def test_weiner_boley_yields_as_published() -> None:
    law = load_law("weiner_boley", EL)
    assert isinstance(law, PerfectlyPlastic)
    t = np.array([1000.0, 1247.2, 1494.0, 1494.4, 1550.0]) + ZERO
    expected = np.maximum(20e6 * (1494.4 + ZERO - t) / 494.4, 1e4)
    np.testing.assert_allclose(law.yield_stress(t), expected, rtol=1e-9)


def test_delta_share_is_a_fraction_of_the_solid() -> None:
    share = delta_share_of(0.09)
    t = np.array([1350.0, 1480.0, 1510.0, 1520.0, 1600.0]) + ZERO
    np.testing.assert_allclose(share(t)[[0, 2, 3, 4]], [0.0, 1.0, 1.0, 1.0], atol=1e-12)
    assert 0.1 < share(t)[1] < 1.0
    assert (delta_share_of(0.6)(t) == 0.0).all()


def test_laws_are_read_from_data() -> None:
    creep = law_from(
        {"law": "norton_creep", "stress": "10 MPa", "rate": "1e-4 1/s", "exponent": 5}, EL
    )
    assert isinstance(creep, NortonCreep)
    assert creep.ln_factor(np.full(1, 900.0))[0] == pytest.approx(np.log(1e-4) - 5 * np.log(1e7))
    limited = law_from(
        {"law": "norton_hoff", "strength": "30 MPa", "p3": 0.1, "yield_limit": {"value": "2 MPa"}},
        EL,
    )
    assert isinstance(limited, NortonHoff) and limited.yield_limit is not None
    assert limited.yield_limit(np.full(1, 900.0))[0] == 2e6
    assert limited.p4(np.full(1, 900.0))[0] == 0.0
    assert isinstance(law_from({"law": "thermo_elastic"}, EL), ThermoElastic)
    assert limited.hardening == "accumulated" and limited.state_names == ("viscoplastic_strain",)
    steel = law_from(
        {"law": "unified_steel", "carbon": 0.1, "hardening": "signed", "recovery_time": "50 s"}, EL
    )
    assert isinstance(steel, UnifiedSteel) and steel.signed
    assert steel.fading(np.full(1, 900.0))[0] == pytest.approx(0.02)
    table = {
        "temperature": [900, 1100],
        "temperature_unit": "degC",
        "value": [40, 10],
        "unit": "MPa",
    }
    hoff = law_from({"law": "norton_hoff", "strength": table, "p3": 0.1}, EL)
    assert isinstance(hoff, NortonHoff)
    assert hoff.strength(np.full(1, 1000.0 + ZERO))[0] == pytest.approx(20e6)  # by powers


@pytest.mark.parametrize(
    ("data", "texts"),
    [
        ({"law": "norton_hof"}, ["law: ", "did you mean norton_hoff?"]),
        ({"law": "norton_hoff", "p3": 0.1}, ["strength: is missing"]),
        ({"law": "norton_hoff", "strength": "30 K", "p3": 2.0}, ["strength: 'K' is", "p3: must"]),
        ({"law": "perfectly_plastic", "yeld_stress": "3 MPa"}, ["did you mean yield_stress?"]),
        ({"law": "unified_steel"}, ["carbon: is missing"]),
        ({"law": "unified_steel", "carbon": 0.1, "recovery_time": "-3 s"}, ["recovery_time: must"]),
        (
            {"law": "thermo_elastic", "data": {"temperature": ["9 degC", "2 degC"], "rate": [1]}},
            ["data.temperature: the lowest must be below", "data.rate: must be lowest and highest"],
        ),
        ({"law": "thermo_elastic", "hardening": "signed"}, ["hardening: unknown key"]),
    ],
)
def test_invalid_parameters_are_rejected(data: dict[str, object], texts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        law_from(data, EL, "here")
    assert all(line.startswith("here: ") for line in caught.value.problems)
    for text in texts:
        assert text in str(caught.value)


def test_invalid_files_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean norton_hoff_kozlowski"):
        load_law("norton_hof_kozlowski", EL)
    with pytest.raises(InputError, match=r"none\.toml.*not found"):
        load_law("none.toml", EL, tmp_path)
    (tmp_path / "bad.toml").write_text("law = ")
    with pytest.raises(InputError, match=r"bad\.toml: "):
        load_law("bad.toml", EL, tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'law = "\xe9"')
    with pytest.raises(InputError, match="UTF-8"):
        load_law("latin.toml", EL, tmp_path)
    (tmp_path / "own.toml").write_text('young = "20 GPa"\npoisson = 0.7\n')
    with pytest.raises(InputError, match="poisson: must not be above"):
        load_elasticity(str(tmp_path / "own.toml"))


def test_invalid_coefficients_are_rejected(tmp_path: Path) -> None:
    one = np.full(1, 1200.0)
    law = NortonHoff(EL, Constant(-1.0), Constant(0.0), Constant(0.1), Constant(0.1))
    with pytest.raises(ValueError, match="strength K0 p2 must be positive"):
        law.coefficients(one, one)
    flat = NortonHoff(EL, Constant(1e6), Constant(0.0), Constant(0.0), Constant(0.1))
    with pytest.raises(ValueError, match=r"p3 must be at least 0\.001"):
        flat.coefficients(one, one)
    with pytest.raises(ValueError, match="yield stress must be positive"):
        PerfectlyPlastic(EL, Constant(0.0)).coefficients(one, one)


def test_tables_interpolate() -> None:
    t = np.array([0.0, 100.0, 150.0, 200.0, 300.0])
    linear = Table("temperature", (100.0, 200.0), (1.0, 4.0))
    np.testing.assert_allclose(linear(t), [1.0, 1.0, 2.5, 4.0, 4.0])
    logarithmic = Table("temperature", (100.0, 200.0), (1.0, 4.0), logarithmic=True)
    np.testing.assert_allclose(logarithmic(t), [1.0, 1.0, 2.0, 4.0, 4.0])
    for rows in (((1.0,), ()), ((2.0, 1.0), (1.0, 1.0)), ((), ())):
        with pytest.raises(ValueError, match="table"):
            Table("temperature", *rows)
    with pytest.raises(ValueError, match="logarithm"):
        Table("temperature", (1.0, 2.0), (0.0, 1.0), logarithmic=True)
