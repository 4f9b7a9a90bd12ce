"""Polynomials through runs and their derivatives: exact ones, runs left out, what is not known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.studies.optimisation import polynomial_fit
from castfem.studies.optimisation.polynomial_fit import coefficients, fit, least, samples


def cubic(x: Array) -> tuple[Array, Array]:
    """Two results of a variable and two inputs at places (r, 3), and derivatives (r, 2, 3)."""
    a, b, c = x.T
    values = np.column_stack([1.0 + 2.0 * a - b * c + a**3, 3.0 * c - a * b])
    one = np.column_stack([2.0 + 3.0 * a**2, -c, -b])
    other = np.column_stack([-b, -a, np.full_like(a, 3.0)])
    return values, np.stack([one, other], axis=1)


def bent(x: Array) -> tuple[Array, Array]:
    """A result that is no quadratic, and its derivatives."""
    a, b, c = x.T
    slopes = np.column_stack([4.0 * np.cos(4.0 * a) * b, np.sin(4.0 * a), 2.0 * c])
    return (np.sin(4.0 * a) * b + c**2)[:, None], slopes[:, None]


def drawn(count: int) -> Array:
    return 2.0 * np.random.default_rng(3).random((count, 3)) - 1.0


@pytest.mark.parametrize("carrying", [True, False])
def test_polynomials_are_found_again(carrying: bool) -> None:
    """By as few runs as are allowed, whichever of them is left out."""
    places = drawn(least(1, 2, derivatives=carrying))
    values, slopes = cubic(places)
    laid, missed = fit(places, values, 1, slopes if carrying else None)
    there = drawn(40)
    assert laid(there) == pytest.approx(cubic(there)[0], abs=1e-8)
    assert missed == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("carrying", [True, False])
def test_what_is_missed_is_that_of_fits_to_the_others(carrying: bool) -> None:
    places = drawn(18)
    values, slopes = bent(places)
    left = []
    for i in range(len(places)):
        rest = np.arange(len(places)) != i
        laid, _ = fit(places[rest], values[rest], 1, slopes[rest] if carrying else None)
        left.append(laid(places[i : i + 1])[0, 0] - values[i, 0])
    _, missed = fit(places, values, 1, slopes if carrying else None)
    assert missed[0] == pytest.approx(np.sqrt(np.mean(np.square(left))), rel=1e-9)
    assert missed[0] > 0.1


def test_a_derivative_that_is_not_known_is_no_equation() -> None:
    places = drawn(9)
    values, slopes = cubic(places)
    slopes[2, 0, 1] = slopes[5, 1, :] = np.nan
    laid, missed = fit(places, values, 1, slopes)
    there = drawn(40)
    assert laid(there) == pytest.approx(cubic(there)[0], abs=1e-8)
    assert missed == pytest.approx(0.0, abs=1e-8)


def test_how_many_runs() -> None:
    """As docs/mould_design.md has measured them for a taper and four inputs."""
    assert (coefficients(1, 4), samples(1, 4), samples(1, 4, derivatives=True)) == (22, 32, 16)
    for variables, inputs in itertools.product(range(1, 5), range(1, 7)):
        for carrying in (True, False):
            few = least(variables, inputs, derivatives=carrying)
            assert samples(variables, inputs, derivatives=carrying) >= few


@pytest.mark.parametrize("variables", [1, 2, 4])
@pytest.mark.parametrize("inputs", [1, 3])
def test_the_least_number_is_enough(variables: int, inputs: int) -> None:
    """Any polynomial of the kind is found from so few, and one less, with and without slopes."""
    every = variables + inputs
    random = np.random.default_rng(1)
    weights = random.random(coefficients(variables, inputs))

    def given(x: Array) -> tuple[Array, Array]:
        step = 1e-5 * np.eye(every)
        columns = polynomial_fit.columns
        by = [columns(x + h, variables) - columns(x - h, variables) for h in step]
        slopes = np.stack([b @ weights / 2e-5 for b in by], axis=1)
        return (columns(x, variables) @ weights)[:, None], slopes[:, None, :]

    for carrying in (True, False):
        places = 2.0 * random.random((least(variables, inputs, derivatives=carrying), every)) - 1.0
        values, slopes = given(places)
        laid, missed = fit(places, values, variables, slopes if carrying else None)
        there = 2.0 * random.random((20, every)) - 1.0
        assert laid(there) == pytest.approx(given(there)[0], abs=1e-5)
        assert missed == pytest.approx(0.0, abs=1e-3)
