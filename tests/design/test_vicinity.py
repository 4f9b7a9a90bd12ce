"""Where an optimum goes when its margins are those of another level."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.design.numerical import Numerical
from castfem.design.vicinity import REACH, Quadratic, moved_best
from castfem.values.types import Array

CENTRE, STEP = np.array([0.5, 0.4]), np.array([0.05, 0.05])
MOVED = -0.01  # of the margin


def valley(slope: float, bent: float = 0.0) -> Quadratic:
    """A cost that rises along x and by `slope` along y, under the margin x >= 0.5 of its runs.

    Where `bent`, the runs have something between them that no quadratic has.
    """
    grid = np.linspace(-REACH, REACH, 7)
    offsets = np.array([[a, b] for a in grid for b in grid])
    shares = CENTRE + offsets * STEP
    cost = 10.0 + 40.0 * (shares[:, 0] - 0.5) - slope * (shares[:, 1] - 0.4)
    cost = cost + bent * (-1.0) ** np.arange(len(cost))
    return Quadratic.fit(CENTRE, STEP, shares, np.column_stack([cost, shares[:, 0] - 0.5]))


def moved(model: Quadratic, noise: float, margin: float = MOVED) -> Array:
    here = np.array([10.0, 0.0])
    error = Numerical.of("default", {"default": here, "fine": here + np.array([0.3, margin])})
    return moved_best(model, np.array([noise, 0.0]), error)


def test_what_the_cost_does_not_tell_apart_stays():
    """Along y the cost falls by less than its noise: only x has to move, by what is missed."""
    found = moved(valley(slope=0.2), noise=0.05)
    assert found == pytest.approx(CENTRE + np.array([-MOVED, 0.0]), abs=0.1 * STEP[0])


def test_what_runs_leave_of_the_quadratic_counts_as_noise():
    found = moved(valley(slope=0.2, bent=0.05), noise=0.0)
    assert found == pytest.approx(CENTRE + np.array([-MOVED, 0.0]), abs=0.1 * STEP[0])


def test_a_cost_that_falls_is_followed():
    """By more than its noise along y, to where the quadratics end less what the noise hides."""
    x, y = moved(valley(slope=8.0), noise=0.05)
    assert x == pytest.approx(CENTRE[0] - MOVED, abs=0.1 * STEP[0])
    assert y > CENTRE[1] + (REACH - 0.5) * STEP[1]


def test_an_optimum_that_keeps_its_margins_stays_where_it_is():
    assert moved(valley(slope=0.2), noise=0.5, margin=-MOVED) == pytest.approx(CENTRE, abs=1e-12)
