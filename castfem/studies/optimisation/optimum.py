"""The result of a search: optimum with intervals, binding constraints, neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from castfem.base.shown_quantity import from_si, unit_of_difference
from castfem.base.shown_units import Scale, scale_of

Status = Literal["found", "not converged", "independent", "impossible", "failed"]
_DIFFERENCE = "delta_"


def unit_name(unit: str) -> str:
    """A unit in the tables of a search; "" for none."""
    return {"-": "", "percent": "%"}.get(unit, unit.removeprefix(_DIFFERENCE))


@dataclass(frozen=True, slots=True)
class ShownResult:
    """A result with the documented unit of files, and the chosen one of tables and figures."""

    name: str
    label: str  #: label
    shown_unit: str  #: documented unit

    def shown(self, value: float) -> float:
        """Convert a value from SI to the documented unit."""
        return from_si(value, self.shown_unit)

    def shown_difference(self, value: float) -> float:
        """Convert a difference from SI to the documented unit."""
        return from_si(value, unit_of_difference(self.shown_unit))

    @property
    def scale(self) -> Scale:
        """Conversion from the documented unit to the chosen one."""
        return scale_of(self.shown_unit, self.name)

    @property
    def difference_scale(self) -> Scale:
        """The same conversion for a difference."""
        return scale_of(unit_of_difference(self.shown_unit), self.name)

    def chosen(self, value: float) -> float:
        """Convert a value from SI to the chosen unit."""
        return float(self.scale(self.shown(value)))

    def chosen_difference(self, value: float) -> float:
        """Convert a difference from SI to the chosen unit."""
        return float(self.difference_scale(self.shown_difference(value)))

    @property
    def difference_unit(self) -> str:
        """The chosen unit of a difference, "" for none."""
        return unit_name(self.difference_scale.unit)

    def heading(self, *, chosen: bool = True) -> str:
        """Name and unit, either the chosen or the documented one."""
        unit = self.scale.unit if chosen else self.shown_unit
        return self.name if unit == "-" else f"{self.name} [{unit}]"

    @property
    def in_words(self) -> str:
        """Label and chosen unit."""
        unit = unit_name(self.scale.unit)
        return f"{self.label} [{unit}]" if unit else self.label


@dataclass(frozen=True, slots=True)
class ResultWithError(ShownResult):
    """A result at the optimum and its errors, SI."""

    value: float
    noise: float  #: scatter between nearly equal runs
    numerical: float  #: numerical error; NaN if no other level has finished
    twin: tuple[str, float] | None = None  #: for a smooth approximation, the maximum it stands for
    measured: bool = True  #: whether the noise was measured; otherwise it is 0

    def to_json(self) -> dict[str, Any]:
        """Its content in optimum.json."""
        return {
            "quantity": self.name,
            "label": self.label,
            "unit": self.shown_unit,
            "value": self.shown(self.value),
            "noise": self.shown_difference(self.noise) if self.measured else None,
            "numerical": self.shown_difference(self.numerical),
            **({} if self.twin is None else {self.twin[0]: self.shown(self.twin[1])}),
        }


@dataclass(frozen=True, slots=True)
class Value:
    """A variable at the optimum, in the unit of its range."""

    key: str
    unit: str  #: "" for none
    value: float  #: value of the best run
    low: float  #: lowest value that cannot be distinguished from the best
    high: float
    open_low: bool  #: whether it may be lower still
    open_high: bool
    #: value at the optimum with the constraints of the check; None if that failed
    checked: float | None
    range: tuple[float, float]  #: range of the search
    at_end: str = ""  #: "lowest" or "highest" of its range, "runs fail" where runs fail, or ""
    drawn: tuple[float, float] | None = None  #: 5 and 95 % quantiles over the draws of the inputs
    #: value at the best point that meets all constraints in 95 % of the draws
    safe: float | None = None


@dataclass(frozen=True, slots=True)
class SpreadRow:
    """Effect of the inputs on a result at the optimum, or on the best value of a variable."""

    name: str  #: name of the objective, the constraint as written, or the variable
    #: change from the optimum, 5 and 95 % quantiles of the draws, in `unit`
    change: tuple[float, float]
    unit: str  #: "-" or "" for none
    error: float | None  #: error of the fit; None for a variable
    met: float | None  #: fraction of the draws in which the constraint is met; else None
    first: tuple[float, ...]  #: first-order Sobol index of each input
    total: tuple[float, ...]  #: total Sobol index of each input


@dataclass(frozen=True, slots=True)
class Spread:
    """The spread of an optimum due to its inputs."""

    labels: tuple[str, ...]  #: labels of the inputs
    rows: tuple[SpreadRow, ...]  #: objective, constraints, variables
    runs: int  #: number of runs made for it
    failed: int  #: number of failed ones among them
    open: bool  #: whether draws lead to the limits of the runs around the optimum
    derivatives: bool  #: whether the runs have derivatives


@dataclass(frozen=True, slots=True)
class ConstraintStatus:
    """A constraint at the optimum, SI."""

    text: str  #: constraint as written
    result: ResultWithError
    bound: float
    left: float  #: margin of the result
    checked: float  #: margin at the level of the check; NaN if that failed
    error: float  #: error of the margin: noise and numerical error; NaN if the latter is unknown
    met: bool
    binding: bool  #: whether it limits the objective
    near: bool = True  #: whether it does so here: its bound is at the optimum, within its error

    def to_json(self) -> dict[str, Any]:
        """Its content in optimum.json."""
        return {
            "text": self.text,
            **self.result.to_json(),
            "bound": self.result.shown(self.bound),
            "left": self.result.shown_difference(self.left),
            "left_checked": self.result.shown_difference(self.checked),
            "error": self.result.shown_difference(self.error),
            "met": self.met,
            "binding": self.binding,
            "near": self.near,
        }


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A run a step of one variable away from the optimum."""

    key: str
    value: float  #: value of that variable, in its unit
    objective: float  #: change of the objective, SI; NaN if the run fails
    left: tuple[float, ...]  #: margins of the constraints there, SI
    message: str = ""  #: why it failed


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Results of the checking level at its own optimum, SI."""

    objective: float
    left: tuple[float, ...]  #: margins of the constraints


@dataclass(frozen=True, slots=True)
class FrontResult(ShownResult):
    """One of the two results of a front."""

    sense: float  #: 1 to minimise, -1 to maximise
    noise: float  #: noise, SI


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """A run on a front."""

    values: tuple[float, ...]  #: values of the variables, in the units of their ranges
    first: float  #: the first objective, SI
    second: float  #: the second objective, SI
    price: float | None  #: change of first over that of second from the previous point, SI
    run: str  #: name of its folder, "" if made elsewhere


@dataclass(frozen=True, slots=True)
class Front:
    """The Pareto front of two results."""

    keys: tuple[str, ...]  #: keys of the variables, with their units
    first: FrontResult
    second: FrontResult
    points: tuple[FrontPoint, ...]
    """From the best of the first to the best of the second, none better than another in both by
    more than noise. With a single point both are best together."""
    runs: int  #: number of runs made for it
    exhausted: bool  #: whether a search for it used up its runs

    def price_heading(self, *, chosen: bool = True) -> str:
        """Heading of the price in tables, with its chosen or documented unit."""
        results = (self.first, self.second)
        units = [
            one.difference_scale.unit if chosen else unit_of_difference(one.shown_unit)
            for one in results
        ]
        named = ["1" if unit == "-" else unit for unit in units]
        if chosen:
            named = [unit.removeprefix(_DIFFERENCE) for unit in named]
        return f"price [{' per '.join(named)}]"

    def price(self, point: FrontPoint, *, chosen: bool = False) -> float | None:
        """Price of a point, in the documented or the chosen units."""
        if point.price is None:
            return None
        if chosen:
            change = self.first.chosen_difference(point.price)
            return change / self.second.chosen_difference(1.0)
        return self.first.shown_difference(point.price) / self.second.shown_difference(1.0)

    def to_json(self) -> dict[str, Any]:
        """Its content in optimum.json."""
        first, second = self.first, self.second
        return {
            "first": {"quantity": first.name, "unit": first.shown_unit},
            "second": {"quantity": second.name, "unit": second.shown_unit},
            "price_unit": self.price_heading(chosen=False)[len("price [") : -1],
            "runs": self.runs,
            "spent": self.exhausted,
            "points": [
                {
                    "values": list(point.values),
                    "first": first.shown(point.first),
                    "second": second.shown(point.second),
                    "price": self.price(point),
                    "run": point.run,
                }
                for point in self.points
            ],
        }


@dataclass(frozen=True, slots=True)
class Optimum:
    """The result of a search: best values, results there, and their uncertainty."""

    title: str  #: title of the case
    status: Status
    """"found"; "not converged" if the runs were used up while better ones were still found;
    "independent" if no variable changes any result; "impossible" if no run meets all constraints,
    of which this one violates them least; "failed" if no run has finished."""
    sense: str  #: "minimise" or "maximise"
    values: tuple[Value, ...]  #: the variables
    objective: ResultWithError | None  #: the objective; None if no run has finished
    constraints: tuple[ConstraintStatus, ...]
    neighbours: tuple[Neighbour, ...]  #: runs one or two steps away
    other_optima: tuple[tuple[float, ...], ...]
    """Values of runs outside the intervals that are as good within scatter, best first, one for
    each region."""
    fidelity: str  #: level of the search
    checked: str  #: level that checked it, "" if that failed
    step: float  #: size of the last steps, as a fraction of the ranges
    runs: Mapping[str, int]
    """Numbers of runs: when the search ended, which most_runs limits; of its level, including those
    around the optimum; failed ones among these; in total."""
    exhausted: bool  #: whether the search used up its runs
    seconds: float  #: total duration of the runs, s
    best: str = ""  #: name of the best run's folder, "" if it was made elsewhere
    front: Front | None = None  #: Pareto front with a second result, if requested
    #: spread due to uncertain inputs, if requested and enough runs have finished
    spread: Spread | None = None
    by_check: CheckResult | None = None  #: results of the run with the values `checked`
    unverified: tuple[str, ...] = ()  #: parts of its error that were not checked
    without_effect: tuple[str, ...] = ()  #: keys of variables that change no result

    @property
    def binding(self) -> tuple[ConstraintStatus, ...]:
        """The constraints that limit the objective."""
        return tuple(one for one in self.constraints if one.binding)

    @property
    def worst(self) -> ConstraintStatus | None:
        """The most violated constraint, relative to its bound; None if all are met."""

        def relative(one: ConstraintStatus) -> float:
            return one.left / max(abs(one.bound), 1e-300)

        missed = [one for one in self.constraints if not one.met]
        return min(missed, key=relative) if missed else None

    def changes(self) -> dict[str, str | float]:
        """Keys and values of the optimum, for `Case.with_`."""
        return {v.key: f"{v.value:.12g} {v.unit}" if v.unit else v.value for v in self.values}

    def to_json(self) -> dict[str, Any]:
        """The content of optimum.json, results in their documented units."""
        return {
            "format": "castfem optimum",
            "title": self.title,
            "status": self.status,
            "sense": self.sense,
            "values": [asdict(value) for value in self.values],
            "objective": None if self.objective is None else self.objective.to_json(),
            "constraints": [one.to_json() for one in self.constraints],
            "away": [self._neighbour(one) for one in self.neighbours],
            "elsewhere": [list(values) for values in self.other_optima],
            "fidelity": self.fidelity,
            "checked": self.checked,
            "last_step": self.step,
            "runs": dict(self.runs),
            "spent": self.exhausted,
            "seconds": self.seconds,
            "best": self.best,
            "unknown": list(self.unverified),
            "idle": list(self.without_effect),
            **self._by_check(),
            **({} if self.spread is None else {"spread": asdict(self.spread)}),
            **({} if self.front is None else {"front": self.front.to_json()}),
        }

    def _left(self, left: tuple[float, ...]) -> list[float]:
        pairs = zip(self.constraints, left, strict=False)
        return [one.result.shown_difference(value) for one, value in pairs]

    def _by_check(self) -> dict[str, Any]:
        found, objective = self.by_check, self.objective
        if found is None or objective is None:
            return {}
        shown = objective.shown(found.objective)
        return {"by_check": {"objective": shown, "left": self._left(found.left)}}

    def _neighbour(self, one: Neighbour) -> dict[str, Any]:
        assert self.objective is not None
        change = self.objective.shown_difference(one.objective)
        return {
            **{"key": one.key, "value": one.value, "objective": change},
            **{"left": self._left(one.left), "message": one.message},
        }
