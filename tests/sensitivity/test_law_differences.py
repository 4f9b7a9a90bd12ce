"""What derivatives leave out of the evaluation of laws: differences laid once, laws that stay."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Cooling, Patch
from castfem.physics.thermal.flux_laws import Contact, Convection, SurfaceLaw
from castfem.studies.sensitivity.perturbed_simulation import CurveDifference, same_laws
from castfem.studies.sensitivity.perturbed_slices import DIFFERENCES, slope, slope_by_temperature


def _curve(solidus: float, slope: float = 0.0, jump: float = 0.0) -> ThermalCurve:
    """A steel that freezes from 1780 K on, and isothermally there by `jump` (J/m3)."""
    knots = np.array([300.0, solidus, 1780.0, 1900.0])
    capacity, latent = np.array([4e6, 5e6, 6e6]), np.array([0.0, 3e7, 0.0])
    jumps, k = np.array([0.0, 0.0, jump, 0.0]), np.array([30.0, 32.0, 35.0])
    tables = (knots, capacity, (1.0 + slope) * capacity, latent, jumps)
    return ThermalCurve(tables, (knots, k, (1.0 + slope) * k), 1850.0)


@pytest.mark.parametrize("slope", [0.0, 0.1])
@pytest.mark.parametrize("jump", [0.0, 2e9])
def test_a_difference_of_curves_is_that_of_their_values(slope: float, jump: float) -> None:
    above, below = _curve(1740.01, slope, jump), _curve(1739.99, slope, jump * 1.00001)
    ends = above.enthalpy(250.0), above.enthalpy(2000.0)
    met = [curve.enthalpy(curve.knots, side) for curve in (above, below) for side in ("left",)]
    enthalpy = np.concatenate([np.linspace(*ends, 501), *met])
    difference = CurveDifference(above, below)
    one, other = above.at(enthalpy), below.at(enthalpy)
    assert np.abs(one.temperature - other.temperature).max() > 1e-3
    for found, first, second, size in (
        (difference.temperature, one.temperature, other.temperature, 2000.0),
        (difference.conduction, one.conduction, other.conduction, 5e4),
    ):
        assert found(enthalpy) == pytest.approx(first - second, rel=0.0, abs=1e-14 * size)


def _cooling(law: SurfaceLaw, dofs: int = 4) -> Cooling:
    return Cooling([(Patch(np.arange(dofs), np.ones(dofs)), law)], [])


def test_laws_that_stay_are_told_from_those_that_change() -> None:
    beside = (Convection(100.0, 400.0),)
    one = Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=beside)
    same = Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=(Convection(100.0, 400.0),))
    assert same_laws(_cooling(one), _cooling(same))
    others = [
        Contact(1601.0, 430.0, 0.15, gap=np.zeros(4), beside=beside),
        Contact(1600.0, 430.0, 0.15, gap=np.full(4, 1e-4), beside=beside),
        Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=(Convection(101.0, 400.0),)),
        Contact(1600.0, 430.0, 0.15, gap=np.zeros(4)),
        Contact(1600.0, lambda time: 430.0, 0.15, gap=np.zeros(4), beside=beside),
        Convection(1600.0, 430.0),
    ]
    assert not any(same_laws(_cooling(one), _cooling(other)) for other in others)
    assert not same_laws(_cooling(one), _cooling(same, 5))
    assert not same_laws(_cooling(one), Cooling([], []))


def test_a_slope_beside_a_jump_or_a_kink_is_that_of_the_side_that_changes_less() -> None:
    def jumps(t: Array) -> Array:
        return np.where(t > 1000.0, 1e9, 0.0) + 3.0 * t

    def bends(t: Array) -> Array:
        return np.where(t > 1000.0, 5.0, 2.0) * (t - 1000.0)

    at = np.array([900.0, 1000.0, 1000.0 + 0.5 * DIFFERENCES.warmer])
    assert slope_by_temperature(jumps, at, jumps(at)) == pytest.approx([3.0, 3.0, 3.0], rel=1e-3)
    assert slope_by_temperature(bends, at, bends(at))[:2] == pytest.approx([2.0, 2.0])
    smooth = slope(np.array([1.0201]), np.array([1.0]), np.array([0.9801]), 0.01)
    assert smooth == pytest.approx([2.0])  # it bends, and has no kink there


def test_what_bends_within_a_kelvin_has_its_slope_where_it_begins_to() -> None:
    """As the weight of delta ferrite does, whose blend is narrow: that is no kink."""

    def blended(t: Array) -> Array:
        x = np.clip((t - 1700.0) / 3.0, 0.0, 1.0)
        return x * x * (3.0 - 2.0 * x)

    for x in (0.01, 0.1, 0.5, 0.99):
        at = np.array([1700.0 + 3.0 * x])
        (found,) = slope_by_temperature(blended, at, blended(at))
        assert found == pytest.approx(2.0 * x * (1.0 - x), rel=1e-5), x
