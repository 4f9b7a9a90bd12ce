"""What is asked of a case by its table [optimise]: variables between 0 and 1, bounds, the start."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.load import changed, faults_of_key, value_of
from castfem.model.optimise import Bound, Optimise, Variable
from castfem.studies.optimisation.fidelity import THERMAL, at_level
from castfem.studies.optimisation.inputs import Uncertain
from castfem.studies.optimisation.valleys import check_installed

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.optimisation.store import Evaluation

_STEPS = 1e4  # of a range: values are rounded to its hundredths of a percent
_TAPER = "mould.taper"
_COUPLED = 'take fidelity = "coarse"'
_NOT_ALONE = f"is no result of temperature alone, of which fidelity thermal is; {_COUPLED}"


@dataclass(frozen=True, slots=True)
class Wanted:
    """A run that is wanted.

    Attributes:
        values: Of the variables, in the units of their ranges; those of the mould stand at their
            lowest in the idealised mould, to which they mean nothing.
        fidelity: How well it is to be computed (`castfem.studies.optimisation.fidelity`).
        ideal: Whether the mould follows the strand.
        inputs: Values of the uncertain inputs, factors of those that are relative; empty for those
            of the case.
        carries: Whether it is to carry derivatives by variables and inputs along; results without
            them will do. It makes no other run of it.
    """

    values: tuple[float, ...]
    fidelity: str
    ideal: bool = False
    inputs: tuple[float, ...] = ()
    carries: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class Axis:
    """A variable as the search has it.

    Attributes:
        key: Dotted key in the case.
        low: Of its range, in its unit. high: Likewise.
        unit: "" for none.
        decimals: To which its values are rounded.
    """

    key: str
    low: float
    high: float
    unit: str
    decimals: int

    @classmethod
    def of(cls, variable: Variable) -> Axis:
        """The axis of a variable."""
        low, high, si = variable.si
        unit = variable.unit
        ends = [units.convert(end, si, unit or "1") for end in (low, high)]
        decimals = max(0, math.ceil(-math.log10((ends[1] - ends[0]) / _STEPS)))
        return cls(variable.key, ends[0], ends[1], unit, decimals)

    @property
    def of_mould(self) -> bool:
        """Whether it is the mould's, and means nothing to an idealised one."""
        return self.key.partition(".")[0] == "mould"

    @property
    def label(self) -> str:
        """Its key, with the unit."""
        return f"{self.key} [{self.unit}]" if self.unit else self.key

    def value(self, share: float) -> float:
        """The value at a share of the range, rounded."""
        found = round(self.low + share * (self.high - self.low), self.decimals)
        return min(max(found, self.low), self.high) + 0.0

    def share(self, value: float) -> float:
        """The inverse of `value`, within the range."""
        return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def written(self, value: float) -> str | float:
        """A value as a case file has it."""
        return f"{value:.12g} {self.unit}" if self.unit else value


def _placed(line: str, where: str) -> str:
    """A problem with the place in the file that it is about."""
    line = line.removeprefix("case: ")
    return line if line.startswith(where) else f"{where}: {line}"


