"""Takes coupling windows, shortened as often as necessary."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from castfem.base import log
from castfem.base.constants import ROUNDING
from castfem.base.errors import RunFailure
from castfem.physics.coupling.staggered import CouplingWindow, StaggeredCoupling, StrandState
from castfem.physics.coupling.step_control import StepControl


@dataclass(frozen=True, slots=True)
class WindowLimits:
    """Limits of the shortening of windows."""

    #: fraction of the case's window: not shortened further for an unconverged gap, or for a state
    #: outside the range of the model, where a shorter window would end, too
    shortest: float = 0.02
    #: s: a window this short is not shortened for its error, however long others may be
    fine: float = 0.1


LIMITS = WindowLimits()


def take_window(
    coupling: StaggeredCoupling, state: StrandState, control: StepControl
) -> tuple[CouplingWindow, int]:
    """Take a window, shortened until it succeeds; also return the number of failures.

    A window whose gap does not converge counts as a failure, but does not end the run. A window
    whose error is too large is shortened as well.

    Raises:
        RunFailure: The smallest window failed, the model does not hold (`mechanics.validity`), or
            nothing carries a load.
    """
    failed = cut = 0
    begins = control.at_milestone(state.time)  # rates before and after a milestone differ
    length = state.window
    while True:
        tried = control.propose(length, state.time)
        taken = tried.taken
        short = taken < LIMITS.shortest * coupling.window
        fine = taken < min(LIMITS.shortest * coupling.window, LIMITS.fine)
        allowed = np.inf if fine else control.tolerance
        attempt = coupling.take(state, tried.end, allowed)
        if attempt.converged and taken > (1.0 + ROUNDING) * tried.base and not begins:
            curved = coupling.curved(state, attempt.state) * control.tolerance
            attempt = replace(attempt, error=max(attempt.error, curved))
        if attempt.converged and attempt.error > allowed:
            log.logger.debug(
                "t = %.6g s: coupling window %.3g s: error %.3g K", state.time, taken, attempt.error
            )
            length = control.learn(tried, attempt.error)
            cut += 1
            continue
        kept = coupling.max_iterations == 1 or short
        if attempt.converged and (attempt.gap_converged or kept):
            learns = not fine or control.accepts(attempt.error)  # otherwise the next one is as long
            length = control.learn(tried, attempt.error) if learns else tried.length
            committed = replace(attempt.state, window=length)
            return replace(attempt, state=committed, cut_for_error=cut), failed
        reason = "the gap does not converge" if attempt.converged else attempt.mechanical.reason
        log.logger.debug("t = %.6g s: coupling window %.3g s: %s", state.time, taken, reason)
        if attempt.mechanical.unborne or (attempt.mechanical.refused and short):
            raise RunFailure(f"mechanics: {reason}")
        try:
            length = control.failed(tried, reason)
        except RunFailure as error:
            raise RunFailure(f"mechanics: {error}") from None
        failed += 1
