"""Error of a number at one size from its values at several sizes.

Where three sizes show an order of convergence the rest is extrapolated [Richardson1911] with the
factor of safety of [Roache1994]; where they do not, the error is estimated from the differences.
docs/accuracy.md has how often that holds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scipy.optimize import brentq

from castfem.base.constants import EXACT


@dataclass(frozen=True, slots=True)
class ConvergenceRules:
    """Parameters of error estimates from results at several sizes, after [Roache1994]."""

    #: factor on the distance to the limit, if three sizes show an order [Roache1994]
    safety: float = 1.25
    few: float = 3.0  #: factor on the difference to a finer size, if there is no order [Roache1994]
    half: float = 0.5  #: factor on the difference to a coarser size, if there is no order
    #: smallest error relative to the spread, if there is an order: three values may agree by chance
    least: float = 0.25
    least_order: float = 0.5  #: lowest accepted order; below it there is no convergence
    most_order: float = 2.0  #: highest order of the schemes
    most_tried: float = 8.0  #: highest order searched for; above it two values agree by chance


RULES = ConvergenceRules()


@dataclass(frozen=True, slots=True)
class Estimate:
    """The error of a number from one of the sizes."""

    error: float  #: its absolute value, in the unit of the number; NaN where nothing is known
    order: float | None = None  #: observed order of convergence; None without one
    #: the number by size, relative to that of the case; empty if only the error matters
    values: Mapping[float, float] = field(default_factory=dict)

    def scaled(self, factor: float) -> float:
        """Return the error for a size larger by `factor`.

        It scales with the observed order, otherwise with the size itself.
        """
        return self.error * factor ** (
            1.0 if self.order is None else min(self.order, RULES.most_order)
        )


def estimate(values: Mapping[float, float]) -> Estimate:
    """Return the error of a number at the size 1.

    Args:
        values: The number by relative size, including 1.

    The three finest sizes show an order p if the number is monotonic and

        (v2 - v1) / (v1 - v0) = (x2^p - x1^p) / (x1^p - x0^p)

    has a solution of at least 0.5. The error is then the difference to the extrapolated value, with
    the factor of safety, but at least a quarter of the spread, since the order may be chance.
    Without an order it is three times the difference to the finer sizes, or half of that to a
    coarser one if this is more. With two sizes it is three times their difference.
    """
    known = sorted((size, v) for size, v in values.items() if math.isfinite(v))[:3]
    here = values.get(1.0, math.nan)
    if len(known) < 2 or not math.isfinite(here):
        return Estimate(math.nan)
    spread = max(v for _, v in known) - min(v for _, v in known)
    if spread <= EXACT * abs(here):
        return Estimate(0.0)
    if len(known) == 2:
        return Estimate(RULES.few * spread)
    order = observed_order(known)
    if order is None:
        return Estimate(_without_order(known, here))
    believed = min(order, RULES.most_order)
    (x0, v0), (x1, v1), _ = known
    limit = v0 - (v1 - v0) * x0**believed / (x1**believed - x0**believed)
    return Estimate(max(RULES.safety * abs(here - limit), RULES.least * spread), order)


def _without_order(known: Sequence[tuple[float, float]], here: float) -> float:
    """Error without an order: from the differences to finer and coarser sizes."""
    finer = max((abs(v - here) for size, v in known if size < 1.0), default=0.0)
    coarser = max((abs(v - here) for size, v in known if size > 1.0), default=0.0)
    if known[0][0] >= 1.0:  # nothing finer: the next coarser one is used
        return RULES.few * abs(known[1][1] - here)
    return max(RULES.few * finer, RULES.half * coarser)


def convergence_index(values: Mapping[float, float]) -> float:
    """Return the grid convergence index of a number at the size 1; NaN if unknown.

    [Roache1994], with the factor of safety, from the finest size x, or the next coarser one:

        SAFETY |v_x - v_1| / |1 - x^p|

    It is at least as large as the change to any finer size. The order p is that of three sizes,
    limited to 1 (guaranteed by the schemes) to 2; without one it is 1. Unlike `estimate` it needs
    no third size, and takes the distance of the sizes into account.

    Args:
        values: The number by relative size, including 1.
    """
    here = values.get(1.0, math.nan)
    others = {size: v for size, v in values.items() if size != 1.0 and math.isfinite(v)}
    if not others or not math.isfinite(here):
        return math.nan
    order = observed_order(sorted({**others, 1.0: here}.items())[:3]) if len(others) > 1 else None
    believed = min(max(order or 1.0, 1.0), RULES.most_order)
    size = min(others)
    index = RULES.safety * abs((others[size] - here) / (1.0 - size**believed))
    return max(index, *(abs(v - here) for other, v in others.items() if other < 1.0), 0.0)


def observed_order(known: Sequence[tuple[float, float]]) -> float | None:
    """Return the order of three pairs of size and value, the finest first; None for none."""
    (x0, v0), (x1, v1), (x2, v2) = known
    if (v1 - v0) * (v2 - v1) <= 0.0:
        return None
    wanted = (v2 - v1) / (v1 - v0)

    def excess(order: float) -> float:
        return (x2**order - x1**order) / (x1**order - x0**order) - wanted

    if excess(RULES.least_order) > 0.0 or excess(RULES.most_tried) < 0.0:
        return None
    return float(brentq(excess, RULES.least_order, RULES.most_tried))
