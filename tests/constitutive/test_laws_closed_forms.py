"""Constitutive laws compared with closed forms.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.physics.constitutive import (
    Elasticity,
    MaterialStep,
    NortonCreep,
    NortonHoff,
    PerfectlyPlastic,
    UnifiedSteel,
    load_law,
)
from castfem.physics.constitutive.flow_curves import (
    Austenite,
    DeltaFerrite,
    modified_norton_hoff,
    yield_limit,
)
from castfem.physics.constitutive.parameters import DeltaShare
from castfem.physics.constitutive.uniaxial import pull
from castfem.physics.materials import load_steel

from .samples import ZERO, norton_relaxation, one

E = 20e9
EL = Elasticity.constant(E, 0.3)
T = 1273.15
MPA = 1e6


def norton_hoff(
    p1: float, p3: float, p4: float, limit: float | None = None, strength: float = 31.76e6
) -> NortonHoff:
    set_limit = None if limit is None else Constant(limit)
    return NortonHoff(EL, Constant(strength), Constant(p1), Constant(p3), Constant(p4), set_limit)


def test_perfect_plasticity_in_tension_and_back() -> None:
    law = PerfectlyPlastic(EL, Constant(20e6))
    strain = np.concatenate([np.linspace(0.0, 5e-3, 51), np.linspace(5e-3, 2e-3, 31)[1:]])
    found = pull(law, np.arange(len(strain)), strain, T)
    loading, unloading = strain[:51], strain[51:]
    expected = np.concatenate(
        [
            np.minimum(E * loading, 20e6),
            np.maximum(20e6 - E * (5e-3 - unloading), -20e6),
        ]
    )
    np.testing.assert_allclose(found.axial_stress[:, 0], expected, rtol=1e-9, atol=1.0)
    # The dissipated work is the yield stress times the plastic strain.
    slip = 5e-3 - 1e-3 + (5e-3 - 2e-3 - 2e-3)
    assert found.state[-1, 0, 0] == pytest.approx(slip, rel=1e-9)
    assert found.work[-1, 0] == pytest.approx(20e6 * slip, rel=1e-9)


def test_yield_in_shear_is_von_mises() -> None:
    law = PerfectlyPlastic(EL, Constant(20e6))
    found = one(law, [0.0, 0.0, 0.0, np.sqrt(2.0) * 5e-3])
    assert found.stress[0, 3] / np.sqrt(2.0) == pytest.approx(20e6 / np.sqrt(3.0), rel=1e-12)


def test_norton_relaxation() -> None:
    """The error is of first order in the step; extrapolated it is below 1e-4."""
    law = NortonCreep.constant(EL, 1e-9, 1e6, 5.0)
    goals = np.array([10.006182, 5.909888, 3.341641, 1.880185]) * MPA
    exact = norton_relaxation([1.0, 10.0, 100.0, 1000.0], 15e6, E, 1e-9 / MPA**5, 5.0)
    np.testing.assert_allclose(exact, goals, rtol=1e-6)
    results = []
    for per_decade in (80, 160):
        time = np.concatenate([[0.0, 1e-9], np.geomspace(1e-4, 1e3, 7 * per_decade + 1)])
        found = pull(law, time, np.where(time > 0.0, 15e6 / E, 0.0), T)
        at = [2 + k * per_decade for k in (4, 5, 6, 7)]
        results.append(found.axial_stress[at, 0])
    coarse, fine = np.array(results)
    assert (np.abs(fine / goals - 1.0) < 5e-3).all()
    np.testing.assert_allclose((coarse - goals) / (fine - goals), 2.0, rtol=0.05)
    np.testing.assert_allclose(2.0 * fine - coarse, goals, rtol=1e-4)


def test_norton_creep_under_constant_stress() -> None:
    law = NortonCreep.constant(EL, 1e-5, 10e6, 5.0)
    time = np.linspace(0.0, 100.0, 21)
    found = pull(law, time, np.where(time > 0.0, 10e6, 0.0), T, control="stress")
    np.testing.assert_allclose(found.axial_strain[1:, 0], 10e6 / E + 1e-5 * time[1:], rtol=1e-10)
    np.testing.assert_allclose(found.work[:, 0], 10e6 * 1e-5 * time, rtol=1e-9)


def test_norton_is_the_viscous_law_without_hardening() -> None:
    m = 0.2
    viscous = norton_hoff(0.0, m, 0.0, limit=0.0)
    rate_at = (1.0 / (np.sqrt(3.0) * 31.76)) ** (1.0 / m) / np.sqrt(3.0)  # at 1 MPa
    creep = NortonCreep.constant(EL, rate_at, 1e6, 1.0 / m)
    rng = np.random.default_rng(1)
    for _ in range(20):
        strain = list(rng.normal(size=4) * 10.0 ** rng.uniform(-6.0, -1.0))
        a, b = one(viscous, strain, dt=0.3), one(creep, strain, dt=0.3)
        np.testing.assert_allclose(a.stress, b.stress, rtol=1e-10)
        np.testing.assert_allclose(a.tangent, b.tangent, rtol=1e-6, atol=1e-9 * E)


# -- the curve (163) and its yield limit -------------------------------------------------------


def test_norton_hoff_has_its_values() -> None:
    """(162) with K = 40 MPa, m = 0.15."""
    found = modified_norton_hoff(0.37, [1e-4, 1e-3, 1e-2], 40.0, 0.0, 0.15, 0.0)
    np.testing.assert_allclose(found, [18.89752, 26.69345, 37.7055], rtol=3e-7)


def test_yield_limit_has_its_values() -> None:
    """(209) in closed form for p1 = 0; E = 20 GPa, K0 p2 = 31.76 MPa, p3 = 0.13, p4 = 0.2."""
    for rate, strain, stress in ((1e-4, 1.541807e-4, 3.08361e6), (1e-3, 2.241455e-4, 4.48291e6)):
        found = yield_limit(E, rate, 31.76e6, 0.0, 0.13, 0.2)
        assert found[0] == pytest.approx(strain, rel=4e-7)
        assert found[1] == pytest.approx(stress, rel=2e-6)


@pytest.mark.parametrize("rate", [1e-8, 1e-3, 1e2])
def test_yield_limit_is_the_intersection(rate: float) -> None:
    for p1, p4 in product((-9.0, -1.0, 1e-9, 5.0, 300.0, 1e5), (-0.2, 0.0, 0.2, 0.6)):
        strain, stress = yield_limit(E, rate, 31.76e6, p1, 0.13, p4)
        assert stress == pytest.approx(E * strain, rel=1e-12), (p1, p4)
        curve = modified_norton_hoff(strain, rate, 31.76e6, p1, 0.13, p4)
        assert float(curve) == pytest.approx(stress, rel=1e-9), (p1, p4)
        before = np.linspace(0.01, 0.99, 50) * strain
        above = modified_norton_hoff(before, rate, 31.76e6, p1, 0.13, p4) > E * before
        assert above.all(), (p1, p4)


def test_parameters_that_never_yield_are_rejected() -> None:
    with pytest.raises(ValueError, match="below 1"):
        yield_limit(E, 1e-3, 31.76e6, 0.0, 0.13, 1.0)
    with pytest.raises(ValueError, match="never meets"):
        yield_limit(E, 1e-3, 31.76e6, -1e5, 0.13, 0.2)


@pytest.mark.parametrize("rate", [1e-4, 1e-3, 1e-1])
@pytest.mark.parametrize("steps", [7, 100])
def test_elastic_below_the_limit_and_on_the_curve_above(rate: float, steps: int) -> None:
    law = norton_hoff(0.0, 0.13, 0.2)
    strain = np.linspace(0.0, 4e-3, steps + 1)
    found = pull(law, strain / rate, strain, T)
    onset, limit = yield_limit(E, rate, 31.76e6, 0.0, 0.13, 0.2)
    curve = modified_norton_hoff(np.maximum(strain, onset), rate, 31.76e6, 0.0, 0.13, 0.2)
    expected = np.where(strain < onset, E * strain, curve)
    np.testing.assert_allclose(found.axial_stress[:, 0], expected, rtol=1e-10)
    np.testing.assert_array_equal(found.flows[:, 0], expected > limit * (1.0 + 1e-12))
    np.testing.assert_allclose(found.state[1:, 0, 1], rate, rtol=1e-9)  # remembered rate


def test_relaxation_from_the_curve_is_that_of_the_viscous_law() -> None:
    """For p1 = p4 = 0: Norton's closed form, from the stress at the rate of loading."""
    m, rate = 0.2, 1e-3
    law = norton_hoff(0.0, m, 0.0)
    start = float(modified_norton_hoff(1.0, rate, 31.76e6, 0.0, m, 0.0))
    factor = (1.0 / (np.sqrt(3.0) * 31.76e6)) ** (1.0 / m) / np.sqrt(3.0)
    errors = []
    for steps in (400, 800):
        loading = np.linspace(0.0, 2.0, 41)
        holding = 2.0 + np.concatenate([[0.0], np.geomspace(1e-4, 1e3, steps)])
        time = np.concatenate([loading, holding[1:]])
        found = pull(law, time, rate * np.minimum(time, 2.0), T)
        expected = norton_relaxation(holding[1:] - 2.0, start, E, factor, 1.0 / m)
        errors.append(np.abs(found.axial_stress[41:, 0] / expected - 1.0).max())
    assert errors[1] < 4e-3 and errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


