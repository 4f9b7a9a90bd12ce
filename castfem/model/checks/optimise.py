"""Checks of [optimise]."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.base import result_registry, units
from castfem.model.base import Faults
from castfem.model.checks.registry import check
from castfem.model.optimise import Front, Input, Optimise, Variable

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("optimise")
def _objectives(case: Case, table: Optimise) -> Faults:
    count = len(table.objectives)
    if count != 1:
        found = "no result to optimise" if not count else f"{count} results to optimise"
        more = ", and weigh it against another by [optimise.front]" if count else ""
        fix = f'give minimise = "von_mises_max" or maximise = "heat_removed", one of them{more}'
        yield "", f"{found}; {fix}"
    for key in ("minimise", "maximise"):
        for name in getattr(table, key):
            yield from _unknown(name, key)


def _unknown(name: str, key: str) -> Faults:
    if result_registry.unit_of(name) is None:
        near = units.nearest(name, result_registry.result_names())
        yield key, f'("{name}") is not a result of a run{near}'


@check("optimise.front")
def _front(case: Case, front: Front) -> Faults:
    if (front.minimise is None) == (front.maximise is None):
        yield "", 'one of minimise and maximise is needed, such as "heat_removed"'
        return
    name, _ = front.objective
    yield from _unknown(name, "minimise" if front.minimise is not None else "maximise")
    if case.optimise is not None and name in (*case.optimise.minimise, *case.optimise.maximise):
        yield "", f'("{name}") is weighed against itself; name another result'


@check("optimise.variable.*")
def _starts(case: Case, variable: Variable) -> Faults:
    """Report a start outside its range; a wrong unit is reported by the check of the key."""
    if variable.start is None:
        return
    low, high, unit = variable.si
    try:
        start, other = units.parse_any(variable.start)
    except ValueError as error:
        yield "start", str(error)
        return
    if unit == other and not low <= start <= high:
        yield (
            "start",
            f'("{variable.start}") is not within the range, {" to ".join(variable.range)}',
        )


@check("optimise")
def _variables(case: Case, table: Optimise) -> Faults:
    keys = [variable.key for variable in table.variable]
    for key in sorted({key for key in keys if keys.count(key) > 1}):
        yield "variable", f'("{key}") is given twice; leave one out'
    for number, one in enumerate(table.input):
        if one.key in keys:
            yield (
                f"input.{number}.key",
                f'("{one.key}") is a variable, too, whose value an input would take; leave one out',
            )


@check("optimise.input.*")
def _inputs(case: Case, one: Input) -> Faults:
    if (one.range is None) == (one.relative is None):
        yield "", 'one of range and relative is needed, such as ["-10 %", "10 %"]'


@check("optimise")
def _constraint_faults(case: Case, table: Optimise) -> Faults:
    for number, found in enumerate(table.bounds):
        key, right = f"constraints.{number}", found.right
        if found.relative:
            unit = result_registry.unit_of(found.quantity)
            right = "1" if unit in (None, "1") else f"1 {unit}"
            if case.mould is None:
                yield key, f'("{found.text}"): the case has no [mould], it is idealised'
            elif found.value <= 0.0:
                yield key, f'("{found.text}"): a share above 0 % is needed'
        fault = result_registry.fault(found.quantity, right)
        if fault is not None:
            yield key, fault[1]
