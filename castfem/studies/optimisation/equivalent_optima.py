"""Runs that are as good as an optimum within scatter: in its valley, and in others."""

from __future__ import annotations

import numpy as np

from castfem.studies.optimisation.global_search import APART
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.search import ROUNDING, Search


def equivalent_optima(
    search: Search, best: RunRequest, scatter: float
) -> tuple[list[RunRequest], list[RunRequest]]:
    """Return runs that meet all constraints, and whose objective is not worse by more than scatter.

    Returns:
        Those in the valley of the best one, itself among them; of each other valley the best.
    """
    responses = search.responses
    places = {w: search.problem.shares(w) for w in responses.of_level(best.fidelity)}
    cost = responses.cost(best)
    enough = cost + scatter + ROUNDING * abs(cost)
    good = [w for w in places if search.violation(w) <= 0.0 and responses.cost(w) <= enough]
    near, elsewhere = [best], list[RunRequest]()

    def apart(one: RunRequest, other: RunRequest) -> bool:
        return bool(np.max(np.abs(places[one] - places[other])) >= APART)

    def in_valley(one: RunRequest) -> bool:
        """Whether there are runs between it and the best one, all of them good."""
        low, high = np.sort([places[one], places[best]], axis=0)
        between = [w for w, at in places.items() if np.all((low <= at) & (at <= high))]
        others = [w in good for w in between if w not in (one, best)]
        return bool(others) and all(others)

    for one in sorted(good, key=responses.cost):
        if not apart(one, best) or in_valley(one):
            near.append(one)
        elif all(apart(one, other) for other in elsewhere):
            elsewhere.append(one)
    return near, elsewhere
