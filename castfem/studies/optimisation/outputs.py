"""What a run means for a question: objective and margins of the constraints, failed or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.optimisation.carried import by_shares, of_run
from castfem.studies.optimisation.question import Question, Wanted

if TYPE_CHECKING:
    from castfem.studies.optimisation.store import Evaluation


class Needs(Exception):
    """Runs that must be done before a search can go on.

    Attributes:
        wanted: The runs, none of which waits for another.
    """

    def __init__(self, wanted: Sequence[Wanted]) -> None:
        super().__init__(f"{len(wanted)} runs are needed")
        self.wanted = tuple(wanted)


Look = Callable[[Wanted], "Evaluation | None"]
Obtain = Callable[[Sequence[Wanted]], None]


@dataclass(frozen=True, slots=True)
class Margin:
    """A constraint at a run.

    Attributes:
        value: The result, in SI. bound: What it must keep to, in SI.
        sign: 1 where more is better, -1 where less is.
    """

    value: float
    bound: float
    sign: float

    @property
    def left(self) -> float:
        """How far the result is on the right side, in SI; below 0 the constraint is not met."""
        return self.sign * (self.value - self.bound)


class Outputs:
    """Objective and margins of the runs of a question.

    Args:
        question: What is asked.
        look: Gives what a run has given, None where it has not been done.
        obtain: Does the runs that are missing; None where they are to be asked for.
        objective: Result and sense, instead of the question's.
        extra: Constraints beside the question's.
        seen: The runs that others have looked at, to be shared with them.

    Attributes:
        objective: The result that is to be best. sense: 1 where it is to be small, -1 where large.
        bounds: The constraints.
        seen: The runs that were looked at, in that order.
    """

    def __init__(
        self,
        question: Question,
        look: Look,
        obtain: Obtain | None = None,
        objective: tuple[str, float] | None = None,
        extra: Sequence[Bound] = (),
        seen: dict[Wanted, Evaluation] | None = None,
    ) -> None:
        self.question, self._look, self._obtain = question, look, obtain
        (own,) = question.table.objectives
        self.objective, self.sense = objective or own
        self.bounds = (*question.bounds, *extra)
        self.seen: dict[Wanted, Evaluation] = {} if seen is None else seen

    def other(
        self, objective: tuple[str, float] | None = None, extra: Sequence[Bound] = ()
    ) -> Outputs:
        """Another objective, or further constraints, of the same runs; see the arguments."""
        return Outputs(self.question, self._look, self._obtain, objective, extra, self.seen)

    @property
    def aim(self) -> tuple[object, ...]:
        """What makes it another aim than that of other outputs of the same runs."""
        return self.objective, self.sense, self.bounds

    def fetch(self, wanted: Sequence[Wanted]) -> list[Evaluation]:
        """Return what runs have given.

        Raises:
            Needs: Some have not been done; all of them, and the idealised ones they are held to.
        """
        ideal = [self.question.ideal(one) for one in wanted] if self._relative else []
        every = list(dict.fromkeys([*ideal, *wanted]))
        found = {one: self._look(one) for one in every}
        missing = [one for one, given in found.items() if given is None]
        if missing and self._obtain is None:
            raise Needs(missing)
        if missing and self._obtain is not None:
            self._obtain(missing)
        lost = [one for one in missing if self._look(one) is None]
        if lost:
            raise InputError(
                f"solve: obtain has told nothing of {len(lost)} of the {len(missing)} runs that it "
                "was handed; tell(run, results) each"
            )
        given = [found[one] or self._look(one) for one in wanted]
        self.seen.update({w: e for w, e in zip(wanted, given, strict=True) if e is not None})
        return [one for one in given if one is not None]

    @property
    def _relative(self) -> bool:
        return any(bound.relative for bound in self.bounds)

    @property
    def count(self) -> int:
        """How many constraints there are."""
        return len(self.bounds)

    def text(self, number: int) -> str:
        """A constraint in words."""
        return self.bounds[number].text.strip()

    def name(self, number: int) -> str:
        """The result that a constraint is about."""
        return self.bounds[number].quantity

    def value(self, wanted: Wanted) -> float:
        """The objective of a run in SI, as it is.

        Raises:
            KeyError: The run has failed.
        """
        return self._quantity(self.seen[wanted], self.objective, "objective").value

    def cost(self, wanted: Wanted) -> float:
        """The objective of a run, less is better."""
        return self.sense * self.value(wanted)

    def margins(self, wanted: Wanted) -> list[Margin]:
        """The constraints at a run.

        Raises:
            KeyError: It has failed.
            InputError: It has no such result, or the idealised mould's run has failed.
        """
        found, given = [], self.seen[wanted]
        for bound in self.bounds:
            own = self._quantity(given, bound.quantity, "constraints").value
            limit = bound.value
            if bound.relative:
                limit *= self._ideal(wanted, bound.quantity)
            found.append(Margin(own, limit, bound.sign))
        return found

    def vector(self, wanted: Wanted) -> Array:
        """Cost and margins of a run (1 + m,); NaN of one that has failed."""
        if self.seen[wanted].failed:
            return np.full(1 + self.count, np.nan)
        return np.array([self.cost(wanted), *(m.left for m in self.margins(wanted))])

    def vector_or_nan(self, wanted: Wanted) -> Array:
        """The same, NaN also where the run in the idealised mould has failed."""
        try:
            return self.vector(wanted)
        except InputError:
            return np.full(1 + self.count, np.nan)

    def slopes(self, wanted: Wanted) -> Array | None:
        """Derivatives of cost and margins by the shares of all ranges (1 + m, n + d), SI.

        None of a run that tells none; NaN for those that are not known.
        """
        given = self.seen[wanted].slopes
        names = [self.objective, *(bound.quantity for bound in self.bounds)]
        if not given or any(name not in given for name in names):
            return None
        rows = [by_shares(self.question, wanted, given[name]) for name in names]
        rows[0] = self.sense * rows[0]
        for i, bound in enumerate(self.bounds, 1):
            ideal = self.question.ideal(wanted)
            if bound.relative and of_run(self.question, ideal).to:  # else it is what it is
                known = self._look(ideal)
                there = known.slopes if known is not None else None
                if not there or bound.quantity not in there:
                    return None
                share = by_shares(self.question, ideal, there[bound.quantity])
                rows[i] = rows[i] - bound.value * share
            rows[i] = bound.sign * rows[i]
        return np.array(rows)

    def runs_of(self, fidelity: str) -> tuple[Array, Array]:
        """Places (r, n) of the runs by a level, shares of the ranges, and their vectors."""
        own = [w for w in self.seen if w.fidelity == fidelity and not (w.ideal or w.inputs)]
        shares = np.array([self.question.shares(w) for w in own])
        return shares, np.array([self.vector(w) for w in own])

    def _ideal(self, wanted: Wanted, name: str) -> float:
        given = self._look(replace(self.question.ideal(wanted), carries=False))
        assert given is not None
        if given.failed:
            raise InputError(
                f"{self.question.origin}: optimise.constraints: the run in the idealised mould, by "
                f"which {name} is measured, has failed: {given.message}"
            )
        return self._quantity(given, name, "constraints").value

    def _quantity(self, given: Evaluation, name: str, key: str) -> Quantity:
        found: Mapping[str, Quantity] = given.quantities
        if name not in found:
            if given.failed:
                raise KeyError(name)
            raise InputError(
                f'{self.question.origin}: optimise: {key} ("{name}") is no result of this case'
                f"{units.nearest(name, found)}"
            )
        return found[name]
