"""Hooke's law over temperature, and the elastic stress in solidification and melting.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from castfem.base.tables import Constant, Table, celsius
from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
    MaterialStep,
    Solidity,
    ThermoElastic,
    load_elasticity,
)
from castfem.physics.materials import load_steel

from .samples import LIQUIDUS, SOLIDUS, ZERO, one, steel_like

E, NU = 20e9, 0.3


def step_of(
    strain: list[float], old: float, new: float, thermal: float = 0.0, dt: float = 1.0
) -> MaterialStep:
    return MaterialStep(
        np.array([strain]), np.full(1, thermal), np.full(1, old), np.full(1, new), dt
    )


def hooke(strain: list[float], young: float = E, poisson: float = NU) -> Array:
    """Return the stress of Hooke's law, thesis (56)."""
    e = np.array(strain)
    trace = np.array([1.0, 1.0, 1.0, 0.0]) * e[:3].sum()
    factor = young / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    return factor * ((1.0 - 2.0 * poisson) * e + poisson * trace)


def integrated(law: ThermoElastic, steps: list[MaterialStep]) -> Array:
    stress, state = np.zeros((1, 4)), law.initial_state(1)
    for step in steps:
        stress = law.integrate(step, stress, state).stress
    return stress[0]


def test_stress_and_tangent_are_those_of_hooke() -> None:
    law = ThermoElastic(Elasticity.constant(E, NU))
    strain = [1e-3, -2e-4, 4e-4, np.sqrt(2.0) * 3e-4]
    found = one(law, strain)
    np.testing.assert_allclose(found.stress[0], hooke(strain), rtol=1e-13)
    columns = np.stack([hooke(list(row)) for row in np.eye(4)])
    np.testing.assert_allclose(found.tangent[0], columns, rtol=1e-13, atol=1e-3)
    assert not found.flows.any() and found.dissipation[0] == 0.0 and found.state.shape == (1, 0)


def test_free_expansion_makes_no_stress() -> None:
    law = ThermoElastic(load_elasticity())
    found = integrated(law, [step_of([5e-3, 5e-3, 5e-3, 0.0], 400.0, 900.0, 5e-3)])
    assert np.abs(found).max() < 1e-5


def test_stress_follows_the_moduli_of_the_temperature() -> None:
    """(94): for any path, the stress is that of Hooke's law with the final moduli."""
    elasticity = Elasticity(
        celsius([20, 800, 1200, 1400], [200e9, 60e9, 15e9, 5e9]), celsius([20, 1400], [0.28, 0.4])
    )
    law = ThermoElastic(elasticity)
    rng = np.random.default_rng(0)
    temperature, strain, steps = 300.0, np.zeros(4), []
    for _ in range(12):
        increment, new = rng.normal(size=4) * 1e-3, rng.uniform(300.0, 1650.0)
        steps.append(step_of(list(increment), temperature, new))
        strain, temperature = strain + increment, new
    one_t = np.full(1, temperature)
    young, poisson = float(elasticity.young(one_t)[0]), float(elasticity.poisson(one_t)[0])
    found = integrated(law, steps)
    np.testing.assert_allclose(found, hooke(list(strain), young, poisson), rtol=1e-11)


def test_steep_change_of_the_modulus_is_followed() -> None:
    elasticity = Elasticity(Table("temperature", (1000.0, 1000.1), (100e9, 1e6)), Constant(0.3))
    law = ThermoElastic(elasticity)
    strain = [1e-3, 0.0, 0.0, 0.0]
    down = [step_of(strain, 900.0, 900.0), step_of([0.0] * 4, 900.0, 1100.0)]
    np.testing.assert_allclose(integrated(law, down), hooke(strain, 1e6), rtol=1e-12)
    back = [*down, step_of([0.0] * 4, 1100.0, 900.0)]
    np.testing.assert_allclose(integrated(law, back), hooke(strain, 100e9), rtol=1e-12)


