"""Quadratics around an optimum: intervals of the variables, binding constraints, shifted bounds.

Two neighbouring runs have nearly the same numerical error, which shifts a bound rather than the
ranking of the two. So the uncertainty of the optimum follows from
    - the scatter of the objective (noise and misfit of the quadratics) relative to its curvature:
      all points whose objective is not worse by more than that,
    - the error of the constraints (numerical error, noise, misfit) relative to their slopes: the
      optima for bounds shifted by it,
    - where bounds do not fix all variables, the tilt of the objective: the change of its numerical
      error from neighbour to neighbour.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Flags
from castfem.studies.optimisation.fidelity import NumericalError
from castfem.studies.optimisation.polynomial_fit import columns


@dataclass(frozen=True, slots=True)
class ModelSettings:
    """Settings of the quadratics around an optimum."""

    reach: float = 2.5  #: distance from the optimum within which they are used, in steps
    samples: int = 2**14  #: points in that box with several variables
    line: int = 4001  #: points with one variable
    #: tried fractions of the largest error of margins and cost
    parts: tuple[float, float, float] = (1.0 / 3.0, 2.0 / 3.0, 1.0)
    #: relative distance from the end of the box within which an interval may continue
    edge: float = 0.02
    #: relative distance, in steps, within which the end of a range next to another point is left
    #: out
    beside: float = 0.04
    neighbours: int = 5  #: runs that measure the noise
    apart: float = 1e-3  #: their distance, relative to the ranges
    #: significant difference of two runs over their scatter; one in thirty by chance
    sigmas: float = 3.0


MODEL = ModelSettings()


@dataclass(frozen=True, slots=True)
class Quadratic:
    """Cost and margins near an optimum as quadratics of the variables."""

    centre: Array  #: the optimum (n,), fractions of the ranges
    step: Array  #: units of length of the fit (n,)
    weights: Array  #: weights of 1, d_i, d_i d_j (i <= j), (k, 1 + m)
    misfit: Array  #: scatter of the runs about it (1 + m,), SI

    @classmethod
    def fit(cls, centre: Array, step: Array, shares: Array, values: Array) -> Quadratic:
        """Fit the runs (r, n) within reach, with cost and margins (r, 1 + m)."""
        near = np.max(np.abs(shares - centre) / step, axis=1) <= MODEL.reach * (1.0 + 1e-9)
        near &= ~np.isnan(values).any(axis=1)
        rows = columns(np.asarray((shares[near] - centre) / step))
        weights, _, rank, _ = np.linalg.lstsq(rows, values[near], rcond=1e-8)
        rest = values[near] - rows @ weights
        free = max(len(rows) - int(rank), 1)
        return cls(centre, step, weights, np.sqrt(np.sum(rest**2, axis=0) / free))

    def __call__(self, shares: Array) -> Array:
        """Cost and margins (r, 1 + m) at some points (r, n)."""
        return np.asarray(columns((shares - self.centre) / self.step) @ self.weights)

    @property
    def slopes(self) -> Array:
        """Slopes at the optimum (n, 1 + m), SI over the range."""
        return np.asarray(self.weights[1 : 1 + len(self.centre)] / self.step[:, None])

    @property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest point of its range of use (n,)."""
        ends = (np.clip(self.centre + s * MODEL.reach * self.step, 0.0, 1.0) for s in (-1.0, 1.0))
        low, high = ends
        return low, high

    def places(self) -> Array:
        """Points that fill the box (r, n), the last one the optimum."""
        low, high = self.box
        if len(low) == 1:
            return np.vstack([np.linspace(low, high, MODEL.line), self.centre])
        from scipy.stats import qmc

        points = qmc.Sobol(len(low), scramble=False).random(MODEL.samples)
        return np.vstack([low + points * (high - low), self.centre])


@dataclass(frozen=True, slots=True)
class Interval:
    """Interval of an optimum along one variable, as fractions of its range."""

    low: float
    high: float
    open_low: bool  #: whether it may be lower, beyond the quadratics
    open_high: bool


