"""Assembles the result of a search from its runs, with the unchecked parts of its error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.result_registry import general_label, smooth_twins
from castfem.base.shown_quantity import unit_of_difference
from castfem.base.types import Array, Flags
from castfem.studies.accuracy.sizes import LEVELS
from castfem.studies.optimisation.check_level import CheckedOptimum
from castfem.studies.optimisation.fidelity import NumericalError, error, next_of
from castfem.studies.optimisation.global_search import GLOBAL
from castfem.studies.optimisation.local_model import Binding, Interval, Quadratic, around, intervals
from castfem.studies.optimisation.optimum import (
    CheckResult,
    ConstraintStatus,
    Front,
    Neighbour,
    Optimum,
    ResultWithError,
    Spread,
    SpreadRow,
    Status,
    Value,
)  # fmt: skip
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.search import SEARCH, Search
from castfem.studies.optimisation.spread import InputSpread
from castfem.studies.optimisation.store import Evaluation

_NOISE = "noise was not measured: runs around the start or the best one fail"
_EXHAUSTED = "the search ran out of runs: raise optimise.most_runs"
_NO_SPREAD = "the spread by the inputs is missing: too few of those runs succeeded"


@dataclass(frozen=True, slots=True)
class UnverifiedError:
    """Unknown errors of an optimum: unchecked parts open its intervals.

    If runs of a check fail, that part of the error is unknown. The interval is then open to both
    sides or, if the check was moving, to the side in that direction.
    """

    lower: Flags  #: whether each variable may therefore be lower (n,)
    higher: Flags
    reasons: tuple[str, ...]

    @classmethod
    def of(
        cls,
        search: Search,
        best: RunRequest,
        error: NumericalError,
        checked: CheckedOptimum | None,
        spread: InputSpread | None,
    ) -> UnverifiedError:
        """Return what the checks of a best run have left open."""
        problem = search.problem
        both = np.ones(len(problem.variables), dtype=bool)
        found: list[tuple[Flags, Flags, str]] = []
        if search.exhausted:
            found.append((both, both, _EXHAUSTED))
        if not search.noise_known:
            found.append((both, both, _NOISE))
        if not error.checked:
            found.append((both, both, _no_check(best, error)))
        elif checked is not None and checked.further:
            way = np.array(checked.further)
            why = f"the optimum by {error.checked} was not reached: {checked.why}"
            found.append((way < 0.0, way > 0.0, why))
        if any(error.untilted):
            shares, last = problem.shares(best), SEARCH.at_end * search.radius
            free = error.untilted & (shares > last) & (shares < 1.0 - last)
            pairs = zip(problem.variables, free, strict=True)
            if keys := " and ".join(variable.key for variable, one in pairs if one):
                why = f"how the numerical error changes along {keys} is not known: "
                found.append((free, free, f"{why}runs by {next_of(best.fidelity)} fail"))
        if problem.inputs and spread is None:
            found.append((both, both, _NO_SPREAD))
        lower, higher = (
            np.any([~both, *sides], axis=0)
            for sides in ([one for one, _, _ in found], [one for _, one, _ in found])
        )
        return cls(lower, higher, tuple(why for _, _, why in found))


def _no_check(best: RunRequest, error: NumericalError) -> str:
    """State that no level checks a best run, and which one gives its numerical error."""
    others = [word for word in LEVELS if word != best.fidelity]
    missing = " and ".join(word for word in others if word not in error.finished)
    known = [word for word in others if word in error.finished]
    if known:
        return f"the numerical error is by {known[0]} cells alone: the best run fails by {missing}"
    return f"the numerical error is not known: the best run fails by {missing}"


@dataclass(frozen=True, slots=True)
class Findings:
    """Findings of a search; without a model no run has finished, or better ones were seen."""

    search: Search
    best: RunRequest
    model: Quadratic | None = None  #: fit to the runs around the best one
    error: NumericalError | None = None
    checked: CheckedOptimum | None = None  #: optimum at the level of the check; None if that failed
    binding: Binding | None = None
    converged: bool = True  #: whether no other run of the search is better
    spread: InputSpread | None = None
    front: Front | None = None

    @property
    def runs(self) -> dict[RunRequest, Evaluation]:
        """All runs."""
        return self.search.responses.runs.results


def assemble(found: Findings) -> Optimum:
    """Return the answer."""
    search, best = found.search, found.best
    responses, problem = search.responses, search.problem
    run, level = responses.seen[best], problem.table.fidelity
    own = responses.of_level(level)
    idle = search.without_effect()
    status = _status(found, idle)
    near, elsewhere = _equivalent(found) if status == "found" else ([best], [])
    places = _intervals(found, near)
    unverified = None
    if found.error is not None:
        unverified = UnverifiedError.of(search, best, found.error, found.checked, found.spread)
    return Optimum(
        title=problem.case.title,
        status=status,
        sense="minimise" if responses.sense > 0 else "maximise",
        values=tuple(
            _value(found, number, place, unverified) for number, place in enumerate(places)
        ),
        objective=None if run.failed else _result(found, 0),
        constraints=() if run.failed else tuple(_constraints(found)),
        neighbours=tuple(_neighbours(found)),
        other_optima=_other_optima(found, places, elsewhere),
        fidelity=level,
        checked="" if found.error is None else found.error.checked,
        step=search.radius,
        runs={
            "looked_at": search.looked_at,
            "search": len(own),
            "failed": sum(responses.seen[one].failed for one in own),
            "all": len(found.runs),
        },
        exhausted=search.exhausted,
        seconds=sum(one.seconds for one in found.runs.values()),
        best="" if run.folder is None else run.folder.name,
        front=found.front,
        spread=None if found.spread is None else _spread(found, found.spread),
        by_check=_by_check(found),
        unverified=() if unverified is None else unverified.reasons,
        without_effect=idle,
    )


def _status(found: Findings, idle: tuple[str, ...]) -> Status:
    search = found.search
    if search.responses.seen[found.best].failed:
        return "failed"
    if search.violation(found.best) > 0.0:
        return "impossible"
    if len(idle) == len(search.problem.variables):
        return "independent"
    return "found" if found.converged else "not converged"


def _by_check(found: Findings) -> CheckResult | None:
    if found.checked is None:
        return None
    cost, *left = (float(v) for v in found.checked.vector)
    return CheckResult(found.search.responses.sense * cost, tuple(left))


def equivalent_optima(
    search: Search, best: RunRequest, scatter: float
) -> tuple[list[RunRequest], list[RunRequest]]:
    """Return runs that meet all constraints and whose objective is equal within scatter.

    Returns:
        Regions connected to the best one, including itself; of each other region the best.
    """
    responses = search.responses
    places = {w: search.problem.shares(w) for w in responses.of_level(best.fidelity)}
    cost = responses.cost(best)
    enough = cost + scatter + ROUNDING * abs(cost)
    good = [w for w in places if search.violation(w) <= 0.0 and responses.cost(w) <= enough]
    near, elsewhere = [best], list[RunRequest]()

    def apart(one: RunRequest, other: RunRequest) -> bool:
        return bool(np.max(np.abs(places[one] - places[other])) >= GLOBAL.apart)

    def is_connected(one: RunRequest) -> bool:
        """Whether there are good runs all the way between it and the best one."""
        low, high = np.sort([places[one], places[best]], axis=0)
        between = [w for w, at in places.items() if np.all((low <= at) & (at <= high))]
        others = [w in good for w in between if w not in (one, best)]
        return bool(others) and all(others)

    for one in sorted(good, key=responses.cost):
        if not apart(one, best) or is_connected(one):
            near.append(one)
        elif all(apart(one, other) for other in elsewhere):
            elsewhere.append(one)
    return near, elsewhere


def _equivalent(found: Findings) -> tuple[list[RunRequest], list[RunRequest]]:
    """Equivalent runs connected to the optimum, and others."""
    assert found.model is not None
    scatter = float(found.search.noise[0] + found.model.misfit[0])
    return equivalent_optima(found.search, found.best, scatter)


def _intervals(found: Findings, near: list[RunRequest]) -> list[Interval]:
    """Intervals of the optimum: from the quadratics, and from connected equivalent runs."""
    problem, responses = found.search.problem, found.search.responses
    if found.model is None or found.error is None:
        return [Interval(0.0, 1.0, False, False) for _ in problem.variables]
    runs = responses.table(found.best.fidelity)
    places = intervals(found.model, found.search.noise, found.error, *runs)
    shares = np.array([problem.shares(one) for one in near])
    ends = zip(places, shares.min(axis=0), shares.max(axis=0), strict=True)
    return [replace(p, low=min(p.low, float(a)), high=max(p.high, float(b))) for p, a, b in ends]


def _value(
    found: Findings, number: int, place: Interval, unverified: UnverifiedError | None
) -> Value:
    """A variable with its interval: from runs, last step, failures, check and inputs."""
    search, check, spread = found.search, found.checked, found.spread
    variable, value = search.problem.variables[number], found.best.values[number]
    share, last = float(search.problem.shares(found.best)[number]), SEARCH.at_end * search.radius
    below, above = _failing(found, number)
    ends = max(place.low - search.radius, 0.0, below), min(place.high + search.radius, 1.0, above)
    low, high = (variable.at(share) for share in ends)
    at_end = "lowest" if share <= last else "highest" if share >= 1.0 - last else ""
    if not at_end and (share - below <= last or above - share <= last):
        at_end = "runs fail"
    checked = None if check is None else check.request.values[number]
    known = [value]
    if checked is not None and found.error is not None and found.error.better:
        known.append(checked)
    low, high = min(low, *known), max(high, *known)
    open_low, open_high, drawn, safe = place.open_low, place.open_high, None, None
    if check is not None and check.missed and checked is not None:  # the optimum is beyond
        open_low, open_high = open_low or checked < value, open_high or checked > value
    if spread is not None:  # independent errors
        drawn = _drawn(found, spread, number)
        low = value - float(np.hypot(value - low, max(value - drawn[0], 0.0)))
        high = value + float(np.hypot(high - value, max(drawn[1] - value, 0.0)))
        low, high = max(low, variable.low), min(high, variable.high)
        open_low, open_high = (flag or bool(spread.open[number]) for flag in (open_low, open_high))
        safe = None if spread.safe is None else variable.value(float(spread.safe[number]))
    if unverified is not None:
        open_low |= bool(unverified.lower[number]) and low > variable.low
        open_high |= bool(unverified.higher[number]) and high < variable.high
    return Value(
        variable.key, variable.unit, value, low, high, open_low, open_high,
        checked, (variable.low, variable.high), at_end, drawn, safe,
    )  # fmt: skip


def _failing(found: Findings, number: int) -> tuple[float, float]:
    """The nearest failing runs below and above the optimum along a variable (fractions)."""
    search = found.search
    centre = search.problem.shares(found.best)
    below, above = -np.inf, np.inf
    for request in search.responses.of_level(found.best.fidelity):
        there = search.problem.shares(request)
        others = np.delete(np.abs(there - centre), number)
        if search.responses.seen[request].failed and np.all(others <= search.radius):
            if there[number] > centre[number]:
                above = min(above, float(there[number]))
            elif there[number] < centre[number]:
                below = max(below, float(there[number]))
    return below, above


def _drawn(found: Findings, spread: InputSpread, number: int) -> tuple[float, float]:
    """5 and 95 % quantiles of a variable's optimum over the draws."""
    low, high = (float(share) for share in spread.place[number])
    one = found.search.problem.variables[number]
    return one.at(low), one.at(high)


