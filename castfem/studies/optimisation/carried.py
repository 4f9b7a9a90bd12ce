"""Derivatives that the runs of a question carry: which they are, and by the shares of ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.errors import InputError
from castfem.base.shown_quantity import from_si, to_si, unit_of_difference
from castfem.base.types import Array
from castfem.studies.optimisation.inputs import Uncertain
from castfem.studies.optimisation.question import Axis, Question, Wanted
from castfem.studies.sweep.work import Derivatives

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.sensitivity.slopes import Slope


def of_run(question: Question, wanted: Wanted) -> Derivatives:
    """The derivatives that a run is to carry: of what is looked at, by all that is varied.

    The idealised mould has no variables of its own; of its run the shares of bounds are taken.
    """
    bounds = [bound.quantity for bound in question.bounds if bound.relative or not wanted.ideal]
    own = [] if wanted.ideal else [name for name, _ in question.table.objectives]
    axes = [axis.key for axis in question.axes if not (wanted.ideal and axis.of_mould)]
    keys = [*axes, *(one.key for one in question.inputs if wanted.inputs)]
    return Derivatives(tuple(dict.fromkeys([*own, *bounds])), tuple(keys))


def hindrances(question: Question, runs: Mapping[Wanted, Case]) -> list[str]:
    """Return why some runs can have no derivatives, as far as that shows before they are made.

    Args:
        question: What is asked.
        runs: One of each kind, and their cases.
    """
    from castfem.model.build.simulation import case_steel
    from castfem.studies.sensitivity.parameters import read_parameters
    from castfem.studies.sensitivity.run import refuse

    for wanted, case in runs.items():
        held = [one.key for one in question.inputs if one.key.partition(".")[0] == "mould"]
        if wanted.ideal and wanted.inputs and held:
            return [f"{', '.join(held)}: the idealised mould knows nothing of it"]
        try:
            refuse(case)
            if to := of_run(question, wanted).to:
                read_parameters(case, case_steel(case), to)
        except InputError as error:
            return [problem.removeprefix(f"{case.title}: ") for problem in error.problems]
    return []


def by_shares(question: Question, wanted: Wanted, slopes: Mapping[str, Slope]) -> Array:
    """Derivatives of a result of a run by the shares of the ranges (n + d,), SI; NaN for unknown.

    Those of the inputs (d) only where the run has other ones than the case.

    Args:
        question: What is asked.
        wanted: The run.
        slopes: By key.

    Returns:
        The derivatives.
    """
    inputs = question.inputs if wanted.inputs else ()
    ranges: Sequence[Axis | Uncertain] = (*question.axes, *inputs)
    found = np.zeros(len(ranges))
    factors = (*(1.0 for _ in question.axes), *wanted.inputs)
    for i, (one, factor) in enumerate(zip(ranges, factors, strict=True)):
        if wanted.ideal and isinstance(one, Axis) and one.of_mould:
            continue
        slope = slopes.get(one.key)
        found[i] = np.nan if slope is None else slope.value * _width(one, slope, factor)
    return found


def _width(one: Axis | Uncertain, slope: Slope, factor: float) -> float:
    """Width of a range in the unit of the parameter: of a factor, by what it multiplies."""
    if isinstance(one, Uncertain) and one.relative:
        return slope.at / factor * (one.high - one.low)
    low, high = (to_si(end, one.unit or "1") for end in (one.low, one.high))
    return from_si(high - low, unit_of_difference(slope.unit))
