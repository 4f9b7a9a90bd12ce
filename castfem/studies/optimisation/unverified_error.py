"""Parts of the error of an optimum that were not checked: they open its intervals.

Where runs of a check fail, that part of the error is not zero. The interval is open to both sides
then, or, where the check was moving, to the side it was moving to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.types import Flags
from castfem.studies.accuracy.sizes import LEVELS
from castfem.studies.optimisation.check_level import CheckedOptimum
from castfem.studies.optimisation.numerical_error import NumericalError, next_of
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.search import SEARCH, Search
from castfem.studies.optimisation.spread import InputSpread

_NOISE = "noise was not measured: runs about the start, or about the best one, fail"
_EXHAUSTED = "the search has had its runs before it was done: raise optimise.most_runs"
_NO_SPREAD = "it lacks the spread by the inputs: too few of those runs came through"


@dataclass(frozen=True, slots=True)
class UnverifiedError:
    """What is not known of the place of an optimum."""

    lower: Flags  #: whether each variable may therefore lie lower (n,)
    higher: Flags
    reasons: tuple[str, ...]

    @classmethod
    def of(
        cls,
        search: Search,
        best: RunRequest,
        error: NumericalError,
        checked: CheckedOptimum | None,
        spread: InputSpread | None,
    ) -> UnverifiedError:
        """Return what the checks of a best run have left open."""
        problem = search.problem
        both = np.ones(len(problem.variables), dtype=bool)
        found: list[tuple[Flags, Flags, str]] = []
        if search.exhausted:
            found.append((both, both, _EXHAUSTED))
        if not search.noise_known:
            found.append((both, both, _NOISE))
        if not error.checked:
            found.append((both, both, _no_check(best, error)))
        elif checked is not None and checked.further:
            way = np.array(checked.further)
            why = f"the optimum by {error.checked} was not reached: {checked.why}"
            found.append((way < 0.0, way > 0.0, why))
        if any(error.untilted):
            shares, last = problem.shares(best), SEARCH.at_end * search.radius
            free = error.untilted & (shares > last) & (shares < 1.0 - last)
            pairs = zip(problem.variables, free, strict=True)
            if keys := " and ".join(variable.key for variable, one in pairs if one):
                why = f"how the numerical error changes along {keys} is not known: "
                found.append((free, free, f"{why}runs by {next_of(best.fidelity)} fail"))
        if problem.inputs and spread is None:
            found.append((both, both, _NO_SPREAD))
        lower, higher = (
            np.any([~both, *sides], axis=0)
            for sides in ([one for one, _, _ in found], [one for _, one, _ in found])
        )
        return cls(lower, higher, tuple(why for _, _, why in found))


def _no_check(best: RunRequest, error: NumericalError) -> str:
    """Say that no level checks a best run, and by which its numerical error is known."""
    others = [word for word in LEVELS if word != best.fidelity]
    missing = " and ".join(word for word in others if word not in error.finished)
    known = [word for word in others if word in error.finished]
    if known:
        return f"the numerical error is by {known[0]} cells alone: the best run fails by {missing}"
    return f"the numerical error is not known: the best run fails by {missing}"
