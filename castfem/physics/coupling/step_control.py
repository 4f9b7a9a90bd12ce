"""Time step control: fixed or by error estimate, with milestones hit exactly, and step reduction.

The controller has no state: each function takes the step length so far and returns the next one, so
that a rejected step leaves nothing behind.

A fixed step is shortened to lengths from a ladder: two runs with small differences then take the
same steps, and their results differ by these differences, not by where their steps end.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.constants import EXACT
from castfem.base.errors import RunFailure
from castfem.base.types import Array


@dataclass(frozen=True, slots=True)
class StepLimits:
    """Limits of the change from one step to the next, and tolerance of equal lengths."""

    safety: float = 0.9  # fraction of the step that would just meet the allowed error
    growth: float = 2.0  # largest growth from step to step
    shrink: float = 0.2  # smallest factor after too large an error
    failed: float = 0.25  # factor on the step after a failure of the solver
    rounding: float = 1e-6  # rounding of a step, relative to the smallest
    rungs: tuple[float, ...] = (1.0, 1.25, 1.6)  # steps of the ladder between 1 and 2
    # largest expected error of the first step after a change of cooling, as a fraction of the
    # allowed error; the expected error leaves out what neighbouring vertices add
    jump: float = 0.1
    finer: float = 0.5  # ratio of the lengths considered for that step, as a power of two
    strain: float = 1e-5  # default error of the axial strain in a window that has grown


LIMITS = StepLimits()


def rung(step: float, unit: float) -> float:
    """The longest step of the ladder up to `step`.

    Args:
        step: Step to be shortened.
        unit: Reference step; the ladder has 1, 4/5, 5/8, 1/2 ... of it, and 5/4, 8/5, 2 ...
    """
    limit = step / unit * (1.0 + LIMITS.rounding)
    whole = 2.0 ** (math.frexp(limit)[1] - 1)
    return unit * max(whole * part for part in LIMITS.rungs if whole * part <= limit)


@dataclass(frozen=True, slots=True)
class Adaptive:
    """Error-controlled stepping."""

    tolerance: float  #: allowed temperature error of a step, K
    first: float  #: shortest first step, at the meniscus and after each change of cooling, s
    smallest: float  #: smallest step, s; the run stops if it is still too long
    largest: float  #: largest step, s


@dataclass(frozen=True, slots=True)
class StepLength:
    """Length of the next step so far: `step` (s), and its growth factor."""

    step: float
    growth: float = 1.0


NO_STEP = StepLength(0.0)


@dataclass(frozen=True, slots=True)
class Proposal:
    """A step to try."""

    end: float  #: time at its end, s
    taken: float  #: length, s
    base: float  #: length without growth, s
    clipped: bool  #: whether a milestone or a limit ends it
    length: StepLength  #: step length from which it was proposed


class StepControl:
    """Proposes the end of the next step, and adapts the length to the result.

    Args:
        end: End of the run, s.
        milestones: Times that must be hit exactly (zone changes, output), s.
        fixed: Fixed step, s, or None for `adaptive`.
        adaptive: Error control, or None for `fixed`.
        tolerance: Allowed error (K) of a fixed step, above which it is shortened; None: any.
        order: Power of the step in the error estimate.
        longest: Longest step that begins at a time, s, as a function; None for no such limit.
        unit: Unit of the ladder for shortened fixed steps, s; the fixed step itself if None.
        most: Largest growth of a fixed or longest step between milestones, as a factor.

    Attributes:
        first: Step length at the start of a run.
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
        """Whether a milestone, or the start, is at `time` (s)."""
        before = bisect_right(self._stops, time + self._tiny) - 1
        return time - (self._stops[before] if before >= 0 else 0.0) <= self._tiny

    def propose(self, length: StepLength, time: float, limit: float | None = None) -> Proposal:
        """Return the step to try from `time`, never beyond the next milestone or `limit`, s."""
        if self.most > 1.0 and self.at_milestone(time):
            length = replace(length, growth=1.0)
        stop = self.next_stop(time)
        stop = stop if limit is None else min(stop, limit)
        base = length.step if self._longest is None else min(length.step, self._longest(time))
        left, step = stop - time, base * length.growth
        clipped = left <= step * (1 + 1e-9)
        end = stop if clipped else time + step
        if not clipped and (self._adaptive is not None or length.growth > 1.0) and left < 2 * step:
            end = time + 0.5 * left  # two even steps instead of a tiny one at the end
        return Proposal(end, end - time, base, clipped, length)

    def accepts(self, error: float) -> bool:
        """Whether a step with this estimated error (K) is accepted."""
        return error <= self.tolerance

    def learn(self, tried: Proposal, error: float) -> StepLength:
        """Return the step length after a step with this error, accepted or not.

        Raises:
            RunFailure: The error of the smallest step is too large.
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
        # Growth is damped: vertices passing the liquidus make the estimate jump from step to step,
        # and a step that grows after a quiet one would be rejected next.
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
        if tried.clipped:  # a step cut short by a milestone does not reduce the length
            proposed = max(proposed, length.step)
        assert self._adaptive is not None
        return replace(length, step=min(max(proposed, self.smallest), self._adaptive.largest))

    def failed(self, tried: Proposal, reason: str, wanted: float | None = None) -> StepLength:
        """Return the step length to try after the solver has failed.

        Args:
            tried: The failed step.
            reason: Reason of the failure.
            wanted: Length to try instead, s; None for a default fraction.

        Raises:
            RunFailure: The step is already the smallest.
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
        """Step to try after a rejected one, s; None if there is none.

        It is not below the smallest step. Only a step shortened below that by a milestone may be
        halved once more, since its length was not chosen for its error.
        """
        if tried.taken > self.smallest * (1 + LIMITS.rounding):
            return max(self._on_ladder(proposed), self.smallest)
        cut = tried.clipped and tried.taken < self.smallest * (1 - LIMITS.rounding)
        return proposed if cut else None

    def _on_ladder(self, step: float) -> float:
        """A step of at most this length, s; with fixed steps from the ladder."""
        return step if self._unit is None else rung(step, self._unit)

    def restart(self, length: StepLength, errors: Callable[[Array], Array]) -> StepLength:
        """Return the step length after a change of the cooling.

        Args:
            length: Step length before it.
            errors: Expected errors, K, of a first step of some lengths, s; they grow with them.
        """
        if self._adaptive is None:
            return length
        first = self._adaptive.first
        # At the start of a run no error of a step is known yet.
        longest = self._adaptive.largest if length == self.first else max(length.step, first)
        rungs = max(round(math.log2(longest / first) / LIMITS.finer), 0) + 1
        steps: Array = np.geomspace(first, longest, rungs, dtype=float)
        small = errors(steps) <= LIMITS.jump * self.tolerance
        return replace(length, step=float(steps[small].max(initial=first)))