def intervals(
    model: Quadratic, scatter: Array, error: NumericalError, shares: Array, seen: Array
) -> list[Interval]:
    """Return the intervals of the optimum, one per variable.

    A better run far from the optimum violates a constraint; if by less than its error, the optimum
    may be there.

    Args:
        model: Fit to the runs near the optimum.
        scatter: Noise of cost and margins (1 + m,), SI.
        error: Numerical error of cost and margins; that of the cost only matters through its tilt.
        shares: Points of all runs (r, n), fractions of the ranges.
        seen: Their cost and margins (r, 1 + m), NaN where they have failed.
    """
    places, (low, high) = model.places(), model.box
    values = model(places)
    beside = float(scatter[0] + model.misfit[0])
    best = seen[np.argmin(np.max(np.abs(shares - model.centre), axis=1))]
    far = np.any((shares < low) | (shares > high), axis=1)
    far &= seen[:, 0] < best[0] - beside  # NaN is not
    there = seen[far] - best + values[-1]  # relative to the best run according to the quadratics
    places, values = np.vstack([shares[far], places]), np.vstack([there, values])
    allowed_miss, moves = _errors(scatter[1:] + model.misfit[1:], error)
    kept = np.zeros(len(places), dtype=bool)
    kept[-1] = True
    for shift, tilt in moves:
        here = slice(np.count_nonzero(far) if tilt else 0, None)  # only linear near the optimum
        allowed = nearest_to_allowed(values[here, 1:] + shift, allowed_miss)
        cost = values[here, 0] + error.tilted(places[here], tilt)
        kept[here] |= allowed & (cost <= np.min(cost[allowed]) + beside)
    lowest, highest, edge = (
        places[kept].min(axis=0),
        places[kept].max(axis=0),
        MODEL.edge * (high - low),
    )
    below = (low > 0.0) & (lowest <= low + edge)
    above = (high < 1.0) & (highest >= high - edge)
    every = zip(lowest, highest, below, above, strict=True)
    return [Interval(float(a), float(b), bool(c), bool(d)) for a, b, c, d in every]


def _errors(blurred: Array, error: NumericalError) -> tuple[Array, list[tuple[Array, float]]]:
    """Possible errors of margins (m,), and the shifts of margins and tilts of the cost to try.

    `blurred` is the noise of the margins and the misfit of their quadratics (m,), SI.
    """
    up, down = blurred + error.above[1:], -blurred - error.below[1:]
    ends = [*np.diag(up), *np.diag(down), *([up, down] if len(up) > 1 else [])]
    shifts = [np.zeros(len(up)), *(part * end for end in ends for part in MODEL.parts)]
    tilts = [0.0, *(part * error.most for part in MODEL.parts)] if error.tilt is not None else [0.0]
    moves = list(itertools.product(shifts, tilts))
    if error.better:
        moves.append((error.moved[1:], 0.0))
    return np.maximum(up, -down), moves


def nearest(model: Quadratic, off: Array, binding: Sequence[bool]) -> Array:
    """Return the point nearest to an optimum where shifted bounds are met, binding ones exactly.

    Near an optimum all ways to a shifted bound cost the same, to first order; the quadratics are
    most accurate at the nearest point.

    Args:
        model: Fit to the runs around the optimum.
        off: Error of its margins (m,), SI; positive if they are larger than it says.
        binding: Which of them bind.

    Returns:
        Point, fractions of the ranges (n,). If none within reach meets the bounds, the nearest to
            them.
    """
    if not len(off):
        return model.centre
    from scipy.optimize import minimize

    scale = np.max(np.abs(model.weights[1:, 1:]), axis=0)  # change over a step
    scale = np.maximum(np.where(scale > 0.0, scale, 1.0), 1e-9 * np.abs(off))
    low, high = ((end - model.centre) / model.step for end in model.box)

    def margins(steps: Array, which: npt.NDArray[np.intp]) -> Array:
        place = model.centre + steps * model.step
        return np.asarray(((model(place[None])[0, 1:] + off) / scale)[which])

    kinds = {"eq": np.flatnonzero(binding), "ineq": np.flatnonzero(np.logical_not(binding))}
    with warnings.catch_warnings():  # from rounding at the ends of the box
        warnings.simplefilter("ignore", RuntimeWarning)
        found = minimize(
            lambda steps: float(steps @ steps), np.zeros(len(low)), jac=lambda steps: 2.0 * steps,
            method="SLSQP", bounds=list(zip(low, high, strict=True)),
            constraints=[
                {"type": kind, "fun": margins, "args": (which,)}
                for kind, which in kinds.items() if len(which)
            ],
        )  # fmt: skip
    if found.success:
        return np.asarray(np.clip(model.centre + found.x * model.step, 0.0, 1.0))
    places = model.places()
    left = model(places)[:, 1:] + off
    left = np.where(binding, -np.abs(left), left)
    places = places[nearest_to_allowed(left, scale)]
    far = np.linalg.norm((places - model.centre) / model.step, axis=1)
    return np.asarray(places[np.argmin(far)])


