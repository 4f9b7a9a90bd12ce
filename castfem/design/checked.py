"""Where an optimum is by the level that checks it: by runs of that level, not by quadratics alone.

A finer level has other margins than the search. How margins change with the variables the
quadratics of the search tell, what they are the runs of the finer level: the nearest place at which
a constraint that binds is just met is run by that level, which shows what the quadratics had wrong,
and so on until the place stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.design import vicinity
from castfem.design.outputs import Outputs
from castfem.design.question import Wanted
from castfem.values.types import Array

_TURNS = 4  # runs by the level of the check, beside that of the best one


@dataclass(frozen=True, slots=True)
class Checked:
    """An optimum by the level of its check.

    Attributes:
        wanted: Its run by that level.
        vector: What it has given: cost and margins (1 + m,), SI.
    """

    wanted: Wanted
    vector: Array


def best_by(
    level: str,
    outputs: Outputs,
    best: Wanted,
    model: vicinity.Quadratic,
    binds: Sequence[bool],
    radius: float,
) -> Checked | None:
    """Return the optimum by another level; None where the best run has not come through there.

    Args:
        level: Of the check.
        outputs: What the runs mean; gets those that are missing.
        best: The optimum by the level of the search.
        model: Quadratics of the runs about it.
        binds: Which constraints keep the objective from being better.
        radius: Share of the ranges by which a place may be off.
    """
    found, question = None, outputs.question
    tried = replace(best, fidelity=level)
    for _ in range(1 + _TURNS):
        outputs.fetch([tried])
        vector = outputs.vector_or_nan(tried)
        if np.isnan(vector).any():
            break
        found, here = Checked(tried, vector), question.shares(tried)
        off = vector[1:] - model(here[None])[0, 1:]
        there = vicinity.nearest(model, off, binds)
        if np.max(np.abs(there - here)) <= radius:
            break
        tried = replace(question.at(there), fidelity=level)
    return found