def test_creep_from_the_curve_continues_at_its_rate() -> None:
    law, rate = norton_hoff(0.0, 0.13, 0.0), 1e-3
    stress = float(modified_norton_hoff(1.0, rate, 31.76e6, 0.0, 0.13, 0.0))
    time = np.concatenate([np.linspace(0.0, 2.0, 21), np.linspace(2.0, 4.0, 21)[1:]])
    loaded = pull(law, time[:21], rate * time[:21], T)
    assert loaded.axial_stress[-1, 0] == pytest.approx(stress, rel=1e-12)
    held = np.concatenate([loaded.axial_stress[:, 0], np.full(20, stress)])
    found = pull(law, time, held, T, control="stress")
    late = found.axial_strain[21:, 0]
    np.testing.assert_allclose(np.diff(late) / np.diff(time[21:]), rate, rtol=1e-6)


def test_creep_below_the_curve_begins_after_a_delay() -> None:
    """After a sudden small load: elastic until the remembered rate is that of Norton's law.

    The delay is p3 q / (E r), so the creep strain lacks p3 q / E from then on.
    """
    m, stress = 0.13, 8e6
    law = norton_hoff(0.0, m, 0.0)
    rate = (stress / (np.sqrt(3.0) * 31.76e6)) ** (1.0 / m) / np.sqrt(3.0)
    delay = m * stress / (E * rate)
    time = np.concatenate([[0.0], np.geomspace(1e-6 * delay, 10.0 * delay, 1500)])
    found = pull(law, time, np.where(time > 0.0, stress, 0.0), T, control="stress")
    creep = found.axial_strain[:, 0] - stress / E
    assert creep[time < 0.95 * delay].max() < 1e-12
    assert creep[-1] == pytest.approx(rate * 9.0 * delay, rel=5e-3)


