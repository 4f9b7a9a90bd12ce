"""The solid skeleton of the mushy zone, and points that solidify under load."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
    MaterialStep,
    NortonCreep,
    PerfectlyPlastic,
    Solidity,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.base import equivalent_stress
from castfem.physics.constitutive.flow_laws import RadialReturn, ThermoElastic

from .samples import LIQUIDUS, SOLIDUS

SHARE = 0.4  # of the way from coherency to solid
MUSHY = SOLIDUS + 0.25 * (1.0 - SHARE) * (LIQUIDUS - SOLIDUS)
SOFT = SOLIDUS + 0.26 * (LIQUIDUS - SOLIDUS)


def elasticity(memory: bool = False) -> Elasticity:
    solidity = Solidity.between(
        SOLIDUS, LIQUIDUS, mushy_zone="skeleton", coherency=0.75, memory=memory
    )
    return load_elasticity(solidity=solidity)


def laws() -> dict[str, RadialReturn]:
    el = elasticity()
    return {
        "plastic": PerfectlyPlastic(el, Constant(2e5)),
        "creep": NortonCreep.constant(el, 1e-3, 4e5, 5.0),
        "hoff": load_law("norton_hoff_kozlowski", el),
        "steel, austenite": load_law("kozlowski_zhu", el, carbon=0.42),
        "steel, delta": load_law("kozlowski_zhu", el, carbon=0.05, delta_share=np.ones_like),
    }


def strained(
    law: RadialReturn, temperature: float, strain: float, time: float, steps: int
) -> tuple[Array, Array]:
    """Return stress and state of a point sheared at a constant rate from rest."""
    stress, state = np.zeros((1, 4)), law.initial_state(1)
    heat, nothing = np.full(1, temperature), np.zeros(1)
    change = np.array([[0.0, 0.0, 0.0, np.sqrt(1.5) * strain / steps]])
    for _ in range(steps):
        step = MaterialStep(change, nothing, heat, heat, time / steps)
        answer = law.integrate(step, stress, state)
        stress, state = answer.stress.copy(), answer.state.copy()
    return stress, state


@pytest.mark.parametrize("name", list(laws()))
def test_skeleton_has_its_share_of_the_stress_of_solid(name: str) -> None:
    """Exact for Poisson's ratio 0, which does not change with the solid fraction."""
    solidity = elasticity().solidity
    law = replace(laws()[name], elasticity=Elasticity.constant(5e9, 0.0, solidity))
    for strain in (1e-6, 1e-3, 0.2):
        stress, _ = strained(law, MUSHY, strain, 10.0, 1)
        solid, _ = strained(law, SOLIDUS, strain, 10.0, 1)
        np.testing.assert_allclose(stress, SHARE * solid, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("name", ["plastic", "creep", "steel, delta", "hoff"])
def test_stress_of_skeleton_converges_with_the_step(name: str) -> None:
    """A strain rate of 1e-5 1/s, elastic at first: 10, 100 and 1000 steps agree at first order."""
    law = laws()[name]
    found = [equivalent_stress(strained(law, MUSHY, 1e-4, 10.0, n)[0])[0] for n in (10, 100, 1000)]
    assert found[2] > 1e3
    assert abs(found[1] - found[2]) < max(0.2 * abs(found[0] - found[2]), 1e-6 * found[2])
    assert found[0] == pytest.approx(found[2], rel=0.15)


def test_skeleton_does_not_harden() -> None:
    law = laws()["steel, delta"]
    _, state = strained(law, MUSHY, 0.05, 10.0, 50)
    assert law.strain(state)[0] < 2e-3


def test_point_that_becomes_coherent_starts_without_stress() -> None:
    """A point that cools into the skeleton loses the stress of the stand-in for the liquid."""
    law = PerfectlyPlastic(elasticity(), Constant(2e5))
    old = np.array([[0.0, 0.0, 0.0, 1e5]])
    cooled = MaterialStep(np.zeros((1, 4)), np.zeros(1), np.full(1, SOFT), np.full(1, MUSHY), 0.1)
    answer = law.integrate(cooled, old, law.initial_state(1))
    np.testing.assert_array_equal(answer.stress, 0.0)


def test_reheated_solid_has_the_flow_stress_of_the_skeleton() -> None:
    """Solid reheated into the mushy zone has at most the flow stress at its solid fraction."""
    law = PerfectlyPlastic(elasticity(), Constant(2e5))
    old = np.array([[0.0, 0.0, 0.0, 1.9e5 * np.sqrt(2.0 / 3.0)]])
    hotter = MaterialStep(
        np.zeros((1, 4)), np.zeros(1), np.full(1, SOLIDUS), np.full(1, MUSHY), 0.1
    )
    answer = law.integrate(hotter, old, law.initial_state(1))
    assert 0.0 < equivalent_stress(answer.stress)[0] <= SHARE * 2e5 * (1.0 + 1e-9)


@pytest.mark.parametrize("name", list(laws()))
def test_tangent_matches_differences(name: str) -> None:
    law, dt, by = laws()[name], 0.1, 1e-9
    heat = np.full(1, MUSHY)
    strain = np.array([[2e-4, -1e-4, 1e-5, 3e-4]])
    start, state = strained(law, MUSHY, 1e-4, 1.0, 4)

    def stress(of: Array) -> Array:
        step = MaterialStep(of, np.zeros(1), heat, heat, dt)
        return law.integrate(step, start, state).stress.copy()

    step = MaterialStep(strain, np.zeros(1), heat, heat, dt)
    tangent = law.integrate(step, start, state).tangent[0].copy()
    for k in range(4):
        way = np.zeros((1, 4))
        way[0, k] = by
        found = (stress(strain + way) - stress(strain - way))[0] / (2 * by)
        np.testing.assert_allclose(tangent[:, k], found, rtol=2e-4, atol=2e-5 * abs(tangent).max())


def cooled(law: RadialReturn, ends: tuple[float, float], strain: float, steps: int) -> float:
    """Return the equivalent stress of a point sheared and cooled at constant rates from rest."""
    stress, state = np.zeros((1, 4)), law.initial_state(1)
    heat, nothing = np.linspace(*ends, steps + 1)[:, None], np.zeros(1)
    change = np.array([[0.0, 0.0, 0.0, np.sqrt(1.5) * strain / steps]])
    for before, after in itertools.pairwise(heat):
        answer = law.integrate(
            MaterialStep(change, nothing, before, after, 1.0 / steps), stress, state
        )
        stress, state = answer.stress.copy(), answer.state.copy()
    return float(equivalent_stress(stress)[0])


def test_stress_of_stiffening_skeleton_is_independent_of_steps() -> None:
    """Exact for a modulus that grows linearly: the mean modulus times the strain."""
    law = ThermoElastic(Elasticity.constant(5e9, 0.0, elasticity(memory=True).solidity))
    expected = 1.5 * 5e9 * 0.5 * (SHARE + 1.0) * 1e-5
    for steps in (1, 7):
        assert cooled(law, (MUSHY, SOLIDUS), 1e-5, steps) == pytest.approx(expected, rel=1e-9)


def test_creep_at_constant_stress_is_of_second_order() -> None:
    """The creep rate falls tenfold per 100 K: the strain is the integral of the rate."""
    el = Elasticity.constant(5e9, 0.3, elasticity().solidity)
    law = NortonCreep.at_stress(
        el, Constant(1e6), lambda t: 1e-4 * 10.0 ** ((t - SOLIDUS) / 100.0), Constant(5.0)
    )
    start = np.array([[0.0, 0.0, 0.0, np.sqrt(2.0 / 3.0) * 1e6]])

    def strain(steps: int) -> float:
        """Solve for the strain at a stress of 1 MPa while the steel cools by 100 K in 10 s."""
        total, state = 0.0, law.initial_state(1)
        heat, dt = np.linspace(SOLIDUS, SOLIDUS - 100.0, steps + 1)[:, None], 10.0 / steps
        for before, after in itertools.pairwise(heat):
            change = np.zeros((1, 4))
            for _ in range(30):
                step = MaterialStep(change, np.zeros(1), before, after, dt)
                answer = law.integrate(step, start, state)
                change[0, 3] -= (answer.stress[0, 3] - start[0, 3]) / answer.tangent[0, 3, 3]
            total, state = total + change[0, 3], answer.state.copy()
        return float(np.sqrt(2.0 / 3.0) * total)

    exact = 1e-4 * 10.0 / np.log(10.0) * (1.0 - 0.1)
    coarse, fine = (strain(steps) / exact - 1.0 for steps in (10, 20))
    assert abs(coarse) < 3e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.05)


