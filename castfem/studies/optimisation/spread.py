"""The spread of an optimum due to uncertain inputs.

Runs are made at points of Sobol's sequence, in the variables around the optimum and the ranges of
the inputs together. Polynomials of objective and margins are fitted to them, and to their
derivatives if available; the error is that of each run against the fit to all others. For many
draws of the inputs they give results at the optimum, the optimum itself, and Sobol indices: of
first order (fraction of the variance due to one input alone) and total (with all of its
interactions).

Indices: [Saltelli2010] (docs/references.md), by `scipy.stats.sobol_indices`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array, Flags
from castfem.studies.optimisation.local_model import Quadratic, nearest_to_allowed
from castfem.studies.optimisation.polynomial_fit import fit, least, samples
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.responses import Responses


@dataclass(frozen=True, slots=True)
class SpreadSettings:
    """Settings of the sampling for the spread of an optimum."""

    places: int = 2**11  #: points in the box of the variables
    draws: int = 2**8  #: draws of the inputs
    tails: tuple[float, float] = (0.05, 0.95)  #: reported quantiles
    edge: float = 0.04  #: relative distance from the end of the box that counts as there
    safe: float = 0.95  #: fraction of the draws in which a safe optimum meets its constraints
    seed: int = 12  #: seed of the random numbers


SPREAD = SpreadSettings()


@dataclass(frozen=True, slots=True)
class InputSpread:
    """Effect of the inputs on an optimum."""

    low: Array  #: 5 % quantiles of cost and margins at the optimum (1 + m,), SI
    high: Array  #: 95 % quantiles of cost and margins at the optimum (1 + m,), SI
    #: error of the fit (1 + m,), SI: root mean square, each run against the fit to the others
    error: Array
    met: Array  #: fraction of the draws in which each constraint is met at the optimum (m,)
    first: Array  #: first-order Sobol indices of cost, margins and best values (1 + m + n, d)
    total: Array  #: total Sobol indices (1 + m + n, d)
    place: Array  #: best values (n, 2), 5 and 95 % quantiles of the draws, fractions of the ranges
    open: Flags  #: whether they reach the limits of the runs, by variable (n,)
    safe: Array | None  #: best point (n,) that meets all constraints in 95 % of the draws, if any
    runs: int  #: number of runs, without those in the idealised mould
    failed: int  #: number of failed ones among them
    derivatives: bool  #: whether they have derivatives


@dataclass(frozen=True, slots=True)
class _Box:
    """The box of the runs, in which each variable and each input goes from -1 to 1."""

    middle: Array  #: centre, of the variables (n,), fractions of the ranges
    half: Array  #: half width

    def shares(self, place: Array) -> Array:
        """Fractions of the ranges at points of the variables (..., n)."""
        return np.asarray(self.middle + self.half * place)

    def place(self, shares: Array) -> Array:
        """Inverse of `shares`."""
        return np.asarray((shares - self.middle) / self.half)

    def open(self, ends: Array) -> Flags:
        """Whether intervals with some ends (n, 2) reach the limits of the runs, by variable."""
        below = (self.middle - self.half > 0.0) & (ends[:, 0] <= SPREAD.edge - 1.0)
        above = (self.middle + self.half < 1.0) & (ends[:, 1] >= 1.0 - SPREAD.edge)
        return np.asarray(below | above)


def input_spread(
    responses: Responses, best: RunRequest, model: Quadratic, *, derivatives: bool = False
) -> InputSpread | None:
    """Return the effect of the inputs on an optimum; None if too many of the runs fail.

    Args:
        responses: Responses of the runs, separate from those of the search.
        best: The best run.
        model: Quadratics around it, which determine the box of the variables.
        derivatives: Whether runs can compute derivatives; if one has none, more runs are made.
    """
    problem, (low, high) = responses.problem, model.box
    n, d = len(problem.variables), len(problem.inputs)
    box = _Box(0.5 * (low + high), 0.5 * (high - low))
    places, values, slopes = _runs(responses, best, box, derivatives)
    fine = ~np.isnan(values).any(axis=1)
    if np.count_nonzero(fine) < least(n, d, derivatives=slopes is not None):
        return None
    polynomials, error = fit(
        places[fine], values[fine], n, None if slopes is None else slopes[fine]
    )
    centre, draws = box.place(model.centre), 2.0 * _sobol(d, SPREAD.draws) - 1.0

    def at_optimum(inputs: Array) -> Array:
        return polynomials(np.hstack([np.tile(centre, (len(inputs), 1)), inputs]))

    here, finder = at_optimum(draws), _Finder(polynomials, n)
    ends, safe = np.quantile(finder.best(draws), SPREAD.tails, axis=0).T, finder.safe(draws)
    indices = zip(_indices(at_optimum, d), _indices(finder.best, d), strict=True)
    first, total = (np.vstack(pair) for pair in indices)
    return InputSpread(
        low=np.quantile(here, SPREAD.tails[0], axis=0),
        high=np.quantile(here, SPREAD.tails[1], axis=0),
        error=error, met=np.mean(here[:, 1:] >= 0.0, axis=0), first=first, total=total,
        place=np.clip(box.shares(ends.T).T, 0.0, 1.0), open=box.open(ends),
        safe=None if safe is None else box.shares(safe), runs=len(values),
        failed=int(np.count_nonzero(~fine)), derivatives=slopes is not None,
    )  # fmt: skip


def _sobol(dimensions: int, count: int) -> Array:
    from scipy.stats import qmc

    points = qmc.Sobol(dimensions, seed=SPREAD.seed).random_base2((count - 1).bit_length())
    return np.asarray(points[:count])


def _runs(
    responses: Responses, best: RunRequest, box: _Box, derivatives: bool
) -> tuple[Array, Array, Array | None]:
    """Points of the runs (r, n + d), cost and margins (r, 1 + m) and their slopes by the points.

    Slopes (r, 1 + m, n + d) if all runs have them; otherwise further runs are made.
    """
    problem = responses.problem
    n, d = len(problem.variables), len(problem.inputs)
    asked = problem.table.samples or samples(n, d, derivatives=derivatives)
    requests, places = [], []
    for point in _sobol(n + d, max(asked, least(n, d, derivatives=derivatives))):
        values = problem.request(box.shares(2.0 * point[:n] - 1.0)).values
        pairs = list(zip(problem.inputs, point[n:], strict=True))
        inputs = tuple(one.value(float(share)) for one, share in pairs)
        one = RunRequest(values, best.fidelity, inputs=inputs, derivatives=derivatives)
        drawn = zip(problem.inputs, inputs, strict=True)
        scaled = [2.0 * (value - u.low) / (u.high - u.low) - 1.0 for u, value in drawn]
        requests.append(one)
        places.append([*box.place(problem.shares(one)), *scaled])
    responses.fetch(requests)
    vectors = np.array([responses.vector(one) for one in requests])
    if not derivatives:
        return np.array(places), vectors, None
    missing, width = np.full((vectors.shape[1], n + d), np.nan), np.array([*box.half, *[0.5] * d])
    failed = [responses.seen[one].failed for one in requests]
    slopes = [missing if bad else responses.slopes(one)
              for one, bad in zip(requests, failed, strict=True)]  # fmt: skip
    known = [one for one in slopes if one is not None]
    if len(known) < len(slopes):
        return _runs(responses, best, box, derivatives=False)
    return np.array(places), vectors, np.array(known) * width


def _indices(function: Callable[[Array], Array], inputs: int) -> tuple[Array, Array]:
    """Sobol indices (results, inputs) of a function of inputs between -1 and 1."""
    from scipy import stats

    def twice(x: Array) -> Array:
        """A single result of a single input is repeated, since scipy fails for one number."""
        values = function(x.T).T
        return np.vstack([values, values]) if inputs == len(values) == 1 else values

    found = stats.sobol_indices(
        func=twice,
        n=SPREAD.draws,
        dists=[stats.uniform(-1.0, 2.0)] * inputs,
        rng=np.random.default_rng(SPREAD.seed),
    )
    with np.errstate(invalid="ignore"):
        parts = [np.reshape(part, (-1, inputs)) for part in (found.first_order, found.total_order)]
    count = np.shape(function(np.zeros((1, inputs))))[1]
    first, total = (np.clip(np.nan_to_num(part), 0.0, 1.0)[:count] for part in parts)
    return first, total


class _Finder:
    """Finds the optimum of polynomials for given inputs, among many points in the box."""

    def __init__(self, polynomials: Callable[[Array], Array], variables: int) -> None:
        self._polynomials, self._places = polynomials, 2.0 * _sobol(variables, SPREAD.places) - 1.0

    def _values(self, inputs: Array) -> Array:
        """Cost and margins at all points for one draw (points, 1 + m)."""
        drawn = np.tile(inputs, (len(self._places), 1))
        return self._polynomials(np.hstack([self._places, drawn]))

    def best(self, draws: Array) -> Array:
        """The best point (draws, n) for each draw of the inputs (draws, d)."""
        found = []
        for inputs in draws:
            values = self._values(inputs)
            allowed = nearest_to_allowed(values[:, 1:], np.std(values[:, 1:], axis=0))
            found.append(self._places[allowed][np.argmin(values[allowed, 0])])
        return np.array(found)

    def safe(self, draws: Array) -> Array | None:
        """The point of least mean cost that meets all constraints in most draws (n,)."""
        met, cost = np.zeros(len(self._places)), np.zeros(len(self._places))
        for inputs in draws:
            values = self._values(inputs)
            met += np.all(values[:, 1:] >= 0.0, axis=1)
            cost += values[:, 0]
        sound = met >= SPREAD.safe * len(draws)
        return np.asarray(self._places[sound][np.argmin(cost[sound])]) if np.any(sound) else None