def test_imposed_yield_limit_is_kept() -> None:
    """Elastic below the limit; beyond it the limit at low rates, the viscous curve at high ones."""
    law = norton_hoff(0.0, 0.13, 0.0, limit=6e6)
    slow, fast = 1e-10, 1e-1
    for rate, expected in ((slow, 6e6), (fast, None)):
        strain = np.linspace(0.0, 5e-3, 400)
        found = pull(law, strain / rate, strain, T)
        stress, elastic = found.axial_stress[:, 0], E * strain <= 6e6
        np.testing.assert_allclose(stress[elastic], E * strain[elastic], rtol=1e-12)
        assert not found.flows[elastic, 0].any() and found.flows[~elastic, 0].all()
        end = expected or float(modified_norton_hoff(1.0, fast, 31.76e6, 0.0, 0.13, 0.0))
        assert stress[-1] == pytest.approx(end, rel=1e-5)


def test_viscous_law_approaches_the_curve_from_below() -> None:
    """Unlike with the automatic limit: a rounded knee, then a stress p3 H/E below the curve."""
    law = norton_hoff(0.0, 0.13, 0.2, limit=0.0)
    strain = np.linspace(0.0, 0.01, 2001)
    found = pull(law, 1e3 * strain, strain, T).axial_stress[1:, 0]
    curve = modified_norton_hoff(strain[1:], 1e-3, 31.76e6, 0.0, 0.13, 0.2)
    assert (found < curve).all()
    slope = np.gradient(found, strain[1:])
    late = strain[1:] > 2e-3
    expected = curve * (1.0 - slope / E) ** 0.13
    np.testing.assert_allclose(found[late], expected[late], rtol=1e-4)


