"""A freezing strip of steel that creeps: the slice against layers integrated without castfem.

There is no closed form; `mechanics.layers` is an integration of its own in every part: formulas of
the flow, temperature, equilibrium, time integration.  Two comparisons tell the causes of the
difference apart: with the exact temperature given at the vertices only the mechanics differs, with
the strip's own heat balance the front moves from cell to cell, too.

What cannot agree is thinner than the cells: behind the front the stress rises from nothing over
sigma / E' = 5e-5 of strain, 0.05 to 0.1 mm; and at the surface the shell of the first instants was
a part of one cell.  So the whole shell is held to 2 % of 20 MPa, the size of the stress at the
surface, and what lies half a millimetre from either end to 1 % (0.25 mm cells).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.constitutive import load_law
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from mechanics.layers import Shell, shell
from mechanics.setups import SliceSetup, box, mapped
from mechanics.weiner_boley import POURED, YIELD, HalfSpace, Strip

EXACT = HalfSpace()
# Short steps first: the shell thickens by 3.4 mm in the first second, half of it in a quarter.
START = ((0.02, 4e-3), (0.1, 1.6e-2), (0.5, 4e-2))
INNER = 0.5e-3  # from either end of the shell, m


@cache
def austenite() -> dict[float, Shell]:
    """The layers at 0.27 %C, integrated once for all tests."""
    times = (1.0, 5.0, 5.13, 20.0, 21.0)
    return dict(zip(times, shell(times, 0.27), strict=True))


def advance(strip: Strip, end: float, step: float, exact_heat: bool) -> None:
    """Even steps to `end`, by the strip's own heat balance or at the exact temperature."""
    if not exact_heat:
        strip.advance(end, step)
        return
    section, begin = strip.thermal.section, strip.state.time
    x = section.vertex_space.tabulate_dof_coordinates()[: section.owned, 0]
    for time in np.linspace(begin, end, round((end - begin) / step) + 1)[1:]:
        zeta = x / (2.0 * np.sqrt(33.0 / (7500.0 * 661.0) * time))
        heat = np.where(zeta < EXACT.front, EXACT.temperature(zeta), POURED) + ZERO_CELSIUS
        result = strip.stepper.step(strip.state, float(time), heat)
        assert result.converged, result.reason
        strip.state = result.state
        strip.results.append(result)


def errors(strip: Strip, expected: Shell) -> tuple[float, float]:
    """Rms difference of sigma_zz over 20 MPa: in the whole shell, and off its ends."""
    thick = EXACT.shell(strip.state.time)
    difference = strip.stress[:, 2] - 1e6 * np.interp(strip.depth, expected.depth, expected.stress)
    inside = strip.depth < thick
    inner = (strip.depth > INNER) & (strip.depth < thick - INNER)
    whole, off_ends = (np.sqrt(np.mean(difference[k] ** 2)) / YIELD for k in (inside, inner))
    return float(whole), float(off_ends)


def flowed(strip: Strip, expected: Shell) -> float:
    """Rms difference of the flow over its largest, from 2 mm below the surface on."""
    depth, thick = strip.depth, EXACT.shell(strip.state.time)
    inner = (depth > 2e-3) & (depth < thick - INNER)
    found = strip.state.internal[: strip.problem.points.deviator_points, 0][inner]
    theirs = np.interp(depth[inner], expected.depth, expected.flow)
    return float(np.sqrt(np.mean((found - theirs) ** 2)) / theirs.max())


def test_exact_temperature() -> None:
    """Austenite, 0.27 %C: nothing but law, slice and time steps differ."""
    first, early, late = (austenite()[time] for time in (1.0, 5.0, 21.0))
    strip = Strip(0.25e-3, law="kozlowski_zhu", carbon=0.27)
    for end, step in (*START, (1.0, 0.05)):
        advance(strip, end, step, True)
    strains = [strip.state.generalized_strains[0]]
    for expected, end, step in ((early, 5.0, 0.1), (late, 21.0, 0.2)):
        advance(strip, end, step, True)
        whole, inner = errors(strip, expected)
        assert whole < 0.02
        assert inner < 0.01
        assert flowed(strip, expected) < 0.05
        strains.append(strip.state.generalized_strains[0])
    # What the plane of the shell shrinks; the first second depends on the first layer.
    expected_strains = np.diff([first.strain, early.strain, late.strain])
    assert strains[1] - strains[0] == pytest.approx(expected_strains[0], rel=0.02)
    assert strains[2] - strains[1] == pytest.approx(expected_strains[1], rel=0.005)
    assert max(r.balance.axial_error for r in strip.results if r.balance) < 1e-8
    stress = strip.stress
    assert np.abs(stress[:, 1] - stress[:, 2]).max() < 1e-6 * YIELD


