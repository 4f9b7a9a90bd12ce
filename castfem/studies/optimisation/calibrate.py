"""Keys of a case fitted to what was measured: weighted least squares within bounds.

Which values make the computed numbers most like the measured ones: the sum of the squares of
(computed - measured)/error is least (Gauss-Newton with a trust region, scipy's `trf`). The
derivatives are differences over a hundredth of the range of each key; the runs for them are done
side by side, and none twice. What the fit knows of the keys follows from the derivatives where it
ends, by Student's t: it holds for errors that are independent, and a case that is right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.types import Array

STEP = 0.01  # of a key's range, for the derivatives
_NEAR = 1e-3  # of its range: a value so near to a bound is held by it
_CLOSE = 1e-4  # relative change of the sum of squares, or of the keys, at which the fit ends
_MOST = 20  # evaluations of the derivatives
_SURE = 0.95  # probability of the intervals


@dataclass(frozen=True, slots=True)
class Free:
    """A key that is fitted.

    Attributes:
        key: Dotted, as `--set` takes it.
        low: Least value. high: Largest, both in `unit`.
        unit: Of its values; empty for a plain number.
    """

    key: str
    low: float
    high: float
    unit: str = ""

    def text(self, value: float) -> str:
        """A value as a case file has it, to as many digits as count."""
        return f"{value:.8g} {self.unit}".strip()


def read_free(assignment: str) -> Free:
    """Return a key with its bounds as a user has written them: `KEY=800..3000 W/(m^2 K)`.

    Raises:
        InputError: It is not written so.
    """
    key, equals, bounds = assignment.partition("=")
    low, dots, high = bounds.partition("..")
    sample = "KEY=LOW..HIGH UNIT, such as casting.speed=2..4 m/min"
    if not equals or not dots or not key.strip():
        raise InputError(f'--free "{assignment}": write {sample}')
    try:
        most, unit = units.split(high.strip())
        least, own = units.split(low.strip())
        ends = float(least), float(most)
    except ValueError:
        raise InputError(f'--free "{assignment}": bounds are numbers; write {sample}') from None
    if own and own != unit:
        raise InputError(f'--free "{assignment}": both bounds in one unit; write {sample}')
    if not ends[0] < ends[1]:
        raise InputError(f'--free "{assignment}": the lower bound must be below the upper one')
    return Free(key.strip(), *ends, unit)


@dataclass(frozen=True, slots=True)
class Fitted:
    """What was found for one key.

    Attributes:
        free: The key. start: Where the fit began. value: What fits best, both in the key's unit.
        interval: Half the 95 % interval; NaN where the data do not tell.
        held: Whether a bound holds it, so that the interval says little.
    """

    free: Free
    start: float
    value: float
    interval: float
    held: bool


@dataclass(frozen=True, slots=True)
class Fit:
    """A fit.

    Attributes:
        keys: What was found. correlation: Of the keys (p, p).
        start: Residuals where it began (n,). end: Where it ended.
        spread: Root of the sum of squares over the data that are left (n - p): 1 where data and
            errors agree, the scatter of the data where no errors were given.
        converged: Whether it came to rest.
    """

    keys: tuple[Fitted, ...]
    correlation: Array
    start: Array
    end: Array
    spread: float
    converged: bool


Residuals = Callable[[Sequence[Mapping[str, str]]], list[Array]]
"""Residuals (n,) for each of some sets of values, key to text."""


def fit(
    residuals: Residuals, keys: Sequence[Free], start: Sequence[float], *, errors_known: bool
) -> Fit:
    """Fit some keys.

    Args:
        residuals: (computed - measured)/error; runs the case.
        keys: To be fitted.
        start: Where to begin, in their units; drawn into the bounds.
        errors_known: Whether the errors in it are those of the measurement; otherwise their size is
            taken from how far the best fit is off.

    Raises:
        InputError: There are fewer data than keys.
    """
    from scipy.optimize import least_squares

    low, size = np.array([k.low for k in keys]), np.array([k.high - k.low for k in keys])

    def many(points: Sequence[Array]) -> list[Array]:
        return residuals(
            [
                {k.key: k.text(float(v)) for k, v in zip(keys, low + size * point, strict=True)}
                for point in points
            ]
        )

    def slopes(point: Array) -> Array:
        """Derivatives of the residuals by the scaled keys (n, p), inwards at an upper bound."""
        steps = np.where(point + STEP > 1.0, -STEP, STEP)
        base, *moved = many(
            [point, *(point + s * e for s, e in zip(steps, np.eye(p), strict=True))]
        )
        return np.column_stack([(m - base) / s for m, s in zip(moved, steps, strict=True)])

    p = len(keys)
    begin = np.clip((np.asarray(start, float) - low) / size, 0.0, 1.0)
    first = many([begin])[0]
    if len(first) < p:
        raise InputError(
            f"{len(first)} measured values cannot tell {p} keys; give more, or fit less"
        )
    found = least_squares(
        lambda point: many([point])[0], begin, jac=slopes, bounds=(0.0, 1.0), method="trf",
        ftol=_CLOSE, xtol=_CLOSE, gtol=1e-10, max_nfev=_MOST,
    )  # fmt: skip
    left = len(first) - p
    spread = math.sqrt(float(found.fun @ found.fun) / left) if left else math.nan
    half, correlation = _uncertainty(found.jac, spread, left, errors_known)
    values, ends = low + size * found.x, size * half
    fitted = tuple(
        Fitted(k, float(low[i] + size[i] * begin[i]), float(values[i]), float(ends[i]),
               bool(min(found.x[i], 1.0 - found.x[i]) < _NEAR))
        for i, k in enumerate(keys)
    )  # fmt: skip
    return Fit(fitted, correlation, first, np.asarray(found.fun), spread, bool(found.status > 0))


def _uncertainty(
    slopes: Array, spread: float, left: int, errors_known: bool
) -> tuple[Array, Array]:
    """Half the 95 % intervals of the scaled keys (p,), and their correlation (p, p).

    NaN of keys that the data do not tell apart, and of all without more data than keys where the
    errors are not known.
    """
    from scipy import stats

    p = slopes.shape[1]
    unknown = np.full(p, np.nan), np.full((p, p), np.nan)
    normal = slopes.T @ slopes
    if np.linalg.matrix_rank(slopes) < p:
        return unknown
    covariance = np.linalg.inv(normal)
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    if errors_known:
        return float(stats.norm.ppf(0.5 + 0.5 * _SURE)) * deviation, correlation
    if not left:
        return unknown[0], correlation
    return float(stats.t.ppf(0.5 + 0.5 * _SURE, left)) * spread * deviation, correlation
