"""From the runs of a search to its answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.result_registry import general_label, smooth_twins
from castfem.base.shown_quantity import unit_of_difference
from castfem.base.types import Array
from castfem.studies.accuracy.levels import LEVELS
from castfem.studies.optimisation import vicinity
from castfem.studies.optimisation.as_good import AsGood
from castfem.studies.optimisation.binding import Binding
from castfem.studies.optimisation.checked import Checked
from castfem.studies.optimisation.front import Front
from castfem.studies.optimisation.numerical import Numerical, error
from castfem.studies.optimisation.optimum import (
    Away,
    ByCheck,
    Kept,
    Known,
    Optimum,
    Spreading,
    SpreadRow,
    Status,
    Value,
)  # fmt: skip
from castfem.studies.optimisation.outputs import Outputs
from castfem.studies.optimisation.question import Axis, Question, Wanted
from castfem.studies.optimisation.search import AT_END, ROUNDING, Search
from castfem.studies.optimisation.spread import Spread
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.unknown import Unknown


@dataclass(frozen=True, slots=True)
class Findings:
    """What a search has come to.

    Attributes:
        question: What was asked. outputs: What the runs mean. search: The search.
        best: The best run. model: Of what lies about it; None where no run has come through.
        numerical: The error by the other levels; None where no run has come through.
        told: All runs.
        there: The optimum by the level of the check; None where that failed.
        binds: Which constraints bind; None where no run has come through.
        ended: Whether no other run of the search is better.
    """

    question: Question
    outputs: Outputs
    search: Search
    best: Wanted
    model: vicinity.Quadratic | None
    numerical: Numerical | None
    told: Mapping[Wanted, Evaluation]
    there: Checked | None = None
    binds: Binding | None = None
    ended: bool = True

    @property
    def noise(self) -> Array:
        """Of cost and margins (1 + m,), SI."""
        noise = self.search.noise
        return np.zeros(1 + self.outputs.count) if noise is None else noise.sigma

    @property
    def checked(self) -> str:
        """The level by which the best run was checked, "" where that failed."""
        return "" if self.numerical is None else self.numerical.checked


def verdict(found: Findings, front: Front | None = None, spread: Spread | None = None) -> Optimum:
    """Return the answer, with the front and the spread by the inputs if they were asked for."""
    outputs, best = found.outputs, found.best
    given = outputs.seen[best]
    level = found.question.table.fidelity
    own = [w for w in outputs.seen if w.fidelity == level and not w.ideal]
    idle = found.search.without_effect()
    status: Status = "found" if found.ended else "not converged"
    if len(idle) == len(found.question.axes):
        status = "independent"
    if found.search.violation(best) > 0.0:
        status = "impossible"
    good = None if status != "found" or given.failed else _as_good(found)
    places = _intervals(found, good)
    unknown = _unknown(found, spread)
    return Optimum(
        title=found.question.case.title,
        status="failed" if given.failed else status,
        sense="minimise" if outputs.sense > 0 else "maximise",
        values=_values(found, places, spread, unknown),
        objective=None if given.failed else _known(found, outputs.objective, 0),
        constraints=() if given.failed else tuple(_constraints(found)),
        away=tuple(_away(found)),
        elsewhere=() if good is None else _elsewhere(found, places, good),
        fidelity=level,
        checked=found.checked,
        step=found.search.radius,
        runs={
            "looked_at": found.search.looked_at,
            "search": len(own),
            "failed": sum(outputs.seen[w].failed for w in own),
            "all": len(found.told),
        },
        spent=found.search.spent,
        seconds=sum(one.seconds for one in found.told.values()),
        best="" if given.folder is None else given.folder.name,
        front=front,
        spread=None if spread is None else _spread(found, spread),
        by_check=_by_check(found),
        unknown=() if unknown is None else unknown.reasons,
        idle=idle,
    )


def _unknown(found: Findings, spread: Spread | None) -> Unknown | None:
    """What of the error was not checked; None where no run has come through."""
    if found.numerical is None:
        return None
    best, there = found.best, found.there
    return Unknown.of(found.question, found.search, best, found.numerical, there, spread)


def _by_check(found: Findings) -> ByCheck | None:
    """What the run by the level of the check has given where the optimum is by that level."""
    if found.there is None:
        return None
    cost, *left = (float(v) for v in found.there.vector)
    return ByCheck(found.outputs.sense * cost, tuple(left))


def _as_good(found: Findings) -> AsGood:
    assert found.model is not None
    scatter = float(found.noise[0] + found.model.misfit[0])
    return AsGood.of(found.outputs, found.search, found.best, scatter)


def _intervals(found: Findings, good: AsGood | None) -> list[vicinity.Interval]:
    """Where the optimum may lie: by the quadratics, and by runs of its valley that are as good."""
    if found.model is None or found.numerical is None:
        return [vicinity.Interval(0.0, 1.0, False, False) for _ in found.question.axes]
    runs = found.outputs.runs_of(found.best.fidelity)
    places = vicinity.intervals(found.model, found.noise, found.numerical, *runs)
    if good is None:
        return places
    shares = np.array([found.question.shares(one) for one in good.near])
    ends = zip(places, shares.min(axis=0), shares.max(axis=0), strict=True)
    return [replace(p, low=min(p.low, float(a)), high=max(p.high, float(b))) for p, a, b in ends]


def _values(
    found: Findings,
    places: list[vicinity.Interval],
    spread: Spread | None,
    unknown: Unknown | None,
) -> tuple[Value, ...]:
    shares, last = found.question.shares(found.best), AT_END * found.search.radius
    moved = found.there
    finer = moved is not None and found.numerical is not None and found.numerical.better
    values = []
    for number, (axis, value, place, share) in enumerate(
        zip(found.question.axes, found.best.values, places, shares, strict=True)
    ):
        ends = max(place.low - found.search.radius, 0.0), min(place.high + found.search.radius, 1.0)
        below, above = _failing(found, number)
        ends = max(ends[0], below), min(ends[1], above)
        low, high = (axis.low + s * (axis.high - axis.low) for s in ends)
        end = "lowest" if share <= last else "highest" if share >= 1.0 - last else ""
        if not end and (share - below <= last or above - share <= last):
            end = "runs fail"
        checked = None if moved is None else moved.wanted.values[number]
        known = [value] if checked is None or not finer else [value, checked]
        low, high = min(low, *known), max(high, *known)
        open_low, open_high, drawn, safe = place.open_low, place.open_high, None, None
        if moved is not None and moved.missed and checked is not None:  # it lies beyond
            open_low, open_high = open_low or checked < value, open_high or checked > value
        if spread is not None:  # errors that know nothing of one another
            drawn = _drawn(spread, axis, number)
            low = max(value - float(np.hypot(value - low, max(value - drawn[0], 0.0))), axis.low)
            high = min(value + float(np.hypot(high - value, max(drawn[1] - value, 0.0))), axis.high)
            open_low, open_high = (flag or spread.open[number] for flag in (open_low, open_high))
            safe = None if spread.safe is None else axis.value(float(spread.safe[number]))
        if unknown is not None:
            lower, higher = unknown.sides[number]
            open_low |= lower and low > axis.low
            open_high |= higher and high < axis.high
        values.append(
            Value(
                axis.key, axis.unit, value, low, high, open_low, open_high,
                checked, (axis.low, axis.high), end, drawn, safe,
            )
        )  # fmt: skip
    return tuple(values)


def _drawn(spread: Spread, axis: Axis, number: int) -> tuple[float, float]:
    """Values of a variable's optimum below which 5 and 95 % of the draws lie."""
    low, high = (axis.low + float(s) * (axis.high - axis.low) for s in spread.place[number])
    return low, high


