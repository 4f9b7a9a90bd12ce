"""The spread of an optimum by inputs that are not known exactly.

Runs at points of Sobol's sequence, in the box of the variables about the optimum and of the
ranges of the inputs together. Through them quadratics of objective and margins are laid, whose
error is that of each run against the fit to all others. By the quadratics, for many draws of the
inputs: results at the optimum, where the optimum would be, and their Sobol indices: of the first
order (share of the variance that one input alone makes) and total (with all that it makes together
with others).

Indices: [Saltelli2010] (docs/references.md), by `scipy.stats.sobol_indices`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.design.inputs import Uncertain
from castfem.design.outputs import Outputs
from castfem.design.question import Wanted
from castfem.design.vicinity import REACH, Quadratic, nearest_to_allowed
from castfem.values.types import Array

_MORE = 1.5  # runs over coefficients of the quadratics
_PLACES, _DRAWS = 2**11, 2**8
_TAILS = 0.05, 0.95
_SAFE = 0.95  # share of the draws in which a safe optimum meets its constraints
_SEED = 12


@dataclass(frozen=True, slots=True)
class Spread:
    """What the inputs do to an optimum.

    Attributes:
        labels: Of the inputs.
        results: Names of objective and bounded results, in order (1 + m).
        low: Of cost and margins at the optimum (1 + m,), 5 % of the draws lie below, SI.
        high: Likewise, 95 % lie below.
        error: Of the quadratics (1 + m,), SI: root mean square, each run by the fit to the others.
        met: Share of the draws in which each constraint is met at the optimum (m,).
        first: Sobol indices of the first order of cost and margins (1 + m, d). total: Likewise.
        place: Variables of the optimum (n, 2), 5 and 95 % of the draws, shares of the ranges.
        place_first: Sobol indices of each variable's best value (n, d). place_total: Likewise.
        open: Whether the draws lead to where the runs end, by variable.
        safe: The best place (n,) that meets all constraints in 95 % of the draws; None if there is
            none near.
        runs: How many were made, those in the idealised mould not counted. failed: Of these.
    """

    labels: tuple[str, ...]
    results: tuple[str, ...]
    low: Array
    high: Array
    error: Array
    met: Array
    first: Array
    total: Array
    place: Array
    place_first: Array
    place_total: Array
    open: tuple[bool, ...]
    safe: Array | None
    runs: int
    failed: int


def coefficients(variables: int) -> int:
    """How many coefficients a quadratic of some variables has."""
    return 1 + variables + variables * (variables + 1) // 2


def samples(variables: int) -> int:
    """How many runs are made for a spread, a power of two."""
    return int(2 ** np.ceil(np.log2(_MORE * coefficients(variables))))


def spread(outputs: Outputs, best: Wanted, model: Quadratic) -> Spread | None:
    """Return what the inputs do to an optimum; None where too many of the runs fail.

    Args:
        outputs: What runs mean; of its own, for its runs are none of the search.
        best: The best run.
        model: Quadratics about it, by which the box of the variables is chosen.

    Raises:
        Needs: Runs are missing.
    """
    question = outputs.question
    n, d = len(question.axes), len(question.inputs)
    low = np.clip(model.centre - REACH * model.step, 0.0, 1.0)
    high = np.clip(model.centre + REACH * model.step, 0.0, 1.0)
    points = _sobol(n + d, question.table.samples or samples(n + d))
    wanted = [
        _drawn(outputs, best.fidelity, low + point[:n] * (high - low), point[n:])
        for point in points
    ]
    outputs.fetch(wanted)
    values = np.array([outputs.vector(one) for one in wanted])
    fine = ~np.isnan(values).any(axis=1)
    if np.count_nonzero(fine) <= coefficients(n + d):
        return None
    where = np.array([_place(outputs, one, model) for one in wanted])
    fit, error = _fit(where[fine], values[fine])
    centre = np.zeros(n)
    draws = 2.0 * _sobol(d, _DRAWS) - 1.0
    here = fit(np.hstack([np.tile(centre, (len(draws), 1)), draws]))
    finder = _Finder(fit, (low - model.centre) / model.step, (high - model.centre) / model.step)
    found = finder.best(draws)
    ends = np.quantile(found, _TAILS, axis=0).T
    edge = 0.02 * (finder.high - finder.low)
    safe = finder.safe(draws)
    first, total = _indices(lambda x: fit(np.hstack([np.zeros((len(x), n)), x])), d)
    place_first, place_total = _indices(finder.best, d)
    shares = model.centre[:, None] + model.step[:, None] * ends
    return Spread(
        labels=tuple(one.label for one in question.inputs),
        results=(outputs.objective, *(outputs.name(i) for i in range(outputs.count))),
        low=np.quantile(here, _TAILS[0], axis=0), high=np.quantile(here, _TAILS[1], axis=0),
        error=error, met=np.mean(here[:, 1:] >= 0.0, axis=0), first=first, total=total,
        place=np.clip(shares, 0.0, 1.0), place_first=place_first, place_total=place_total,
        open=tuple(
            bool((lo > 0.0 and a <= e_lo + e) or (hi < 1.0 and b >= e_hi - e))
            for lo, hi, (a, b), e_lo, e_hi, e in zip(
                low, high, ends, finder.low, finder.high, edge, strict=True
            )
        ),
        safe=None if safe is None else model.centre + model.step * safe,
        runs=len(wanted), failed=int(np.count_nonzero(~fine)),
    )  # fmt: skip


def _sobol(dimensions: int, count: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(dimensions, seed=_SEED).random(count))


def _drawn(outputs: Outputs, fidelity: str, shares: Array, inputs: Array) -> Wanted:
    """The run at shares of the ranges of variables and inputs."""
    question = outputs.question
    at = question.at(shares, fidelity)
    drawn = zip(question.inputs, inputs, strict=True)
    return Wanted(at.values, at.fidelity, inputs=tuple(one.value(float(u)) for one, u in drawn))


def _place(outputs: Outputs, wanted: Wanted, model: Quadratic) -> Array:
    """Where a run is: variables in steps from the optimum, inputs from -1 to 1 (n + d,)."""
    question = outputs.question
    inputs = [_scaled(o, v) for o, v in zip(question.inputs, wanted.inputs, strict=True)]
    return np.array([*((question.shares(wanted) - model.centre) / model.step), *inputs])


def _scaled(one: Uncertain, value: float) -> float:
    return 2.0 * (value - one.low) / (one.high - one.low) - 1.0


def _columns(x: Array) -> Array:
    n = x.shape[1]
    squares = [x[:, i] * x[:, j] for i, j in itertools.combinations_with_replacement(range(n), 2)]
    return np.column_stack([np.ones(len(x)), *x.T, *squares])


def _fit(where: Array, values: Array) -> tuple[Callable[[Array], Array], Array]:
    """Quadratics of runs (r, n + d) with values (r, 1 + m), and their errors (1 + m,)."""
    columns = _columns(where)
    weights, *_ = np.linalg.lstsq(columns, values, rcond=1e-10)
    hat = columns @ np.linalg.pinv(columns, rcond=1e-10)
    left_out = (values - columns @ weights) / np.maximum(1.0 - np.diag(hat), 1e-6)[:, None]
    return (lambda x: _columns(x) @ weights), np.sqrt(np.mean(left_out**2, axis=0))


def _indices(function: Callable[[Array], Array], inputs: int) -> tuple[Array, Array]:
    """Sobol indices (results, inputs) of a function of inputs between -1 and 1."""
    from scipy import stats

    def twice(x: Array) -> Array:
        """A single result of a single input stands there twice: scipy fails at one number."""
        values = function(x.T).T
        return np.vstack([values, values]) if inputs == len(values) == 1 else values

    found = stats.sobol_indices(
        func=twice,
        n=_DRAWS,
        dists=[stats.uniform(-1.0, 2.0)] * inputs,
        rng=np.random.default_rng(_SEED),
    )
    shape = -1, inputs
    with np.errstate(invalid="ignore"):
        parts = [np.reshape(part, shape) for part in (found.first_order, found.total_order)]
    first, total = (np.clip(np.nan_to_num(part), 0.0, 1.0) for part in parts)
    count = np.shape(function(np.zeros((1, inputs))))[1]
    return first[:count], total[:count]


class _Finder:
    """Finds the optimum of quadratics for given inputs, among many places about it.

    Args:
        fit: The quadratics. low: Of the box of the variables, in steps (n,). high: Likewise.
    """

    def __init__(self, fit: Callable[[Array], Array], low: Array, high: Array) -> None:
        self._fit, self.low, self.high = fit, low, high
        self._places = low + _sobol(len(low), _PLACES) * (high - low)

    def _values(self, inputs: Array) -> Array:
        """Cost and margins at all places for one draw (places, 1 + m)."""
        drawn = np.tile(inputs, (len(self._places), 1))
        return self._fit(np.hstack([self._places, drawn]))

    def best(self, draws: Array) -> Array:
        """The best place (draws, n) for each draw of the inputs (draws, d)."""
        found = []
        for inputs in draws:
            values = self._values(inputs)
            scale = np.std(values[:, 1:], axis=0)
            allowed = nearest_to_allowed(values[:, 1:], scale)
            found.append(self._places[allowed][np.argmin(values[allowed, 0])])
        return np.array(found)

    def safe(self, draws: Array) -> Array | None:
        """The place of least mean cost that meets all constraints in most draws (n,)."""
        met, cost = np.zeros(len(self._places)), np.zeros(len(self._places))
        for inputs in draws:
            values = self._values(inputs)
            met += np.all(values[:, 1:] >= 0.0, axis=1)
            cost += values[:, 0]
        sound = met >= _SAFE * len(draws)
        if not np.any(sound):
            return None
        return np.asarray(self._places[sound][np.argmin(cost[sound])])
