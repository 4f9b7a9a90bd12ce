"""Checks of the arguments of `Study` and `Evaluator`, with one-line errors."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.result_registry import unit_of
from castfem.base.shown_quantity import Quantity
from castfem.model.key_names import full_key
from castfem.studies.optimisation.fidelity import check_word
from castfem.studies.optimisation.problem import DesignProblem, DesignVariable, RunRequest

if TYPE_CHECKING:
    from castfem.model import Case


def origin_of(case: Case | str | Path) -> str:
    """Name of the case in messages: its path or name as given; "" for a case object."""
    return str(case) if isinstance(case, str | Path) else ""


def check_integer(number: int, least: int, what: str) -> int:
    """Return an integer of at least `least`."""
    if isinstance(number, bool) or not isinstance(number, int) or number < least:
        raise InputError(f"{what} must be an integer >= {least}, got {number!r}")
    return number


def check_changes(changes: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return changes of a case, value by key."""
    if changes is not None and not isinstance(changes, Mapping):
        raise InputError(
            'changes must be keys with their values, {"casting.speed": "3 m/min"}, '
            f"got {changes!r}"
        )
    return changes or {}


def check_request(
    problem: DesignProblem, request: RunRequest | Mapping[str, Any], caller: str
) -> RunRequest:
    """Return a run from a request of a study, or from the values of all variables."""
    variables = problem.variables
    if isinstance(request, Mapping):
        request = RunRequest(_values(problem, request, caller), problem.table.fidelity)
    if not isinstance(request, RunRequest) or not isinstance(request.values, list | tuple):
        keys = ", ".join(f'"{one.key}": {one.low:g}' for one in variables)
        raise InputError(
            f"{caller}: a run must be one that ask() returns, or values by key, {{{keys}}}, "
            f"got {request!r}"
        )
    values, inputs = tuple(request.values), tuple(request.inputs)
    if len(values) != len(variables) or len(inputs) not in (0, len(problem.inputs)):
        keys = ", ".join(one.label for one in variables)
        raise InputError(
            f"{caller}: a run has {len(values)} values and {len(inputs)} inputs; it needs a value "
            f"for each of {keys}, and none or all of the {len(problem.inputs)} inputs"
        )
    for number, (one, value) in enumerate(zip(variables, values, strict=True)):
        if not one.low <= _number(one, value, caller) <= one.high:
            at = f"{value} {one.unit}".rstrip()
            ends = f"{one.low:g} to {one.high:g} {one.unit}".rstrip()
            raise InputError(
                f"{problem.origin}: optimise.variable.{number}.range: {one.key} = {at} of a run "
                f"is outside the range, {ends}; widen the range, or leave the run out"
            )
    check_word(request.fidelity)
    numbers = (_number(one, value, caller) for one, value in zip(variables, values, strict=True))
    return replace(request, values=tuple(numbers), inputs=inputs)


def _values(problem: DesignProblem, values: Mapping[str, Any], caller: str) -> tuple[float, ...]:
    """Values of the variables in the units of their ranges, rounded as in the search."""
    variables = {one.key: one for one in problem.variables}
    found: dict[str, float] = {}
    for key, value in values.items():
        try:
            full = full_key(type(problem.case), problem.case.document(), str(key))
        except ValueError:
            full = str(key)
        if full not in variables:
            raise InputError(
                f"{caller}: {key} is not a variable of [optimise]; there are {', '.join(variables)}"
                f"{units.nearest(full, list(variables))}"
            )
        found[full] = round(_number(variables[full], value, caller), variables[full].decimals)
    if missing := [key for key in variables if key not in found]:
        raise InputError(f"{caller}: {', '.join(missing)} is missing; give all variables a value")
    return tuple(found[key] for key in variables)


def _number(variable: DesignVariable, value: Any, caller: str) -> float:
    """A value of a variable as a number in its unit."""
    try:
        number = units.number_in(value, variable.unit) if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        number = None
    if number is None:
        unit = f" in {variable.unit}" if variable.unit else ""
        raise InputError(f"{caller}: {variable.key} must be a number{unit}, got {value!r}")
    return number


def quantities_of(
    problem: DesignProblem, request: RunRequest, results: Mapping[str, Any]
) -> dict[str, Quantity]:
    """Return results given by name, in SI, as quantities in the units that castfem shows."""
    found = {str(name): _quantity(str(name), value) for name, value in results.items()}
    missing = [] if request.ideal else [n for n in problem.result_names if n not in found]
    if missing:
        near = difflib.get_close_matches(missing[0], found, n=1, cutoff=0.5)
        other = f'; write it so, not "{near[0]}"' if near else ""
        raise InputError(f"tell: {', '.join(missing)} is missing; [optimise] needs it{other}")
    return found


def _quantity(name: str, value: Any) -> Quantity:
    if isinstance(value, Quantity):
        return value
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"tell: {name} must be a finite number in SI, got {value!r}; for a run that has failed "
            'give Evaluation(share=0.3, message="why"), or its Result'
        )
    unit = unit_of(name) or "1"
    return Quantity(number, "-" if unit == "1" else unit, name.replace("_", " "))
