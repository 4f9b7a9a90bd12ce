"""Fits with and without derivatives find quadratics, and say how far anything else is from one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.optimum_fit import _Point, misses
from castfem.base.types import Array

PLACES = 2.0 * np.random.default_rng(1).random((36, 5)) - 1.0


def points(function: Callable[[Array], Array], slope: Callable[[Array], Array]) -> list[_Point]:
    return [_Point(x, function(x), slope(x), 0.0) for x in PLACES]


def quadratic(x: Array) -> Array:
    return np.array([1.0 + x[0] + 2.0 * x[1] * x[2], x[4] ** 2 - x[3] * x[0]])


def its_slope(x: Array) -> Array:
    return np.array([[1.0, 2.0 * x[2], 2.0 * x[1], 0.0, 0.0],
                     [-x[3], 0.0, 0.0, -x[0], 2.0 * x[4]]])  # fmt: skip


def test_quadratics_are_found_by_so_few_runs() -> None:
    """22 coefficients: by as many values, or by few points of six numbers."""
    given = points(quadratic, its_slope)
    assert misses(given[:28], given[28:], carries=False) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert misses(given[:6], given[28:], carries=True) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.all(misses(given[:12], given[28:], carries=False) > 0.01)


def test_what_is_no_quadratic_is_missed_by_what_it_is() -> None:
    """A kink of 0.3 in the first result alone."""

    def bent(x: Array) -> Array:
        return quadratic(x) + np.array([0.3 * abs(x[0]), 0.0])

    def its(x: Array) -> Array:
        return its_slope(x) + 0.3 * np.sign(x[0]) * np.eye(2, 5) * [[1.0], [0.0]]

    missed = misses(points(bent, its)[:28], points(bent, its)[28:], carries=True)
    assert 0.02 < missed[0] < 0.15
    assert missed[1] == pytest.approx(0.0, abs=1e-9)
