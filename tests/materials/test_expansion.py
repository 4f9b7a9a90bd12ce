"""Thermal contraction: closed forms, Chandra's procedure, and the numbers of the thesis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from castfem.base.tables import Constant, Table
from castfem.physics.materials import load_steel
from castfem.physics.materials.expansion import (
    ChandraExpansion,
    ConstantExpansion,
    DensityExpansion,
    DifferentialExpansion,
    MeanExpansion,
    atomic_percent,
    gamma_edge_per_carbon,
)
from castfem.physics.materials.iron_carbon import IronCarbon

ZERO = 273.15


def test_constant_coefficient_gives_linear_strain():
    law = ConstantExpansion(13.5e-6)
    assert law.strain([1000.0, 1100.0], 1725.15) == pytest.approx(
        [-13.5e-6 * 725.15, -13.5e-6 * 625.15], rel=1e-14
    )


@given(st.floats(700.0, 2000.0), st.floats(700.0, 2000.0))
def test_differential_table_is_integrated_exactly(temperature, reference):
    """The length satisfies dL = alpha L dT."""
    table = Table("temperature", (900.0, 1200.0, 1500.0), (12e-6, 18e-6, 15e-6))
    law = DifferentialExpansion(table)
    integral = quad(
        lambda t: float(table(t)), reference, temperature, points=table.kinks, limit=200
    )[0]
    assert float(law.strain(temperature, reference)) == pytest.approx(
        math.expm1(integral), abs=1e-12
    )


def test_mean_table_counts_from_its_origin():
    law = MeanExpansion(Table("temperature", (300.0, 1500.0), (12e-6, 18e-6)), origin=293.15)
    lengths = [1.0 + 15e-6 * (900.0 - 293.15), 1.0 + 18e-6 * (1500.0 - 293.15)]
    assert float(law.strain(900.0, 1500.0)) == pytest.approx(
        lengths[0] / lengths[1] - 1.0, rel=1e-12
    )


def test_density_law_is_the_cube_root_of_volume():
    law = DensityExpansion(Table("temperature", (1000.0, 1500.0), (7600.0, 7400.0)))
    assert float(law.strain(1000.0, 1500.0)) == pytest.approx((7400 / 7600) ** (1 / 3) - 1)
    assert np.all(DensityExpansion(Constant(7400.0)).strain([900.0, 1400.0], 1700.0) == 0.0)


def test_pure_iron_has_the_volumes_of_wray():
    law = ChandraExpansion(IronCarbon(0.0))
    assert float(law.specific_volume(1450 + ZERO)) == pytest.approx(
        1e-3 * (0.1234 + 9.38e-6 * 1430), rel=1e-14
    )
    assert float(law.specific_volume(1300 + ZERO)) == pytest.approx(
        1e-3 * (0.1225 + 9.45e-6 * 1280), rel=1e-14
    )


def test_volume_of_austenite_is_that_of_its_unit_cell():
    """The cell has four iron atoms and their share of carbon."""
    celsius, carbon = 1300.0, 0.42
    avogadro, iron = 6.02214076e23, 55.845
    pure = np.cbrt((0.1225 + 9.45e-6 * 1280) * 4 * iron / avogadro)  # cm
    edge = pure + 1e-8 * carbon * (0.0317 - 11.65e-7 * celsius - 0.05e-7 * celsius**2)
    grams = 4 * iron / avogadro / (1 - carbon / 100)
    law = ChandraExpansion(IronCarbon(carbon))
    volume = float(law.specific_volume(celsius + ZERO))
    assert volume == pytest.approx(1e-3 * edge**3 / grams, rel=1e-12)


def test_carbon_corrections_match_independent_data():
    """The lattice of austenite at 20 degC, and the mean slopes of Harste's densities."""
    assert float(gamma_edge_per_carbon(20.0)) == pytest.approx(0.0330, rel=0.05)
    edge = 3.57  # Angstrom
    assert float(gamma_edge_per_carbon(700.0)) / edge == pytest.approx(0.008, rel=0.02)
    delta = 8.4e-3 * float(atomic_percent(0.1)) / 0.1 / 2.93
    assert delta == pytest.approx(0.013, rel=0.05)
    hot = gamma_edge_per_carbon(np.linspace(20.0, 1500.0, 50))
    assert np.all(hot > 0.0) and np.all(np.diff(hot) < 0.0)


def test_atomic_percent_of_cementite():
    assert float(atomic_percent(0.0)) == 0.0
    assert float(atomic_percent(6.67)) == pytest.approx(25.0, abs=0.1)  # cementite, Fe3C


@pytest.mark.parametrize("celsius", [900.0, 1100.0, 1400.0])
def test_contraction_of_austenite_is_that_of_the_thesis(celsius):
    """V.1.4.3 quotes 22e-6 1/K for austenite from its Figure 28."""
    steel = load_steel("plain_carbon", composition={"C": 0.42})
    assert float(steel.thermal_expansion(celsius + ZERO)) == pytest.approx(22e-6, rel=0.03)


@pytest.mark.parametrize("carbon", [0.05, 0.15, 0.42])
def test_chandra_and_densities_agree(carbon):
    """Two independent sets of volumes agree to 8 % in the contraction to 1000 degC."""
    chandra = load_steel("plain_carbon", composition={"C": carbon})
    harste = load_steel(
        "plain_carbon",
        composition={"C": carbon},
        overrides={"thermal_expansion": {"formula": "density"}},
    )
    assert float(chandra.thermal_strain(1273.15)) == pytest.approx(
        float(harste.thermal_strain(1273.15)), rel=0.08
    )


def test_delta_to_gamma_contracts_low_carbon_steel():
    steel = load_steel("plain_carbon", composition={"C": 0.05})
    start, end = steel.diagram.gamma_start, steel.diagram.gamma_end
    shrinkage = float(steel.thermal_strain(start) - steel.thermal_strain(end))
    assert 0.0022 < shrinkage < 0.0032  # cooling by 22 K gives 0.0005


@given(st.floats(0.0, 1.0), st.floats(900.0, 1900.0))
def test_strain_is_zero_above_the_solidus_and_negative_below(carbon, temperature):
    steel = load_steel("plain_carbon", composition={"C": carbon})
    strain = float(steel.thermal_strain(temperature))
    mean = float(steel.thermal_expansion(temperature))
    if temperature >= steel.solidus:
        assert strain == 0.0 and mean == 0.0
    else:
        assert strain <= 0.0
        assert 10e-6 < mean < 1e-2 or temperature > steel.solidus - 1.0
        if temperature < steel.solidus - 1e-2:
            assert mean * (temperature - steel.solidus) == pytest.approx(strain, rel=1e-12)


def test_strain_is_continuous_at_the_solidus():
    for carbon in (0.05, 0.15, 0.42):
        steel = load_steel("plain_carbon", composition={"C": carbon})
        assert abs(float(steel.thermal_strain(steel.solidus - 1e-9))) < 1e-9


def test_mean_coefficient_at_the_solidus_is_the_slope():
    steel = load_steel("carbon_042")
    near = steel.solidus - np.array([1e-12, 1e-6, 1e-3, 1.0])
    assert steel.thermal_expansion(near) == pytest.approx(13.5e-6, rel=1e-9)