def _result(found: Findings, number: int) -> ResultWithError:
    """The objective at the optimum (0), or the result of a constraint (from 1 on)."""
    search, best = found.search, found.best
    name, run = search.responses.names[number], search.responses.seen[best]
    quantity, twin = run.quantities[name], smooth_twins().get(name)
    levels = {w: found.runs.get(RunRequest(best.values, w)) for w in (*LEVELS, best.fidelity)}
    values = {w: e[name] for w, e in levels.items() if e is not None and name in e.quantities}
    return ResultWithError(
        name, general_label(name, quantity.label), quantity.shown_unit, quantity.value,
        float(search.noise[number]), error(values, best.fidelity),
        None if twin is None else (twin, run[twin]), search.noise_known,
    )  # fmt: skip


def _constraints(found: Findings) -> list[ConstraintStatus]:
    responses, numerical, binding = found.search.responses, found.error, found.binding
    constraints = []
    for i, (left, bound) in enumerate(zip(*responses.margins(found.best), strict=True)):
        result = _result(found, 1 + i)
        moved, off = np.nan, np.nan
        if numerical is not None and numerical.known:
            moved = float(numerical.moved[1 + i])
            off = float(max(numerical.below[1 + i], numerical.above[1 + i]))
        met = bool(left >= -result.noise - ROUNDING * abs(bound))
        constraints.append(
            ConstraintStatus(
                responses.bounds[i].text.strip(), result, float(bound), float(left),
                float(left) + moved, result.noise + off, met,
                binding is not None and binding.held[i], binding is None or binding.near[i],
            )
        )  # fmt: skip
    return constraints


