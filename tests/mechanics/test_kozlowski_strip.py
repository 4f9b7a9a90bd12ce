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

from functools import cache

import numpy as np
import pytest

from castfem.base.constants import ZERO_CELSIUS
from mechanics.layers import Shell, shell
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


def test_delta_ferrite_behind_the_front() -> None:
    """0.10 %C: above 1453 degC the solid is delta ferrite, an eighth as strong."""
    (expected,) = shell([5.0], 0.10, 0.1e-3)
    strip = Strip(0.25e-3, law="kozlowski_zhu", carbon=0.10)
    for end, step in (*START, (5.0, 0.1)):
        advance(strip, end, step, True)
    whole, inner = errors(strip, expected)
    assert whole < 0.02
    assert inner < 0.01
    # Where the phases change the stress falls within a cell; beyond it is that of delta ferrite.
    hot = (strip.depth > 7.0e-3) & (strip.depth < 7.5e-3)
    theirs = np.interp(strip.depth[hot], expected.depth, expected.stress)
    assert strip.stress[hot, 2] == pytest.approx(1e6 * theirs, rel=0.1)


def test_both_phases_by_their_fractions() -> None:
    """0.10 %C: from 1450 degC on delta ferrite takes over, its weight going with its fraction."""
    (expected,) = shell([5.0], 0.10, 0.1e-3, mixed=True)
    strip = Strip(0.25e-3, law="kozlowski_zhu_mixed", carbon=0.10)
    for end, step in (*START, (5.0, 0.1)):
        advance(strip, end, step, True)
    whole, inner = errors(strip, expected)
    assert whole < 0.02
    assert inner < 0.01
    hot = (strip.depth > 6.9e-3) & (strip.depth < 7.5e-3)
    theirs = np.interp(strip.depth[hot], expected.depth, expected.stress)
    assert strip.stress[hot, 2] == pytest.approx(1e6 * theirs, rel=0.1)


def test_own_heat_balance() -> None:
    """Cells of 0.1 mm: as good, but for pulses of the rate as the front passes from cell to cell.

    The temperature behind a front that rests in a cell falls slower, then faster, and the stress
    of a flow that depends on the rate follows: averaged over the passage of two cells the
    difference behind the front is less than half of that at an instant.
    """
    early, middle = (austenite()[time] for time in (5.0, 5.13))
    strip = Strip(0.1e-3, law="kozlowski_zhu", carbon=0.27)
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
