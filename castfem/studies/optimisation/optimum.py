"""The answer to a question: the optimum as an interval, what binds, what a step away costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from castfem.base.shown_quantity import from_si, unit_of_difference
from castfem.studies.optimisation.front import Front

Status = Literal["found", "not converged", "independent", "impossible", "failed"]


@dataclass(frozen=True, slots=True)
class Value:
    """A variable at the optimum, in the unit of its range.

    Attributes:
        key: Of the case. unit: "" for none.
        value: At the best run.
        low: Lowest value that cannot be told from the best.
        high: Likewise.
        open_low: Whether it may lie lower still.
        open_high: Likewise.
        checked: Where the optimum is with the constraints as the level of the check has them, by
            runs of that level; None where that failed.
        range: In which it was looked for.
        at_end: What it lies at: the "lowest" or "highest" of its range, or where "runs fail"; ""
            for none.
        drawn: Where the optimum is for other inputs, 5 and 95 % of the draws; None where none was
            asked for.
        safe: Of the best place that meets all constraints in 95 % of the draws; None where none
            near does.
    """

    key: str
    unit: str
    value: float
    low: float
    high: float
    open_low: bool
    open_high: bool
    checked: float | None
    range: tuple[float, float]
    at_end: str = ""
    drawn: tuple[float, float] | None = None
    safe: float | None = None


@dataclass(frozen=True, slots=True)
class SpreadRow:
    """What the inputs do to a result at the optimum, or to a variable's best value.

    Attributes:
        name: Of the objective, the constraint as written, or the variable.
        change: From the optimum, 5 and 95 % of the draws, in `unit`.
        unit: As it is shown, "-" or "" for none.
        error: Of the quadratics by which it was computed; None of a variable.
        met: Share of the draws in which the constraint is met; None of anything else.
        first: Sobol index of the first order of each input.
        total: Likewise.
    """

    name: str
    change: tuple[float, float]
    unit: str
    error: float | None
    met: float | None
    first: tuple[float, ...]
    total: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Spreading:
    """The spread of an optimum by its inputs.

    Attributes:
        labels: Of the inputs.
        rows: Results and variables.
        runs: How many were made for it.
        failed: Of these.
        open: Whether draws lead to where the runs about the optimum end.
        derivatives: Whether the runs have carried their derivatives along.
    """

    labels: tuple[str, ...]
    rows: tuple[SpreadRow, ...]
    runs: int
    failed: int
    open: bool
    derivatives: bool


@dataclass(frozen=True, slots=True)
class Known:
    """A result at the optimum and its errors, in SI.

    Attributes:
        name: Of the result.
        label: In words.
        shown_unit: In which it is shown.
        value: At the best run.
        noise: Scatter between runs that differ by next to nothing.
        numerical: Its numerical error, by all levels of fidelity; NaN where only that of the search
            came through.
        twin: Of a smooth one the maximum that it stands for, and that at the best run; else None.
        measured: Whether its noise was; it stands as 0 otherwise.
    """

    name: str
    label: str
    shown_unit: str
    value: float
    noise: float
    numerical: float
    twin: tuple[str, float] | None = None
    measured: bool = True

    def shown(self, value: float) -> float:
        """A value in the unit in which it is shown."""
        return from_si(value, self.shown_unit)

    def shown_difference(self, value: float) -> float:
        """A difference likewise."""
        return from_si(value, unit_of_difference(self.shown_unit))


@dataclass(frozen=True, slots=True)
class Kept:
    """A constraint at the optimum.

    Attributes:
        text: As written.
        known: The result.
        bound: In SI.
        left: How far it is on the right side, SI.
        checked: The same by the level of the check; NaN where that failed.
        error: Of that: noise and numerical error; NaN where the latter is not known.
        met: Whether it holds.
        binding: Whether it keeps the objective from being better.
        near: Whether it does so here: its bound is at the optimum, as far as can be told.
    """

    text: str
    known: Known
    bound: float
    left: float
    checked: float
    error: float
    met: bool
    binding: bool
    near: bool = True


@dataclass(frozen=True, slots=True)
class Away:
    """What a step of one variable from the optimum costs.

    Attributes:
        key: The variable.
        value: Where the step leads, in its unit.
        objective: Change of the objective, SI; NaN where the run fails.
        left: What the constraints have left there, SI.
        message: Why that run failed.
    """

    key: str
    value: float
    objective: float
    left: tuple[float, ...]
    message: str = ""


@dataclass(frozen=True, slots=True)
class ByCheck:
    """What the level of the check gives where the optimum is with its constraints.

    Attributes:
        objective: In SI.
        left: What the constraints have left, SI.
    """

    objective: float
    left: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Optimum:
    """What a search has found: the best values, what they give, and how sure they are.

    Attributes:
        title: Of the case.
        status: "found"; "not converged" where runs were used up while better ones were still met;
            "independent" where no variable changes any result; "impossible" where no run meets all
            constraints, of which this is the one
            that misses them least; "failed" where no run has come to its end.
        sense: "minimise" or "maximise".
        values: The variables.
        objective: The result that is best.
        constraints: What must hold.
        away: What steps away from the optimum cost.
        elsewhere: Values of runs outside of the intervals that are as good within scatter, the best
            first, one for each valley.
        fidelity: Of the search.
        checked: The level by which it was checked, "" where that failed.
        step: Of the last steps, as a share of the ranges.
        runs: Counts: when the search ended, which most_runs limits; of its level, those about the
            optimum too; failed, of these; in all.
        spent: Whether the search ended because the allowed runs were used up.
        seconds: Duration of all runs, s.
        best: Name of the best run's folder, "" of a run that was made elsewhere.
        spread: By inputs that are not known exactly; None where that was not asked for, or where
            too many of its runs have failed.
        front: Of the objective and what it is weighed against; None where that was not asked for.
        by_check: Results of the run with the values `checked`; None where there are none.
        unknown: What of its error was not checked, a clause each: intervals are open for it.
        idle: Keys of the variables that change no result.
    """

    title: str
    status: Status
    sense: str
    values: tuple[Value, ...]
    objective: Known | None
    constraints: tuple[Kept, ...]
    away: tuple[Away, ...]
    elsewhere: tuple[tuple[float, ...], ...]
    fidelity: str
    checked: str
    step: float
    runs: Mapping[str, int]
    spent: bool
    seconds: float
    best: str = ""
    front: Front | None = None
    spread: Spreading | None = None
    by_check: ByCheck | None = None
    unknown: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()

    @property
    def binding(self) -> tuple[Kept, ...]:
        """The constraints that keep the objective from being better."""
        return tuple(kept for kept in self.constraints if kept.binding)

    @property
    def worst(self) -> Kept | None:
        """The constraint that is missed most, by its own bound; None where all are met."""
        missed = [kept for kept in self.constraints if not kept.met]
        by_bound = [kept.left / max(abs(kept.bound), 1e-300) for kept in missed]
        return missed[by_bound.index(min(by_bound))] if missed else None

    def changes(self) -> dict[str, str | float]:
        """Keys and values of the optimum, as `Case.with_` takes them."""
        return {v.key: f"{v.value:.12g} {v.unit}" if v.unit else v.value for v in self.values}

    def to_json(self) -> dict[str, Any]:
        """The content of optimum.json, results in the units in which they are shown."""
        return {
            "format": "castfem optimum",
            "title": self.title,
            "status": self.status,
            "sense": self.sense,
            "values": [asdict(value) for value in self.values],
            "objective": None if self.objective is None else _known(self.objective),
            "constraints": [
                {
                    "text": kept.text,
                    **_known(kept.known),
                    "bound": kept.known.shown(kept.bound),
                    "left": kept.known.shown_difference(kept.left),
                    "left_checked": kept.known.shown_difference(kept.checked),
                    "error": kept.known.shown_difference(kept.error),
                    "met": kept.met,
                    "binding": kept.binding,
                    "near": kept.near,
                }
                for kept in self.constraints
            ],
            "away": [self._away(step) for step in self.away],
            "elsewhere": [list(values) for values in self.elsewhere],
            "fidelity": self.fidelity,
            "checked": self.checked,
            "last_step": self.step,
            "runs": dict(self.runs),
            "spent": self.spent,
            "seconds": self.seconds,
            "best": self.best,
            "unknown": list(self.unknown),
            "idle": list(self.idle),
            **self._by_check(),
            **({} if self.spread is None else {"spread": asdict(self.spread)}),
            **({} if self.front is None else {"front": self.front.to_json()}),
        }

    def _by_check(self) -> dict[str, Any]:
        found, objective = self.by_check, self.objective
        if found is None or objective is None:
            return {}
        left = zip(self.constraints, found.left, strict=True)
        of_all = [kept.known.shown_difference(value) for kept, value in left]
        return {"by_check": {"objective": objective.shown(found.objective), "left": of_all}}

    def _away(self, step: Away) -> dict[str, Any]:
        known = self.objective
        return {
            "key": step.key,
            "value": step.value,
            "objective": step.objective
            if known is None
            else known.shown_difference(step.objective),
            "left": [
                kept.known.shown_difference(left)
                for kept, left in zip(self.constraints, step.left, strict=False)
            ],
            "message": step.message,
        }


def _known(known: Known) -> dict[str, Any]:
    return {
        "quantity": known.name,
        "label": known.label,
        "unit": known.shown_unit,
        "value": known.shown(known.value),
        "noise": known.shown_difference(known.noise) if known.measured else None,
        "numerical": known.shown_difference(known.numerical),
        **({} if known.twin is None else {known.twin[0]: known.shown(known.twin[1])}),
    }