CRITERION = [
    norton_hoff(0.0, 0.13, 0.0),
    norton_hoff(0.0, 0.13, 0.2),
    PerfectlyPlastic(EL, Constant(4e6)),
]


@pytest.mark.parametrize("law", CRITERION, ids=["hoff", "hoff hardening", "plastic"])
def test_criterion_without_thermal_strain(law: NortonHoff | PerfectlyPlastic) -> None:
    """Thesis 2.5.1: compressed, partly unloaded, loaded again."""
    turns = [0.0, -2e-3, -1.9e-3, -3e-3]
    strain = np.concatenate([np.linspace(a, b, 41)[1:] for a, b in pairwise(turns)])
    time = (
        np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.concatenate([[0.0], strain]))))]) * 1e3
    )
    found = pull(law, time, np.concatenate([[0.0], strain]), T)
    _check_criterion(found.axial_stress[:, 0], found.axial_strain[:, 0], found.flows[:, 0])
    assert found.flows[40, 0] and not found.flows[41:81, 0].any() and found.flows[-1, 0]


@pytest.mark.parametrize("law", CRITERION, ids=["hoff", "hoff hardening", "plastic"])
def test_criterion_with_thermal_strain(law: NortonHoff | PerfectlyPlastic) -> None:
    """Thesis 2.5.2: a bar of fixed length is heated (compressive loading), then cooled."""
    thermal = np.concatenate([np.linspace(0.0, 2e-3, 41), np.linspace(2e-3, 1.9e-3, 21)[1:]])
    time = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(thermal)))]) * 1e3
    found = pull(law, time, np.zeros(61), T, thermal_strain=thermal)
    assert found.axial_stress[40, 0] < -3e6
    _check_criterion(found.axial_stress[:, 0], found.axial_strain[:, 0], found.flows[:, 0])
    assert found.flows[40, 0] and not found.flows[41:, 0].any()


def _check_criterion(stress: np.ndarray, strain: np.ndarray, flows: np.ndarray) -> None:
    """Check that nothing flows in a step with stress . mechanical strain increment < 0 (214)."""
    work = stress[:-1] * np.diff(strain)
    unloading = work < 0.0
    assert unloading.any() and not flows[1:][unloading].any()
    np.testing.assert_allclose(
        np.diff(stress)[unloading], E * np.diff(strain)[unloading], rtol=1e-9
    )


