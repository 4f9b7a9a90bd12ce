"""Derivatives that the runs of a problem compute, and what they are by the shares of its ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.errors import InputError
from castfem.base.shown_quantity import from_si, to_si, unit_of_difference
from castfem.base.types import Array
from castfem.studies.optimisation.problem import DesignProblem, DesignVariable, RunRequest
from castfem.studies.optimisation.uncertain_inputs import UncertainInput
from castfem.studies.sweep.work import Derivatives

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.sensitivity.result import Slope


def of_run(problem: DesignProblem, request: RunRequest) -> Derivatives:
    """The derivatives that a run computes: of objective and constraints, by all that is varied.

    In the idealised mould only results of relative bounds, and not by keys of the mould.
    """
    bounds = [bound.quantity for bound in problem.bounds if bound.relative or not request.ideal]
    own = [] if request.ideal else [name for name, _ in problem.table.objectives]
    keys = [one.key for one in problem.variables if not (request.ideal and one.of_mould)]
    keys += [one.key for one in problem.inputs if request.inputs]
    return Derivatives(tuple(dict.fromkeys([*own, *bounds])), tuple(keys))


def obstacles(problem: DesignProblem, runs: Mapping[RunRequest, Case]) -> list[str]:
    """Return why runs, one of each kind, cannot compute derivatives, as far as known before."""
    from castfem.model.build.simulation import case_steel
    from castfem.studies.sensitivity.parameters import read_parameters
    from castfem.studies.sensitivity.run import refuse

    for request, case in runs.items():
        mould = [one.key for one in problem.inputs if one.key.partition(".")[0] == "mould"]
        if request.ideal and request.inputs and mould:
            return [f"{', '.join(mould)}: has no effect in the idealised mould"]
        try:
            refuse(case)
            if to := of_run(problem, request).to:
                read_parameters(case, case_steel(case), to)
        except InputError as error:
            return [line.removeprefix(f"{case.title}: ") for line in error.problems]
    return []


def by_shares(problem: DesignProblem, request: RunRequest, slopes: Mapping[str, Slope]) -> Array:
    """Derivatives of a result by the shares of the ranges (n + d,), SI; NaN where not known.

    Those by the d inputs only where the run has other inputs than the case.
    """
    inputs = problem.inputs if request.inputs else ()
    ranges: Sequence[DesignVariable | UncertainInput] = (*problem.variables, *inputs)
    factors = (*(1.0 for _ in problem.variables), *request.inputs)
    found = np.zeros(len(ranges))
    for i, (one, factor) in enumerate(zip(ranges, factors, strict=True)):
        if request.ideal and isinstance(one, DesignVariable) and one.of_mould:
            continue
        slope = slopes.get(one.key)
        found[i] = np.nan if slope is None else slope.value * _width(one, slope, factor)
    return found


def _width(one: DesignVariable | UncertainInput, slope: Slope, factor: float) -> float:
    """Width of a range in the unit of the parameter; that of a factor times what it multiplies."""
    if isinstance(one, UncertainInput) and one.relative:
        return slope.at / factor * (one.high - one.low)
    low, high = (to_si(end, one.unit or "1") for end in (one.low, one.high))
    return from_si(high - low, unit_of_difference(slope.unit))
