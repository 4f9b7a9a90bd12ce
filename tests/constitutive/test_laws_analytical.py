"""The analytical answer of a bar: by hand where it is simple, and against the laws where not.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.physics.constitutive import (
    Elasticity,
    NortonCreep,
    NortonHoff,
    PerfectlyPlastic,
    ThermoElastic,
)
from castfem.physics.constitutive.curves import modified_norton_hoff, yield_limit
from castfem.physics.constitutive.uniaxial import axial_stress, pull

E, T = 20e9, 1373.15
EL = Elasticity.constant(E, 0.3)


def hoff(p1: float, p4: float) -> NortonHoff:
    return NortonHoff(EL, Constant(31.76e6), Constant(p1), Constant(0.13), Constant(p4))


def strain_history(*segments: tuple[float, float], steps: int = 100) -> tuple[np.ndarray, ...]:
    """Times, strains and rates of segments (rate, duration)."""
    rate = np.repeat([r for r, _ in segments], steps)
    dt = np.repeat([d / steps for _, d in segments], steps)
    time, strain = (np.concatenate([[0.0], np.cumsum(v)]) for v in (dt, rate * dt))
    return time, strain, np.concatenate([[0.0], rate])


def answer(law: NortonHoff | PerfectlyPlastic, strain: np.ndarray, rate: np.ndarray) -> np.ndarray:
    curve = law.flow_curve(T)
    assert curve is not None
    return axial_stress(strain, rate, E, curve)


def test_perfect_plasticity_by_hand() -> None:
    """Pulled to 0.3 %, pressed by 0.5 %, pulled by 0.15 %; yield at 0.1 %."""
    _, strain, rate = strain_history((1e-3, 3.0), (-1e-3, 5.0), (1e-3, 1.5), steps=50)
    found = answer(PerfectlyPlastic(EL, Constant(20e6)), strain, rate) / 1e6
    corners = {0: 0.0, 25: 20.0, 50: 20.0, 60: 0.0, 70: -20.0, 100: -20.0, 150: 10.0}
    assert found[list(corners)] == pytest.approx(list(corners.values()), abs=1e-9)


def test_onset_is_the_yield_limit() -> None:
    """The first point off the elastic line is where (207)-(212) puts the yield limit."""
    for p1, p4 in ((0.0, 0.2), (50.0, 0.2), (-8.0, 0.05), (0.0, 0.0)):
        strain = np.linspace(0.0, 4e-3, 80001)
        found = answer(hoff(p1, p4), strain, np.full(80001, 1e-3))
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
def test_the_laws_follow_it_through_reversals(law: NortonHoff | PerfectlyPlastic) -> None:
    """Pulled, pressed until it flows again, let go in part, pressed on, pulled until it flows.

    Not to rounding: a step in which the stress goes through zero is of two directions.
    """
    segments = ((1e-3, 4.0), (-1e-3, 6.0), (1e-3, 0.2), (-1e-3, 1.0), (1e-3, 5.0))
    time, strain, rate = strain_history(*segments)
    found = pull(law, time, strain, T)
    np.testing.assert_allclose(
        found.axial_stress[:, 0], answer(law, strain, rate), rtol=2e-4, atol=10.0
    )
    assert found.axial_stress.min() < -4e6


def test_no_answer_for_a_bar_that_is_held() -> None:
    _, strain, rate = strain_history((1e-3, 2.0), (0.0, 1.0), (1e-3, 1.0), steps=10)
    found = answer(hoff(0.0, 0.2), strain, rate)
    assert np.isfinite(found[:11]).all() and np.isnan(found[11:]).all()


def test_laws_without_a_closed_form_have_none() -> None:
    assert NortonCreep.constant(EL, 1e-3, 20e6, 5.0).flow_curve(T) is None
    viscous = NortonHoff(
        EL, Constant(3e7), Constant(0.0), Constant(0.1), Constant(0.1), Constant(0.0)
    )
    assert viscous.flow_curve(T) is None
    curve = ThermoElastic(EL).flow_curve(T)
    assert curve is not None and np.isinf(curve(np.ones(1), 1.0)).all()