KOZLOWSKI = {  # 0.27 %C, MPa: rows degC, columns rates 1e-4, 1e-3, 1e-2 at strains .002, .01, .05
    900: [18.37, 22.01, 32.86, 25.62, 29.27, 40.11, 36.06, 39.71, 50.55],
    1000: [11.84, 14.19, 22.57, 16.77, 19.13, 27.51, 23.94, 26.30, 34.68],
    1100: [8.05, 9.54, 15.90, 11.59, 13.08, 19.44, 16.78, 18.27, 24.63],
    1200: [5.72, 6.66, 11.42, 8.37, 9.30, 14.07, 12.28, 13.22, 17.98],
    1300: [4.22, 4.80, 8.33, 6.26, 6.84, 10.37, 9.31, 9.89, 13.43],
    1400: [3.20, 3.56, 6.16, 4.82, 5.18, 7.78, 7.27, 7.62, 10.22],
}


@pytest.mark.parametrize("celsius", KOZLOWSKI)
def test_kozlowski_has_its_values(celsius: int) -> None:
    rate, strain = np.meshgrid([1e-4, 1e-3, 1e-2], [0.002, 0.01, 0.05], indexing="ij")
    found = Austenite.at(celsius + ZERO, 0.27).stress(strain, rate).ravel() / MPA
    np.testing.assert_allclose(found, KOZLOWSKI[celsius], atol=0.006)


@pytest.mark.parametrize(
    ("celsius", "expected"),
    [(1400, (0.616, 0.996, 1.611)), (1450, (0.486, 0.801, 1.319)), (1500, (0.385, 0.647, 1.086))],
)
def test_delta_ferrite_has_its_values(celsius: int, expected: tuple[float, ...]) -> None:
    found = DeltaFerrite.at(celsius + ZERO, 0.05).stress(0.05, np.array([1e-4, 1e-3, 1e-2])) / MPA
    np.testing.assert_allclose(found, expected, atol=6e-4)


@pytest.mark.parametrize(("celsius", "carbon"), [(1000, 0.27), (1300, 0.27), (1450, 0.05)])
def test_unified_law_is_on_its_curve(celsius: int, carbon: float) -> None:
    """In every step the stress is the formula at the strain and the rate of that step."""
    law = load_law("kozlowski_zhu", EL, carbon=carbon)
    formula = (Austenite if carbon > 0.1 else DeltaFerrite).at(celsius + ZERO, carbon)
    time = np.linspace(0.0, 60.0, 301)
    found = pull(law, time, 1e-3 * time, celsius + ZERO)
    p = found.state[:, 0, 0]
    rate = np.diff(p) / np.diff(time)
    np.testing.assert_allclose(found.axial_stress[1:, 0], formula.stress(p[1:], rate), rtol=1e-9)
    late = p[1:] > 0.05
    assert rate[late] == pytest.approx(1e-3, rel=0.03)


def test_delta_ferrite_law_holds_above_a_share_of_a_tenth() -> None:
    def share(t: np.ndarray) -> np.ndarray:
        return np.clip((t - 1600.0) / 100.0, 0.0, 1.0)

    law = UnifiedSteel(EL, 0.1, share)
    t = np.array([1600.0, 1609.0, 1611.0, 1700.0])
    np.testing.assert_array_equal(law.delta_weight(t), [0.0, 0.0, 1.0, 1.0])
    soft = replace(law, threshold=0.5, blend=0.4)
    middle = soft.delta_weight(np.array([1629.0, 1650.0, 1671.0]))
    np.testing.assert_allclose(middle, [0.0, 0.5, 1.0], atol=1e-12)
    weights = soft.delta_weight(np.linspace(1600.0, 1700.0, 200))
    assert (np.diff(weights) >= 0.0).all()


def test_mixed_steel_carries_the_weighted_stress() -> None:
    t, carbon = 1700.0, 0.09
    law = UnifiedSteel(EL, carbon, lambda x: np.full_like(x, 0.5), threshold=0.5, blend=0.2)
    time = np.linspace(0.0, 30.0, 151)
    found = pull(law, time, 1e-3 * time, t)
    p = found.state[:, 0, 0]
    rate = np.diff(p) / np.diff(time)
    gamma, delta = Austenite.at(t, carbon), DeltaFerrite.at(t, carbon)
    expected = 0.5 * (gamma.stress(p[1:], rate) + delta.stress(p[1:], rate))
    np.testing.assert_allclose(found.axial_stress[1:, 0], expected, rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.04, 0.3, 0.8, 1.0])
