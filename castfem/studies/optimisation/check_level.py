"""The optimum with the constraints of the checking level, from runs of that level.

A finer level has other margins than the search. The quadratics of the search give the nearest point
at which binding constraints are just met; the run of the finer level there corrects the quadratics,
and so on until the point converges. If a constraint is still violated then, or a binding one has a
large margin, the search goes on along the slope of the runs of that level. The best of its runs
that meet the constraints counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.types import Array
from castfem.studies.optimisation.local_model import Quadratic, nearest
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.responses import Responses


@dataclass(frozen=True, slots=True)
class CheckLimits:
    """Limits on the runs of the check."""

    turns: int = 4  #: runs of the checking level, besides that of the best one
    onward: int = 6  #: further runs if a constraint is still violated
    farthest: float = 0.25  #: longest step of these, relative to the ranges


LIMITS = CheckLimits()


@dataclass(frozen=True, slots=True)
class CheckedOptimum:
    """An optimum at the level of its check."""

    request: RunRequest  #: its run at that level
    vector: Array  #: cost and margins of that run (1 + m,), SI
    missed: bool = False  #: whether it violates a constraint by more than scatter
    further: tuple[float, ...] = ()
    """Direction of the search where it was stopped, by variable -1, 0 or 1; empty if it ended."""
    why: str = ""  #: why it was stopped


@dataclass(frozen=True, slots=True)
class Check:
    """Searches for the optimum at the level of the check."""

    level: str
    responses: Responses
    model: Quadratic  #: quadratics of the runs around the optimum
    binding: Sequence[bool]  #: which constraints limit the objective
    radius: float  #: allowed error of the point, relative to the ranges
    scatter: Array  #: scatter of cost and margins (1 + m,), SI

    def optimum(self, best: RunRequest) -> CheckedOptimum | None:
        """Return the optimum at the checking level; None if the best run fails there."""
        problem, runs = self.responses.problem, list[CheckedOptimum]()
        place = problem.shares(best)
        for _ in range(1 + LIMITS.turns):
            found = self._run(place)
            if found is None:
                break
            runs.append(found)
            here = problem.shares(found.request)
            off = found.vector[1:] - self.model(here[None])[0, 1:]
            place = nearest(self.model, off, self.binding)
            if np.max(np.abs(place - here)) <= self.radius:
                break
        if not runs:
            return None
        target, why = self._onward(runs)
        found = self._best(runs)
        if target is None:
            return found
        way = np.sign(target - problem.shares(found.request))
        return replace(found, further=tuple(float(step) for step in way), why=why)

    def _run(self, place: Array) -> CheckedOptimum | None:
        """The run at a point (n,), fractions of the ranges; None if it fails."""
        request = self.responses.problem.request(place, self.level)
        self.responses.fetch([request])
        vector = self.responses.vector_or_nan(request)
        return None if np.isnan(vector).any() else CheckedOptimum(request, vector)

    def _allowed(self) -> Array:
        """Allowed violation of the margins (m,), SI."""
        rises = self.model.slopes[:, 1:]
        return np.asarray(self.scatter[1:] + self.radius * np.linalg.norm(rises, axis=0))

    def _missed(self, run: CheckedOptimum) -> float:
        """Largest violation of a margin, relative to the allowed one; 0 if all are met."""
        allowed = self._allowed()
        missed = np.minimum(run.vector[1:] + allowed, 0.0)
        return float(np.min(missed / np.maximum(allowed, 1e-300), initial=0.0))

    def _best(self, runs: Sequence[CheckedOptimum]) -> CheckedOptimum:
        """The last run that meets all, or an earlier, better one; else the least violation."""
        meet = [run for run in runs if self._missed(run) >= 0.0]
        if not meet:
            return replace(max(runs, key=self._missed), missed=True)
        cheapest = min(meet, key=lambda run: float(run.vector[0]))
        return meet[-1] if meet[-1].vector[0] <= cheapest.vector[0] + self.scatter[0] else cheapest

    def _to_move(self, margins: Array) -> int | None:
        """The most violated margin; else the binding one that is largest; None if neither."""
        if not len(margins):
            return None
        relative = margins / np.maximum(self._allowed(), 1e-300)
        if relative.min() < -1.0:
            return int(np.argmin(relative))
        number = int(np.argmax(np.where(self.binding, relative, 0.0)))
        return number if self.binding[number] and relative[number] > 1.0 else None

    def _onward(self, runs: list[CheckedOptimum]) -> tuple[Array | None, str]:
        """Make further runs until all margins are met, and binding ones just met.

        Returns:
            The point (n,) that could not be reached, and why; None if there is none.
        """
        shares, before = self.responses.problem.shares, len(runs)
        while True:
            last = runs[-1]
            here, margins = shares(last.request), last.vector[1:]
            number = self._to_move(margins)
            if number is None:
                return None, ""
            slope = self.model.slopes[:, 1 + number]
            if len(runs) > before:  # improvement by the last step
                step = here - shares(runs[-2].request)
                gain = last.vector[1 + number] - runs[-2].vector[1 + number]
                if gain * float(slope @ step) > 0.0:
                    slope = gain * step / float(step @ step)
            steep = float(np.linalg.norm(slope))
            if not steep > 0.0:
                return None, ""
            length = float(np.clip(-margins[number] / steep, -LIMITS.farthest, LIMITS.farthest))
            place = np.clip(here + length * slope / steep, 0.0, 1.0)
            if np.max(np.abs(place - here)) <= 0.1 * self.radius:
                return None, ""  # the end of a range
            target = shares(self.responses.problem.request(place))
            if len(runs) == before + LIMITS.onward:
                return target, f"{LIMITS.onward} runs towards it were not enough"
            found = self._run(place)
            if found is None:
                return target, "a run towards it fails"
            runs.append(found)
