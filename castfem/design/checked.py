"""Where an optimum is by the level that checks it: by runs of that level, not by quadratics alone.

A finer level has other margins than the search. How margins change with the variables the
quadratics of the search tell, what they are the runs of the finer level: the nearest place at which
a constraint that binds is just met is run by that level, which shows what the quadratics had wrong,
and so on until the place stays. Where a constraint is missed there still, for the quadratics end or
bend, the way goes on by what the runs of that level have gained.
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
_ONWARD = 6  # more, where a constraint is missed still
_FARTHEST = 0.25  # of the ranges, a step of these


@dataclass(frozen=True, slots=True)
class Checked:
    """An optimum by the level of its check.

    Attributes:
        wanted: Its run by that level.
        vector: What it has given: cost and margins (1 + m,), SI.
        missed: Whether a constraint is missed there still, by more than scatter.
    """

    wanted: Wanted
    vector: Array
    missed: bool = False


def best_by(
    level: str,
    outputs: Outputs,
    best: Wanted,
    model: vicinity.Quadratic,
    binds: Sequence[bool],
    radius: float,
    scatter: Array,
) -> Checked | None:
    """Return the optimum by another level; None where the best run has not come through there.

    Args:
        level: Of the check.
        outputs: What the runs mean; gets those that are missing.
        best: The optimum by the level of the search.
        model: Quadratics of the runs about it.
        binds: Which constraints keep the objective from being better.
        radius: Share of the ranges by which a place may be off.
        scatter: Of the margins (m,), SI.
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
    rises = model.weights[1 : 1 + len(model.centre), 1:] / model.step[:, None]
    allowed = scatter + radius * np.linalg.norm(rises, axis=0)
    if found is None or _least(found, allowed) >= 0.0:
        return found
    return _onward(found, outputs, rises, radius, allowed)


def _least(checked: Checked, allowed: Array) -> float:
    """The margin that is missed most, over what may be missed; 0 where all are met."""
    missed = np.minimum(checked.vector[1:] + allowed, 0.0)
    return float(np.min(missed / np.maximum(allowed, 1e-300), initial=0.0))


def _onward(
    found: Checked, outputs: Outputs, rises: Array, radius: float, allowed: Array
) -> Checked:
    """Go on until all margins are met; where no run meets them, the one that misses least.

    Args:
        found: Where a margin is missed.
        outputs: What the runs mean; gets those that are missing.
        rises: Slopes of the margins by the quadratics (n, m), SI per share of a range.
        radius: Share of the ranges by which a place may be off.
        allowed: What of each margin may be missed (m,), SI.
    """
    question, before, best = outputs.question, None, found
    for _ in range(_ONWARD):
        here, margins = question.shares(found.wanted), found.vector[1:]
        number = int(np.argmin(margins / np.maximum(allowed, 1e-300)))
        rise = rises[:, number]
        if before is not None:  # what the way so far has gained
            way = here - question.shares(before.wanted)
            gain = margins[number] - before.vector[1 + number]
            if gain > 0.0:
                rise = gain * way / float(way @ way)
        steep = float(np.linalg.norm(rise))
        if not steep > 0.0:
            break
        step = min(-margins[number] / steep, _FARTHEST)
        there = np.clip(here + step * rise / steep, 0.0, 1.0)
        if np.max(np.abs(there - here)) <= 0.1 * radius:
            break  # the end of a range
        tried = replace(question.at(there), fidelity=found.wanted.fidelity)
        outputs.fetch([tried])
        vector = outputs.vector_or_nan(tried)
        if np.isnan(vector).any():
            break
        before, found = found, Checked(tried, vector)
        if _least(found, allowed) > _least(best, allowed):
            best = found
        if _least(found, allowed) >= 0.0:
            break
    return replace(best, missed=_least(best, allowed) < 0.0)
