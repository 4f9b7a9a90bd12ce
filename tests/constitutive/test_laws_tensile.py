"""Tensile tests of thesis III.2.6, the integration of a bar, and its analytical stress.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.thesis_tensile import (
    P3,
    P4,
    RATE,
    SOFT,
    TESTS,
    YOUNG,
    TensileTest,
    plot_tensile_tests,
)
from castfem.base.errors import RunFailure
from castfem.base.tables import Constant
from castfem.physics.constitutive import (
    Elasticity,
    NortonCreep,
    NortonHoff,
    PerfectlyPlastic,
    ThermoElastic,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.base import equivalent_strain, equivalent_stress
from castfem.physics.constitutive.flow_curves import modified_norton_hoff, yield_limit
from castfem.physics.constitutive.uniaxial import axial_stress, pull

BY_FIGURE = {test.figure: test for test in TESTS}


@pytest.mark.parametrize("steps", [20, 200])
@pytest.mark.parametrize("figure", [58, 60])
def test_constant_rate_is_the_curve(figure: int, steps: int) -> None:
    """Figs 58 and 60: the stress is on the curve at every step, also for coarse steps."""
    test = BY_FIGURE[figure]
    found = test.run(steps)
    expected = test.curve(found.axial_strain[:, 0], RATE)
    np.testing.assert_allclose(found.axial_stress[:, 0], expected, rtol=1e-9)


def test_peak_stress_is_at_p4_over_p1() -> None:
    found = BY_FIGURE[60].run(600)
    top = found.axial_strain[np.argmax(found.axial_stress[:, 0]), 0]
    assert top == pytest.approx(P4 / SOFT, abs=2e-5)
    assert found.axial_stress[-1, 0] < 0.85 * found.axial_stress.max()


def test_change_of_rate_goes_from_curve_to_curve() -> None:
    """Fig. 59: each segment ends on the curve of its rate; the slope is at most elastic."""
    test, steps = BY_FIGURE[59], 200
    found = test.run(steps)
    strain, stress = found.axial_strain[:, 0], found.axial_stress[:, 0]
    for k, (rate, _) in enumerate(test.segments, start=1):
        assert stress[k * steps] == pytest.approx(
            float(test.curve(strain[k * steps], rate)), rel=1e-9
        )
    slope = np.diff(stress) / np.diff(strain)
    assert slope.max() <= YOUNG * (1.0 + 1e-9)
    after = strain > test.segments[0][1] + 15.0 * P3 * stress.max() / YOUNG
    fast = after & (strain < test.segments[1][1] + 1e-12)
    np.testing.assert_allclose(stress[fast], test.curve(strain[fast], 10.0 * RATE), rtol=2e-3)


@pytest.mark.parametrize("figure", [61, 62])
def test_unloading_is_elastic_and_returns_to_the_curve(figure: int) -> None:
    """Figs 61 and 62: unloading and reloading on the elastic line, then on the curve."""
    test, steps = BY_FIGURE[figure], 100
    found = test.run(steps)
    strain, stress = found.axial_strain[:, 0], found.axial_stress[:, 0]
    turn, back = steps, 2 * steps
    np.testing.assert_allclose(
        stress[1 : turn + 1], test.curve(strain[1 : turn + 1], RATE), rtol=1e-9
    )
    line = stress[turn] + YOUNG * (strain - strain[turn])
    np.testing.assert_allclose(stress[turn : back + 1], line[turn : back + 1], rtol=1e-9)
    assert not found.flows[turn + 1 : back + 1].any()
    expected = np.where(strain < strain[turn], line, test.curve(strain, RATE))
    np.testing.assert_allclose(stress[back:], expected[back:], rtol=1e-9)


def test_large_step_ends_on_the_curve() -> None:
    """A single step of a hundred times the yield strain ends on the curve."""
    found = TensileTest(58, "", 0.0, ((RATE, 0.02),)).run(1)
    assert found.axial_stress[-1, 0] == pytest.approx(
        float(BY_FIGURE[58].curve(0.02, RATE)), rel=1e-9
    )


def test_picture_is_written(tmp_path: Path) -> None:
    path = plot_tensile_tests(tmp_path / "tensile.png", steps=20)
    assert path.stat().st_size > 20_000


def test_sides_are_stress_free_and_flow_is_isochoric() -> None:
    law = load_law("norton_hoff_kozlowski", load_elasticity())
    time = np.linspace(0.0, 100.0, 41)
    heat = np.array([1123.15, 1273.15, 1473.15, 1673.15])
    found = pull(law, time, np.outer(1e-3 * time, [1.0, 1.0, -1.0, 2.0]), np.tile(heat, (41, 1)))
    stress = found.stress
    assert np.abs(stress[:, :, [0, 1, 3]]).max() < 1e-9 * np.abs(stress).max()
    bulk = law.elasticity.moduli(heat)[1]
    volume = found.strain[:, :, :3].sum(axis=2)
    np.testing.assert_allclose(volume, stress[:, :, 2] / 3.0 / bulk, rtol=1e-6, atol=1e-12)
    q = equivalent_stress(stress)
    np.testing.assert_allclose(q, np.abs(stress[:, :, 2]), rtol=1e-9, atol=1e-2)
    late = equivalent_strain(found.strain)[-1]
    np.testing.assert_allclose(late, [0.1, 0.1, 0.1, 0.2], rtol=2e-3)  # less the elastic volume


@pytest.mark.parametrize(
    ("elasticity", "close"), [(Elasticity.constant(20e9, 0.3), 1e-9), (load_elasticity(), 2e-3)]
)
def test_cooling_bar_follows_the_current_curve(elasticity: Elasticity, close: float) -> None:
    """At constant rate and falling temperature the stress is on the current flow curve.

    Exact for constant moduli. Steel stiffens faster than it hardens: the growing modulus raises the
    stress of the existing elastic strain, and some strain is needed to relax it.
    """
    law = load_law("norton_hoff_kozlowski", elasticity)
    assert isinstance(law, NortonHoff)
    time = np.linspace(0.0, 50.0, 201)
    heat = np.linspace(1573.15, 1223.15, 201)
    found = pull(law, time, 1e-3 * time, heat)
    t = heat[20:]
    expected = modified_norton_hoff(
        1e-3 * time[20:], 1e-3, law.strength(t), 0.0, law.p3(t), law.p4(t)
    )
    np.testing.assert_allclose(found.axial_stress[20:, 0], expected, rtol=close)


def test_creep_rates_under_stress_control() -> None:
    law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-4, 10e6, 4.0)
    stress = np.outer(np.concatenate([[0.0], np.full(20, 1e6)]), [5.0, 10.0, 20.0])
    found = pull(law, np.linspace(0.0, 20.0, 21), stress, 1273.15, control="stress")
    rates = np.diff(found.axial_strain[1:], axis=0)
    expected = np.tile([1e-4 * 0.5**4, 1e-4, 1e-4 * 2**4], (19, 1))
    np.testing.assert_allclose(rates, expected, rtol=1e-8)


def test_failed_pull_is_reported() -> None:
    law = ThermoElastic(Elasticity.constant(1e9, 0.3))
    with pytest.raises(RunFailure, match="at 1 s"):
        pull(law, [0.0, 1.0], [0.0, 1e-3], 300.0, tolerance=0.0)
    with pytest.raises(ValueError, match="3 times, but 2 values"):
        pull(law, [0.0, 1.0, 2.0], [0.0, 1e-3], 300.0)


E, T = 20e9, 1373.15
EL = Elasticity.constant(E, 0.3)


def hoff(p1: float, p4: float) -> NortonHoff:
    return NortonHoff(EL, Constant(31.76e6), Constant(p1), Constant(0.13), Constant(p4))


def strain_history(*segments: tuple[float, float], steps: int = 100) -> tuple[np.ndarray, ...]:
    """Return times, strains and rates of segments (rate, duration)."""
    rate = np.repeat([r for r, _ in segments], steps)
    dt = np.repeat([d / steps for _, d in segments], steps)
    time, strain = (np.concatenate([[0.0], np.cumsum(v)]) for v in (dt, rate * dt))
    return time, strain, np.concatenate([[0.0], rate])


def analytical_stress(
    law: NortonHoff | PerfectlyPlastic, strain: np.ndarray, rate: np.ndarray
) -> np.ndarray:
    curve = law.flow_curve(T)
    assert curve is not None
    return axial_stress(strain, rate, E, curve)


def test_perfect_plasticity_by_hand() -> None:
    """Pulled to 0.3 %, compressed by 0.5 %, pulled by 0.15 %; yield at 0.1 %."""
    _, strain, rate = strain_history((1e-3, 3.0), (-1e-3, 5.0), (1e-3, 1.5), steps=50)
    found = analytical_stress(PerfectlyPlastic(EL, Constant(20e6)), strain, rate) / 1e6
    corners = {0: 0.0, 25: 20.0, 50: 20.0, 60: 0.0, 70: -20.0, 100: -20.0, 150: 10.0}
    assert found[list(corners)] == pytest.approx(list(corners.values()), abs=1e-9)


def test_onset_is_the_yield_limit() -> None:
    """The stress leaves the elastic line at the yield limit of (207)-(212)."""
    for p1, p4 in ((0.0, 0.2), (50.0, 0.2), (-8.0, 0.05), (0.0, 0.0)):
        strain = np.linspace(0.0, 4e-3, 80001)
        found = analytical_stress(hoff(p1, p4), strain, np.full(80001, 1e-3))
        onset, stress = yield_limit(E, 1e-3, 31.76e6, p1, 0.13, p4)
        first = strain[np.argmax(found < E * strain * (1 - 1e-12))]
        assert first == pytest.approx(onset, abs=6e-8)
        assert found[np.searchsorted(strain, onset)] == pytest.approx(stress, rel=1e-3)
        late = strain > 2 * onset
        expected = modified_norton_hoff(strain[late], 1e-3, 31.76e6, p1, 0.13, p4)
        np.testing.assert_allclose(found[late], expected, rtol=1e-13)


@pytest.mark.parametrize(
    "law",
    [hoff(0.0, 0.2), hoff(50.0, 0.2), hoff(0.0, 0.0), PerfectlyPlastic(EL, Constant(6e6))],
    ids=["hardening", "softening", "viscous", "plastic"],
)
def test_laws_match_the_analytical_stress_in_reversals(law: NortonHoff | PerfectlyPlastic) -> None:
    """Pulled, compressed to flow, partly unloaded, compressed again, pulled to flow.

    Not exact to rounding: the stress changes its direction within a step through zero.
    """
    segments = ((1e-3, 4.0), (-1e-3, 6.0), (1e-3, 0.2), (-1e-3, 1.0), (1e-3, 5.0))
    time, strain, rate = strain_history(*segments)
    found = pull(law, time, strain, T)
    np.testing.assert_allclose(
        found.axial_stress[:, 0], analytical_stress(law, strain, rate), rtol=2e-4, atol=10.0
    )
    assert found.axial_stress.min() < -4e6


def test_no_analytical_stress_at_zero_rate() -> None:
    _, strain, rate = strain_history((1e-3, 2.0), (0.0, 1.0), (1e-3, 1.0), steps=10)
    found = analytical_stress(hoff(0.0, 0.2), strain, rate)
    assert np.isfinite(found[:11]).all() and np.isnan(found[11:]).all()


def test_laws_without_a_closed_form_have_none() -> None:
    assert NortonCreep.constant(EL, 1e-3, 20e6, 5.0).flow_curve(T) is None
    viscous = NortonHoff(
        EL, Constant(3e7), Constant(0.0), Constant(0.1), Constant(0.1), Constant(0.0)
    )
    assert viscous.flow_curve(T) is None
    curve = ThermoElastic(EL).flow_curve(T)
    assert curve is not None and np.isinf(curve(np.ones(1), 1.0)).all()
