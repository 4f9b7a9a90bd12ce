"""A strip over several rolls, compared with the periodic strip and a continuous beam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from castfem.base.types import Array
from castfem.fem.probes import Profile
from castfem.model.build.shell_prediction import ShellPrediction
from castfem.physics.closed_forms.by_name import closed_form
from castfem.physics.constitutive import (
    Elasticity,
    NortonCreep,
    ThermoElastic,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.base import Law
from castfem.physics.machine.bulging import CreepingStrip, Rolls, Shell, Span, over_rolls, stiffness
from castfem.physics.machine.bulging.uneven import ABOVE, BELOW, UnevenRolls
from castfem.physics.materials import load_steel

PITCH, PRESSURE, SPEED = 0.31, 0.2e6, 0.02
SHELL = Shell(0.04, lambda depth: 1273.15 + 490.0 * depth / 0.04)
ELASTIC = load_elasticity()


def rolls(places: tuple[int, ...], offsets: dict[int, float] | None = None) -> Rolls:
    by_place = offsets or {}
    shifts = tuple(by_place.get(k, 0.0) for k in places)
    return Rolls(tuple(PITCH * k for k in places), shifts, PRESSURE, SPEED)


def three_moments(row: Rolls, bending: float) -> Array:
    """Return the moments of a continuous beam over the rolls, -p L^2/12 at both ends."""
    pitch, w = np.array(row.pitches), np.array(row.offsets)
    n = len(w)
    matrix, load = np.eye(n), np.full(n, -row.pressure * pitch[0] ** 2 / 12.0)
    load[-1] = -row.pressure * pitch[-1] ** 2 / 12.0
    for j in range(1, n - 1):
        a, b = pitch[j - 1], pitch[j]
        matrix[j, j - 1 : j + 2] = a, 2.0 * (a + b), b
        load[j] = -0.25 * row.pressure * (a**3 + b**3)
        load[j] -= 6.0 * bending * ((w[j - 1] - w[j]) / a + (w[j + 1] - w[j]) / b)
    return np.linalg.solve(matrix, load)


@pytest.mark.parametrize(
    "row",
    [
        rolls((0, 1, 2, 3, 4, 5)),
        rolls((0, 1, 2, 4, 5, 6)),
        rolls((0, 1, 2, 3, 4, 5, 6), {3: -0.5e-3}),
    ],
)
def test_elastic_strip_is_a_continuous_beam(row: Rolls) -> None:
    bulge = over_rolls(CreepingStrip(ThermoElastic(ELASTIC)), row, SHELL)
    bending = stiffness(ELASTIC, SHELL.points()).bending
    exact = three_moments(row, bending)
    found = np.interp(row.positions, bulge.z, bulge.moment)
    assert found == pytest.approx(exact, rel=2e-3)
    assert bulge.at(row.positions) == pytest.approx(row.offsets, abs=2e-4 * bulge.largest)
    # Within a span: the deflection by the load and by the moments at its ends.
    pitch, j = row.pitches, 2
    ends, at = exact[j : j + 2], row.positions[j] + 0.5 * pitch[j]
    middle = 5.0 / 384.0 * PRESSURE * pitch[j] ** 4 + pitch[j] ** 2 / 16.0 * ends.sum()
    lifted = 0.5 * (row.offsets[j] + row.offsets[j + 1])
    assert bulge.at(at) == pytest.approx(middle / bending + lifted, abs=3e-3 * bulge.largest)


@pytest.mark.parametrize("name", ["kozlowski_zhu_signed", "norton_hoff_kozlowski_signed"])
def test_equal_pitches_bulge_as_the_periodic_pitch(name: str) -> None:
    strip = CreepingStrip(load_law(name, ELASTIC, carbon=0.1))
    row = rolls((0, 1, 2, 3, 4, 5))
    many = over_rolls(strip, row, SHELL)
    one = strip.bulge(row.span(0), SHELL)
    z = np.linspace(0.0, PITCH, 41)
    for start in row.positions[:-1]:
        # A pitch is periodic within 5e-3 of its range of curvature, and such errors add up.
        assert many.at(start + z) == pytest.approx(one.at(z), abs=1e-2 * one.largest)
    assert many.roll_force == pytest.approx(one.roll_force[0], rel=3e-3)


def test_linear_creep_obeys_superposition() -> None:
    """For Norton creep with n = 1 the change is proportional to the offset of a roll."""
    law = NortonCreep.constant(Elasticity.constant(10e9, 0.3), 2e-5, 5e6, 1.0)
    strip = CreepingStrip(law)
    places = (0, 1, 2, 3, 4, 5, 6)
    none, once, twice = (
        over_rolls(strip, rolls(places, {3: k * 1e-4}), SHELL) for k in (0.0, 1.0, 2.0)
    )
    added = once.deflection - none.deflection
    assert twice.deflection - none.deflection == pytest.approx(2.0 * added, abs=2e-3 * 1e-4)
    assert twice.moment - none.moment == pytest.approx(
        2.0 * (once.moment - none.moment), abs=2e-3 * np.ptp(once.moment - none.moment)
    )
    # The effect reaches farther downstream: creep strain travels with the strand.
    up, down = (np.abs(added[side]).max() for side in (once.z < 2 * PITCH, once.z > 4 * PITCH))
    assert down > 1.1 * up


@pytest.mark.parametrize("exponent", [None, 1.0, 3.0])
def test_bulge_at_lost_roll_is_of_second_order_in_the_steps(exponent: float | None) -> None:
    """Bulge and roll forces are of second order; the steps of a pitch are its cells in z."""
    shell = Shell(0.03, lambda depth: 1400.0)
    law: Law = ThermoElastic(Elasticity.constant(10e9, 0.3))
    if exponent is not None:  # with negligible elastic strain
        law = NortonCreep.constant(Elasticity.constant(1e13, 0.3), 1e-3, 5e6, exponent)
    row, values = rolls((0, 1, 2, 4, 5, 6)), []
    for steps in (32, 64, 128):
        bulge = over_rolls(CreepingStrip(law, steps=steps, layers=12), row, shell)
        values.append([bulge.largest, bulge.roll_force[1] / (PRESSURE * PITCH)])
    (first, _), (second, force) = np.abs(np.diff(np.array(values), axis=0))
    assert np.log2(first / second) > 1.8
    assert second < 1e-3 * values[-1][0]
    assert force < 2e-4  # without extrapolation: 3e-3, of first order


def test_roll_forces_balance_the_pressure() -> None:
    """The roll forces and the shear forces at the ends balance the load."""
    law = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1)
    row = rolls((0, 1, 2, 3, 4, 5, 6), {3: -1e-3})
    bulge = over_rolls(CreepingStrip(law), row, SHELL)
    ends = np.interp(row.positions, bulge.z, bulge.moment)
    first = (ends[1] - ends[0]) / PITCH + 0.5 * PRESSURE * PITCH
    last = -(ends[-1] - ends[-2]) / PITCH + 0.5 * PRESSURE * PITCH
    total = bulge.roll_force.sum() + first + last
    assert total == pytest.approx(PRESSURE * row.positions[-1], rel=1e-9)
    # The roll moved inwards carries more, its neighbours less.
    assert bulge.roll_force[2] > 1.1 * PRESSURE * PITCH > PRESSURE * PITCH > bulge.roll_force[3]


def test_rolls_beyond_those_counted_have_no_effect() -> None:
    law = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1)
    strip, stiff = CreepingStrip(law), Shell(0.07, lambda depth: 1173.15 + 590.0 * depth / 0.07)
    few = over_rolls(strip, rolls((0, 1, 2, 4, 5, 6)), stiff)
    more = over_rolls(strip, rolls((0, 1, 2, 3, 5, 6, 7, 8)), stiff)
    assert few.largest == pytest.approx(more.largest, rel=2e-2)
    assert more.extremes()[1] / PITCH == pytest.approx(4.0, abs=0.4)
    single = strip.bulge(rolls((0, 1, 2, 3)).span(0), stiff).largest
    assert few.largest > 8.0 * single


def test_invalid_rows_of_rolls_are_rejected() -> None:
    with pytest.raises(ValueError, match="needs four"):
        Rolls((0.0, 0.3, 0.6), (0.0, 0.0, 0.0), PRESSURE, SPEED)
    with pytest.raises(ValueError, match="must increase"):
        Rolls((0.0, 0.3, 0.3, 0.6), (0.0,) * 4, PRESSURE, SPEED)
    with pytest.raises(ValueError, match="4 rolls, but 3 offsets"):
        Rolls((0.0, 0.3, 0.6, 0.9), (0.0,) * 3, PRESSURE, SPEED)


# The shell in the middle of a pitch, predicted from the profile at the roll.


STEEL = load_steel("alloy_similarity")
EXACT = closed_form("alloy_similarity", STEEL, 1300.0, STEEL.liquidus + 25.0)
PREDICTION = ShellPrediction(STEEL)
DEPTH = 0.11 * np.linspace(0.0, 1.0, 401) ** 2  # as of a probe


def exact(time: float) -> Profile:
    return Profile(DEPTH, EXACT.temperature(DEPTH, time))


def shell(profile: Profile) -> float:
    return profile.isotherm_depth(STEEL.solidus)


@pytest.mark.parametrize("time", [40.0, 150.0])
def test_predicted_shell_grows_as_the_closed_form(time: float) -> None:
    """6 s is the time from a roll to the middle of the pitch."""
    now, then = exact(time), exact(time + 6.0)
    found = PREDICTION.later(now, 6.0)
    assert shell(then) - shell(now) > 0.3e-3
    assert shell(found) - shell(now) == pytest.approx(shell(then) - shell(now), rel=0.02)
    assert np.abs(found.temperature - then.temperature).max() < 0.5
    assert found.temperature[0] == now.temperature[0] and found.depth is now.depth


def test_uniform_profile_keeps_its_heat() -> None:
    """The centre of the slab is insulated."""
    warm = Profile(DEPTH, np.full(401, 1600.0) + 1e-9 * np.arange(401))
    assert PREDICTION.later(warm, 600.0).temperature == pytest.approx(warm.temperature, abs=1e-6)


def test_predicted_front_matches_predicted_temperatures() -> None:
    """Also for profiles with their conduction integral, as in a run."""
    curve = STEEL.thermal_curve(1200.0, STEEL.liquidus + 50.0)
    first, last = (
        Profile(p.depth, p.temperature, conducts=curve, theta=curve.conduction(p.temperature))
        for p in (exact(40.0), exact(44.0))
    )
    for time in (41.0, 50.0):
        found = PREDICTION.at(time, (40.0, 44.0), first, last)
        own = Profile(found.depth, found.temperature, conducts=curve)
        assert shell(found) == pytest.approx(shell(own), rel=1e-12)
        assert shell(found) == pytest.approx(shell(exact(time)), rel=0.01)


def test_profile_within_a_step_is_interpolated() -> None:
    first, last = exact(40.0), exact(44.0)
    for time, share in ((30.0, 0.0), (40.0, 0.0), (41.0, 0.25), (44.0, 1.0)):
        mean = (1.0 - share) * first.temperature + share * last.temperature
        found = PREDICTION.at(time, (40.0, 44.0), first, last)
        assert found.temperature == pytest.approx(mean, rel=1e-12)
    beyond = PREDICTION.at(47.0, (40.0, 44.0), first, last)
    assert beyond.temperature == pytest.approx(PREDICTION.later(last, 3.0).temperature, abs=1e-12)


def test_prediction_in_two_steps_is_that_in_one() -> None:
    single = shell(PREDICTION.later(exact(40.0), 6.0))
    double = shell(PREDICTION.later(PREDICTION.later(exact(40.0), 2.5), 3.5))
    assert single == pytest.approx(double, rel=2e-4)


# The creeping strip over a lost roll, compared with an independent ODE solver.
#
# Its bulges are in docs/data/lost_roll.csv: the moments over the rolls by a root finder, the layers
# as one system of differential equations, without implicit steps and tangents.


DATA = Path(__file__).parents[2] / "docs" / "data" / "lost_roll.csv"
LOST_PITCH, LOST_PRESSURE, LOST_SPEED = 0.25, 0.25e6, 0.02
LOST_SHELL = Shell(0.04, lambda depth: 1273.15 + 490.0 / 0.04 * depth)
STRIP = CreepingStrip(
    load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1, delta_share=np.zeros_like)
)


@pytest.fixture(scope="module")
def ode_bulges() -> pd.Series:
    """Return the largest bulge of the ODE solver, mm, by the lost rolls."""
    table = pd.read_csv(DATA)
    return table[table.what == "austenite"].set_index("lost").ode


def test_every_second_roll_lost_matches_the_ode(ode_bulges: pd.Series) -> None:
    found = STRIP.bulge(Span(2 * LOST_PITCH, LOST_PRESSURE, LOST_SPEED), LOST_SHELL)
    assert 1e3 * found.largest == pytest.approx(ode_bulges["every second"], rel=1e-2)


def test_single_lost_roll_matches_the_ode(ode_bulges: pd.Series) -> None:
    """The ODE solver had more rolls, which changes the bulge by half a per cent."""
    places = LOST_PITCH * np.delete(np.arange(7), 3)
    rolls = Rolls(tuple(places), (0.0,) * len(places), LOST_PRESSURE, LOST_SPEED)
    found = over_rolls(STRIP, rolls, LOST_SHELL)
    assert 1e3 * found.largest == pytest.approx(ode_bulges["one"], rel=1e-2)
    assert found.extremes()[1] == pytest.approx(places[2] + 0.62 * 2 * LOST_PITCH, abs=0.01)


# Pitches near lost or misaligned rolls, by the single pitch and the strip over all rolls.


LOAD = PITCH * PRESSURE
EVEN_SHELL = Shell(0.05, lambda depth: 1223.15 + 540.0 * depth / 0.05)
ELASTIC_STRIP = CreepingStrip(ThermoElastic(load_elasticity()))
PLACES = PITCH * np.arange(12)
NONE = np.zeros(12)
COUNT = 81


def uneven(strip: CreepingStrip, places: Array, offsets: Array, *marks: int) -> UnevenRolls:
    return UnevenRolls(strip, places, offsets, marks, (PITCH, PITCH), COUNT)


def span(places: Array, pitch: int) -> Span:
    return Span(float(places[pitch + 1] - places[pitch]), PRESSURE, SPEED)


def test_equal_rolls_give_the_single_pitch() -> None:
    strip = CreepingStrip(load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1))
    found = uneven(strip, PLACES, NONE, 5).bulge(5, span(PLACES, 5), EVEN_SHELL, 1.0)
    one = strip.bulge(span(PLACES, 5), EVEN_SHELL)
    assert found.bulge.z == pytest.approx(one.z, rel=1e-12)
    assert found.bulge.deflection == pytest.approx(one.deflection, abs=1e-2 * one.largest)
    swing = np.ptp(one.curvature)
    assert found.bulge.curvature == pytest.approx(one.curvature, abs=1e-2 * swing)
    assert found.bulge.roll_force[0] == pytest.approx(LOAD, rel=3e-3)
    assert found.added == pytest.approx(np.zeros(3), abs=3e-3 * LOAD)


def test_effect_of_a_lost_roll_matches_total_strip_and_decays() -> None:
    """Adjacent pitches have the same added forces, and the rolls carry the total pressure."""
    places = np.delete(PLACES, 6)
    rolls = uneven(ELASTIC_STRIP, places, NONE[:-1], 5)
    near = [k for k in range(len(places) - 1) if rolls.near(k)]
    assert near == list(range(5 - ABOVE, 5 + BELOW + 1))
    total = over_rolls(
        ELASTIC_STRIP, Rolls(tuple(places), (0.0,) * 11, PRESSURE, SPEED), EVEN_SHELL
    )
    found = {k: rolls.bulge(k, span(places, k), EVEN_SHELL, 1.0) for k in near}
    for k, one in found.items():
        expected = total.at(places[k] + one.bulge.z)
        assert one.bulge.deflection == pytest.approx(expected, abs=1e-2 * total.largest)
        # Roll k is number k - 1 of those with a span on each side.
        assert one.bulge.roll_force[0] == pytest.approx(total.roll_force[k - 1], abs=2e-2 * LOAD)
        if k + 1 in found:
            assert found[k + 1].added[:2] == pytest.approx(one.added[1:], abs=1e-3 * LOAD)
    single = ELASTIC_STRIP.bulge(span(PLACES, 5), EVEN_SHELL).largest
    assert found[5].bulge.largest > 5.0 * single
    # Rolls beside the long pitch carry more than their half pitches, the next rolls less.
    added = np.array([found[k].added[0] for k in near])
    assert added[2] > 0.1 * LOAD > 0.0 > added[1] and abs(added[0]) < abs(added[1])
    assert added.sum() + found[near[-1]].added[1] == pytest.approx(0.0, abs=0.03 * LOAD)


def test_misaligned_roll_presses_one_face_and_leaves_the_other() -> None:
    offsets = NONE.copy()
    offsets[6] = 1e-3  # far beyond what the elastic shell bulges
    rolls = uneven(ELASTIC_STRIP, PLACES, offsets, 5, 6)
    inner, outer = (rolls.bulge(6, span(PLACES, 6), EVEN_SHELL, side) for side in (1.0, -1.0))
    # The outer face is pressed in; the inner face has no contact, as if its roll were lost.
    assert outer.bulge.roll_force[0] > 2.0 * LOAD
    assert outer.added[0] == pytest.approx(outer.bulge.roll_force[0] - LOAD, rel=1e-12)
    assert inner.bulge.roll_force[0] == 0.0 and inner.added[0] == pytest.approx(-LOAD)
    without = np.delete(PLACES, 6)
    lost = uneven(ELASTIC_STRIP, without, NONE[:-1], 5).bulge(5, span(without, 5), EVEN_SHELL, 1.0)
    z = 0.5 * lost.bulge.z[-1] + inner.bulge.z
    expected = np.interp(z, lost.bulge.z, lost.bulge.deflection)
    # Deflections count from the line between the rolls, which falls by 1 mm here.
    found = inner.bulge.deflection + 1e-3 * (1.0 - inner.bulge.z / PITCH)
    assert found == pytest.approx(expected, abs=2e-2 * lost.bulge.largest)
    small = offsets * 1e-2
    for side in (1.0, -1.0):
        one = uneven(ELASTIC_STRIP, PLACES, small, 5, 6).bulge(6, span(PLACES, 6), EVEN_SHELL, side)
        assert one.bulge.roll_force[0] > 0.0
        assert one.added[0] * side < 0.0
        assert one.bulge.deflection[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-7)


def test_rolls_are_continued_beyond_the_ends() -> None:
    places = np.delete(PLACES, 1)
    first = uneven(ELASTIC_STRIP, places, NONE[:-1], 0).bulge(0, span(places, 0), EVEN_SHELL, 1.0)
    inside = np.delete(PLACES, 6)
    within = uneven(ELASTIC_STRIP, inside, NONE[:-1], 5).bulge(5, span(inside, 5), EVEN_SHELL, 1.0)
    assert first.bulge.deflection == pytest.approx(within.bulge.deflection, rel=1e-6, abs=1e-9)
    assert first.added == pytest.approx(within.added, rel=1e-6)


def test_neighbouring_defects_share_a_strip() -> None:
    rolls = uneven(ELASTIC_STRIP, PLACES, NONE, 2, 5, 12)
    assert rolls.around(3) == rolls.around(0) == rolls.around(7) == (-1, 10)
    assert rolls.around(11) == (9, 17) and not rolls.near(9)
