"""Responses of the runs of a problem: objective, margins of the constraints, derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity, from_si, to_si, unit_of_difference
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.optimisation.evaluator import Evaluator, lean, variant
from castfem.studies.optimisation.problem import (
    DesignProblem,
    DesignVariable,
    RunRequest,
    UncertainInput,
)
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.sweep.work import Derivatives

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.sensitivity.result import Slope


Obtain = Callable[[Sequence[RunRequest]], None]
"""Makes runs, so that `KnownRuns.find` returns their results."""


class KnownRuns:
    """Cases and results of the runs of a problem, given by `tell` or found in the folder."""

    def __init__(self, problem: DesignProblem, evaluator: Evaluator | None) -> None:
        self._problem, self._evaluator = problem, evaluator
        self._lean = lean(problem.case)
        self._cases: dict[RunRequest, Case] = {}
        self._differentiated: set[RunRequest] = set()  # requests for which derivatives were wanted
        self.results: dict[RunRequest, Evaluation] = {}

    def case(self, request: RunRequest) -> Case:
        """The case of a run."""
        if request not in self._cases:
            changes = self._problem.changes(request)
            made = variant(self._lean, changes, request.fidelity, ideal=request.ideal)
            self._cases[request] = made
        return self._cases[request]

    def find(self, request: RunRequest) -> Evaluation | None:
        """The results of a run, None if it has not been made as requested."""
        found = self.results.get(request)
        if request.derivatives and request not in self._differentiated:
            found = None
        if found is None and self._evaluator is not None:
            derivatives = of_run(self._problem, request) if request.derivatives else None
            found = self._evaluator.store.find(self.case(request), derivatives)
            if found is not None:
                self.note(request, found)
        return found

    def note(self, request: RunRequest, results: Evaluation) -> None:
        """Keep the results of a run."""
        self.results[request] = results
        if request.derivatives:
            self._differentiated.add(request)


class Responses:
    """Objective and margins of the runs of a problem.

    Args:
        problem: The problem.
        runs: Cases and results.
        obtain: Makes missing runs.
        objective: Result and sense, instead of the problem's.
        extra: Constraints in addition to the problem's.
        seen: The runs of other responses, to be shared.

    Attributes:
        runs: Runs of all responses of the problem.
        objective: The objective. sense: 1 to minimise it, -1 to maximise it.
        bounds: The constraints.
        seen: The runs used so far, in that order.
    """

    def __init__(
        self,
        problem: DesignProblem,
        runs: KnownRuns,
        obtain: Obtain,
        objective: tuple[str, float] | None = None,
        extra: Sequence[Bound] = (),
        seen: dict[RunRequest, Evaluation] | None = None,
    ) -> None:
        self.problem, self.runs, self._obtain = problem, runs, obtain
        (own,) = problem.table.objectives
        self.objective, self.sense = objective or own
        self.bounds = (*problem.bounds, *extra)
        self.names = (self.objective, *(bound.quantity for bound in self.bounds))
        self.seen: dict[RunRequest, Evaluation] = {} if seen is None else seen

    def other(
        self, objective: tuple[str, float] | None = None, extra: Sequence[Bound] = ()
    ) -> Responses:
        """Responses of the same runs with another objective, or further constraints."""
        return Responses(self.problem, self.runs, self._obtain, objective, extra, self.seen)

    def apart(self) -> Responses:
        """The same responses for runs outside the search."""
        return Responses(self.problem, self.runs, self._obtain)

    def fetch(self, requests: Sequence[RunRequest]) -> None:
        """Make missing runs, with those in the idealised mould."""
        ideal = [self.problem.ideal(one) for one in requests] if self.problem.relative else []
        missing = [one for one in dict.fromkeys([*ideal, *requests]) if self.runs.find(one) is None]
        if missing:
            self._obtain(missing)
        for one in requests:
            found = self.runs.find(one)
            assert found is not None, "obtain has made all runs"
            self.seen[one] = found

    @property
    def count(self) -> int:
        """Number of constraints."""
        return len(self.bounds)

    def value(self, request: RunRequest) -> float:
        """The objective of a run in SI."""
        return self._quantity(self.seen[request], self.objective, "objective").value

    def cost(self, request: RunRequest) -> float:
        """The cost of a run: its objective with the sign for minimisation."""
        return self.sense * self.value(request)

    def margins(self, request: RunRequest) -> tuple[Array, Array]:
        """Margin of each constraint (positive if met), and its bound (m,), for a run, SI."""
        left, limits = [], []
        for bound in self.bounds:
            value = self._quantity(self.seen[request], bound.quantity, "constraints").value
            ideal = self._ideal(request, bound.quantity) if bound.relative else 1.0
            limits.append(bound.value * ideal)
            left.append(bound.sign * (value - limits[-1]))
        return np.array(left), np.array(limits)

    def vector(self, request: RunRequest) -> Array:
        """Cost and margins of a run (1 + m,); NaN if it has failed."""
        if self.seen[request].failed:
            return np.full(1 + self.count, np.nan)
        return np.array([self.cost(request), *self.margins(request)[0]])

    def vector_or_nan(self, request: RunRequest) -> Array:
        """The same, NaN also if the run in the idealised mould has failed."""
        try:
            return self.vector(request)
        except InputError:
            return np.full(1 + self.count, np.nan)

    def slopes(self, request: RunRequest) -> Array | None:
        """Derivatives of cost and margins by the fractions of all ranges (1 + m, n + d), SI.

        None for a run without derivatives; NaN for unknown ones.
        """
        slopes = self.seen[request].slopes
        if not slopes or any(name not in slopes for name in self.names):
            return None
        rows = [by_shares(self.problem, request, slopes[name]) for name in self.names]
        rows[0] = self.sense * rows[0]
        for i, bound in enumerate(self.bounds, 1):
            ideal = self.problem.ideal(request)
            if bound.relative and of_run(self.problem, ideal).to:  # otherwise constant
                run = self.runs.find(ideal)
                there = None if run is None else run.slopes
                if not there or bound.quantity not in there:
                    return None
                share = by_shares(self.problem, ideal, there[bound.quantity])
                rows[i] = rows[i] - bound.value * share
            rows[i] = bound.sign * rows[i]
        return np.array(rows)

    def of_level(self, fidelity: str) -> list[RunRequest]:
        """The runs of a level used so far, with the inputs of the case."""
        return [w for w in self.seen if w.fidelity == fidelity and not w.inputs and not w.ideal]

    def table(self, fidelity: str) -> tuple[Array, Array]:
        """Points (r, n) of the runs of a level, fractions of the ranges, and their vectors."""
        own = self.of_level(fidelity)
        shares = np.array([self.problem.shares(one) for one in own])
        return shares, np.array([self.vector(one) for one in own])

    def _ideal(self, request: RunRequest, name: str) -> float:
        run = self.runs.find(replace(self.problem.ideal(request), derivatives=False))
        assert run is not None, "it was made with the run"
        if run.failed:
            raise InputError(
                f"{self.problem.origin}: optimise.constraints: the run in the idealised mould, by "
                f"which {name} is measured, has failed: {run.message}"
            )
        return self._quantity(run, name, "constraints").value

    def _quantity(self, results: Evaluation, name: str, key: str) -> Quantity:
        if name not in results.quantities:
            raise InputError(
                f'{self.problem.origin}: optimise: {key} ("{name}") is not a result of this case'
                f"{units.nearest(name, results.quantities)}"
            )
        return results.quantities[name]


def of_run(problem: DesignProblem, request: RunRequest) -> Derivatives:
    """The derivatives that a run computes: of objective and constraints, by everything that varies.

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
    """Derivatives of a result by the fractions of the ranges (n + d,), SI; NaN if unknown.

    The derivatives by the d inputs are included only if the run has other inputs than the case.
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
    """Width of a range in the unit of the parameter; for a factor times the value it multiplies."""
    if isinstance(one, UncertainInput) and one.relative:
        return slope.at / factor * (one.high - one.low)
    low, high = (to_si(end, one.unit or "1") for end in (one.low, one.high))
    return from_si(high - low, unit_of_difference(slope.unit))
