"""Fits polynomials to results, and to their derivatives where known.

Of second degree in variables and inputs, with the third power of each variable: along a taper a
corner may leave its wall. A run with derivatives counts as one plus the number of variables and
inputs, so that far fewer runs suffice (docs/mould_design.md).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array


@dataclass(frozen=True, slots=True)
class FitCost:
    """Numbers of runs for a polynomial, and their weights."""

    runs: float = 1.4  #: runs per coefficient
    equations: float = 4.3  #: equations per coefficient, for runs with derivatives
    #: weight of derivatives: the misfit is of fourth degree or more, so that its slope is at least
    #: four times its size
    slopes: float = 0.25


COST = FitCost()


def coefficients(variables: int, inputs: int) -> int:
    """Number of coefficients."""
    every = variables + inputs
    return 1 + every + every * (every + 1) // 2 + variables


def samples(variables: int, inputs: int, *, derivatives: bool = False) -> int:
    """Number of runs for a fit; without derivatives a power of two."""
    needed = coefficients(variables, inputs)
    if derivatives:
        enough = int(np.ceil(COST.equations * needed / (1 + variables + inputs)))
        return max(enough, least(variables, inputs, derivatives=True))
    return int(2 ** np.ceil(np.log2(COST.runs * needed)))


def least(variables: int, inputs: int, *, derivatives: bool) -> int:
    """Smallest number of runs that determines all coefficients if any run is left out.

    Derivatives at two points determine the curvature along the line between them: as many lines are
    needed as there are variables and inputs.
    """
    needed, every = coefficients(variables, inputs), variables + inputs
    return 1 + (max(every + 1, -(-needed // (1 + every))) if derivatives else needed)


def fit(
    places: Array, values: Array, variables: int, slopes: Array | None = None
) -> tuple[Callable[[Array], Array], Array]:
    """Return polynomials fitted to runs, and their errors at runs left out of the fit.

    Args:
        places: Points of the runs (r, n), variables first, each variable and input from -1 to 1.
        values: Results (r, m).
        variables: Number of variables.
        slopes: Derivatives by the points (r, m, n), NaN if unknown; None for none.

    Returns:
        Results (k, m) at points (k, n); root mean squares of the errors at each run when the
        polynomials are fitted to all others (m,).
    """
    rows, results = _equations(places, values, variables, slopes)
    each = len(rows) // len(places)
    weights, missed = np.zeros((rows.shape[1], values.shape[1])), np.zeros(values.shape)
    for j in range(values.shape[1]):
        known = ~np.isnan(results[:, j])
        matrix = np.where(known[:, None], rows, 0.0)
        aim = np.where(known, results[:, j], 0.0)
        inverse = np.linalg.pinv(matrix, rcond=1e-10)
        weights[:, j] = inverse @ aim
        left = aim - matrix @ weights[:, j]
        for i in range(len(places)):
            own = slice(i * each, (i + 1) * each)
            others = np.eye(each) - matrix[own] @ inverse[:, own]
            missed[i, j] = np.linalg.lstsq(others, left[own], rcond=1e-9)[0][0]
    return (lambda x: columns(x, variables) @ weights), np.sqrt(np.mean(missed**2, axis=0))


def _equations(
    places: Array, values: Array, variables: int, slopes: Array | None
) -> tuple[Array, Array]:
    """Rows of the coefficients and right-hand sides: for each run its value, then its slopes."""
    rows = columns(places, variables)
    if slopes is None:
        return rows, values
    by_place = [COST.slopes * _slopes(places, variables, i) for i in range(places.shape[1])]
    blocks = np.stack([rows, *by_place], axis=1)
    results = np.concatenate([values[:, None, :], COST.slopes * np.swapaxes(slopes, 1, 2)], axis=1)
    return blocks.reshape(-1, blocks.shape[2]), results.reshape(-1, results.shape[2])


def _powers(count: int, variables: int) -> list[tuple[int, ...]]:
    """Factors of each column: indices of variables and inputs."""
    every = range(count)
    squares = itertools.combinations_with_replacement(every, 2)
    return [(), *((i,) for i in every), *squares, *((i, i, i) for i in range(variables))]


def columns(x: Array, variables: int = 0) -> Array:
    """Values of 1, x_i, x_i x_j (i <= j) and, of the first variables, x_i^3 at points (r, n)."""
    factors = _powers(x.shape[1], variables)
    return np.column_stack([np.prod(x[:, list(one)], axis=1) for one in factors])


def _slopes(x: Array, variables: int, i: int) -> Array:
    """Derivatives of the columns by one variable or input, by the product rule."""
    found = []
    for one in _powers(x.shape[1], variables):
        rests = [[*one[:k], *one[k + 1 :]] for k, factor in enumerate(one) if factor == i]
        found.append(sum((np.prod(x[:, rest], axis=1) for rest in rests), np.zeros(len(x))))
    return np.column_stack(found)