def _neighbours(found: Findings) -> list[Neighbour]:
    """The runs on either side of the optimum along each variable."""
    responses, best, problem = found.search.responses, found.best, found.search.problem
    if found.model is None:
        return []
    here, neighbours = responses.vector(best), []
    for place in around(problem.shares(best), found.model.step):
        request = problem.request(place)
        run = responses.seen.get(request)
        if run is None or request == best:
            continue
        moved = zip(problem.variables, request.values, best.values, strict=True)
        key, value = next((one.key, new) for one, new, old in moved if new != old)
        vector = responses.vector(request)
        change = float(responses.sense * (vector[0] - here[0]))
        left = tuple(float(v) for v in vector[1:])
        neighbours.append(Neighbour(key, value, change, left, run.message))
    return neighbours


def _other_optima(
    found: Findings, places: list[Interval], elsewhere: list[RunRequest]
) -> tuple[tuple[float, ...], ...]:
    """Equivalent runs outside the intervals that are not connected to the optimum."""
    low = np.array([p.low for p in places]) - found.search.radius
    high = np.array([p.high for p in places]) + found.search.radius

    def outside(shares: Array) -> bool:
        return bool(np.any((shares < low) | (shares > high)))

    shares = found.search.problem.shares
    return tuple(one.values for one in elsewhere if outside(shares(one)))


