"""T(H) and theta(H): exact inverses, slopes, jumps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.physics.materials.curve import ThermalCurve


def random_curve(seed: int) -> ThermalCurve:
    rng = np.random.default_rng(seed)
    n, m = rng.integers(3, 9), rng.integers(2, 6)
    t = np.sort(rng.uniform(300, 2000, n))
    tk = np.sort(rng.uniform(250, 2100, m))
    tk[0], tk[-1] = 250.0, 2100.0
    jump = np.where(rng.random(n) < 0.3, rng.uniform(0, 2e9, n), 0.0)
    capacity = (t, *rng.uniform(1e6, 6e6, (2, n - 1)), rng.uniform(0, 5e7, n - 1), jump)
    conductivity = (tk, *rng.uniform(10, 50, (2, m - 1)))
    return ThermalCurve(capacity, conductivity, rng.choice([None, 1500.0]))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_inverse_and_slopes(seed: int) -> None:
    curve = random_curve(seed)
    rng = np.random.default_rng(seed + 1)
    temperature = rng.uniform(200, 2300, 200)
    temperature = temperature[np.abs(temperature[:, None] - curve.knots).min(axis=1) > 0.1]
    enthalpy = curve.enthalpy(temperature)
    point = curve.at(enthalpy)
    assert point.temperature == pytest.approx(temperature, abs=1e-8)
    step = 1e3
    up, down = curve.at(enthalpy + step), curve.at(enthalpy - step)
    assert point.temperature_slope == pytest.approx(
        (up.temperature - down.temperature) / (2 * step), rel=1e-4
    )
    assert point.conduction_slope == pytest.approx(
        (up.conduction - down.conduction) / (2 * step), rel=2e-3
    )
    assert curve.conductivity(temperature) == pytest.approx(
        point.conduction_slope / point.temperature_slope, rel=1e-9
    )


def test_isothermal_jump_is_flat() -> None:
    t = np.array([300.0, 1500.0, 2000.0])
    curve = ThermalCurve(
        (t, np.full(2, 5e6), np.full(2, 5e6), np.zeros(2), np.array([0.0, 2e9, 0.0])),
        (np.array([300.0, 2000.0]), np.array([30.0]), np.array([30.0])),
    )
    solid, molten = curve.enthalpy(1500.0, side="left"), curve.enthalpy(1500.0)
    assert molten - solid == pytest.approx(2e9)
    between = curve.at(np.linspace(solid + 1.0, molten - 1.0, 7))
    assert np.all(between.temperature == 1500.0)
    assert np.all(between.temperature_slope == 0.0)
    assert np.all(between.conduction_slope == 0.0)


def test_datum_is_the_zero() -> None:
    t = np.array([300.0, 2000.0])
    k = np.array([30.0])
    curve = ThermalCurve(
        (t, np.array([4e6]), np.array([6e6]), np.zeros(1), np.zeros(2)), (t, k, k), datum=1234.0
    )
    assert curve.enthalpy(1234.0) == 0.0
    assert curve.at(np.zeros(1)).conduction[0] == 0.0
    assert curve.at(np.zeros(1)).temperature[0] == pytest.approx(1234.0)


def test_negative_capacity_is_refused() -> None:
    t = np.array([300.0, 2000.0])
    k = np.array([30.0])
    with pytest.raises(ValueError, match="positive"):
        ThermalCurve((t, np.array([-1.0]), np.array([1.0]), np.zeros(1), np.zeros(2)), (t, k, k))
