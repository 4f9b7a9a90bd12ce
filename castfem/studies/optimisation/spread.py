"""The spread of an optimum by inputs that are not known exactly.

Runs at points of Sobol's sequence, in the box of the variables about the optimum and of the
ranges of the inputs together. Through them, and through their derivatives where runs carry these,
polynomials of objective and margins are laid, whose error is that of each run against the fit to
all others. By these, for many draws of the inputs: results at the optimum, where the optimum would
be, and their Sobol indices: of the first order (share of the variance that one input alone makes)
and total (with all that it makes together with others).

Indices: [Saltelli2010] (docs/references.md), by `scipy.stats.sobol_indices`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.studies.optimisation.inputs import Uncertain
from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Wanted
from castfem.studies.optimisation.response import fit, least, samples
from castfem.studies.optimisation.vicinity import REACH, Quadratic, nearest_to_allowed

_PLACES, _DRAWS = 2**11, 2**8
_TAILS = 0.05, 0.95
_EDGE = 0.04  # of half the box: how near its end counts as there
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
        error: Of the fit (1 + m,), SI: root mean square, each run by the fit to the others.
        met: Share of the draws in which each constraint is met at the optimum (m,).
        first: Sobol indices of the first order of cost and margins (1 + m, d). total: Likewise.
        place: Variables of the optimum (n, 2), 5 and 95 % of the draws, shares of the ranges.
        place_first: Sobol indices of each variable's best value (n, d). place_total: Likewise.
        open: Whether the draws lead to where the runs end, by variable.
        safe: The best place (n,) that meets all constraints in 95 % of the draws; None if there is
            none near.
        runs: How many were made, those in the idealised mould not counted. failed: Of these.
        carried: Whether they have told their derivatives.
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
    carried: bool


@dataclass(frozen=True, slots=True)
class _Box:
    """Where the runs are: each variable and each input goes from -1 to 1 over it.

    Attributes:
        middle: Of the variables (n,), shares of the ranges.
        half: From there to either side.
    """

    middle: Array
    half: Array

    @classmethod
    def about(cls, model: Quadratic) -> _Box:
        """That in which quadratics about an optimum hold."""
        low = np.clip(model.centre - REACH * model.step, 0.0, 1.0)
        high = np.clip(model.centre + REACH * model.step, 0.0, 1.0)
        return cls(0.5 * (low + high), 0.5 * (high - low))

    def shares(self, place: Array) -> Array:
        """Shares of the ranges at places of the variables (..., n)."""
        return np.asarray(self.middle + self.half * place)

    def place(self, shares: Array) -> Array:
        """The inverse of `shares`."""
        return np.asarray((shares - self.middle) / self.half)

    def open(self, ends: Array) -> tuple[bool, ...]:
        """Whether what lies between some ends (n, 2) goes on beyond the runs, by variable."""
        below = (self.middle - self.half > 0.0) & (ends[:, 0] <= _EDGE - 1.0)
        above = (self.middle + self.half < 1.0) & (ends[:, 1] >= 1.0 - _EDGE)
        return tuple(bool(one) for one in below | above)


@dataclass(frozen=True, slots=True)
class _Made:
    """The runs that a spread is laid through.

    Attributes:
        places: In the box (r, n + d).
        values: Cost and margins (r, 1 + m); NaN of those that have failed.
        slopes: Their derivatives by the places (r, 1 + m, n + d); None without.
    """

    places: Array
    values: Array
    slopes: Array | None

    @property
    def fine(self) -> npt.NDArray[np.bool_]:
        """Which have come to their end (r,)."""
        return np.asarray(~np.isnan(self.values).any(axis=1))


def spread(
    outputs: Outputs, best: Wanted, model: Quadratic, *, carries: bool = False
) -> Spread | None:
    """Return what the inputs do to an optimum; None where too many of the runs fail.

    Args:
        outputs: What runs mean; of its own, for its runs are none of the search.
        best: The best run.
        model: Quadratics about it, by which the box of the variables is chosen.
        carries: Whether the runs may carry derivatives; if one of them tells none, more are made.

    Raises:
        Needs: Runs are missing.
    """
    question, box = outputs.question, _Box.about(model)
    n, d = len(question.axes), len(question.inputs)
    made = _made(outputs, best, box, carries)
    fine, carried = made.fine, made.slopes is not None
    if np.count_nonzero(fine) < least(n, d, carrying=carried):
        return None
    slopes = None if made.slopes is None else made.slopes[fine]
    laid, error = fit(made.places[fine], made.values[fine], n, slopes)
    centre, draws = box.place(model.centre), 2.0 * _sobol(d, _DRAWS) - 1.0

    def at_optimum(inputs: Array) -> Array:
        return laid(np.hstack([np.tile(centre, (len(inputs), 1)), inputs]))

    here, finder = at_optimum(draws), _Finder(laid, n)
    ends, safe = np.quantile(finder.best(draws), _TAILS, axis=0).T, finder.safe(draws)
    first, total = _indices(at_optimum, d)
    place_first, place_total = _indices(finder.best, d)
    return Spread(
        labels=tuple(one.label for one in question.inputs),
        results=(outputs.objective, *(outputs.name(i) for i in range(outputs.count))),
        low=np.quantile(here, _TAILS[0], axis=0), high=np.quantile(here, _TAILS[1], axis=0),
        error=error, met=np.mean(here[:, 1:] >= 0.0, axis=0), first=first, total=total,
        place=np.clip(box.shares(ends.T).T, 0.0, 1.0),
        place_first=place_first, place_total=place_total, open=box.open(ends),
        safe=None if safe is None else box.shares(safe),
        runs=len(made.values), failed=int(np.count_nonzero(~fine)), carried=carried,
    )  # fmt: skip


def _sobol(dimensions: int, count: int) -> Array:
    from scipy.stats import qmc

    points = qmc.Sobol(dimensions, seed=_SEED).random_base2((count - 1).bit_length())
    return np.asarray(points[:count])


def _made(outputs: Outputs, best: Wanted, box: _Box, carries: bool) -> _Made:
    """The runs, which carry derivatives if they may; further ones without where they tell none.

    Args:
        outputs: What runs mean.
        best: The best run.
        box: Where they are to be.
        carries: Whether they may.
    """
    question = outputs.question
    n, d = len(question.axes), len(question.inputs)
    asked = question.table.samples or samples(n, d, carrying=carries)
    count = max(asked, least(n, d, carrying=carries))
    wanted = [
        _drawn(outputs, best.fidelity, box.shares(2.0 * point[:n] - 1.0), point[n:], carries)
        for point in _sobol(n + d, count)
    ]
    outputs.fetch(wanted)
    values = np.array([outputs.vector(one) for one in wanted])
    places = np.array([_place(outputs, one, box) for one in wanted])
    if not carries:
        return _Made(places, values, None)
    missing, width = np.full((values.shape[1], n + d), np.nan), np.array([*box.half, *[0.5] * d])
    slopes = [missing if outputs.seen[w].failed else outputs.slopes(w) for w in wanted]
    told = [one for one in slopes if one is not None]
    if len(told) < len(slopes):
        return _made(outputs, best, box, carries=False)
    return _Made(places, values, np.array(told) * width)


def _drawn(outputs: Outputs, fidelity: str, shares: Array, inputs: Array, carries: bool) -> Wanted:
    """The run at shares of the ranges of variables and inputs."""
    question = outputs.question
    at = question.at(shares, fidelity)
    drawn = zip(question.inputs, inputs, strict=True)
    given = tuple(one.value(float(u)) for one, u in drawn)
    return Wanted(at.values, at.fidelity, inputs=given, carries=carries)


def _place(outputs: Outputs, wanted: Wanted, box: _Box) -> Array:
    """Where a run is in the box (n + d,)."""
    question = outputs.question
    inputs = [_scaled(o, v) for o, v in zip(question.inputs, wanted.inputs, strict=True)]
    return np.array([*box.place(question.shares(wanted)), *inputs])


def _scaled(one: Uncertain, value: float) -> float:
    return 2.0 * (value - one.low) / (one.high - one.low) - 1.0


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
    """Finds the optimum of polynomials for given inputs, among many places in the box.

    Args:
        fit: The polynomials.
        variables: How many there are.
    """

    def __init__(self, fit: Callable[[Array], Array], variables: int) -> None:
        self._fit, self._places = fit, 2.0 * _sobol(variables, _PLACES) - 1.0

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