def test_shipped_mixture_weights_the_stresses_by_the_fractions(share: float) -> None:
    """The parameter set that switches gives one of the two stresses at every share."""
    celsius, carbon, rate = 1480.0, 0.12, 1e-3
    gamma, delta = (f.at(celsius + ZERO, carbon) for f in (Austenite, DeltaFerrite))
    time = np.linspace(0.0, 30.0, 151)
    found = {}
    for name in ("kozlowski_zhu_mixed", "kozlowski_zhu"):
        law = load_law(name, EL, carbon=carbon, delta_share=lambda t: np.full_like(t, share))
        pulled = pull(law, time, rate * time, celsius + ZERO)
        p = pulled.state[:, 0, 0]
        parts = [f.stress(p[1:], np.diff(p) / np.diff(time)) for f in (gamma, delta)]
        found[name] = pulled.axial_stress[1:, 0], parts
    stress, (by_gamma, by_delta) = found["kozlowski_zhu_mixed"]
    np.testing.assert_allclose(stress, (1 - share) * by_gamma + share * by_delta, rtol=1e-9)
    stress, parts = found["kozlowski_zhu"]
    np.testing.assert_allclose(stress, parts[share > 0.1], rtol=1e-9)


def test_weights_of_the_mixture_are_the_phase_fractions() -> None:
    steel = load_steel("plain_carbon", composition={"C": 0.12})
    share = DeltaShare(steel.diagram)
    law = load_law("kozlowski_zhu_mixed", EL, carbon=0.12, delta_share=share)
    assert isinstance(law, UnifiedSteel)
    t = np.linspace(1450.0, 1494.0, 45) + ZERO
    np.testing.assert_allclose(law.delta_weight(t), steel.diagram.phases(t).delta, atol=1e-12)
    assert law.delta_weight(t)[-1] > 0.6 > law.delta_weight(t)[25] > 0.1


@pytest.mark.parametrize("kind", ["plastic", "creep", "hoff", "viscous"])
def test_laws_are_independent_of_units(kind: str) -> None:
    mega, minute = 1e6, 60.0

    def law(stress: float, time: float) -> PerfectlyPlastic | NortonCreep | NortonHoff:
        el = Elasticity.constant(E / stress, 0.3)
        if kind == "plastic":
            return PerfectlyPlastic(el, Constant(20e6 / stress))
        if kind == "creep":
            return NortonCreep.constant(el, 1e-3 * time, 20e6 / stress, 5.0)
        strength = 31.76e6 / stress / time**0.13
        limit = None if kind == "hoff" else Constant(0.0)
        return NortonHoff(
            el, Constant(strength), Constant(2.0), Constant(0.13), Constant(0.2), limit
        )

    rng = np.random.default_rng(8)
    strain = rng.normal(size=(40, 4)) * 10.0 ** rng.uniform(-6.0, -1.0, 40)[:, None]
    none, heat = np.zeros(40), np.full(40, 1200.0)
    stress = rng.normal(size=(40, 4)) * 3e6
    a, b = law(1.0, 1.0), law(mega, minute)
    state = np.abs(rng.normal(size=a.initial_state(40).shape)) * 1e-3
    state_in_minutes = state.copy()
    if kind == "hoff":
        state_in_minutes[:, 1] *= minute
    found = a.integrate(MaterialStep(strain, none, heat, heat, 3.0), stress, state)
    step = MaterialStep(strain, none, heat, heat, 3.0 / minute)
    again = b.integrate(step, stress / mega, state_in_minutes)
    np.testing.assert_allclose(again.stress * mega, found.stress, rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(again.tangent * mega, found.tangent, rtol=1e-6, atol=1e-9 * E)
    np.testing.assert_allclose(again.dissipation * mega, found.dissipation, rtol=1e-8, atol=1e-9)
