"""From the values of a number at several sizes to its error at one of them.

Where three sizes show an order of convergence the rest is extrapolated [Richardson1911] and taken
with the factor of safety of [Roache1994]; where they do not, the spread of the values is what is
known of the error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

SAFETY = 1.25  # [Roache1994], for an order that three sizes have shown
LEAST_ORDER, MOST_ORDER = 0.5, 2.0  # less is no convergence; more the schemes do not have
LUCK = 3.0  # an order above it is an accident of the values
SPREAD = 1.0  # of the values, where no order shows
LEAST = 0.25  # of the spread, where an order shows: three values may agree by luck
FEW = 3.0  # [Roache1994], of the difference between two sizes, when there are no more
_ALIKE = 0.02  # relative; ratios of sizes that differ by less are one
_SAME = 1e-12  # relative; values that differ by less are rounded differently


@dataclass(frozen=True, slots=True)
class Estimate:
    """The error of a number that comes from one of the sizes.

    Attributes:
        error: Its absolute value, in the unit of the number; NaN where nothing is known.
        order: The order of convergence that shows; None where none does.
    """

    error: float
    order: float | None = None

    def scaled(self, factor: float) -> float:
        """Return the error where the size is `factor` times as large.

        It goes with the order that shows, otherwise with the size itself.
        """
        return self.error * factor ** (1.0 if self.order is None else min(self.order, MOST_ORDER))


def estimate(values: Mapping[float, float]) -> Estimate:
    """Return the error of a number at the size 1.

    Args:
        values: The number by size, relative; that of 1 among them.

    The three finest sizes show an order p if the number goes one way, by (v1 - v0) and then by
    (v2 - v1), whose ratio is r^p for sizes with the ratio r. The error is then the difference to
    the extrapolated value, with the factor of safety; it is at least a quarter of the spread, since
    the order may be luck. What is known of two sizes is the difference alone.
    """
    known = sorted((size, v) for size, v in values.items() if math.isfinite(v))
    here = values.get(1.0, math.nan)
    if len(known) < 2 or not math.isfinite(here):
        return Estimate(math.nan)
    known = known[:3]
    spread = max(v for _, v in known) - min(v for _, v in known)
    if spread <= _SAME * abs(here):
        return Estimate(0.0)
    if len(known) == 2:
        return Estimate(FEW * spread)
    order = observed_order(known)
    if order is None:
        return Estimate(SPREAD * spread)
    (finest, last), (next_, before), *_ = known
    rest = (last - before) / ((next_ / finest) ** min(order, MOST_ORDER) - 1.0)
    return Estimate(max(SAFETY * abs(here - last - rest), LEAST * spread), order)


def observed_order(known: list[tuple[float, float]]) -> float | None:
    """Return the order that the first three pairs of size and value show; None for none.

    Sizes whose neighbours have different ratios, a run between them having failed, show none.
    """
    (x0, v0), (x1, v1), (x2, v2) = known[:3]
    if (v1 - v0) * (v2 - v1) <= 0.0 or not math.isclose(x1 / x0, x2 / x1, rel_tol=_ALIKE):
        return None
    order = math.log((v2 - v1) / (v1 - v0)) / math.log(x1 / x0)
    return order if LEAST_ORDER <= order <= LUCK else None
