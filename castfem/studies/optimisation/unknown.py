"""What of the error of an optimum is not known: an interval is open where a check was not done.

A part of the error whose runs fail is not nought. Which way the optimum would go is not known then,
and its interval is open to both sides; where the check was on its way, to the side it went.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from castfem.studies.accuracy.levels import LEVELS
from castfem.studies.optimisation.checked import Checked
from castfem.studies.optimisation.numerical import Numerical, next_of
from castfem.studies.optimisation.question import Question, Wanted
from castfem.studies.optimisation.search import AT_END, Search
from castfem.studies.optimisation.spread import Spread

Sides = tuple[bool, bool]
BOTH: Sides = (True, True)
NEITHER: Sides = (False, False)
_NOISE = "noise was not measured: runs about the start, or about the best one, fail"


@dataclass(frozen=True, slots=True)
class Unknown:
    """What is not known of the place of an optimum.

    Attributes:
        sides: Of each variable, whether it may therefore lie lower, and higher.
        reasons: Why, a clause each.
    """

    sides: tuple[Sides, ...]
    reasons: tuple[str, ...]

    @classmethod
    def of(
        cls,
        question: Question,
        search: Search,
        best: Wanted,
        numerical: Numerical,
        there: Checked | None,
        spread: Spread | None,
    ) -> Unknown:
        """Return what the checks of a best run have left open.

        Args:
            question: What was asked.
            search: Has the noise, and the last step.
            best: The best run.
            numerical: Its numerical error.
            there: The optimum by the level of the check; None where that failed.
            spread: By the inputs; None where it was not asked for or failed.
        """
        count = len(question.axes)
        found: list[tuple[Sequence[Sides], str]] = []
        if search.spent:
            what = "the search has had its runs before it was done: raise optimise.most_runs"
            found.append((count * [BOTH], what))
        if search.noise is None or not search.noise.runs:
            found.append((count * [BOTH], _NOISE))
        if not numerical.checked:
            found.append((count * [BOTH], _no_check(best, numerical)))
        elif there is not None and there.further:
            sides = [(step < 0.0, step > 0.0) for step in there.further]
            what = f"the optimum by {numerical.checked} was not reached: {there.why}"
            found.append((sides, what))
        if any(numerical.untilted):
            shares, last = question.shares(best), AT_END * search.radius
            free = numerical.untilted & (shares > last) & (shares < 1.0 - last)
            keys = " and ".join(a.key for a, one in zip(question.axes, free, strict=True) if one)
            if keys:
                what = (
                    f"how the numerical error changes along {keys} is not known: "
                    f"runs by {next_of(best.fidelity)} fail"
                )
                found.append(([BOTH if one else NEITHER for one in free], what))
        if question.inputs and spread is None:
            what = "it lacks the spread by the inputs: too few of those runs came through"
            found.append((count * [BOTH], what))
        sides = [
            (any(one[i][0] for one, _ in found), any(one[i][1] for one, _ in found))
            for i in range(count)
        ]
        return cls(tuple(sides), tuple(what for _, what in found))


def _no_check(best: Wanted, numerical: Numerical) -> str:
    """Say that no level checks a best run, and what its numerical error is by all the same."""
    missing = " and ".join(w for w in LEVELS if w != best.fidelity and w not in numerical.through)
    known = [w for w in LEVELS if w != best.fidelity and w in numerical.through]
    if known:
        return f"the numerical error is by {known[0]} cells alone: the best run fails by {missing}"
    return f"the numerical error is not known: the best run fails by {missing}"
