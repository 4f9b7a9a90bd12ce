"""The optimisation problem of a case, from its table [optimise]: variables, constraints, inputs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base import units
from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.load import changed, faults_of_key, value_of
from castfem.model.optimise import Bound, Input, Optimise, Variable
from castfem.physics.constitutive.parameters import given_set
from castfem.physics.materials.library import given_steel
from castfem.studies.optimisation.fidelity import THERMAL, at_level
from castfem.studies.optimisation.global_search import check_installed

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.physics.mould.mould import Mould
    from castfem.studies.optimisation.store import Evaluation


_SETS = {"mechanics.law.": "law", "mechanics.elasticity.": "elasticity"}
_STEEL = "steel."
_ELASTICITY = "elastic_steel"  # by default
_FOLDER = "castfem_inputs"
_ABSOLUTE = ("degC", "degF", "°C", "°F")  # temperature scales that do not begin at absolute zero


@dataclass(frozen=True, slots=True)
class UncertainInput:
    """An uncertain input, from the table [[optimise.input]].

    A `range` contains values of a key. A `relative` input is a factor: on a number or a table of
    the case, a property of the steel (`steel.conductivity`), a parameter of the constitutive law or
    of the elasticity (`mechanics.law.strength`, `mechanics.elasticity.young`). For the latter a
    parameter file with the changed numbers is written; a run copies it.
    """

    key: str
    low: float  #: lowest value, or factor
    high: float
    unit: str  #: unit of a value, "" for none
    relative: bool  #: whether it is a factor

    @classmethod
    def of(cls, table: Input) -> UncertainInput:
        """Make the input of a table."""
        if table.relative is not None:
            low, high = (1.0 + units.parse(end, "1") for end in table.relative)
            return cls(table.key, low, high, "", True)
        assert table.range is not None
        unit = units.split(table.range[0])[1]
        ends = [units.parse_any(end) for end in table.range]
        low, high = (units.convert(end, si, unit or "1") for end, si in ends)
        return cls(table.key, low, high, unit, False)

    @property
    def label(self) -> str:
        """Its name in tables."""
        unit = "times" if self.relative else self.unit
        return f"{self.key} [{unit}]" if unit else self.key

    def value(self, share: float) -> float:
        """Value at a fraction of the range, to six digits."""
        return float(f"{self.low + share * (self.high - self.low):.6g}")

    def changes(self, case: Case, value: float) -> dict[str, Any]:
        """Keys and values of the case with this value, for `Case.with_`."""
        if not self.relative:
            return {self.key: f"{value:.12g} {self.unit}" if self.unit else value}
        for prefix, key in _SETS.items():
            if self.key.startswith(prefix) and case.mechanics is not None:
                name = getattr(case.mechanics, key) or _ELASTICITY
                return {f"mechanics.{key}": self._file(name, self.key.removeprefix(prefix), value)}
        name = self.key.removeprefix(_STEEL)
        if self.key.startswith(_STEEL) and "." not in name:
            tables = {**given_steel(case.steel.name), **case.steel.changes}
            return {f"steel.overrides.{name}": self._scaled(tables.get(name), value)}
        try:
            return {self.key: self._scaled(value_of(case, self.key), value)}
        except ValueError as error:
            raise InputError(f"{self.key}: {error}") from None

    def _file(self, name: str, key: str, factor: float) -> str:
        """Path of a parameter set with one of its parameters multiplied."""
        import tomli_w

        tables = dict(given_set(name))
        tables[key] = self._scaled(tables.get(key), factor)
        text = tomli_w.dumps(tables)
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        path = Path(gettempdir()) / _FOLDER / f"{Path(name).stem}_{digest}.toml"
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)
        return str(path)

    def _scaled(self, written: Any, factor: float) -> Any:
        """A value, text or table from a file, times a factor."""
        if isinstance(written, bool) or written is None:
            raise InputError(f"{self.key}: there is no number that could be multiplied")
        if isinstance(written, int | float):
            return written * factor
        if isinstance(written, Mapping):
            if "value" not in written or written.get("unit") in _ABSOLUTE:
                raise InputError(f"{self.key}: has no value that could be multiplied; give range")
            return {**written, "value": self._scaled(written["value"], factor)}
        if isinstance(written, list | tuple):
            return [self._scaled(one, factor) for one in written]
        try:
            number, unit = units.split(str(written))
        except ValueError:
            raise InputError(f'{self.key}: ("{written}") is not a number; give range') from None
        if unit in _ABSOLUTE:
            raise InputError(f"{self.key}: a temperature is not multiplied; give range")
        return f"{float(number) * factor:.12g} {unit}".strip()


_TAPER = "mould.taper"
_COUPLED = 'take fidelity = "coarse"'
_MISSING = (
    'optimise: the table is missing; add [optimise] with minimise = "von_mises_max" and '
    '[[optimise.variable]] with key = "mould.taper" and range = ["0 %/m", "3 %/m"]'
)


@dataclass(frozen=True, slots=True)
class RunRequest:
    """A run needed by a search; requests that differ only in `derivatives` are equal."""

    values: tuple[float, ...]
    """Values of the variables, in the units of their ranges; in the idealised mould those of the
    mould, which have no effect there, are the lowest of their ranges."""
    fidelity: str  #: level of fidelity
    ideal: bool = False  #: whether it is in the idealised mould
    inputs: tuple[float, ...] = ()  #: values or factors of uncertain inputs; (): those of the case
    derivatives: bool = field(default=False, compare=False)
    """Whether derivatives by variables and inputs are wanted, too; a run without them is
    acceptable."""


@dataclass(frozen=True, slots=True)
class DesignVariable:
    """A variable of the search, which varies it as a fraction of its range, 0 to 1."""

    key: str
    low: float  #: lower end of the range, in `unit`
    high: float
    unit: str  #: "" for none
    decimals: int  #: number of decimals to which values are rounded

    @classmethod
    def of(cls, variable: Variable) -> DesignVariable:
        """Make the variable of a table."""
        low, high, si = variable.si
        low, high = (units.convert(end, si, variable.unit or "1") for end in (low, high))
        decimals = max(0, math.ceil(-math.log10((high - low) / 1e4)))
        return cls(variable.key, low, high, variable.unit, decimals)

    @property
    def of_mould(self) -> bool:
        """Whether it is a key of the mould, without effect in the idealised one."""
        return self.key.partition(".")[0] == "mould"

    @property
    def label(self) -> str:
        """Key and unit."""
        return f"{self.key} [{self.unit}]" if self.unit else self.key

    def at(self, share: float) -> float:
        """Value at a fraction of the range."""
        return self.low + share * (self.high - self.low)

    def value(self, share: float) -> float:
        """Value at a fraction of the range, rounded."""
        return min(max(round(self.at(share), self.decimals), self.low), self.high) + 0.0

    def share(self, value: float) -> float:
        """Fraction of the range at a value, within 0 to 1."""
        return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def written(self, value: float) -> str | float:
        """A value as text for a case file."""
        return f"{value:.12g} {self.unit}" if self.unit else value


class DesignProblem:
    """A case with its table [optimise].

    Attributes:
        case: The case.
        origin: Name of the case in messages.
        table: The table.
        variables: The variables.
        bounds: The constraints.
        inputs: Uncertain inputs.
    """

    def __init__(self, case: Case, origin: str = "") -> None:
        self.case, self.origin = case, origin or case.title
        if case.optimise is None:
            raise InputError(f"{self.origin}: {_MISSING}")
        self.table: Optimise = case.optimise
        if self.table.method == "optuna":
            check_installed(self.origin)
        self.variables = tuple(DesignVariable.of(one) for one in self.table.variable)
        self.bounds: tuple[Bound, ...] = self.table.bounds
        self.inputs = tuple(UncertainInput.of(one) for one in self.table.input)
        if problems := list(dict.fromkeys(self._faults())):
            raise InputError(problems)

    def _faults(self) -> Iterator[str]:
        """Yield keys that cannot be varied: both ends of each range are tried in the case."""
        if self.table.fidelity == THERMAL:
            where = f"{self.origin}: optimise.fidelity: thermal runs have no mould"
            for one in (one for one in self.variables if one.of_mould):
                yield f"{where}: {one.key} changes nothing in them; {_COUPLED}"
            for bound in (bound for bound in self.bounds if bound.relative):
                yield f'{where}, to hold "{bound.text}" against; {_COUPLED}'
        for number, (one, table) in enumerate(
            zip(self.variables, self.table.variable, strict=True)
        ):
            where = f"{self.origin}: optimise.variable.{number}"
            tried = [one.written(one.low), one.written(one.high)]
            tried += [] if table.start is None else [table.start]
            yield from faults_of_key(self.case, one.key, tried, where)
        for number, uncertain in enumerate(self.inputs):
            where = f"{self.origin}: optimise.input.{number}"
            for end in (uncertain.low, uncertain.high):
                try:
                    changed(self.case, uncertain.changes(self.case, end), where)
                except InputError as error:
                    for line in error.problems:
                        line = line.removeprefix("case: ")
                        yield line if line.startswith(where) else f"{where}: {line}"

    def check_results(self) -> None:
        """Refuse results that no run of the case has, before any run."""
        from castfem.runs.results.needs import faults_of

        asked = {"minimise": self.table.minimise, "maximise": self.table.maximise}
        keys = [(key, name) for key, names in asked.items() for name in names]
        keys += [(f"constraints.{i}", one.quantity) for i, one in enumerate(self.bounds)]
        if self.table.front is not None:
            side = "minimise" if self.table.front.minimise is not None else "maximise"
            keys.append((f"front.{side}", self.table.front.objective[0]))
        names = [name for _, name in keys]
        faults = faults_of(self.case, names)
        if self.table.fidelity == THERMAL and not any(faults):
            alone = "is not a result of temperature alone, of which fidelity thermal is"
            found = faults_of(at_level(self.case, THERMAL), names)
            faults = [fault and f"{alone}; {_COUPLED}" for fault in found]
        problems = [
            f'{self.origin}: optimise.{key}: ("{name}") {fault}'
            for (key, name), fault in zip(keys, faults, strict=True)
            if fault
        ]
        if problems:
            raise InputError(problems)

    @property
    def result_names(self) -> tuple[str, ...]:
        """Names of the results needed from each run."""
        names = [name for name, _ in self.table.objectives]
        names += [bound.quantity for bound in self.bounds]
        if self.table.front is not None:
            names.append(self.table.front.objective[0])
        return tuple(dict.fromkeys(names))

    @property
    def relative(self) -> bool:
        """Whether a constraint is relative to the idealised mould."""
        return any(bound.relative for bound in self.bounds)

    @property
    def needs_ideal(self) -> bool:
        """Whether a run in the idealised mould is needed: for a constraint, or to start tapers."""
        return self.case.mould is not None and (self.relative or bool(self._fitted_tapers()))

    def _fitted_tapers(self) -> list[int]:
        """Indices of the variables that are tapers without a start value."""
        pairs = zip(self.variables, self.table.variable, strict=True)
        return [i for i, (one, table) in enumerate(pairs)
                if one.key.startswith(_TAPER) and table.start is None]  # fmt: skip

    def request(self, shares: Array, fidelity: str = "") -> RunRequest:
        """The run at fractions of the ranges (n,)."""
        values = tuple(a.value(float(u)) for a, u in zip(self.variables, shares, strict=True))
        return RunRequest(values, fidelity or self.table.fidelity)

    def shares(self, request: RunRequest) -> Array:
        """The fractions of the ranges of a run (n,)."""
        pairs = zip(self.variables, request.values, strict=True)
        return np.array([one.share(value) for one, value in pairs])

    def ideal(self, request: RunRequest) -> RunRequest:
        """The run in the idealised mould, otherwise equal to another one."""
        pairs = zip(self.variables, request.values, strict=True)
        values = tuple(one.low if one.of_mould else value for one, value in pairs)
        return replace(request, values=values, ideal=True)

    def changes(self, request: RunRequest) -> dict[str, Any]:
        """Keys and values of a run, for `Case.with_`."""
        pairs = zip(self.variables, request.values, strict=True)
        changes = {
            one.key: one.written(value)
            for one, value in pairs
            if not (request.ideal and one.of_mould)
        }
        for uncertain, value in zip(self.inputs, request.inputs, strict=False):
            changes |= uncertain.changes(self.case, value)
        return changes

    def start(self, ideal: Evaluation | None) -> Array:
        """Start of the search (n,), as fractions of the ranges.

        Args:
            ideal: Run in the idealised mould, to whose strand tapers are fitted.
        """
        from castfem.model.mould_from_case import build_mould
        from castfem.studies.mould_fit.ideal_taper import fitted_tapers

        def mould_of(shares: Array) -> Mould:
            case = self.case.with_(self.changes(self.request(shares)))
            assert case.mould is not None
            return build_mould(case.mould, case.section)

        start: list[float] = []
        for one, table in zip(self.variables, self.table.variable, strict=True):
            written = value_of(self.case, one.key) if table.start is None else table.start
            value = units.number_in(written, one.unit)
            start.append(0.5 if value is None else one.share(value))
        tapers = self._fitted_tapers()
        if tapers and ideal is not None and ideal.folder is not None and not ideal.failed:
            keys = {i: self.variables[i].key for i in tapers}
            return fitted_tapers(mould_of, np.array(start), keys, ideal.folder)
        return np.array(start)