class Question:
    """A case with its table [optimise].

    Attributes:
        case: The case.
        table: The table.
        axes: Its variables.
        bounds: Its constraints.
        inputs: What is not known exactly.

    Raises:
        InputError: The case asks for nothing, a variable is none of its keys, or Optuna is asked
            for and not installed.
    """

    def __init__(self, case: Case, origin: str = "") -> None:
        origin = origin or case.title
        if case.optimise is None:
            raise InputError(
                f"{origin}: optimise: the table is missing; add [optimise] with minimise = "
                '"von_mises_max" and [[optimise.variable]] with key = "mould.taper" and '
                'range = ["0 %/m", "3 %/m"]'
            )
        if case.optimise.method == "optuna":
            check_installed(origin)
        self.case, self.origin = case, origin
        self.table: Optimise = case.optimise
        self.axes = tuple(Axis.of(variable) for variable in self.table.variable)
        self.bounds: tuple[Bound, ...] = self.table.bounds
        self.inputs = tuple(Uncertain.of(one) for one in self.table.input)
        self._check_keys()

    def _check_keys(self) -> None:
        """Try both ends of each range, each start in the case."""
        problems: list[str] = [*self._thermal_faults()]
        for number, (axis, variable) in enumerate(zip(self.axes, self.table.variable, strict=True)):
            where = f"{self.origin}: optimise.variable.{number}"
            ends = (axis.written(axis.low), axis.written(axis.high), variable.start)
            given = [value for value in ends if value is not None]
            problems += faults_of_key(self.case, axis.key, given, where)
        for number, one in enumerate(self.inputs):
            where = f"{self.origin}: optimise.input.{number}"
            for end in (one.low, one.high):
                try:
                    changed(self.case, one.changes(self.case, end), where)
                except InputError as error:
                    problems += [_placed(line, where) for line in error.problems]
        if problems:
            raise InputError(dict.fromkeys(problems))

    def _thermal_faults(self) -> Iterator[str]:
        """Yield what a search by temperature alone knows nothing of."""
        if self.table.fidelity != THERMAL:
            return
        where = f"{self.origin}: optimise.fidelity: thermal runs"
        for axis in self.axes:
            if axis.of_mould:
                yield f"{where} have no mould: {axis.key} changes nothing in them; {_COUPLED}"
        for bound in self.bounds:
            if bound.relative:
                yield f'{where} have no mould, to hold "{bound.text}" against; {_COUPLED}'

    def check_results(self) -> None:
        """Refuse, before anything runs, results that no run of the case has.

        Raises:
            InputError: With a line for each.
        """
        from castfem.runs.results.of_case import faults_of

        asked = [("minimise", name) for name in self.table.minimise]
        asked += [("maximise", name) for name in self.table.maximise]
        asked += [(f"constraints.{i}", one.quantity) for i, one in enumerate(self.bounds)]
        if self.table.front is not None:
            name = self.table.front.objective[0]
            key = "minimise" if self.table.front.minimise is not None else "maximise"
            asked.append((f"front.{key}", name))
        names = [name for _, name in asked]
        faults = faults_of(self.case, names)
        if self.table.fidelity == THERMAL and not any(faults):
            alone = faults_of(at_level(self.case, THERMAL), names)
            faults = [fault and _NOT_ALONE for fault in alone]
        problems = [
            f'{self.origin}: optimise.{key}: ("{name}") {fault}'
            for (key, name), fault in zip(asked, faults, strict=True)
            if fault
        ]
        if problems:
            raise InputError(problems)

    @property
    def needs_ideal(self) -> bool:
        """Whether something is measured by the idealised mould: a bound, or a taper's start."""
        tapers = any(
            axis.key.startswith(_TAPER) and variable.start is None
            for axis, variable in zip(self.axes, self.table.variable, strict=True)
        )
        return self.case.mould is not None and (tapers or any(b.relative for b in self.bounds))

    def at(self, shares: Array, fidelity: str = "") -> Wanted:
        """The run at shares of the ranges (n,)."""
        values = tuple(a.value(float(u)) for a, u in zip(self.axes, shares, strict=True))
        return Wanted(values, fidelity or self.table.fidelity)

    def shares(self, wanted: Wanted) -> Array:
        """The inverse of `at` (n,)."""
        return np.array([a.share(v) for a, v in zip(self.axes, wanted.values, strict=True)])

    def check_place(self, wanted: Wanted) -> None:
        """Refuse a run that is no place within the ranges.

        Raises:
            InputError: With what is wrong with it.
        """
        if len(wanted.values) != len(self.axes):
            keys = ", ".join(axis.label for axis in self.axes)
            raise InputError(
                f"{self.origin}: optimise.variable: a run has {len(wanted.values)} values where "
                f"{len(self.axes)} are needed: {keys}"
            )
        for number, (axis, value) in enumerate(zip(self.axes, wanted.values, strict=True)):
            if not axis.low <= value <= axis.high:
                raise InputError(
                    f"{self.origin}: optimise.variable.{number}.range: a run with "
                    f"{axis.key} = {value:g} {axis.unit}".rstrip()
                    + f" lies outside of it, {axis.low:g} to {axis.high:g} {axis.unit}".rstrip()
                    + "; widen the range, "
                    "or leave the run out"
                )

    def ideal(self, wanted: Wanted) -> Wanted:
        """The run in the idealised mould, all else as in another one."""
        pairs = zip(self.axes, wanted.values, strict=True)
        values = tuple(axis.low if axis.of_mould else value for axis, value in pairs)
        return replace(wanted, values=values, ideal=True)

    def changes(self, wanted: Wanted) -> dict[str, Any]:
        """Keys and values of a run, as `Case.with_` takes them."""
        found = {
            axis.key: axis.written(value)
            for axis, value in zip(self.axes, wanted.values, strict=True)
            if not (wanted.ideal and axis.of_mould)
        }
        if wanted.inputs:
            for one, value in zip(self.inputs, wanted.inputs, strict=True):
                found |= one.changes(self.case, value)
        return found

    def start(self, ideal: Evaluation | None) -> Array:
        """Where the search begins, as shares of the ranges (n,).

        Args:
            ideal: The run in the idealised mould; tapers begin with what its strand does.
        """
        from castfem.studies.optimisation.ideal_taper import fitted

        found: list[float] = []
        for axis, variable in zip(self.axes, self.table.variable, strict=True):
            given = value_of(self.case, axis.key) if variable.start is None else variable.start
            value = units.number_in(given, axis.unit)
            found.append(0.5 if value is None else axis.share(value))
        begun = np.array(found)
        free = [
            i
            for i, (axis, variable) in enumerate(zip(self.axes, self.table.variable, strict=True))
            if axis.key.startswith(_TAPER) and variable.start is None
        ]
        if free and ideal is not None and ideal.folder is not None and not ideal.failed:
            return fitted(self, begun, free, ideal.folder)
        return begun
