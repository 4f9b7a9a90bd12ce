"""Checks of [casting], [steel], [output] and [[reference]]."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from castfem.base import result_registry
from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.casting import (
    CONTACT_FIELDS,
    MECHANICAL_FIELDS,
    Casting,
    Output,
    Reference,
    Start,
    Steel,
)
from castfem.model.checks.registry import check, check_test, one_of

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.tensile import TensileCase


@check("steel")
def _with_database(_: Any, steel: Steel) -> Faults:
    """Report keys that need a database where there is none."""
    for key in ("phases", "scheil"):
        if getattr(steel, key) and steel.database is None:
            yield key, 'needs a thermodynamic database; give one, database = "steel.tdb"'


@check("casting")
def _temperature(case: Case, casting: Casting) -> Faults:
    yield from one_of(casting, {"superheat": '"40 K"', "temperature": '"1540 degC"'})


@check("casting")
def _stands(case: Case, casting: Casting) -> Faults:
    """Report a strand that stops for good before the end of the followed length."""
    table = casting.speed
    if not isinstance(table, Table) or math.isfinite(casting.duration):
        return
    last = table.arguments[-1]
    yield (
        "speed",
        f"the strand stands for good after {last:g} s, {casting.travel.position(last):.6g} m below "
        f"the meniscus: it never reaches casting.length ({casting.length:g} m); let the last row "
        "of the table be above 0 m/min, or shorten the length",
    )


@check("casting.start")
def _start(case: Case, start: Start) -> Faults:
    """Report what cannot be combined with a start below the mould, or from a profile."""
    if case.verification is not None:
        yield "", "a closed form begins at the meniscus, at one temperature; leave it out"
    if start.at != "mould_exit":
        return
    if case.mould is not None:
        yield "at", '("mould_exit") begins below the mould; leave it or [mould] out'
        return
    ends, length = case.mould_exit(), case.casting.length
    if ends is None:
        yield "at", '("mould_exit"): there is no mould; name a zone of [[cooling]] so, with its end'
    elif not ends < length:
        text = f"{in_mm(ends)}, does not lie above casting.length ({in_mm(length)})"
        yield "at", f'("mould_exit"), {text}'


@check("casting.start")
def _meniscus(case: Case, start: Start) -> Faults:
    """Report what cannot be combined with contact above the start, in the meniscus."""
    height = start.meniscus
    if height is None:
        return
    if start.profile is not None or start.at == "mould_exit":
        other = "profile" if start.profile is not None else 'at = "mould_exit"'
        yield "meniscus", f"and {other} both give the initial state; leave one of them out"
        return
    ends = case.cooling[0].to
    if ends is not None and not height < ends:
        most = f"the first zone of the cooling, which ends at {in_mm(ends)}"
        yield "meniscus", f"({in_mm(height)}) is not within {most}; it is about 10 mm high"


@check("output")
def _fields(case: Case, output: Output) -> Faults:
    names = output.fields or ()
    for index, name in enumerate(names):
        if name in names[:index]:
            yield "fields", f"'{name}' appears twice"
        if name in MECHANICAL_FIELDS and case.mechanics is None:
            yield "fields", f"'{name}' needs the table [mechanics], which is missing"
        if name in CONTACT_FIELDS and case.mould is None:
            yield "fields", f"'{name}' needs the table [mould], which is missing"
    if len({round(100.0 * fraction) for fraction in output.shell_at}) < len(output.shell_at):
        yield "shell_at", "has a solid fraction twice"


@check("reference.*")
def _compared(case: Case, reference: Reference) -> Faults:
    """Report references that no run can be compared with."""
    if fault := result_registry.fault(reference.quantity, reference.value):
        yield fault


@check_test("reference.*")
def _without_position(case: TensileCase, reference: Reference) -> Faults:
    if reference.at is not None:
        fix = "the quantities stress_1, stress_2 ... hold at the ends of its segments"
        yield "at", f"a tensile test has no position; {fix}"
