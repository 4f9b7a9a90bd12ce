"""Runs that are as good as an optimum, as far as can be told: in its valley, and in others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Wanted
from castfem.studies.optimisation.search import ROUNDING, Search
from castfem.studies.optimisation.valleys import APART


@dataclass(frozen=True, slots=True)
class AsGood:
    """Runs that meet all constraints, and whose objective is not worse by more than scatter.

    Attributes:
        near: In the valley of the optimum, itself among them.
        elsewhere: In others, the best first, one of each valley.
    """

    near: tuple[Wanted, ...]
    elsewhere: tuple[Wanted, ...]

    @classmethod
    def of(cls, outputs: Outputs, search: Search, best: Wanted, scatter: float) -> AsGood:
        """Sort the runs of the level of a search.

        Args:
            outputs: What the runs mean.
            search: Knows which of them meet the constraints.
            best: The optimum.
            scatter: Of the objective, SI.
        """
        own = [w for w in outputs.seen if w.fidelity == best.fidelity and not (w.ideal or w.inputs)]
        places = {w: outputs.question.shares(w) for w in own}
        enough = outputs.cost(best) + scatter + ROUNDING * abs(outputs.cost(best))
        good = [w for w in own if search.violation(w) <= 0.0 and outputs.cost(w) <= enough]
        near, elsewhere = [best], list[Wanted]()

        def apart(one: Wanted, other: Wanted) -> bool:
            return bool(np.max(np.abs(places[one] - places[other])) >= APART)

        def between(one: Wanted) -> Iterator[Wanted]:
            low, high = (end(places[one], places[best]) for end in (np.minimum, np.maximum))
            for w in own:
                if w not in (one, best) and np.all((low <= places[w]) & (places[w] <= high)):
                    yield w

        for one in sorted(good, key=outputs.cost):
            seen = [w in good for w in between(one)]
            if not apart(one, best) or (seen and all(seen)):
                near.append(one)
            elif all(apart(one, other) for other in elsewhere):
                elsewhere.append(one)
        return cls(tuple(near), tuple(elsewhere))