def test_growing_stiffness_keeps_the_stress() -> None:
    """A stiffness that grows keeps the stress, one that falls keeps the elastic strain."""
    law, stress = ThermoElastic(elasticity()), np.array([[1e5, 2e5, -6e4, 5e4]])
    state, still = law.initial_state(1), (np.zeros((1, 4)), np.zeros(1))
    heat = {name: np.full(1, t) for name, t in (("solid", SOLIDUS), ("mushy", MUSHY))}
    freezes = MaterialStep(*still, heat["mushy"], heat["solid"], 1.0)
    assert law.integrate(freezes, stress, state).stress == pytest.approx(stress, rel=1e-12)
    melts = MaterialStep(*still, heat["solid"], heat["mushy"], 1.0)
    soft, hard = (law.elasticity.moduli(heat[name]) for name in ("mushy", "solid"))
    shear, bulk = soft[0] / hard[0], soft[1] / hard[1]
    mean = stress[:, :3].mean() * np.array([[1.0, 1.0, 1.0, 0.0]])
    expected = shear * (stress - mean) + bulk * mean
    assert law.integrate(melts, stress, state).stress == pytest.approx(expected, rel=1e-12)


N = 4001


@pytest.mark.parametrize("celsius", [1100.0, 1300.0, 1449.0])
@pytest.mark.parametrize("dt", [0.2, 0.0125, 1e-4])
def test_stress_is_continuous_across_the_yield_limit(celsius: float, dt: float) -> None:
    """The shear of a virgin point grows through the yield limit: no jump or fall of stress."""
    elastic = load_elasticity("elastic_steel", Solidity())
    law = load_law("norton_hoff_kozlowski", elastic)
    hot = np.full(N, celsius + 273.15)
    shear = 0.5 * float(elastic.young(hot[:1])[0]) / (1.0 + float(elastic.poisson(hot[:1])[0]))
    for carried in (0.2e6, 1.5e6, 4e6):
        stress = np.zeros((N, 4))
        stress[:, 3] = carried * np.sqrt(2.0 / 3.0)
        gain = np.linspace(0.0, 3e-6, N)  # Mandel shear strain
        strain = np.zeros((N, 4))
        strain[:, 3] = gain
        step = MaterialStep(strain, np.zeros(N), hot, hot, dt)
        found = law.integrate(step, stress, law.initial_state(N))
        q = equivalent_stress(found.stress)
        rise = np.diff(q) / (np.sqrt(6.0) * shear * np.diff(gain))  # 1: elastic
        assert rise.min() > -1e-3 and rise.max() < 1.2  # 3G/E of elasticity: docs/laws.md
