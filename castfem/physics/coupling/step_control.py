"""Choice of the time step: fixed or by error control; milestones hit exactly, cut-back.

A fixed step that is cut back has a length from a ladder, not just any: two runs that differ little
then take the same steps, and their results differ by what differs between the runs, not by where
their steps end.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from castfem.base.constants import EXACT
from castfem.base.errors import RunFailure

SAFETY = 0.9
GROWTH = 2.0
SHRINK = 0.2
FAILED = 0.25  # what is left of the step when the solver fails
ALLOWED_STRAIN = 1e-5  # error of the axial strain of a window that has grown, by default
_NEARLY = 1e-6  # of the smallest step: how far rounding takes a step from it
_RUNGS = 1.0, 1.25, 1.6  # of the ladder, from one to its double


def rung(step: float, unit: float) -> float:
    """The longest step of the ladder that is no longer than `step`.

    Args:
        step: To be shortened.
        unit: 1, 4/5, 5/8, 1/2 and so on of it are on the ladder, likewise what is longer.
    """
    limit = step / unit * (1.0 + _NEARLY)
    whole = 2.0 ** (math.frexp(limit)[1] - 1)
    return unit * max(whole * part for part in _RUNGS if whole * part <= limit)


@dataclass(frozen=True, slots=True)
class Adaptive:
    """Error-controlled stepping.

    Attributes:
        tolerance: Temperature error allowed in a step, K.
        first: Step after the meniscus and after each change of cooling, s.
        smallest: The run stops when this one is still too long, s. largest: Upper limit, s.
    """

    tolerance: float
    first: float
    smallest: float
    largest: float


class StepControl:
    """Proposes the end of the next step and learns from how it went.

    Args:
        end: Where the run ends, s.
        milestones: Instants that must be hit exactly (zone changes, output), s.
        fixed: Step, s, or None for `adaptive`.
        adaptive: Error control, or None for `fixed`.
        tolerance: Error (K) allowed in a fixed step, which is cut back for it; None: any.
        order: Power of the step that the error estimate follows.
        longest: Of a step that begins at a time, s; None for no other limit than these.
        unit: Whose parts a fixed step is cut to, s; that step where it is None.
        most: How many times such a step, fixed or longest, one may grow to between milestones.
    """

    def __init__(
        self,
        end: float,
        milestones: Iterable[float] = (),
        *,
        fixed: float | None = None,
        adaptive: Adaptive | None = None,
        tolerance: float | None = None,
        order: float = 3,
        longest: Callable[[float], float] | None = None,
        unit: float | None = None,
        most: float = 1.0,
    ) -> None:
        if (fixed is None) == (adaptive is None):
            raise ValueError("give a fixed step or an adaptive one")
        self.end, self._tiny = end, EXACT * end
        inner = sorted({m for m in milestones if self._tiny < m < end - self._tiny})
        self._stops = [
            m for i, m in enumerate(inner) if i == 0 or m - inner[i - 1] > self._tiny
        ] + [end]
        self._fixed, self._adaptive, self._exponent = fixed, adaptive, 1.0 / order
        allowed = adaptive.tolerance if adaptive is not None else tolerance
        self.tolerance = float("inf") if allowed is None else allowed
        self.step = fixed if fixed is not None else adaptive.first  # type: ignore[union-attr]
        self.smallest = adaptive.smallest if adaptive is not None else 1e-6 * self.step
        self._longest, self._clipped, self._unit = longest, False, unit or fixed
        self.most, self.growth, self.base = most, 1.0, self.step

    def next_stop(self, time: float) -> float:
        """The first milestone after `time`, or the end."""
        return self._stops[min(bisect_right(self._stops, time + self._tiny), len(self._stops) - 1)]

    def at_milestone(self, time: float) -> bool:
        """Whether a milestone, or the beginning, is at `time` (s)."""
        before = bisect_right(self._stops, time + self._tiny) - 1
        return time - (self._stops[before] if before >= 0 else 0.0) <= self._tiny

    def propose(self, time: float, limit: float | None = None) -> float:
        """End of the step to try from `time`, never past the next milestone or `limit`, s."""
        if self.most > 1.0 and self.at_milestone(time):
            self.growth = 1.0
        stop = self.next_stop(time)
        stop = stop if limit is None else min(stop, limit)
        left = stop - time
        step = self.step if self._longest is None else min(self.step, self._longest(time))
        self.base, step = step, step * self.growth
        self._clipped = left <= step * (1 + 1e-9)
        if self._clipped:
            return stop
        if (self._adaptive is not None or self.growth > 1.0) and left < 2 * step:
            return time + 0.5 * left  # two even steps rather than a crumb at the end
        return time + step

    def accepts(self, error: float) -> bool:
        """Whether a step with this estimated error (K) may be kept."""
        return error <= self.tolerance

    def learn(self, taken: float, error: float) -> None:
        """Adapt the step to the error of the step `taken` (s), kept or not.

        Raises:
            RunFailure: If the error of the smallest step is too large.
        """
        ratio = self.tolerance / max(error, 1e-300)
        if self.most > 1.0 and (self.accepts(error) or self.growth > 1.0):
            scale = min(max(SHRINK, SAFETY * ratio**self._exponent), GROWTH)
            self.growth = min(max(taken / self.base * scale, 1.0), self.most)
            if not self.accepts(error):
                return
        if self._adaptive is None and self.accepts(error):
            grown = min(GROWTH, SAFETY * ratio**self._exponent)
            grown = max(grown, 1.0) if self._clipped else grown
            self.step = min(self._fixed or self.step, self._on_ladder(self.step * grown))
            return
        # Growth is damped: vertices that pass the liquidus make the estimate jump from step to
        # step, and a step that grows on a quiet one is rejected at the next.
        factor = SAFETY * ratio ** (self._exponent if ratio < 1.0 else 0.5 * self._exponent)
        factor = min(max(SHRINK, factor), GROWTH)  # in this order SHRINK for an error that is NaN
        proposed = taken * factor
        if not self.accepts(error):
            shorter = self._shorter(taken, proposed)
            if shorter is None:
                raise RunFailure(
                    f"the error of a step of {taken:.3g} s is {error:.3g} K; allow a shorter step "
                    "(thermal.time.adaptive.smallest) or a larger error "
                    "(thermal.time.adaptive.tolerance)"
                )
            self.step = shorter
            return
        if self._clipped:  # a step cut short by a milestone teaches no smaller one
            proposed = max(proposed, self.step)
        assert self._adaptive is not None
        self.step = min(max(proposed, self.smallest), self._adaptive.largest)

    def failed(self, taken: float, reason: str, wanted: float | None = None) -> None:
        """Cut the step back after the solver failed on the step `taken` (s).

        Args:
            taken: Its length.
            reason: Why it failed.
            wanted: What to try instead, s; a share of it if not known.

        Raises:
            RunFailure: If the step is already the smallest.
        """
        if self.growth > 1.0:
            self.growth = max(taken * FAILED / self.base, 1.0)
            return
        shorter = self._shorter(taken, taken * FAILED if wanted is None else wanted)
        if shorter is None:
            raise RunFailure(f"the solver fails at the smallest step ({taken:.3g} s): {reason}")
        self.step = shorter

    def _shorter(self, taken: float, proposed: float) -> float | None:
        """The step to try after one of `taken` that is not kept, s; None if there is none.

        It is no shorter than the smallest.  Only what a milestone had cut below that may be
        divided once more: the length that is left was not chosen for its error.
        """
        if taken > self.smallest * (1 + _NEARLY):
            return max(self._on_ladder(proposed), self.smallest)
        cut = self._clipped and taken < self.smallest * (1 - _NEARLY)
        return proposed if cut else None

    def _on_ladder(self, step: float) -> float:
        """A step that is no longer, from the ladder where steps are fixed, s."""
        return step if self._unit is None else rung(step, self._unit)

    def restart(self) -> None:
        """Forget the step learnt: the cooling has just changed."""
        if self._adaptive is not None:
            self.step = min(self.step, self._adaptive.first)
