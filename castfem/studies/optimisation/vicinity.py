"""What lies round an optimum: slopes, the cost of a step, and how sure its place is.

Quadratics are fitted to the runs near the optimum. Of two runs near to one another the numerical
error is nearly the same: it moves a bound rather than which of two has the smaller objective.
So the place of the optimum is as sure as
    - the scatter of the objective (noise, and what the quadratic leaves) against its curvature: all
      values whose objective is not worse by more than that,
    - the error of the constraints (numerical error, noise, misfit) against their slopes: the optima
      of bounds that are moved by it,
    - where bounds do not hold all variables, what the numerical error of the objective changes from
      neighbour to neighbour: its tilt.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.studies.optimisation.numerical import Numerical

REACH = 2.5  # steps from the optimum to which the quadratics are held
_SAMPLES = 2**14
_LINE = 4001
_PARTS = 1.0 / 3.0, 2.0 / 3.0, 1.0  # of the largest error of margins, and of that of the cost


@dataclass(frozen=True, slots=True)
class Quadratic:
    """Results near an optimum as quadratics of the variables.

    Attributes:
        centre: The optimum (n,), shares of the ranges. step: The units of length of the fit (n,).
        weights: (k, 1 + m), of 1, d_i, d_i d_j (i <= j).
        misfit: What the runs scatter about it (1 + m,), SI.
    """

    centre: Array
    step: Array
    weights: Array
    misfit: Array

    @classmethod
    def fit(cls, centre: Array, step: Array, shares: Array, values: Array) -> Quadratic:
        """Fit runs (r, n) with cost and margins (r, 1 + m); those beyond reach do not count."""
        near = np.max(np.abs(shares - centre) / step, axis=1) <= REACH * (1.0 + 1e-9)
        near &= ~np.isnan(values).any(axis=1)
        columns = _columns(np.asarray((shares[near] - centre) / step))
        weights, _, rank, _ = np.linalg.lstsq(columns, values[near], rcond=1e-8)
        rest = values[near] - columns @ weights
        free = max(len(columns) - int(rank), 1)
        return cls(centre, step, weights, np.sqrt(np.sum(rest**2, axis=0) / free))

    def __call__(self, shares: Array) -> Array:
        """Cost and margins (r, 1 + m) at some places (r, n)."""
        return np.asarray(_columns((shares - self.centre) / self.step) @ self.weights)


def _columns(d: npt.NDArray[np.floating[Any]]) -> Array:
    n = d.shape[1]
    squares = [d[:, i] * d[:, j] for i, j in itertools.combinations_with_replacement(range(n), 2)]
    return np.column_stack([np.ones(len(d)), *d.T, *squares])


@dataclass(frozen=True, slots=True)
class Interval:
    """Where an optimum may lie along one variable.

    Attributes:
        low: Share of the range. high: Likewise.
        open_low: Whether it may lie below, where the quadratics end. open_high: Likewise.
    """

    low: float
    high: float
    open_low: bool
    open_high: bool


def intervals(
    model: Quadratic, scatter: Array, error: Numerical, shares: Array, seen: Array
) -> list[Interval]:
    """Return where the optimum may lie, one interval a variable.

    Runs that are better, and far from the optimum, miss a constraint: by less than its error
    perhaps, and then the optimum may lie there.

    Args:
        model: Of the runs near it.
        scatter: Of cost and margins (1 + m,), SI: noise.
        error: Numerical error of cost and margins. That of the cost counts by how it changes alone.
        shares: Of the ranges, of all runs (r, n).
        seen: What they gave: cost and margins (r, 1 + m), NaN where they have failed.
    """
    near, low, high = _places(model)
    values = model(near)
    beside = float(scatter[0] + model.misfit[0])
    best = seen[np.argmin(np.max(np.abs(shares - model.centre), axis=1))]
    far = np.any((shares < low) | (shares > high), axis=1)
    far &= seen[:, 0] < best[0] - beside  # what has failed is not
    beyond = seen[far] - best + values[-1]  # against the best run as the quadratics have it
    places, values = np.vstack([shares[far], near]), np.vstack([beyond, values])
    moved, pairs = _errors(scatter[1:] + model.misfit[1:], error)
    kept = np.zeros(len(places), dtype=bool)
    kept[-1] = True
    for shift, tilt in pairs:
        here = slice(np.count_nonzero(far) if tilt else 0, None)  # it is linear near by alone
        allowed = nearest_to_allowed(values[here, 1:] + shift, moved)
        cost = values[here, 0] + error.tilted(places[here], tilt)
        kept[here] |= allowed & (cost <= np.min(cost[allowed]) + beside)
    found = places[kept]
    ends = zip(found.min(axis=0), found.max(axis=0), low, high, strict=True)
    edge = 0.02 * (high - low)
    return [
        Interval(
            float(a), float(b),
            bool(lo > 0.0 and a <= lo + e), bool(hi < 1.0 and b >= hi - e),
        )
        for (a, b, lo, hi), e in zip(ends, edge, strict=True)
    ]  # fmt: skip


def _errors(blurred: Array, error: Numerical) -> tuple[Array, list[tuple[Array, float]]]:
    """What margins may be off by (m,), and all that margins and cost may be moved by together.

    Args:
        blurred: Scatter of the margins and misfit of their quadratics (m,), SI.
        error: Numerical error of cost and margins.
    """
    up, down = blurred + error.above[1:], -blurred - error.below[1:]
    count = len(blurred)
    most = [*np.diag(up), *np.diag(down), *([up, down] if count > 1 else [])]
    shifts = [np.zeros(count), *(part * end for end in most for part in _PARTS)]
    tilts = [0.0, *(part * error.most for part in _PARTS)] if error.tilt is not None else [0.0]
    pairs = list(itertools.product(shifts, tilts))
    if error.better:
        pairs.append((error.moved[1:], 0.0))
    return np.maximum(up, -down), pairs


def nearest(model: Quadratic, off: Array, binds: Sequence[bool]) -> Array:
    """Return the place nearest to an optimum where what binds is just met, and all else is met.

    Near an optimum every way that meets a moved bound costs the same, to first order: the nearest
    place is as good as any, and there the quadratics hold best.

    Args:
        model: Of the runs about the optimum.
        off: By how much margins are larger than it says (m,), SI.
        binds: Which of them bind.

    Returns:
        Shares of the ranges (n,). Where no place within reach does so, that which comes nearest.
    """
    if not len(off):
        return model.centre
    from scipy.optimize import minimize

    scale = np.max(np.abs(model.weights[1:, 1:]), axis=0)  # what a step does
    scale = np.maximum(np.where(scale > 0.0, scale, 1.0), 1e-9 * np.abs(off))
    ends = (np.clip(model.centre + e * REACH * model.step, 0.0, 1.0) for e in (-1.0, 1.0))
    low, high = ((end - model.centre) / model.step for end in ends)

    def margins(steps: Array) -> Array:
        place = model.centre + steps * model.step
        return np.asarray((model(place[None])[0, 1:] + off) / scale)

    kinds = {"eq": np.flatnonzero(binds), "ineq": np.flatnonzero(np.logical_not(binds))}
    with warnings.catch_warnings():  # of rounding at the ends of the box
        warnings.simplefilter("ignore", RuntimeWarning)
        found = minimize(
            lambda steps: float(steps @ steps), np.zeros(len(low)), jac=lambda steps: 2.0 * steps,
            method="SLSQP", bounds=list(zip(low, high, strict=True)),
            constraints=[
                {"type": kind, "fun": lambda steps, which=which: margins(steps)[which]}
                for kind, which in kinds.items() if len(which)
            ],
        )  # fmt: skip
    if found.success:
        return np.asarray(np.clip(model.centre + found.x * model.step, 0.0, 1.0))
    places, _, _ = _places(model)
    left = model(places)[:, 1:] + off
    left = np.where(binds, -np.abs(left), left)  # what binds is to be met, and no more than that
    places = places[nearest_to_allowed(left, scale)]
    far = np.linalg.norm((places - model.centre) / model.step, axis=1)
    return np.asarray(places[np.argmin(far)])


def better_without(model: Quadratic, scatter: Array) -> list[bool]:
    """Return of each constraint whether the objective near an optimum would be better without it.

    Args:
        model: Of the runs near the optimum.
        scatter: Of cost and margins (1 + m,), SI; what is gained must be more.
    """
    places, _, _ = _places(model)
    values, scale = model(places), scatter[1:] + model.misfit[1:]
    least = np.min(values[nearest_to_allowed(values[:, 1:], scale), 0])
    found = []
    for i in range(len(scale)):
        others = np.delete(values[:, 1:], i, axis=1)
        allowed = nearest_to_allowed(others, np.delete(scale, i))
        found.append(bool(np.min(values[allowed, 0]) < least - scatter[0] - model.misfit[0]))
    return found


def _places(model: Quadratic) -> tuple[Array, Array, Array]:
    """Places where a model holds (r, n), the last one its centre, and the ends of their box."""
    low = np.clip(model.centre - REACH * model.step, 0.0, 1.0)
    high = np.clip(model.centre + REACH * model.step, 0.0, 1.0)
    return np.vstack([_sampled(low, high), model.centre]), low, high


def nearest_to_allowed(margins: Array, scale: Array) -> npt.NDArray[np.bool_]:
    """Which of some places meet all margins (r, m), or miss them least; m may be 0."""
    if not margins.shape[1]:
        return np.ones(len(margins), dtype=bool)
    missed = -margins / np.maximum(scale, 1e-300)
    short = np.max(np.maximum(missed, 0.0), axis=1)
    return np.asarray(short <= np.min(short) + 1e-9)


def _sampled(low: Array, high: Array) -> Array:
    """Places that fill a box: evenly spaced in one dimension, Sobol's in more."""
    if len(low) == 1:
        return np.asarray(np.linspace(low, high, _LINE), dtype=np.float64)
    from scipy.stats import qmc

    points = qmc.Sobol(len(low), scramble=False).random(_SAMPLES)
    return np.asarray(low + points * (high - low))


def around(centre: Array, step: Array, steps: Sequence[int] = (1, 2)) -> list[Array]:
    """Return the places along each variable through an optimum: some steps to either side.

    Where a range ends before, there are none.
    """
    found: list[Array] = []
    for i in range(len(centre)):
        below = [k for k in (-j for j in steps) if centre[i] + k * step[i] >= -1e-9]
        above = [k for k in steps if centre[i] + k * step[i] <= 1.0 + 1e-9]
        for k in sorted([*below, *above]):
            place = np.array(centre)
            place[i] = np.clip(centre[i] + k * step[i], 0.0, 1.0)
            found.append(place)
    return found
