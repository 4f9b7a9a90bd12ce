"""Choice of the time step: fixed or by error control; milestones hit exactly, cut-back.

What is learnt of a step is a value: each function here takes the length so far and returns the next
one, so that a step that is not kept leaves nothing behind.

A fixed step that is cut back has a length from a ladder, not just any: two runs that differ little
then take the same steps, and their results differ by what differs between the runs, not by where
their steps end.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from castfem.base.constants import EXACT
from castfem.base.errors import RunFailure


@dataclass(frozen=True, slots=True)
class StepLimits:
    """By how much a step may differ from the one before, and what counts as one length."""

    safety: float = 0.9  # of the step that would just meet the error allowed
    growth: float = 2.0  # at most, from step to step
    shrink: float = 0.2  # at least, for an error that is too large
    failed: float = 0.25  # what is left of the step when the solver fails
    rounding: float = 1e-6  # of the smallest step: how far rounding takes a step from it
    rungs: tuple[float, ...] = (1.0, 1.25, 1.6)  # of the ladder, from one to its double
    strain: float = 1e-5  # axial, error in a window that has grown, where the case gives none


LIMITS = StepLimits()


def rung(step: float, unit: float) -> float:
    """The longest step of the ladder that is no longer than `step`.

    Args:
        step: To be shortened.
        unit: 1, 4/5, 5/8, 1/2 and so on of it are on the ladder, likewise what is longer.
    """
    limit = step / unit * (1.0 + LIMITS.rounding)
    whole = 2.0 ** (math.frexp(limit)[1] - 1)
    return unit * max(whole * part for part in LIMITS.rungs if whole * part <= limit)


@dataclass(frozen=True, slots=True)
class Adaptive:
    """Error-controlled stepping."""

    tolerance: float  #: temperature error allowed in a step, K
    first: float  #: step after the meniscus and after each change of cooling, s
    smallest: float  #: the run stops when this one is still too long, s
    largest: float  #: upper limit, s


@dataclass(frozen=True, slots=True)
class StepLength:
    """Length of the next step as learnt so far: `step` (s), and the factor it may grow by."""

    step: float
    growth: float = 1.0


NO_STEP = StepLength(0.0)


@dataclass(frozen=True, slots=True)
class Proposal:
    """A step to try."""

    end: float  #: where it ends, s
    taken: float  #: its length, s
    base: float  #: the same without growth, s
    clipped: bool  #: whether a milestone or a limit ends it
    length: StepLength  #: what it was proposed from


class StepControl:
    """Proposes the end of the next step, and tells what follows from how it went.

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

    Attributes:
        first: What a run begins with.
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
        self.first = StepLength(fixed if adaptive is None else adaptive.first)  # type: ignore[arg-type]
        self.smallest = 1e-6 * self.first.step if adaptive is None else adaptive.smallest
        self._longest, self._unit, self.most = longest, unit or fixed, most

    def next_stop(self, time: float) -> float:
        """The first milestone after `time`, or the end."""
        return self._stops[min(bisect_right(self._stops, time + self._tiny), len(self._stops) - 1)]

    def stops_until(self, time: float) -> tuple[float, ...]:
        """The milestones up to `time` (s)."""
        return tuple(self._stops[: bisect_right(self._stops, time + self._tiny)])

    def at_milestone(self, time: float) -> bool:
        """Whether a milestone, or the beginning, is at `time` (s)."""
        before = bisect_right(self._stops, time + self._tiny) - 1
        return time - (self._stops[before] if before >= 0 else 0.0) <= self._tiny

    def propose(self, length: StepLength, time: float, limit: float | None = None) -> Proposal:
        """The step to try from `time`, never past the next milestone or `limit`, s."""
        if self.most > 1.0 and self.at_milestone(time):
            length = replace(length, growth=1.0)
        stop = self.next_stop(time)
        stop = stop if limit is None else min(stop, limit)
        base = length.step if self._longest is None else min(length.step, self._longest(time))
        left, step = stop - time, base * length.growth
        clipped = left <= step * (1 + 1e-9)
        end = stop if clipped else time + step
        if not clipped and (self._adaptive is not None or length.growth > 1.0) and left < 2 * step:
            end = time + 0.5 * left  # two even steps rather than a crumb at the end
        return Proposal(end, end - time, base, clipped, length)

    def accepts(self, error: float) -> bool:
        """Whether a step with this estimated error (K) may be kept."""
        return error <= self.tolerance

    def learn(self, tried: Proposal, error: float) -> StepLength:
        """What follows from the error of a step, kept or not.

        Raises:
            RunFailure: If the error of the smallest step is too large.
        """
        ratio, accepted = self.tolerance / max(error, 1e-300), self.accepts(error)
        length, taken = tried.length, tried.taken
        if self.most > 1.0 and (accepted or length.growth > 1.0):
            scale = min(max(LIMITS.shrink, LIMITS.safety * ratio**self._exponent), LIMITS.growth)
            growth = min(max(taken / tried.base * scale, 1.0), self.most)
            length = replace(length, growth=growth)
            if not accepted:
                return length
        if self._adaptive is None and accepted:
            grown = min(LIMITS.growth, LIMITS.safety * ratio**self._exponent)
            grown = max(grown, 1.0) if tried.clipped else grown
            step = min(self._fixed or length.step, self._on_ladder(length.step * grown))
            return replace(length, step=step)
        # Growth is damped: vertices that pass the liquidus make the estimate jump from step to
        # step, and a step that grows on a quiet one is rejected at the next.
        factor = LIMITS.safety * ratio ** (self._exponent if ratio < 1.0 else 0.5 * self._exponent)
        # In this order it shrinks for an error that is NaN.
        proposed = taken * min(max(LIMITS.shrink, factor), LIMITS.growth)
        if not accepted:
            shorter = self._shorter(tried, proposed)
            if shorter is None:
                raise RunFailure(
                    f"the error of a step of {taken:.3g} s is {error:.3g} K; allow a shorter step "
                    "(thermal.time.adaptive.smallest) or a larger error "
                    "(thermal.time.adaptive.tolerance)"
                )
            return replace(length, step=shorter)
        if tried.clipped:  # a step cut short by a milestone teaches no smaller one
            proposed = max(proposed, length.step)
        assert self._adaptive is not None
        return replace(length, step=min(max(proposed, self.smallest), self._adaptive.largest))

    def failed(self, tried: Proposal, reason: str, wanted: float | None = None) -> StepLength:
        """What to try after the solver failed on a step.

        Args:
            tried: The step.
            reason: Why it failed.
            wanted: What to try instead, s; a share of it if not known.

        Raises:
            RunFailure: If the step is already the smallest.
        """
        left = tried.taken * LIMITS.failed
        if tried.length.growth > 1.0:
            return replace(tried.length, growth=max(left / tried.base, 1.0))
        shorter = self._shorter(tried, left if wanted is None else wanted)
        if shorter is None:
            raise RunFailure(
                f"the solver fails at the smallest step ({tried.taken:.3g} s): {reason}"
            )
        return replace(tried.length, step=shorter)

    def _shorter(self, tried: Proposal, proposed: float) -> float | None:
        """The step to try after one that is not kept, s; None if there is none.

        It is no shorter than the smallest.  Only what a milestone had cut below that may be
        divided once more: the length that is left was not chosen for its error.
        """
        if tried.taken > self.smallest * (1 + LIMITS.rounding):
            return max(self._on_ladder(proposed), self.smallest)
        cut = tried.clipped and tried.taken < self.smallest * (1 - LIMITS.rounding)
        return proposed if cut else None

    def _on_ladder(self, step: float) -> float:
        """A step that is no longer, from the ladder where steps are fixed, s."""
        return step if self._unit is None else rung(step, self._unit)

    def restart(self, length: StepLength) -> StepLength:
        """Forget the step learnt: the cooling has just changed."""
        if self._adaptive is None:
            return length
        return replace(length, step=min(length.step, self._adaptive.first))
