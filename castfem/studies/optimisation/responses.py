"""What the runs of a problem give: objective and margins of the constraints, failed or not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.optimisation.derivative_request import by_shares, of_run
from castfem.studies.optimisation.evaluator import Evaluator, lean, variant
from castfem.studies.optimisation.problem import DesignProblem, RunRequest
from castfem.studies.optimisation.store import Evaluation

if TYPE_CHECKING:
    from castfem.model import Case

Obtain = Callable[[Sequence[RunRequest]], None]
"""Makes runs, after which `KnownRuns.find` gives their results."""


class KnownRuns:
    """The cases and results of the runs of a problem: handed in, or in the folder."""

    def __init__(self, problem: DesignProblem, evaluator: Evaluator | None) -> None:
        self._problem, self._evaluator = problem, evaluator
        self._lean = lean(problem.case)
        self._cases: dict[RunRequest, Case] = {}
        self._differentiated: set[RunRequest] = set()  # that were asked for derivatives
        self.results: dict[RunRequest, Evaluation] = {}

    def case(self, request: RunRequest) -> Case:
        """The case of a run."""
        if request not in self._cases:
            changes = self._problem.changes(request)
            made = variant(self._lean, changes, request.fidelity, ideal=request.ideal)
            self._cases[request] = made
        return self._cases[request]

    def find(self, request: RunRequest) -> Evaluation | None:
        """The results of a run, None where it has not been made as requested."""
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
        obtain: Makes those that are missing.
        objective: Result and sense, instead of the problem's.
        extra: Constraints beside the problem's.
        seen: The runs of other responses, to be shared with them.

    Attributes:
        runs: Of all responses of the problem.
        objective: The result that is to be best. sense: 1 where it is to be small, -1 where large.
        bounds: The constraints.
        seen: The runs that were looked at, in that order.
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
        """Another objective, or further constraints, of the same runs; see the arguments."""
        return Responses(self.problem, self.runs, self._obtain, objective, extra, self.seen)

    def apart(self) -> Responses:
        """The same for runs that are none of the search."""
        return Responses(self.problem, self.runs, self._obtain)

    def fetch(self, requests: Sequence[RunRequest]) -> None:
        """Have runs made where they are missing, those in the idealised mould with them."""
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
        """The objective of a run in SI, as it is."""
        return self._quantity(self.seen[request], self.objective, "objective").value

    def cost(self, request: RunRequest) -> float:
        """The objective of a run, less is better."""
        return self.sense * self.value(request)

    def margins(self, request: RunRequest) -> tuple[Array, Array]:
        """How far each constraint is on the right side, and its bound (m,), of a run, SI."""
        left, limits = [], []
        for bound in self.bounds:
            value = self._quantity(self.seen[request], bound.quantity, "constraints").value
            ideal = self._ideal(request, bound.quantity) if bound.relative else 1.0
            limits.append(bound.value * ideal)
            left.append(bound.sign * (value - limits[-1]))
        return np.array(left), np.array(limits)

    def vector(self, request: RunRequest) -> Array:
        """Cost and margins of a run (1 + m,); NaN for one that has failed."""
        if self.seen[request].failed:
            return np.full(1 + self.count, np.nan)
        return np.array([self.cost(request), *self.margins(request)[0]])

    def vector_or_nan(self, request: RunRequest) -> Array:
        """The same, NaN also where the run in the idealised mould has failed."""
        try:
            return self.vector(request)
        except InputError:
            return np.full(1 + self.count, np.nan)

    def slopes(self, request: RunRequest) -> Array | None:
        """Derivatives of cost and margins by the shares of all ranges (1 + m, n + d), SI.

        None for a run that has none; NaN for those that are not known.
        """
        slopes = self.seen[request].slopes
        if not slopes or any(name not in slopes for name in self.names):
            return None
        rows = [by_shares(self.problem, request, slopes[name]) for name in self.names]
        rows[0] = self.sense * rows[0]
        for i, bound in enumerate(self.bounds, 1):
            ideal = self.problem.ideal(request)
            if bound.relative and of_run(self.problem, ideal).to:  # else it is constant
                run = self.runs.find(ideal)
                there = None if run is None else run.slopes
                if not there or bound.quantity not in there:
                    return None
                share = by_shares(self.problem, ideal, there[bound.quantity])
                rows[i] = rows[i] - bound.value * share
            rows[i] = bound.sign * rows[i]
        return np.array(rows)

    def of_level(self, fidelity: str) -> list[RunRequest]:
        """The runs of a level that were looked at, with the inputs of the case."""
        return [w for w in self.seen if w.fidelity == fidelity and not w.inputs and not w.ideal]

    def table(self, fidelity: str) -> tuple[Array, Array]:
        """Places (r, n) of the runs of a level, shares of the ranges, and their vectors."""
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
                f'{self.problem.origin}: optimise: {key} ("{name}") is no result of this case'
                f"{units.nearest(name, results.quantities)}"
            )
        return results.quantities[name]
