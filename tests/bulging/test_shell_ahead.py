"""The shell in the middle of a pitch, foreseen from the profile where the slice enters it."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.fem.probes import Profile
from castfem.model.build.shell_prediction import ShellPrediction
from castfem.physics.closed_forms.by_name import closed_form
from castfem.physics.materials import load_steel

STEEL = load_steel("alloy_similarity")
EXACT = closed_form("alloy_similarity", STEEL, 1300.0, STEEL.liquidus + 25.0)
AHEAD = ShellPrediction(STEEL)
DEPTH = 0.11 * np.linspace(0.0, 1.0, 401) ** 2  # as probes have it


def exact(time: float) -> Profile:
    return Profile(DEPTH, EXACT.temperature(DEPTH, time))


def shell(profile: Profile) -> float:
    return profile.isotherm_depth(STEEL.solidus)


@pytest.mark.parametrize("time", [40.0, 150.0])
def test_a_shell_grows_as_its_closed_form(time: float) -> None:
    """6 s: from a roll to the middle of its pitch."""
    now, then = exact(time), exact(time + 6.0)
    found = AHEAD.later(now, 6.0)
    assert shell(then) - shell(now) > 0.3e-3
    assert shell(found) - shell(now) == pytest.approx(shell(then) - shell(now), rel=0.02)
    assert np.abs(found.temperature - then.temperature).max() < 0.5
    assert found.temperature[0] == now.temperature[0] and found.depth is now.depth


def test_no_heat_is_lost() -> None:
    """What a whole slab at rest in its heat has to give stays: its middle is insulated."""
    warm = Profile(DEPTH, np.full(401, 1600.0) + 1e-9 * np.arange(401))
    assert AHEAD.later(warm, 600.0).temperature == pytest.approx(warm.temperature, abs=1e-6)


def test_within_a_step_the_profile_is_between_its_ends() -> None:
    first, last = exact(40.0), exact(44.0)
    for time, share in ((30.0, 0.0), (40.0, 0.0), (41.0, 0.25), (44.0, 1.0)):
        mean = (1.0 - share) * first.temperature + share * last.temperature
        found = AHEAD.at(time, (40.0, 44.0), first, last)
        assert found.temperature == pytest.approx(mean, rel=1e-12)
    beyond = AHEAD.at(47.0, (40.0, 44.0), first, last)
    assert beyond.temperature == pytest.approx(AHEAD.later(last, 3.0).temperature, abs=1e-12)


def test_a_step_does_not_matter() -> None:
    """From half-way or from the roll: the same shell."""
    one = shell(AHEAD.later(exact(40.0), 6.0))
    other = shell(AHEAD.later(AHEAD.later(exact(40.0), 2.5), 3.5))
    assert one == pytest.approx(other, rel=2e-4)
