"""The error of a derivative is its scatter about a smooth curve while the shell grows."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.studies.sensitivity.fronts import FRONTS, Scatter

CELL = 1e-3


def followed(depths: np.ndarray, slopes: np.ndarray, zone: int = 0) -> Scatter:
    found = Scatter()
    for depth, row in zip(depths, slopes, strict=True):
        if found.due(zone, depth, CELL):
            found.add(depth, CELL, list(row))
    return found


def test_a_smooth_derivative_has_none() -> None:
    depth = np.linspace(0.0, 20e-3, 400)
    smooth = 3.0 + 200.0 * depth - 4e4 * depth**2
    assert followed(depth, smooth[:, None]).errors(1) == pytest.approx([0.0], abs=1e-9)


def test_steps_from_cell_to_cell_have_their_rms() -> None:
    """A wave of amplitude a whose length is a cell: a/sqrt(2)."""
    depth = np.linspace(0.0, 20e-3, 2000)
    waves = np.stack([0.5 * np.sin(2.0 * np.pi * depth / (7.0 * FRONTS.apart * CELL))] * 2, axis=1)
    errors = followed(depth, waves * [1.0, 10.0]).errors(2)
    assert errors == pytest.approx(
        FRONTS.times * 0.5 / np.sqrt(2.0) * np.array([1.0, 10.0]), rel=0.15
    )


def test_readings_are_a_part_of_a_cell_apart_and_of_one_zone() -> None:
    depth = np.linspace(0.0, 30e-3, 3001)
    found = followed(depth, depth[:, None])
    steps = np.diff([row[0] for row in found.rows])
    assert steps == pytest.approx(FRONTS.apart * CELL, rel=0.05)
    assert found.rows[-1][0] - found.rows[0][0] <= FRONTS.cells * CELL
    assert found.due(1, depth[-1], CELL) and found.rows == []


def test_with_few_readings_or_without_a_front_it_is_not_known() -> None:
    depth = np.linspace(0.0, (FRONTS.fewest - 1.5) * FRONTS.apart * CELL, 200)
    assert np.isnan(followed(depth, depth[:, None]).errors(1)).all()
    assert not Scatter().due(0, 0.0, np.nan)
    assert np.isnan(Scatter().errors(3)).all()
    depth = np.linspace(0.0, 20e-3, 400)
    slopes = np.stack([depth, np.where(depth > 10e-3, np.nan, 1.0)], axis=1)
    errors = followed(depth, slopes).errors(2)
    assert errors[0] < 1e-9 and np.isnan(errors[1])