@pytest.mark.parametrize(
    ("law", "above"), [("kozlowski_zhu", 7.0e-3), ("kozlowski_zhu_mixed", 6.9e-3)]
)
def test_delta_ferrite_behind_the_front(law: str, above: float) -> None:
    """0.10 %C: above 1453 degC the solid is delta ferrite, an eighth as strong.

    Of the mixed law it takes over from 1450 degC on, its weight going with its fraction.
    """
    (expected,) = shell([5.0], 0.10, 0.1e-3, mixed=law.endswith("mixed"))
    strip = Strip(0.25e-3, law=law, carbon=0.10, length=0.015)
    for end, step in (*START, (5.0, 0.1)):
        advance(strip, end, step, True)
    whole, inner = errors(strip, expected)
    assert whole < 0.02
    assert inner < 0.01
    # Where the phases change the stress falls within a cell; beyond it is that of delta ferrite.
    hot = (strip.depth > above) & (strip.depth < 7.5e-3)
    theirs = np.interp(strip.depth[hot], expected.depth, expected.stress)
    assert strip.stress[hot, 2] == pytest.approx(1e6 * theirs, rel=0.1)


def test_own_heat_balance() -> None:
    """Cells of 0.1 mm: as good, but for pulses of the rate as the front passes from cell to cell.

    The temperature behind a front that rests in a cell falls slower, then faster, and the stress
    of a flow that depends on the rate follows: averaged over the passage of two cells the
    difference behind the front is less than half of that at an instant.
    """
    early, middle = (austenite()[time] for time in (5.0, 5.13))
    strip = Strip(0.1e-3, law="kozlowski_zhu", carbon=0.27, length=0.015)
    for end, step in (*START, (5.0, 0.1)):
        advance(strip, end, step, False)
    whole, inner = errors(strip, early)
    assert whole < 0.02
    assert inner < 0.01
    hot = (strip.depth > 5e-3) & (strip.depth < 7.1e-3)
    theirs = np.interp(strip.depth[hot], middle.depth, middle.stress)
    differences = []
    for _ in range(13):
        advance(strip, strip.state.time + 0.02, 0.02, False)
        differences.append(strip.stress[hot, 2] / 1e6 - theirs)
    instant = np.mean([np.sqrt(np.mean(d**2)) for d in differences])
    lasting = np.sqrt(np.mean(np.mean(differences, axis=0) ** 2))
    assert lasting < 0.5 * instant
    assert lasting < 0.05


def test_steps_a_hundred_times_longer() -> None:
    """Ten steps to 20 s instead of a thousand: still the closed form, and the layers."""
    strip = Strip(0.25e-3).advance(20.0, 2.0)
    assert strip.error(EXACT) < 0.01
    strip = Strip(0.25e-3, law="kozlowski_zhu", carbon=0.27).advance(20.0, 2.0)
    assert errors(strip, austenite()[20.0])[0] < 0.05
    assert max(r.balance.axial_error for r in strip.results if r.balance) < 1e-8


# States the model cannot speak of are refused: the solid judged strictly, the liquid less.


SIZE, COLD, HOT = 0.1, 1000.0, 1800.0
LAW = ThermoElastic(Elasticity.constant(1e10, 0.3, Solidity.between(1700.0, 1750.0)))


def refusal(
    temperature: float,
    *,
    large: bool = False,
    generalized_strains: tuple[float, ...] = (0, 0, 0, 0),
    right: float | None = None,
    law: Law = LAW,
    path: float = 0.0,
    **u: float,
) -> str:
    """What is said of a square of 4 x 4 cells of a temperature (K), its right half of another.

    `path` is the viscoplastic strain that it has summed up; of u "middle" is the middle node along
    x, m, and the others are displacement gradients, "half" that is yx of the right half alone.
    """
    given = {"large_strain": large}
    setup = SliceSetup(mapped(4, 4, box(SIZE, SIZE)), law, judge=True, given=given)
    problem, judge = setup.problem, setup.stepper._validity
    x, y = problem.space.tabulate_dof_coordinates()[:, :2].T
    along = u.get("xx", 0.0) * x + u.get("xy", 0.0) * y
    moved = np.column_stack([along, u.get("yx", 0.0) * x + u.get("yy", 0.0) * y])
    moved[np.hypot(x - 0.5 * SIZE, y - 0.5 * SIZE) < 1e-9, 0] += u.get("middle", 0.0)
    moved[:, 1] += u.get("half", 0.0) * np.maximum(x - 0.5 * SIZE, 0.0)
    problem.fields.u.x.array[:] = moved.ravel()
    problem.fields.generalized_strains.value[:] = generalized_strains
    state = replace(
        setup.state,
        displacement=moved.ravel(),
        generalized_strains=np.array(generalized_strains, float),
        internal=np.full_like(setup.state.internal, path),
    )
    heat = np.full(problem.points.count, temperature)
    if right is not None:
        heat[problem.points.position[:, 0] > 0.5 * SIZE] = right
    return judge.refusal(state, heat)


@pytest.mark.parametrize("large", [False, True])
def test_what_is_as_it_was_is_kept(large: bool) -> None:
    assert refusal(COLD, large=large) == "" == refusal(HOT, large=large)
    assert refusal(COLD, large=large, xx=-0.02, generalized_strains=(-0.02, 0.1, 0.1, 0.01)) == ""