def test_solidifying_point_keeps_stress_not_elastic_strain() -> None:
    ratio = 1e-6
    law = ThermoElastic(steel_like(ratio))
    liquid, solid = LIQUIDUS + 20.0, SOLIDUS - 20.0
    compressed = [step_of([-0.5, 0.2, 0.1, 0.3], liquid, liquid)]
    before = integrated(law, compressed)
    assert 0.0 < np.abs(before).max() < 5e4
    after = integrated(law, [*compressed, step_of([0.0] * 4, liquid, solid)])
    np.testing.assert_allclose(after, before, rtol=1e-12)
    through_mushy_zone = [
        step_of([0.0] * 4, liquid, SOLIDUS + 30.0),
        step_of([0.0] * 4, SOLIDUS + 30.0, SOLIDUS + 1.0),
        step_of([0.0] * 4, SOLIDUS + 1.0, solid),
    ]
    np.testing.assert_allclose(
        integrated(law, [*compressed, *through_mushy_zone]), before, rtol=1e-12
    )


def test_melting_releases_the_stress() -> None:
    law = ThermoElastic(steel_like(1e-6))
    pulled = [step_of([1e-3, 0.0, 0.0, 0.0], SOLIDUS - 50.0, SOLIDUS - 50.0)]
    before = np.abs(integrated(law, pulled)).max()
    melted = [*pulled, step_of([0.0] * 4, SOLIDUS - 50.0, LIQUIDUS + 1.0)]
    assert np.abs(integrated(law, melted)).max() < 1e-5 * before
    half = [*pulled, step_of([0.0] * 4, SOLIDUS - 50.0, SOLIDUS + 1.0)]
    both = [*half, step_of([0.0] * 4, SOLIDUS + 1.0, LIQUIDUS + 1.0)]
    np.testing.assert_allclose(integrated(law, both), integrated(law, melted), rtol=1e-9, atol=1e-9)


def test_strain_counts_from_the_solidus_within_a_step() -> None:
    """A step across the solidus gives the stress of two steps that are split at the solidus."""
    elasticity = Elasticity.constant(
        E, NU, Solidity.between(SOLIDUS, LIQUIDUS, stiffness_ratio=1e-9)
    )
    law = ThermoElastic(elasticity)
    old, new, part = SOLIDUS + 60.0, SOLIDUS - 20.0, 0.25
    strain = np.array([1e-3, -4e-4, 2e-4, 5e-4])
    single_step = integrated(law, [step_of(list(strain), old, new, thermal=-2e-4)])
    split = integrated(
        law,
        [
            step_of(list((1.0 - part) * strain), old, LIQUIDUS),
            step_of(list(part * strain), SOLIDUS, new, thermal=-2e-4),
        ],
    )
    np.testing.assert_allclose(single_step, split, rtol=1e-6)
    solid = hooke(list(part * strain + np.array([2e-4, 2e-4, 2e-4, 0.0])))
    np.testing.assert_allclose(single_step, solid, rtol=1e-6)


def test_strain_of_the_complete_step_can_count() -> None:
    solidity = Solidity.between(SOLIDUS, LIQUIDUS, from_freezing=False)
    law = ThermoElastic(Elasticity.constant(E, NU, solidity))
    strain = [1e-3, -4e-4, 2e-4, 5e-4]
    found = integrated(law, [step_of(strain, SOLIDUS + 60.0, SOLIDUS - 20.0)])
    np.testing.assert_allclose(found, hooke(strain), rtol=1e-12)


