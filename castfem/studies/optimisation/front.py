"""The front of two results: the best of one at each level of the other (epsilon-constraint).

From the best run of the first result to that of the second: the largest gap between two neighbours
is halved, the second result held to its middle, and the search begins with the best run that keeps
to it, of all that were made so far. A level that gives nothing new closes its gap.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.atomic_files import write_text
from castfem.base.result_registry import general_label
from castfem.base.shown_quantity import from_si, unit_of_difference
from castfem.base.types import Array
from castfem.model.optimise import Bound
from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Wanted
from castfem.studies.optimisation.search import FIRST, Done, Search

TABLE_NAME = "front.csv"

_SIGMAS = 2.0  # of noise: nearer results are not told apart


@dataclass(frozen=True, slots=True)
class Weighed:
    """One of the two results.

    Attributes:
        name: Of the result. label: In words. shown_unit: In which it is shown.
        sense: 1 where it is to be small, -1 where large. noise: Of it, SI.
    """

    name: str
    label: str
    shown_unit: str
    sense: float
    noise: float

    @property
    def heading(self) -> str:
        """Its name with the unit."""
        return self.name if self.shown_unit == "-" else f"{self.name} [{self.shown_unit}]"

    def shown(self, value: float) -> float:
        """A value in the unit in which it is shown."""
        return from_si(value, self.shown_unit)

    def shown_difference(self, value: float) -> float:
        """A difference likewise."""
        return from_si(value, unit_of_difference(self.shown_unit))


@dataclass(frozen=True, slots=True)
class Point:
    """A run on the front.

    Attributes:
        values: Of the variables, in the units of their ranges.
        first: The result that is to be best, SI. second: What it is weighed against, SI.
        price: Change of the first over that of the second from the point before, SI; None at the
            first point.
        run: Name of its folder, "" where it was told by others.
    """

    values: tuple[float, ...]
    first: float
    second: float
    price: float | None
    run: str


@dataclass(frozen=True, slots=True)
class Front:
    """What can be had of two results.

    Attributes:
        keys: Of the variables, with their units.
        first: What is to be best. second: What it is weighed against.
        points: From the best of the first to the best of the second; none is better than another in
            both by more than noise. One alone: both are best together.
        runs: How many were made for it, beside those of the first search.
        spent: Whether a search of it ended for it had no more runs.
    """

    keys: tuple[str, ...]
    first: Weighed
    second: Weighed
    points: tuple[Point, ...]
    runs: int
    spent: bool

    @property
    def price_unit(self) -> str:
        """Of the price, as it is shown."""
        units = [unit_of_difference(one.shown_unit) for one in (self.first, self.second)]
        return " per ".join("1" if unit == "-" else unit for unit in units)

    @property
    def price_heading(self) -> str:
        """What heads the price in tables."""
        return f"price [{self.price_unit}]"

    def price(self, point: Point) -> float | None:
        """The price of a point as it is shown."""
        if point.price is None:
            return None
        return self.first.shown_difference(point.price) / self.second.shown_difference(1.0)

    def to_json(self) -> dict[str, Any]:
        """Its content in optimum.json, in the units in which results are shown."""
        return {
            "first": {"quantity": self.first.name, "unit": self.first.shown_unit},
            "second": {"quantity": self.second.name, "unit": self.second.shown_unit},
            "price_unit": self.price_unit,
            "runs": self.runs,
            "spent": self.spent,
            "points": [
                {
                    "values": list(point.values),
                    "first": self.first.shown(point.first),
                    "second": self.second.shown(point.second),
                    "price": self.price(point),
                    "run": point.run,
                }
                for point in self.points
            ],
        }


def write_front(folder: Path, front: Front) -> Path:
    """Write the points as CSV, a row each, and return its path.

    Raises:
        RunFailure: It cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    head = (front.first.heading, front.second.heading, front.price_heading)
    writer.writerow([*front.keys, *head, "run"])
    for point in front.points:
        price = front.price(point)
        results = front.first.shown(point.first), front.second.shown(point.second)
        numbers = (f"{value:.9g}" for value in (*point.values, *results))
        writer.writerow([*numbers, "" if price is None else f"{price:.6g}", point.run])
    path = folder / TABLE_NAME
    write_text(path, text.getvalue())
    return path