def test_liquid_that_folds_means_nothing_at_small_strain() -> None:
    """Its stand-in may distort; where the equations are those of the slice as it is it may not."""
    assert refusal(HOT, middle=0.15 * SIZE) == ""
    assert "the liquid folds" in refusal(HOT, middle=0.15 * SIZE, large=True)
    for large in (False, True):
        assert "the shell folds" in refusal(COLD, middle=0.15 * SIZE, large=large)


@pytest.mark.parametrize("temperature", [COLD, HOT])
def test_thickness(temperature: float) -> None:
    """The planes are those of solid and liquid alike."""
    for a0, times in ((-1.2, -0.2), (-1.0, 0.0), (-0.15, 0.85), (0.2, 1.2)):
        assert f"{times:.3g} times as thick" in refusal(
            temperature, generalized_strains=(a0, 0, 0, 0)
        )
    assert refusal(temperature, generalized_strains=(0.2, 0, 0, 0), large=True) == ""
    assert "as thick" in refusal(temperature, generalized_strains=(0, -12.0, 0, 0))
    assert "as thick" in refusal(temperature, generalized_strains=(0, -12.0, 0, 0), large=True)
    assert "times as thick" in refusal(temperature, generalized_strains=(np.nan, 0, 0, 0))


def test_small_strain_has_a_range() -> None:
    """A shell that turns, a section that bulges: at large strain both are what they are."""
    told = refusal(COLD, xy=-0.25, yx=0.25)
    assert "the shell turns by 0.245 rad (at most 0.2)" in told and "strain" in told
    assert refusal(COLD, xy=-0.25, yx=0.25, large=True) == ""
    assert refusal(HOT, xy=0.05) == ""
    assert "bulge or shrinkage is 0.15" in refusal(COLD, xx=0.15)
    assert "look at loads" in refusal(COLD, xx=0.15)
    assert "look at loads" in refusal(HOT, xx=0.15)
    assert "there is no shell yet" in refusal(HOT, generalized_strains=(0.15, 0, 0, 0))
    assert refusal(HOT, xx=0.15, large=True) == ""


@pytest.mark.parametrize("temperature", [COLD, HOT])
@pytest.mark.parametrize("change", [0.35, -0.35, 4.8])
def test_no_section_bulges_or_shrinks_by_a_third(temperature: float, change: float) -> None:
    """Soft liquid without a shell that runs apart to 4.8 times its size is no strand."""
    for along in ("xx", "yy"):
        told = refusal(temperature, large=True, **{along: change})
        assert f"bulge or shrinkage is {abs(change):.3g} of the section (at most 0.3)" in told
    assert "bulge" not in refusal(temperature, large=True, xx=0.25)


def test_what_has_turned_as_liquid_is_told_from_a_shell_that_turns() -> None:
    """The right half turns by atan(0.3), and is 10 or 700 K below the solidus of 1700 K."""
    fresh = "and no more than 0 rad where it is 50 K below its solidus: cells of the front"
    for right, told in ((1690.0, True), (COLD, False)):
        found = refusal(COLD, half=0.6, right=right)
        assert "the shell turns by 0.291 rad (at most 0.2)" in found
        assert (fresh in found) == told
    # Nothing is colder: it is not known which it is.
    assert "below its solidus" not in refusal(1690.0, half=0.6)


def test_strain_that_is_borne() -> None:
    """A bar drawn out beyond 10 %, and one that is squeezed on all sides, are taken back."""
    for component, value, told in ((0, 0.15, "strained by 0.15"), (None, -0.03, "mean stress")):
        setup = SliceSetup(mapped(1, 1, box(SIZE, SIZE)), LAW, judge=True, start=COLD)
        stress = np.zeros((setup.problem.points.count, 4))
        if component is None:
            stress[:, :3] = 3.0 * 1e10 / (3.0 * (1.0 - 0.6)) * value
        else:
            stress[:, component] = value * 3.0 * 1e10 / 2.6
        judge = setup.stepper._validity
        temperature = np.full(setup.problem.points.count, COLD)
        state = replace(setup.state, stress=stress)
        assert told in judge.refusal(state, temperature)
        assert judge.refusal(state, np.full_like(temperature, HOT)) == ""


def test_strain_to_and_fro_is_no_strain() -> None:
    """What hardening has summed up counts as far as the cell is distorted: 0.086 and 0.104 here."""
    law = load_law("kozlowski_zhu", LAW.elasticity, carbon=0.1)
    for drawn, kept in ((0.075, True), (0.09, False)):
        found = refusal(COLD, law=law, path=0.3, xx=drawn, generalized_strains=(-drawn, 0, 0, 0))
        assert (found == "") == kept and ("strained by 0.104" in found) == (not kept)
        assert refusal(COLD, law=law, path=0.09, xx=drawn) == ""
    # At large strain the path counts, whose limit is ten times as much.
    for path, kept in ((0.3, True), (1.1, False)):
        assert (refusal(COLD, law=law, path=path, large=True) == "") == kept