@pytest.mark.parametrize(("mushy_zone", "middle"), [("geometric", 1e-3), ("linear", 0.5)])
def test_stiffness_of_mushy_zone_and_liquid(mushy_zone: Any, middle: float) -> None:
    solidity = Solidity.between(1700.0, 1800.0, stiffness_ratio=1e-6, mushy_zone=mushy_zone)
    elasticity = Elasticity.constant(E, NU, solidity)
    t = np.array([1500.0, 1700.0, 1750.0, 1800.0, 1900.0])
    shear, bulk, young = elasticity.moduli(t)
    np.testing.assert_allclose(young / E, [1.0, 1.0, middle, 1e-6, 1e-6], rtol=1e-5)
    poisson = 0.5 * young / shear - 1.0
    np.testing.assert_allclose(poisson, [0.3, 0.3, 0.15, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(bulk, young / (3.0 - 6.0 * poisson), rtol=1e-9)


def test_solidity_of_a_steel_follows_its_solidus_and_liquidus() -> None:
    straight = {"diagram": "pascon"}  # the last liquid of 0.1 % C freezes at its peritectic
    steel = load_steel("plain_carbon", composition={"C": 0.1}, overrides=straight)
    elasticity = Elasticity(steel.youngs_modulus, steel.poisson_ratio, Solidity.of(steel))
    t = np.array([1200.0, steel.solidus, steel.liquidus - 1.0, steel.liquidus + 10.0])
    young = elasticity.moduli(t)[2]
    np.testing.assert_allclose(young[:2], steel.youngs_modulus(t[:2]), rtol=1e-12)
    assert 1e-5 * young[1] < young[2] < 1e-3 * young[1]
    assert young[3] == pytest.approx(1e-5 * young[1], rel=1e-9)


def test_mushy_zone_is_soft_below_coherency() -> None:
    solidity = Solidity.between(1700.0, 1800.0, stiffness_ratio=1e-4, coherency=0.6)
    young = Elasticity.constant(E, NU, solidity).moduli(np.array([1745.0, 1720.0, 1700.0]))[2]
    np.testing.assert_allclose(young / E, [1e-4, 1e-2, 1.0], rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"stiffness_ratio": 0.0}, "stiffness_ratio"),
        ({"coherency": 1.0}, "coherency"),
        ({"mushy_zone": "cubic"}, "mushy_zone"),
    ],
)
def test_invalid_solidity_is_rejected(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Solidity(**options)


def test_invalid_moduli_are_rejected() -> None:
    for young, poisson in ((-1.0, 0.3), (0.0, 0.3), (np.nan, 0.3), (1e9, -1.0)):
        with pytest.raises(ValueError, match="must be positive"):
            Elasticity.constant(young, poisson).moduli(np.array([300.0]))


def test_shipped_elasticity() -> None:
    """Kozlowski's regression for hot steel, the lower bound, and finite values when cold."""
    t = np.array([20.0, 900.0, 1000.0, 1100.0, 1200.0, 1300.0, 1400.0, 1450.0, 1600.0])
    young = load_elasticity().moduli(t + ZERO)[2] / 1e9
    expected = [207.0, 32.378, 20.0, 14.542, 12.896, 11.954, 8.608, 5.062, 1.0]
    np.testing.assert_allclose(young, expected, rtol=1e-3)
    fine = load_elasticity().moduli(np.linspace(20.0, 1600.0, 3000) + ZERO)[2]
    assert (np.diff(fine) <= 0.0).all()
    c = np.linspace(700.0, 1488.0, 500)
    cubic = 968.0 - 2.33 * c + 1.90e-3 * c**2 - 5.18e-7 * c**3
    np.testing.assert_allclose(load_elasticity().moduli(c + ZERO)[2] / 1e9, cubic, rtol=0.02)


def skeleton(**options: Any) -> Solidity:
    return Solidity.between(1700.0, 1800.0, mushy_zone="skeleton", coherency=0.75, **options)


def test_skeleton_weight_is_linear_in_solid_above_coherency() -> None:
    solidity = skeleton(stiffness_ratio=1e-5)
    t = np.array([1600.0, 1700.0, 1712.5, 1724.0, 1726.0, 1900.0])
    weight = [1.0, 1.0, 0.5, 0.04, 0.0, 0.0]
    np.testing.assert_allclose(solidity.weight(t), weight, atol=1e-12)
    np.testing.assert_allclose(solidity.strength(t), np.maximum(weight, 0.01), rtol=1e-9)
    young = Elasticity.constant(E, NU, solidity).moduli(t)[2]
    np.testing.assert_allclose(young / E, np.maximum(weight, 1e-5), rtol=1e-9)
    assert solidity.coherent == pytest.approx(1725.0, abs=1e-6)


def test_steel_that_freezes_isothermally_has_no_skeleton() -> None:
    sharp = Solidity(1700.0, lambda t: np.where(t < 1700.0, 1.0, 0.0), mushy_zone="skeleton")
    assert sharp.coherent == pytest.approx(1700.0, abs=1e-9)
    assert Solidity().coherent == np.inf
    assert Solidity.between(1700.0, 1800.0).coherent == 1700.0