@dataclass(frozen=True, slots=True)
class Binding:
    """Constraints that limit an objective."""

    held: tuple[bool, ...]  #: whether it would be better without each
    near: tuple[bool, ...]  #: whether its bound is at the optimum, within its error

    @classmethod
    def of(
        cls, model: Quadratic, scatter: Array, here: Array, seen: Array, error: Array
    ) -> Binding:
        """Return which constraints bind at an optimum, from the quadratics and from all runs.

        Quadratics may follow a dent of a jagged objective. There a constraint binds if it is the
        only one violated by a far better run.

        Args:
            model: Fit to the runs near the optimum.
            scatter: Noise of cost and margins (1 + m,), SI.
            here: Cost and margins of the best run (1 + m,).
            seen: Those of all runs of its level (r, 1 + m), NaN where they have failed; empty if no
                run meets all constraints.
            error: Numerical error of the margins (m,), SI.
        """
        local = _better_without(model, scatter)
        blurred = scatter + model.misfit
        within = here[1:] <= blurred[1:] + error
        seen = seen[~np.isnan(seen).any(axis=1)]
        far = np.zeros(len(within), dtype=bool)
        missed = seen[seen[:, 0] < here[0] - MODEL.sigmas * blurred[0], 1:] < -scatter[1:]
        for which in sorted(missed, key=np.count_nonzero):
            # Of several violated at once those near the optimum bind, if any, else all.
            if np.any(which) and not np.any(which & far):
                far |= which & within if np.any(which & within) else which
        held, near = local | far, local | (far & within)
        return cls(tuple(bool(one) for one in held), tuple(bool(one) for one in near))


def _better_without(model: Quadratic, scatter: Array) -> Flags:
    """Whether the objective near an optimum would be better without each constraint (m,)."""
    values, scale = model(model.places()), scatter[1:] + model.misfit[1:]

    def least(number: int | None = None) -> float:
        others = np.arange(len(scale)) != number
        allowed = nearest_to_allowed(values[:, 1:][:, others], scale[others])
        return float(np.min(values[allowed, 0]))

    enough = least() - scatter[0] - model.misfit[0]
    return np.array([least(number) < enough for number in range(len(scale))], dtype=bool)


def nearest_to_allowed(margins: Array, scale: Array) -> Flags:
    """Which of some points meet all margins (r, m), or violate them least; m may be 0."""
    if not margins.shape[1]:
        return np.ones(len(margins), dtype=bool)
    short = np.max(np.maximum(-margins / np.maximum(scale, 1e-300), 0.0), axis=1)
    return np.asarray(short <= np.min(short) + 1e-9)


def around(centre: Array, step: Array, steps: Sequence[int] = (1, 2)) -> list[Array]:
    """Return the points some steps to either side of an optimum along each variable, in range.

    The end of a range replaces points beyond it, unless it is next to another point: otherwise an
    optimum there would be missed.
    """
    found: list[Array] = []
    for i, middle in enumerate(centre):
        for sign in (-1, 1):
            shares = [float(middle)]
            for k in sorted(steps):
                share = float(np.clip(middle + sign * k * step[i], 0.0, 1.0))
                if abs(share - shares[-1]) > MODEL.beside * step[i]:
                    shares.append(share)
            places = np.tile(centre, (len(shares) - 1, 1))
            places[:, i] = shares[1:]
            found += list(places if sign > 0 else places[::-1])
    return found


def neighbours(place: Array) -> list[Array]:
    """Points (n,) on a short line through one, or as near as the ranges allow, fractions."""
    along = _along()
    middle = np.clip(place, along[-1], 1.0 - along[-1])
    return [np.asarray(middle + step) for step in along]


def scatter(values: Array) -> Array | None:
    """Standard deviation of results (r, 1 + m) at `neighbours` about a line; None if one failed."""
    if np.isnan(values).any():
        return None
    along = _along()
    fit = np.polynomial.polynomial.polyfit(along, values, 1)
    rest = values - np.polynomial.polynomial.polyval(along, fit).T
    return np.asarray(np.sqrt(np.sum(rest**2, axis=0) / (len(along) - 2)))


def _along() -> Array:
    return np.asarray((np.arange(MODEL.neighbours) - MODEL.neighbours // 2) * MODEL.apart)