def _spread(found: Findings, spread: InputSpread) -> Spread:
    """Effect of the inputs, by results and variables, in the units of files."""
    search, best = found.search, found.best
    responses, vector, rows = search.responses, search.responses.vector(best), []
    indices = [
        (tuple(float(x) for x in spread.first[i]), tuple(float(x) for x in spread.total[i]))
        for i in range(len(spread.first))
    ]
    texts = [responses.objective, *(bound.text.strip() for bound in responses.bounds)]
    signs = [responses.sense, *(bound.sign for bound in responses.bounds)]
    for number, (text, sign) in enumerate(zip(texts, signs, strict=True)):
        result = _result(found, number)
        ends = (sign * float(end[number] - vector[number]) for end in (spread.low, spread.high))
        low, high = sorted(result.shown_difference(end) for end in ends)
        rows.append(
            SpreadRow(
                text, (low, high), unit_of_difference(result.shown_unit),
                result.shown_difference(float(spread.error[number])),
                None if number == 0 else float(spread.met[number - 1]), *indices[number],
            )
        )  # fmt: skip
    for number, (one, value) in enumerate(zip(search.problem.variables, best.values, strict=True)):
        low, high = _drawn(found, spread, number)
        change = (low - value, high - value)
        rows.append(SpreadRow(one.key, change, one.unit, None, None, *indices[len(texts) + number]))
    labels = tuple(one.label for one in search.problem.inputs)
    return Spread(
        labels, tuple(rows), spread.runs, spread.failed, bool(np.any(spread.open)),
        spread.derivatives,
    )  # fmt: skip