def _spread(found: Findings, spread: Spread) -> Spreading:
    """What the inputs do, by results and variables, in the units in which they are shown."""
    outputs, best = found.outputs, found.best
    rows = []
    vector = outputs.vector(best)
    for number, name in enumerate(spread.results):
        known = _known(found, name, number)
        ends = [float(end[number] - vector[number]) for end in (spread.low, spread.high)]
        sign = outputs.sense if number == 0 else outputs.margins(best)[number - 1].sign
        changes = sorted(known.shown_difference(sign * end) for end in ends)
        rows.append(
            SpreadRow(
                name if number == 0 else outputs.text(number - 1),
                (changes[0], changes[1]),
                unit_of_difference(known.shown_unit),
                known.shown_difference(float(spread.error[number])),
                None if number == 0 else float(spread.met[number - 1]),
                tuple(float(x) for x in spread.first[number]),
                tuple(float(x) for x in spread.total[number]),
            )
        )
    for number, axis in enumerate(found.question.axes):
        low, high = _drawn(spread, axis, number)
        rows.append(
            SpreadRow(
                axis.key, (low - best.values[number], high - best.values[number]), axis.unit,
                None, None,
                tuple(float(x) for x in spread.place_first[number]),
                tuple(float(x) for x in spread.place_total[number]),
            )
        )  # fmt: skip
    return Spreading(
        spread.labels, tuple(rows), spread.runs, spread.failed, any(spread.open), spread.carried
    )


