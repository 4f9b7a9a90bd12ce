"""The creeping strip over a lost roll, against an ODE solver that shared nothing with it.

Its bulges stand in docs/data/lost_roll.csv: the moments over the rolls by a root finder of its own,
the layers as one system of differential equations, no implicit step, no tangent.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.machine.bulging import CreepingStrip, Rolls, Shell, Span, over_rolls

DATA = Path(__file__).parents[2] / "docs" / "data" / "lost_roll.csv"
PITCH, PRESSURE, SPEED = 0.25, 0.25e6, 0.02
SHELL = Shell(0.04, lambda depth: 1273.15 + 490.0 / 0.04 * depth)
STRIP = CreepingStrip(
    load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1, delta_share=np.zeros_like)
)


@pytest.fixture(scope="module")
def solved() -> pd.Series:
    """Largest bulge by the ODE solver, mm, by which rolls are lost."""
    table = pd.read_csv(DATA)
    return table[table.what == "austenite"].set_index("lost").ode


def test_every_second_roll_lost(solved: pd.Series) -> None:
    found = STRIP.bulge(Span(2 * PITCH, PRESSURE, SPEED), SHELL)
    assert 1e3 * found.largest == pytest.approx(solved["every second"], rel=1e-2)


def test_one_roll_lost_between_sound_ones(solved: pd.Series) -> None:
    """Fewer sound rolls than the ODE solver had move it by half a per cent."""
    places = PITCH * np.delete(np.arange(7), 3)
    rolls = Rolls(tuple(places), (0.0,) * len(places), PRESSURE, SPEED)
    found = over_rolls(STRIP, rolls, SHELL)
    assert 1e3 * found.largest == pytest.approx(solved["one"], rel=1e-2)
    assert found.extremes()[1] == pytest.approx(places[2] + 0.62 * 2 * PITCH, abs=0.01)
