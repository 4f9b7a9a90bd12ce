"""Where an optimum is by the level that checks it: by runs of that level, not by quadratics alone.

A finer level has other margins than the search. How margins change with the variables the
quadratics of the search tell, what they are the runs of the finer level: the nearest place at which
a constraint that binds is just met is run by that level, which shows what the quadratics had wrong,
and so on until the place stays. Where a constraint is missed there still, or one that binds has
much left, for the quadratics end or bend, the way goes on by what the runs of that level have
gained. Of all its runs that meet the constraints the best one counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.types import Array
from castfem.studies.optimisation import vicinity
from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Wanted

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
        further: Which way it would have gone on, by variable -1, 0 or 1; empty where it is done, or
            the range ends.
        why: It did not.
    """

    wanted: Wanted
    vector: Array
    missed: bool = False
    further: tuple[float, ...] = ()
    why: str = ""


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
        scatter: Of cost and margins (1 + m,), SI.
    """
    question = outputs.question
    tried = replace(best, fidelity=level)
    runs: list[Checked] = []
    for _ in range(1 + _TURNS):
        outputs.fetch([tried])
        vector = outputs.vector_or_nan(tried)
        if np.isnan(vector).any():
            break
        runs.append(Checked(tried, vector))
        here = question.shares(tried)
        off = vector[1:] - model(here[None])[0, 1:]
        there = vicinity.nearest(model, off, binds)
        if np.max(np.abs(there - here)) <= radius:
            break
        tried = replace(question.at(there), fidelity=level)
    if not runs:
        return None
    rises = model.weights[1 : 1 + len(model.centre), 1:] / model.step[:, None]
    allowed = scatter[1:] + radius * np.linalg.norm(rises, axis=0)
    more, target, why = _onward(runs[-1], outputs, rises, radius, allowed, binds)
    found = _best([*runs, *more], scatter[0], allowed)
    if target is None:
        return found
    way = np.sign(question.shares(target) - question.shares(found.wanted))
    return replace(found, further=tuple(float(step) for step in way), why=why)


def _least(checked: Checked, allowed: Array) -> float:
    """The margin that is missed most, over what may be missed; 0 where all are met."""
    missed = np.minimum(checked.vector[1:] + allowed, 0.0)
    return float(np.min(missed / np.maximum(allowed, 1e-300), initial=0.0))


def _best(runs: Sequence[Checked], noise: float, allowed: Array) -> Checked:
    """The last run that meets all margins, or one before that is better; else what misses least."""
    meet = [run for run in runs if _least(run, allowed) >= 0.0]
    if not meet:
        return replace(max(runs, key=lambda run: _least(run, allowed)), missed=True)
    cheapest = min(meet, key=lambda run: float(run.vector[0]))
    return meet[-1] if meet[-1].vector[0] <= cheapest.vector[0] + noise else cheapest


def _to_move(margins: Array, allowed: Array, binds: Sequence[bool]) -> int | None:
    """The margin that is missed most; or, if none is, what binds with most left; None if none."""
    if not len(margins):
        return None
    by = margins / np.maximum(allowed, 1e-300)
    number = int(np.argmin(by))
    if by[number] < -1.0:
        return number
    number = int(np.argmax(np.where(binds, by, 0.0)))
    return number if binds[number] and by[number] > 1.0 else None


def _onward(
    found: Checked,
    outputs: Outputs,
    rises: Array,
    radius: float,
    allowed: Array,
    binds: Sequence[bool],
) -> tuple[list[Checked], Wanted | None, str]:
    """Go on until all margins are met, and what binds is just met.

    Args:
        found: Where to begin.
        outputs: What the runs mean; gets those that are missing.
        rises: Slopes of the margins by the quadratics (n, m), SI per share of a range.
        radius: Share of the ranges by which a place may be off.
        allowed: What of each margin may be missed (m,), SI.
        binds: Which constraints keep the objective from being better.

    Returns:
        The runs on the way; if it did not come to its end, the run that it needed, and why not.
    """
    question, before = outputs.question, None
    runs: list[Checked] = []
    while True:
        here, margins = question.shares(found.wanted), found.vector[1:]
        number = _to_move(margins, allowed, binds)
        if number is None:
            break
        rise = rises[:, number]
        if before is not None:  # what the way so far has gained
            way = here - question.shares(before.wanted)
            gain = margins[number] - before.vector[1 + number]
            if gain * float(rise @ way) > 0.0:
                rise = gain * way / float(way @ way)
        steep = float(np.linalg.norm(rise))
        if not steep > 0.0:
            break
        step = float(np.clip(-margins[number] / steep, -_FARTHEST, _FARTHEST))
        there = np.clip(here + step * rise / steep, 0.0, 1.0)
        if np.max(np.abs(there - here)) <= 0.1 * radius:
            break  # the end of a range
        tried = replace(question.at(there), fidelity=found.wanted.fidelity)
        if len(runs) == _ONWARD:
            return runs, tried, f"{_ONWARD} runs towards it were not enough"
        outputs.fetch([tried])
        vector = outputs.vector_or_nan(tried)
        if np.isnan(vector).any():
            return runs, tried, "a run towards it fails"
        before, found = found, Checked(tried, vector)
        runs.append(found)
    return runs, None, ""
