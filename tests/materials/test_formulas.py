"""The named formulas: continuity, physical bounds, agreement of independent formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from castfem.physics.materials.alloying import alloyed
from castfem.physics.materials.formulas import FORMULAS, harste_enthalpy, phase_densities
from castfem.physics.materials.iron_carbon import IronCarbon, Phases
from castfem.physics.materials.properties import named

ZERO = 273.15


def single_phase(phase: str, carbon: float = 0.0) -> Phases:
    names = ("liquid", "delta", "gamma")
    fractions = [np.array(float(name == phase)) for name in names]
    contents = [np.array(carbon if name == phase else np.nan) for name in names]
    return Phases(*fractions, *contents)


def value(name: str, celsius: float, phase: str, carbon: float = 0.0, **parameters) -> float:
    t = np.array(celsius + ZERO)
    return float(FORMULAS[name].evaluate(t, single_phase(phase, carbon), **parameters))


def test_conductivities_of_delta_and_gamma_agree_at_1400():
    gamma, delta = (value("harste_conductivity", 1400.0, p) for p in ("gamma", "delta"))
    assert gamma == pytest.approx(33.3, abs=0.05)
    assert delta == pytest.approx(gamma, rel=0.005)


def test_liquid_factor_multiplies_only_the_liquid():
    assert value("harste_conductivity", 1550.0, "liquid", liquid_factor=2.0) == 78.0
    assert value("harste_conductivity", 1300.0, "gamma", liquid_factor=2.0) == pytest.approx(
        21.6 + 8.35e-3 * 1300
    )


def test_pure_iron_has_its_heats_of_fusion_and_transformation():
    fusion = value("harste_enthalpy", 1811 - ZERO, "liquid") - value(
        "harste_enthalpy", 1811 - ZERO, "delta"
    )
    change = value("harste_enthalpy", 1667 - ZERO, "delta") - value(
        "harste_enthalpy", 1667 - ZERO, "gamma"
    )
    assert fusion == pytest.approx(249.4e3, abs=100)
    assert change == pytest.approx(13.5e3, abs=100)


@pytest.mark.parametrize("phase", ["liquid", "delta", "gamma"])
def test_specific_heat_is_the_slope_of_the_enthalpy(phase):
    t = np.array([1400.0, 1700.0])
    h = [harste_enthalpy(t + d, single_phase(phase)) for d in (-1.0, 1.0)]
    slope = (h[1] - h[0]) / 2.0
    assert FORMULAS["harste_specific_heat"].evaluate(t, single_phase(phase)) == pytest.approx(
        slope, rel=1e-9
    )


def test_densities_of_the_phases_have_their_values():
    liquid, delta, gamma = phase_densities(np.array(1400.0 + ZERO), single_phase("gamma", 0.1))
    delta_01 = phase_densities(np.array(1400.0 + ZERO), single_phase("delta", 0.1))[1]
    assert float(gamma) == pytest.approx(7382, abs=1)
    assert float(delta_01) == pytest.approx(7332, abs=1)
    assert float(liquid) == pytest.approx(7100 + 0.8 * 150, rel=1e-12)
    assert float(delta) > float(delta_01)  # carbon adds more volume than mass


def test_mixture_density_adds_volumes():
    half = Phases(*(np.array(v) for v in (0.5, 0.5, 0.0, 0.3, 0.06, np.nan)))
    t = np.array(1780.0)
    liquid, delta, _ = phase_densities(t, half)
    mean = FORMULAS["jimbo_cramb_density"].evaluate(t, half)
    assert float(1.0 / mean) == pytest.approx(float(0.5 / liquid + 0.5 / delta), rel=1e-14)


@pytest.mark.parametrize(("celsius", "expected"), [(700, 0.70), (900, 0.75), (1100, 0.80)])
def test_emissivity_has_its_values(celsius, expected):
    assert float(named("scaled_surface_emissivity")(celsius + ZERO)) == pytest.approx(
        expected, abs=0.006
    )


@pytest.mark.parametrize(
    ("celsius", "gpa"),
    [(900, 32.4), (1000, 20.0), (1100, 14.5), (1200, 12.9), (1300, 11.95), (1400, 8.6)],
)
def test_youngs_modulus_has_its_values(celsius, gpa):
    assert float(named("mizukami_modulus")(celsius + ZERO)) == pytest.approx(gpa * 1e9, rel=0.01)


def test_youngs_modulus_stays_between_floor_and_ceiling():
    law = named("mizukami_modulus", floor=2e9, ceiling=1e11)
    t = np.linspace(300.0, 2000.0, 500)
    e = law(t)
    assert e.min() == 2e9 and e.max() == 1e11
    assert np.all(np.diff(e) <= 0.0)
    high, low = law.kinks
    assert law([high - 1, high + 1])[0] == 1e11 > law(high + 1)
    assert float(law(low + 1)) == 2e9 < float(law(low - 1))


@given(st.floats(0.0, 1.2), st.sampled_from(["above", "below"]))
def test_phase_formulas_stay_within_physical_bounds(carbon, side):
    diagram = IronCarbon(carbon)
    t = np.union1d(np.linspace(293.15, 1973.15, 200), diagram.kinks)
    bounds = {
        "harste_conductivity": (20.0, 45.0),
        "jimbo_cramb_density": (6600.0, 8200.0),
        "harste_specific_heat": (450.0, 850.0),
    }
    for name, (low, high) in bounds.items():
        values = named(name, diagram)(t, side)
        assert np.all((values > low) & (values < high)), name


@given(st.floats(0.0, 2.0), st.sampled_from([{}, {"Mn": 2.0, "Si": 0.6}, {"Si": 0.6}]))
def test_enthalpy_increases_with_temperature(carbon, others):
    diagram = alloyed({"C": carbon, **others}) if others else IronCarbon(carbon)
    t = np.union1d(np.linspace(1000.0, 1900.0, 900), diagram.kinks)
    law = named("harste_enthalpy", diagram)
    assert np.all(law(t[1:], "below") > law(t[:-1], "above"))
    assert all(law(r, "above") > law(r, "below") for r in diagram.reactions)


def test_formula_by_phase_needs_the_diagram():
    with pytest.raises(ValueError, match="carbon content"):
        named("harste_conductivity")


def test_every_formula_has_source_and_status():
    for formula in FORMULAS.values():
        assert formula.source and formula.status in "FMC"
        assert formula.evaluate.__doc__
