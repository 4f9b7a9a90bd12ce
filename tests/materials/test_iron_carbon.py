"""Iron-carbon equilibrium: the three steels of the thesis, and properties of every steel."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from castfem.physics.materials.alloying import (
    alloyed,
    regression_liquidus,
    regression_solidus,
)
from castfem.physics.materials.iron_carbon import IronCarbon

ZERO = 273.15
PERITECTIC = 1768.15
carbons = st.one_of(
    st.floats(0.0, 2.11),
    st.floats(0.0, 0.6),
    st.sampled_from([0.0, 0.05, 0.10, 0.18, 0.51, 2.11, 1e-6, 0.1000001, 0.5099999]),
)
temperatures = st.one_of(
    st.floats(900.0, 1900.0),
    st.sampled_from([PERITECTIC, 1811.15, 1667.15, 1421.15, 1767.75, 1810.95, 1667.55, 1408.9]),
)
sides = st.sampled_from(["above", "below"])
alloys = st.fixed_dictionaries(
    {},
    optional={
        "Mn": st.floats(0.0, 2.0), "Si": st.floats(0.0, 0.6), "P": st.floats(0.0, 0.04),
        "Cr": st.floats(0.0, 2.0),
    },
)  # fmt: skip
steels = st.one_of(
    st.builds(IronCarbon, carbons),
    st.builds(
        lambda carbon, others, diagram: alloyed({"C": carbon, **others}, diagram),
        carbons, alloys, st.sampled_from(["assessed", "pascon"]),
    ),
)  # fmt: skip


def fractions(steel: IronCarbon, celsius: float, side: str = "above") -> tuple[float, ...]:
    p = steel.phases(celsius + ZERO, side)
    return float(p.liquid), float(p.delta), float(p.gamma)


@pytest.mark.parametrize(
    ("carbon", "liquidus", "solidus"),
    [
        (0.05, 1538 - 43 * 0.05 / 0.51, 1516.5),
        (0.15, 1538 - 43 * 0.15 / 0.51, 1495.0),
        (0.42, 1538 - 43 * 0.42 / 0.51, 1495 - 347 * 0.24 / 1.93),
    ],
)
def test_limits_are_those_of_the_thesis(carbon, liquidus, solidus):
    steel = IronCarbon(carbon)
    assert steel.liquidus - ZERO == pytest.approx(liquidus, abs=1e-9)
    assert steel.solidus - ZERO == pytest.approx(solidus, abs=1e-9)


def test_limits_of_delta_to_gamma_are_exact():
    low, middle, high = IronCarbon(0.05), IronCarbon(0.15), IronCarbon(0.42)
    assert low.gamma_start - ZERO == pytest.approx(1444.5, abs=1e-9)
    assert low.gamma_end - ZERO == pytest.approx(1394 + 101 * 0.05 / 0.18, abs=1e-9)
    assert middle.gamma_start == PERITECTIC
    assert middle.gamma_end - ZERO == pytest.approx(1394 + 101 * 0.15 / 0.18, abs=1e-9)
    assert (high.gamma_start, high.gamma_end) == (PERITECTIC, PERITECTIC)
    assert IronCarbon(0.6).gamma_start is None and IronCarbon(0.6).gamma_end is None


def test_phases_of_low_carbon_steel_at_1520():
    p = IronCarbon(0.05).phases(1520 + ZERO)
    assert float(p.carbon_liquid) == pytest.approx(18 / 43 * 0.51, rel=1e-12)
    assert float(p.carbon_delta) == pytest.approx(18 / 43 * 0.10, rel=1e-12)
    assert np.isnan(p.carbon_gamma)
    assert float(p.liquid) == pytest.approx((0.05 - 1.8 / 43) / (0.41 * 18 / 43), rel=1e-12)
    assert (float(p.liquid), float(p.delta)) == pytest.approx((0.0474, 0.9526), abs=5e-5)


def test_phases_of_low_carbon_steel_at_1430():
    p = IronCarbon(0.05).phases(1430 + ZERO)
    share = 36 / 101
    expected = (0.05 - 0.10 * share) / (0.08 * share)
    assert (float(p.liquid), float(p.gamma)) == pytest.approx((0.0, expected), rel=1e-12)
    assert float(p.carbon_gamma) == pytest.approx(0.18 * share, rel=1e-12)


def test_peritectic_reaction_of_015():
    steel = IronCarbon(0.15)
    assert fractions(steel, 1495.0) == pytest.approx((5 / 41, 36 / 41, 0.0), abs=1e-12)
    assert fractions(steel, 1495.0, "below") == pytest.approx((0.0, 0.375, 0.625), abs=1e-12)


def test_peritectic_reaction_of_042():
    """The thesis prints 0.723; its balance gives 24/33 = 0.727."""
    steel = IronCarbon(0.42)
    assert fractions(steel, 1495.0) == pytest.approx((32 / 41, 9 / 41, 0.0), abs=1e-12)
    assert fractions(steel, 1495.0, "below") == pytest.approx((24 / 33, 0.0, 9 / 33), abs=1e-12)


def test_high_carbon_steel_has_no_ferrite():
    steel = IronCarbon(1.0)
    p = steel.phases(np.linspace(1300, 1600, 301) + ZERO)
    assert np.all(p.delta == 0.0)
    assert steel.reactions == ()


def test_pure_iron_transforms_at_single_temperatures():
    iron = IronCarbon(0.0)
    assert iron.reactions == (1667.15, 1811.15)
    assert fractions(iron, 1538.0) == (1.0, 0.0, 0.0)
    assert fractions(iron, 1538.0, "below") == (0.0, 1.0, 0.0)
    assert fractions(iron, 1394.0) == (0.0, 1.0, 0.0)
    assert fractions(iron, 1394.0, "below") == (0.0, 0.0, 1.0)
    assert fractions(iron, 1450.0) == (0.0, 1.0, 0.0)


@given(steels, temperatures, sides)
def test_fractions_sum_to_one_and_conserve_carbon(steel, temperature, side):
    p = steel.phases(temperature, side)
    parts = np.array([p.liquid, p.delta, p.gamma])
    assert np.all((parts >= 0.0) & (parts <= 1.0))
    assert parts.sum() == pytest.approx(1.0, abs=4e-16)
    contents = np.array([p.carbon_liquid, p.carbon_delta, p.carbon_gamma])
    assert np.all(np.isnan(contents) == (parts == 0.0))
    assert np.nansum(parts * contents) == pytest.approx(steel.carbon, abs=1e-14)


@given(steels, sides)
def test_liquid_fraction_never_decreases_on_heating(steel, side):
    t = np.union1d(np.linspace(1390.0, 1850.0, 2000), steel.kinks)
    assert np.all(np.diff(steel.phases(t, side).liquid) >= -1e-15)


@given(steels, st.floats(0.0, 1.0))
def test_fractions_are_continuous_except_at_reactions(steel, share):
    """A step of 1e-9 of the interval between two kinks changes no fraction by more than 1e-6."""
    limits = [1300.0, *steel.kinks, 1900.0]
    for low, high in itertools.pairwise(limits):
        if high - low < 1e-6:
            continue
        t = low + share * (high - low)
        inside = np.clip([t - 1e-9 * (high - low), t + 1e-9 * (high - low)], low, high)
        before = steel.phases(inside[0], "above")
        after = steel.phases(inside[1], "below")
        for name in ("liquid", "delta", "gamma"):
            assert abs(getattr(before, name) - getattr(after, name)) < 1e-6


@given(steels)
def test_both_sides_agree_at_kinks_without_reaction(steel):
    kinks = [t for t in steel.kinks if t not in steel.reactions]
    above, below = steel.phases(kinks, "above"), steel.phases(kinks, "below")
    assert np.array_equal(above.liquid, below.liquid)
    assert np.array_equal(above.gamma, below.gamma)


@given(steels)
def test_limits_are_where_phases_begin_and_end(steel):
    assert steel.solidus <= steel.liquidus
    assert float(steel.phases(steel.liquidus).liquid) == pytest.approx(1.0, abs=1e-8)
    assert float(steel.phases(steel.solidus, "below").liquid) == pytest.approx(0.0, abs=1e-8)
    assert float(steel.phases(steel.solidus - 1e-6).liquid) == 0.0
    if steel.gamma_end is not None:
        assert float(steel.phases(steel.gamma_end - 1e-6).delta) == 0.0


@pytest.mark.parametrize("carbon", [-0.01, 2.2, float("nan")])
def test_carbon_out_of_range_is_rejected(carbon):
    with pytest.raises(ValueError, match="carbon"):
        IronCarbon(carbon)


def test_alloying_shifts_the_diagram_of_straight_lines():
    contents = {"C": 0.15, "Si": 0.2, "Mn": 0.8, "P": 0.02}
    plain, steel = alloyed({"C": 0.15}, "pascon"), alloyed(contents, "pascon")
    drop = 0.2 * 7.5 + 0.8 * 4.9 + 0.02 * 34.4
    for name in ("liquidus", "solidus", "peritectic", "melting", "eutectic"):
        assert getattr(plain, name) - getattr(steel, name) == pytest.approx(drop, abs=1e-9)
    rise = -60 * 0.2 + 12 * 0.8 - 140 * 0.02
    assert steel.transformation - plain.transformation == pytest.approx(rise, abs=1e-9)


@pytest.mark.parametrize("diagram", ["assessed", "pascon"])
def test_alloyed_diagram_conserves_carbon(diagram):
    p = alloyed({"C": 0.12, "Mn": 1.5}, diagram).phases(np.linspace(1600.0, 1850.0, 400))
    carbon = [np.nan_to_num(c) for c in (p.carbon_liquid, p.carbon_delta, p.carbon_gamma)]
    assert p.liquid * carbon[0] + p.delta * carbon[1] + p.gamma * carbon[2] == pytest.approx(0.12)


def test_diagram_out_of_order_is_rejected():
    with pytest.raises(ValueError, match="out of order"):
        alloyed({"C": 0.1, "Mn": 5.0, "Cu": 5.0, "Cr": 5.0, "Ni": 5.0})


def test_composition_out_of_range_names_the_element():
    with pytest.raises(ValueError, match=r"Mn: 7 wt% is out of range"):
        alloyed({"C": 0.1, "Mn": 7.0})


def test_regressions_have_their_values():
    composition = {"C": 0.14, "Mn": 0.76}
    liquidus = 1536 - 78 * 0.14 - 4.9 * 0.76
    solidus = 1536 - 200 * 0.14 - 6 * 0.76
    assert regression_liquidus(composition) - ZERO == pytest.approx(liquidus, abs=1e-9)
    assert regression_solidus(composition) - ZERO == pytest.approx(solidus, abs=1e-9)
    assert regression_solidus({"C": 0.1, "S": 0.02}) < regression_solidus({"C": 0.1}) - 20


def test_error_of_the_straight_liquidus_is_that_of_the_page() -> None:
    """The assessed liquidus of 0.80 % C is about 1476 degC (docs/materials.md)."""
    assert IronCarbon(0.8).liquidus - ZERO == pytest.approx(1468.4, abs=0.05)
