"""Line search along Newton's correction, by the work of the forces that are out of balance.

Where a material flows almost without hardening, the tangent of a step that has just begun to flow
is next to nothing and Newton's correction is far too long.  The forces out of balance derive from a
convex potential (for laws that do not soften), so their work along the correction falls steadily:
the step is cut where it would turn clearly negative.  The size of the residual, which other line
searches go by, says nothing here, until it is almost as small as it has to be: then the sign of its
work is that of rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.mechanics.interactions import Interactions

OVERSHOOT = 0.05  # of the work at the start: less is Newton's own business
CLOSE = 0.05  # what is left of the work at the start when the search ends
TRIALS = 40
NEARLY = 1e-2  # of the square of the imbalance: what leaves less of it has not overshot, whatever
# its work: along a correction that is no longer than rounding that may have any sign
ALMOST = 10.0  # times what may be out of balance: from there on what makes it smaller is taken
PATIENCE = 8  # Newton iterations in which contact may overshoot


@dataclass(frozen=True, slots=True)
class LineSearch:
    """How much of Newton's correction a slice is to take.

    Attributes:
        comm: Ranks.
        interactions: What acts on its surface.
        residual: Of local unknowns, N/m; leaves the interactions evaluated there.
    """

    comm: MPI.Comm
    interactions: Interactions
    residual: Callable[[Array], Array]

    def share(self, local: Array, step: Array, iteration: int, imbalance: float) -> float:
        """Part of the correction to take: less than 1 where all of it would overshoot by far.

        Args:
            local: Unknowns.
            step: Newton's correction, to be taken off them.
            iteration: Its number in the solve, from 0.
            imbalance: What is out of balance at the unknowns, over what may be.

        Returns:
            The part (collective).
        """
        first, before = self._along(local, step)
        base = self.interactions.evaluated()
        enough = before if imbalance < ALMOST else NEARLY * before

        def work(share: float) -> float:
            found, left = self._along(local - share * step, step)
            if share == 1.0 and left < enough:
                return 0.0
            if share < 1.0 or iteration >= PATIENCE:
                return found
            # Points that come into contact make a kink, no overshoot: full steps find them.
            return found + self.interactions.kink(base)

        return step_share(first, work)

    def _along(self, local: Array, step: Array) -> tuple[float, float]:
        """Work of what is out of balance along a step, and the square of its size (collective)."""
        residual = self.residual(local)
        sums = [float(residual @ step), float(residual @ residual)]
        work, square = reductions.totals(self.comm, sums)
        return float(work), float(square)


def step_share(first: float, work: Callable[[float], float]) -> float:
    """Part of the correction to take, 1 wherever the full one does not overshoot.

    The last share that `work` is asked for is the one that is returned.

    Args:
        first: Work along the correction at the start.
        work: The same after a share of the correction; not finite where it cannot be told, which
            counts as an overshoot.
    """

    def work_after(share: float) -> float:
        found = work(share)
        return found if math.isfinite(found) else -first

    full = work_after(1.0)
    if not first > 0.0 or full >= -OVERSHOOT * first:
        return 1.0
    low, high, share = 0.0, 1.0, 1.0
    at_low, at_high, found = first, full, full
    for _ in range(TRIALS):
        crossing = (at_low * high - at_high * low) / (at_low - at_high)
        share = 0.1 * high if low == 0.0 else crossing
        found = work_after(share)
        if abs(found) <= CLOSE * first:
            break
        if found > 0.0:
            low, at_low, at_high = share, found, 0.5 * at_high
        else:
            high, at_high, at_low = share, found, 0.5 * at_low
    return share