def _failing(found: Findings, number: int) -> tuple[float, float]:
    """The nearest runs that fail below and above the optimum along a variable, as shares."""
    centre, near = found.question.shares(found.best), found.search.radius
    below, above = -np.inf, np.inf
    for wanted, given in found.outputs.seen.items():
        if not given.failed or wanted.fidelity != found.best.fidelity:
            continue
        there = found.question.shares(wanted)
        others = np.delete(np.abs(there - centre), number)
        if np.all(others <= near):
            if there[number] > centre[number]:
                above = min(above, float(there[number]))
            elif there[number] < centre[number]:
                below = max(below, float(there[number]))
    return below, above


def _known(found: Findings, name: str, place: int) -> Known:
    """A result at the optimum; `place` is that of its noise among cost and margins."""
    outputs, best = found.outputs, found.best
    quantity = outputs.seen[best].quantities[name]
    levels = {word: found.told.get(Wanted(best.values, word)) for word in (*LEVELS, best.fidelity)}
    values = {w: e[name] for w, e in levels.items() if e is not None and name in e.quantities}
    numerical = error(values, best.fidelity)
    noise = float(found.noise[place])
    of = smooth_twins().get(name)
    twin = None if of is None else (of, outputs.seen[best][of])
    measured = found.search.noise is not None and found.search.noise.runs > 0
    label = general_label(name, quantity.label)
    return Known(name, label, quantity.shown_unit, quantity.value, noise, numerical, twin, measured)


def _constraints(found: Findings) -> list[Kept]:
    outputs, best = found.outputs, found.best
    kept = []
    for i, margin in enumerate(outputs.margins(best)):
        known = _known(found, outputs.name(i), 1 + i)
        moved, numerical = np.nan, np.nan
        if found.numerical is not None and found.numerical.known:
            moved = float(found.numerical.moved[1 + i])
            numerical = float(max(found.numerical.below[1 + i], found.numerical.above[1 + i]))
        allowed = known.noise + ROUNDING * abs(margin.bound)
        kept.append(
            Kept(
                outputs.text(i), known, margin.bound, margin.left, margin.left + moved,
                known.noise + numerical, margin.left >= -allowed,
                found.binds is not None and found.binds.held[i],
                found.binds is None or found.binds.near[i],
            )
        )  # fmt: skip
    return kept


def _away(found: Findings) -> list[Away]:
    """The runs to either side of the optimum along each variable."""
    outputs, best = found.outputs, found.best
    if found.model is None:
        return []
    here, steps = outputs.vector(best), []
    for place in vicinity.around(found.question.shares(best), found.model.step):
        there = found.question.at(place)
        given = outputs.seen.get(there)
        if given is None or there == best:
            continue
        moved = zip(found.question.axes, there.values, best.values, strict=True)
        key, value = next((axis.key, new) for axis, new, old in moved if new != old)
        vector = outputs.vector(there)
        change = float(outputs.sense * (vector[0] - here[0]))
        left = tuple(float(v) for v in vector[1:])
        steps.append(Away(key, value, change, left, given.message))
    return steps


def _elsewhere(
    found: Findings, places: list[vicinity.Interval], good: AsGood
) -> tuple[tuple[float, ...], ...]:
    """Runs of other valleys that are as good, and outside of the intervals."""
    low = np.array([p.low for p in places]) - found.search.radius
    high = np.array([p.high for p in places]) + found.search.radius
    shares = {one: found.question.shares(one) for one in good.elsewhere}
    return tuple(one.values for one, at in shares.items() if np.any((at < low) | (at > high)))
