"""Hot tearing criteria as laws of arrays: values by hand, quadrature, independence of steps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from castfem.base.types import Array
from castfem.physics.materials import hot_tearing as laws
from castfem.physics.materials.ductility import Ductility, fracture_strain
from castfem.physics.materials.hot_tearing import MushyHistory

LIQUIDUS, WIDTH = 1780.0, 50.0  # K
ROOTS = LIQUIDUS - 0.99 * WIDTH


def linear(temperature: Array) -> Array:
    """Return a solid fraction linear from liquidus to solidus."""
    return np.clip((LIQUIDUS - temperature) / WIDTH, 0.0, 1.0)


def curved(temperature: Array) -> Array:
    """Return a solid fraction that increases fast at first and slowly at the end, as in steel."""
    return np.asarray(np.clip((LIQUIDUS - temperature) / WIDTH, 0.0, 1.0) ** 0.4)


def test_critical_strain_has_the_values_by_hand() -> None:
    """For a range of 20 K: 3.79, 1.84 and 0.90 % at 1e-4, 1e-3 and 1e-2 1/s."""
    found = laws.won_critical_strain(np.array([1e-4, 1e-3, 1e-2]), 20.0)
    assert found == pytest.approx([0.0379, 0.01844, 0.00897], rel=2e-3)
    wider = laws.won_critical_strain(np.array([1e-3]), 40.0)
    assert wider / found[1] == pytest.approx(2.0**-0.8638, rel=1e-12)


def test_damage_is_strain_over_critical_strain() -> None:
    strain, time = np.array([0.002, 0.0, 0.0, 1e-15]), np.array([4.0, 4.0, 0.0, 4.0])
    critical = 0.02821 / (5e-4**0.3131 * 20.0**0.8638)
    found = laws.won_damage(strain, time, 20.0)
    assert found[0] == pytest.approx(0.002 / critical, rel=1e-12) and not found[1:].any()


def test_arm_spacings_have_the_values_of_the_formula() -> None:
    """At 1 K/s 97.01 um for 0.1 % C and 143.9 * 0.4^(0.5501 - 0.7984) um for 0.4 % C."""
    spacing = laws.secondary_arm_spacing
    assert spacing(np.array([1.0]), 0.1) == pytest.approx([97.01e-6], rel=1e-12)
    assert spacing(np.array([1.0]), 0.4) == pytest.approx([143.9e-6 * 0.4**-0.2483], rel=1e-12)
    rates = spacing(np.array([1.0, 10.0]), 0.4)
    assert rates[1] / rates[0] == pytest.approx(10.0**-0.3616, rel=1e-12)


def test_integrals_of_a_linear_fraction_are_exact() -> None:
    """Int f^2/(1-f)^2 df = f + 2 ln(1-f) + f/(1-f) to 0.99; the other by a quadrature over f."""
    end = 0.99
    shrunk = WIDTH * (end + 2.0 * np.log(1.0 - end) + end / (1.0 - end))
    strained, _ = quad(lambda f: 0.5 * (end**2 - f**2) * f**2 / (1.0 - f) ** 3, 0.0, end)
    found = laws.feeding_integrals(linear, LIQUIDUS, ROOTS)
    assert found == pytest.approx((WIDTH**2 * strained, shrunk), rel=1e-9)


def test_pressure_drop_is_the_integral_of_darcys_law() -> None:
    """The flow that feeds shrinkage and strain up to the dendrite roots, over the permeability.

    The reference is a nested adaptive quadrature along x from the roots.
    """
    viscosity, beta, spacing = 5.5e-3, 0.04, 110e-6
    rate, gradient, cooling = 2e-3, 6e3, 5.0
    speed = cooling / gradient
    roots = LIQUIDUS - 0.99**2.5 * WIDTH
    length = (LIQUIDUS - roots) / gradient

    def fraction(x: float) -> float:
        return float(curved(np.array(roots + gradient * x)))

    def drop(x: float) -> float:
        fs = fraction(x)
        permeability = spacing**2 * (1.0 - fs) ** 3 / (180.0 * fs**2) if fs > 0.0 else np.inf
        strained = quad(fraction, 0.0, x, epsrel=1e-10)[0] * rate
        flow = (1.0 + beta) * strained + speed * beta * (1.0 - fs)
        return viscosity / permeability * flow

    expected = quad(drop, 0.0, length, limit=400, epsrel=1e-9)[0]
    integrals = laws.feeding_integrals(curved, LIQUIDUS, roots)
    feeding = laws.Feeding(viscosity, beta, integrals, lambda one: np.full_like(one, spacing))
    arrays = (np.array([value, value, value]) for value in (rate, gradient, cooling))
    found = feeding.pressure_drop(*arrays)
    assert expected > 500.0
    assert found == pytest.approx([expected] * 3, rel=1e-7)
    still = feeding.pressure_drop(np.array([rate]), np.array([gradient]), np.array([0.0]))
    assert still == pytest.approx([0.0])


def cooled(ends: Array, rates: tuple[float, float] = (1.5e-3, -4e-4)) -> MushyHistory:
    """Cool a strip at 4 K/s from 1700 K while it is strained at constant rates, in steps."""
    levels = (1650.0, 1610.0, 1595.0)
    history = MushyHistory.begun(np.full(2, 1700.0), levels[0])
    times = np.concatenate([[0.0], ends])
    for start, end in pairwise(times):
        before, after = (np.array([1700.0, 1720.0]) - 4.0 * t for t in (start, end))
        strain = [np.full(2, rate * (end - start)) for rate in rates]
        history, _ = history.advanced(before, after, levels, end - start, *strain, np.full(2, 5e3))
    return history


def test_history_at_constant_rates_is_exact() -> None:
    """15 K at 4 K/s take 3.75 s, 40 K take 10 s; at 1.5e-3 1/s the strain is 0.5625 %."""
    found = cooled(np.linspace(0.0, 50.0, 38)[1:])
    assert found.vulnerable == pytest.approx([3.75, 3.75], rel=1e-12)
    assert found.relief == pytest.approx([10.0, 10.0], rel=1e-12)
    assert found.around == pytest.approx([0.005625, 0.005625], rel=1e-12)
    assert found.axial == pytest.approx([0.0, 0.0])  # compression does not count
    assert found.gradient() == pytest.approx([5e3, 5e3], rel=1e-12)
    assert laws.clyne_davies(found.vulnerable, found.relief) == pytest.approx([0.375, 0.375])
    critical = 0.02821 / (1.5e-3**0.3131 * 15.0**0.8638)
    damage = laws.won_damage(found.strain, found.vulnerable, 15.0)
    assert damage == pytest.approx([0.005625 / critical] * 2, rel=1e-12)


@pytest.mark.parametrize("steps", [1, 2, 7, 400])
def test_history_is_independent_of_the_steps(steps: int) -> None:
    single, found = cooled(np.array([50.0])), cooled(np.linspace(0.0, 50.0, steps + 1)[1:])
    uneven = cooled(50.0 * np.linspace(0.0, 1.0, steps + 1)[1:] ** 2)
    for name in MushyHistory.names():
        assert getattr(found, name) == pytest.approx(getattr(single, name), rel=1e-9), name
        assert getattr(uneven, name) == pytest.approx(getattr(single, name), rel=1e-9), name


def test_remelting_resets_the_history() -> None:
    levels, one = (1650.0, 1610.0, 1595.0), np.ones(1)
    history, _ = MushyHistory.begun(1660.0 * one, 1650.0).advanced(
        1660.0 * one, 1600.0 * one, levels, 6.0, 0.006
    )
    assert history.vulnerable == pytest.approx([1.0]) and history.around == pytest.approx([0.001])
    constant, inside = history.advanced(1600.0 * one, 1600.0 * one, levels, 2.0, -0.01)
    assert constant.vulnerable == pytest.approx([3.0]) and constant.around == pytest.approx([0.0])
    assert inside == pytest.approx([1.0])
    melted, _ = history.advanced(1600.0 * one, 1640.0 * one, levels, 4.0, 0.004)
    assert melted.vulnerable == pytest.approx([0.0]) and melted.around == pytest.approx([0.0])
    assert melted.relief == pytest.approx([4.0 + 3.0])
    liquid, _ = history.advanced(1600.0 * one, 1700.0 * one, levels, 4.0)
    assert liquid.relief == pytest.approx([0.0])


def test_partly_frozen_start_has_no_ratio() -> None:
    """Its time of feeding is unknown; its strain counts from the start."""
    levels, start = (1650.0, 1610.0, 1595.0), np.array([1640.0, 1651.0])
    history = MushyHistory.begun(start, levels[0])
    history, _ = history.advanced(start, np.full(2, 1590.0), levels, 5.0, 0.005)
    ratio = laws.clyne_davies(history.vulnerable, history.relief)
    assert ratio == pytest.approx([0.0, 15.0 / 40.0])
    assert history.around == pytest.approx([0.005 * 0.3, 0.005 * 15.0 / 61.0])
    assert history.vulnerable == pytest.approx([1.5, 5.0 * 15.0 / 61.0])


def test_ductility_is_linear_in_temperature_and_log_of_rate() -> None:
    table = Ductility((1000.0, 1100.0), (1e-4, 1e-2), ((0.1, 0.3), (0.5, 0.7)))
    at = np.array([1000.0, 1050.0, 1100.0, 1050.0, 1050.0, 1050.0])
    rates = np.array([1e-4, 1e-3, 1e-2, 1.0, 1e-9, 0.0])
    expected = [0.1, 0.4, 0.7, 0.5, 0.3, 0.3]  # beyond the rates that of the nearest
    assert table.critical_strain(at, rates) == pytest.approx(expected, rel=1e-12)
    single = Ductility((1000.0, 1100.0), (1e-3,), ((0.1,), (0.5,)))
    assert single.critical_strain(np.array([1025.0]), np.array([7.0])) == pytest.approx([0.2])
    assert fracture_strain(np.array([0.5])) == pytest.approx([np.log(2.0)], rel=1e-12)
