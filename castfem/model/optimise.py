"""The table [optimise]: variables, objective and constraints of `castfem optimise`.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from castfem.base import units
from castfem.model.base import TableModel

Sense = Literal["at_least", "at_most"]
_SENSES: dict[str, Sense] = {">=": "at_least", "≥": "at_least", "<=": "at_most", "≤": "at_most"}
_CONSTRAINT = re.compile(r"\s*(\w+)\s*(>=|<=|≥|≤)\s*(\S.*?)\s*")
_SHARE = re.compile(r"(.*\S)\s+of\s+idealised")
_EXAMPLE = '"heat_removed >= 99 % of idealised" or "von_mises_max <= 14 MPa"'


@dataclass(frozen=True, slots=True)
class Bound:
    """A constraint."""

    text: str  #: as written
    right: str  #: its right-hand side
    quantity: str  #: name of the result that is bounded
    sense: Sense  #: whether it bounds from below or above
    value: float  #: the bound in SI; if `relative`, a fraction of the result in the idealised mould
    unit: str  #: unit as written, "" for none
    relative: bool  #: whether the bound is such a fraction

    @property
    def sign(self) -> float:
        """1 for a lower bound, -1 for an upper one."""
        return 1.0 if self.sense == "at_least" else -1.0


def bound(text: str) -> Bound:
    """Read a constraint."""
    found = _CONSTRAINT.fullmatch(text)
    if found is None:
        other = re.search(r"[<>=]+", text)
        fix = f' with >= or <=, not "{other[0]}",' if other and other[0] not in _SENSES else ""
        raise ValueError(f"is not a constraint; write it{fix} as {_EXAMPLE}")
    name, sign, right = found.groups()
    share = _SHARE.fullmatch(right)
    if share is None:
        value, _ = units.parse_any(right)
        return Bound(text, right, name, _SENSES[sign], value, units.split(right)[1], False)
    value = units.parse(share[1], "1", kind=("share of the idealised mould's", "99 %"))
    return Bound(text, right, name, _SENSES[sign], value, units.split(share[1])[1], True)


def _constraint(text: str) -> str:
    bound(text)
    return text


def _listed(given: Any) -> Any:
    """Return a single name as a list of one."""
    return (given,) if isinstance(given, str) else given


def _as_text(given: Any) -> Any:
    """Return a number without unit as the text of a quantity."""
    return repr(given) if isinstance(given, int | float) and given is not True else given


_ONE_OR_MORE = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
Names = Annotated[tuple[str, ...], BeforeValidator(_listed), WithJsonSchema(_ONE_OR_MORE)]
Constraint = Annotated[str, AfterValidator(_constraint)]
Constraints = Annotated[
    tuple[Constraint, ...], BeforeValidator(_listed), WithJsonSchema(_ONE_OR_MORE)
]
_TEXT_OR_NUMBER = {"anyOf": [{"type": "string"}, {"type": "number"}]}
Value = Annotated[str, BeforeValidator(_as_text), WithJsonSchema(_TEXT_OR_NUMBER)]


def _checked_range(ends: tuple[str, ...]) -> tuple[str, ...]:
    if len(ends) != 2:
        raise ValueError('two values are needed, such as ["0 %/m", "3 %/m"]')
    (low, unit), (high, other) = (units.parse_any(end) for end in ends)
    if unit != other:
        raise ValueError(f"its ends measure different things ({unit} and {other})")
    if not low < high:
        raise ValueError("is empty: the first value must lie below the second")
    return ends


def _checked_shares(ends: tuple[str, ...]) -> tuple[str, ...]:
    if len(ends) != 2:
        raise ValueError('two shares are needed, such as ["-10 %", "10 %"]')
    low, high = (units.parse(end, "1", kind=("change", "10 %")) for end in ends)
    if not -1.0 < low < high:
        raise ValueError('is empty or reaches zero: write it as ["-10 %", "10 %"]')
    return ends


Range = Annotated[tuple[Value, ...], AfterValidator(_checked_range)]
Shares = Annotated[tuple[Value, ...], AfterValidator(_checked_shares)]


class Variable(TableModel):
    """A key of the case to optimise within a range."""

    key: str = Field(
        examples=["mould.taper", "mould.taper.corner", "mould.taper.0.taper", "casting.speed"]
    )
    """dotted key; of a taper also a part, or segment and end"""
    range: Range = Field(examples=[["0 %/m", "3 %/m"]])
    """lowest and highest value, with unit"""
    start: Value | None = None
    """start value; by default, for a taper, that of the strand in its idealised mould (302), (303),
    otherwise the value of the case"""

    @property
    def si(self) -> tuple[float, float, str]:
        """Both ends of the range in SI, and their SI unit."""
        (low, unit), (high, _) = (units.parse_any(end) for end in self.range)
        return low, high, unit

    @property
    def unit(self) -> str:
        """Unit of the range as written, "" for none."""
        return units.split(self.range[0])[1]


class Input(TableModel):
    """An uncertain number, uniformly distributed over a range."""

    key: str = Field(examples=["cooling.mould.surface.0.coefficient", "mechanics.law.strength"])
    """dotted key; with `relative` also a property of the steel or a parameter of the constitutive
    law or the elasticity"""
    range: Range | None = Field(None, examples=[["1500 W/(m^2 K)", "1700 W/(m^2 K)"]])
    """lowest and highest value, with unit"""
    relative: Shares | None = Field(None, examples=[["-10 %", "10 %"]])
    """range relative to the value of the case, instead of range"""


class Front(TableModel):
    """A second objective: the Pareto front of the two is computed."""

    minimise: str | None = Field(None, examples=["mould_gap_max"])
    """result to minimise"""
    maximise: str | None = Field(None, examples=["heat_removed"])
    """or to maximise"""
    points: int = Field(6, ge=3, le=50, strict=True)
    """largest number of points of the front"""

    @property
    def objective(self) -> tuple[str, float]:
        """The result, and 1 to minimise it, -1 to maximise it."""
        return (self.minimise, 1.0) if self.minimise is not None else (self.maximise or "", -1.0)


class Optimise(TableModel):
    """Optimisation problem of `castfem optimise`: values of some keys that make a result best."""

    minimise: Names = ()
    """result to minimise, named as in summary.json"""
    maximise: Names = ()
    """result to maximise, likewise"""
    constraints: Constraints = Field(
        (), examples=[["heat_removed >= 99 % of idealised", "mould_gap_max <= 0.05 mm"]]
    )
    """constraint: result, >= or <=, and a value with unit or a fraction of the result in the
    idealised mould"""
    fidelity: Literal["thermal", "coarse", "default", "fine"] = "default"
    """accuracy of the runs of the search (thermal: temperature alone, without a mould); the optimum
    is repeated with the others, which gives its numerical error"""
    method: Literal["cobyqa", "slsqp", "optuna"] = "cobyqa"
    """cobyqa: local search from the start; slsqp: local search with derivatives computed in the
    runs, for three variables or more and a smooth result (von_mises_smooth); optuna (the extra
    castfem[optimise]): the first half of the runs covers the ranges, for several minima and many
    variables"""
    most_runs: int = Field(60, ge=1, strict=True)
    """number of runs after which the search ends, at the earliest after those that measure the
    noise; further runs, often as many again, explore and check the optimum"""
    variable: tuple[Variable, ...] = Field(min_length=1)
    """the keys to optimise"""
    input: tuple[Input, ...] = ()
    """uncertain numbers; the resulting spread of the optimum is computed"""
    samples: int | None = Field(None, ge=8, strict=True, examples=[32])
    """runs for that spread, at least as many as the polynomials need; by default a few more, fewer
    if runs compute derivatives"""
    front: Front | None = None
    """second objective"""

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """The constraints."""
        return tuple(bound(text) for text in self.constraints)

    @property
    def names(self) -> set[str]:
        """Names of all results that the problem uses."""
        front = set() if self.front is None else {self.front.objective[0]}
        bounded = {one.quantity for one in self.bounds}
        return {name for name, _ in self.objectives} | bounded | front

    @property
    def objectives(self) -> tuple[tuple[str, float], ...]:
        """The objectives: result, and 1 to minimise it, -1 to maximise it."""
        return (*((n, 1.0) for n in self.minimise), *((n, -1.0) for n in self.maximise))