class Tracer:
    """Finds the front of the question's result and that of its table `front`.

    Args:
        search: The first search, at its end.
        start: Where that began, shares of the ranges (n,).
        done: Parts of searches that have come to their end.
    """

    def __init__(self, search: Search, start: Array, done: Done) -> None:
        self._outputs, self._start, self._done = search.outputs, start, done
        table = self._outputs.question.table
        assert table.front is not None
        self._other = self._outputs.other(objective=table.front.objective)
        self._most, self._points = table.most_runs, table.front.points
        self._noise = [0.0 if search.noise is None else float(search.noise.sigma[0]), 0.0]
        self._spent = False

    def trace(self, best: Wanted) -> Front:
        """Return the front.

        Args:
            best: The best run of the first result.

        Raises:
            Needs: Runs are missing.
        """
        before = len(self._outputs.seen)
        search = self._search(self._other)
        far = search.towards(self._start, best)
        self._spent |= search.spent
        if search.noise is not None:
            self._noise[1] = float(search.noise.sigma[0])
        ends = [] if self._outputs.seen[far].failed else [far]
        found = self._halved([best, *(end for end in ends if end != best)])
        return self._front(found, len(self._outputs.seen) - before)

    def _search(self, outputs: Outputs) -> Search:
        return Search(outputs, len(outputs.seen) + self._most, self._done)

    def _halved(self, found: list[Wanted]) -> list[Wanted]:
        """Points between two ends, by halving the largest gap, until there are enough."""
        found, closed = self._undominated(found), set[tuple[Wanted, Wanted]]()
        while len(found) < self._points:
            gaps = [pair for pair in pairwise(found) if pair not in closed]
            sizes = [self._apart(*pair, found) for pair in gaps]
            if not sizes or max(sizes) <= 0.0:
                break
            pair = gaps[int(np.argmax(sizes))]
            closed.add(pair)
            between = self._between(*pair)
            found = self._undominated([*found, between])
        return found

    def _apart(self, one: Wanted, other: Wanted, all_found: Sequence[Wanted]) -> float:
        """How far two neighbours are apart, in spans of the front; 0 if noise hides it."""
        ends = np.array([self._pair(all_found[0]), self._pair(all_found[-1])])
        step = np.abs(self._pair(one) - self._pair(other))
        if np.any(step <= _SIGMAS * np.array(self._noise)):
            return 0.0
        return float(np.max(step / np.maximum(np.abs(ends[1] - ends[0]), 1e-300)))

    def _between(self, one: Wanted, other: Wanted) -> Wanted:
        """The best run of the first result whose second is half-way between those of two."""
        name, sense = self._other.objective, self._other.sense
        level = 0.5 * (self._other.value(one) + self._other.value(other))
        held = self._outputs.other(extra=(_bound(name, sense, level),))
        search = self._search(held)
        shares = [self._outputs.question.shares(w) for w in (one, other)]
        apart = np.abs(shares[1] - shares[0])
        first = float(np.clip(0.25 * np.max(apart), 0.0, FIRST))
        found = search.towards(self._start, search.best_known(self._start), first)
        self._spent |= search.spent
        return found

    def _pair(self, wanted: Wanted) -> Array:
        """Both results of a run, less is better (2,), SI."""
        return np.array([self._outputs.cost(wanted), self._other.cost(wanted)])

    def _undominated(self, found: Sequence[Wanted]) -> list[Wanted]:
        """Those of some runs than which no other is better in one and no worse in both, in order.

        What is better by no more than noise counts as equal.
        """
        runs = sorted(dict.fromkeys(found), key=lambda w: tuple(self._pair(w)))
        kept: list[Wanted] = []
        for run in runs:  # the first result grows: the second has to become better
            if not kept or self._pair(run)[1] < self._pair(kept[-1])[1] - self._noise[1]:
                kept.append(run)
        return kept

    def _front(self, found: Sequence[Wanted], runs: int) -> Front:
        question, seen = self._outputs.question, self._outputs.seen
        points: list[Point] = []
        for wanted in found:
            first, second = self._outputs.value(wanted), self._other.value(wanted)
            price = None
            if points:  # the second result is another one: `_undominated`
                price = (first - points[-1].first) / (second - points[-1].second)
            folder = seen[wanted].folder
            name = "" if folder is None else folder.name
            points.append(Point(wanted.values, first, second, price, name))
        weighed = [
            _weighed(outputs, found[0], noise)
            for outputs, noise in zip((self._outputs, self._other), self._noise, strict=True)
        ]
        keys = tuple(axis.label for axis in question.axes)
        return Front(keys, weighed[0], weighed[1], tuple(points), runs, self._spent)


def _weighed(outputs: Outputs, wanted: Wanted, noise: float) -> Weighed:
    quantity = outputs.seen[wanted].quantities[outputs.objective]
    label = general_label(outputs.objective, quantity.label)
    return Weighed(outputs.objective, label, quantity.shown_unit, outputs.sense, noise)


def _bound(name: str, sense: float, level: float) -> Bound:
    """The constraint that a result, small or large by its sense, is no worse than a level, SI."""
    sign = "<=" if sense > 0.0 else ">="
    text = f"{name} {sign} {level!r} (SI)"
    return Bound(
        text, repr(level), name, "at_most" if sense > 0.0 else "at_least", level, "", False
    )
