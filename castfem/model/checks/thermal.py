"""Checks of [thermal] and [verification]."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from castfem.model.base import Faults
from castfem.model.checks.registry import check, one_of
from castfem.model.cooling import PrescribedTemperature
from castfem.model.section import Strip
from castfem.model.thermal import Adaptive, Stepping, Thermal, Verification, negative_options

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("thermal")
def _solver(case: Any, thermal: Thermal) -> Faults:
    yield from negative_options(thermal.solver)


@check("thermal.time")
def _one_stepping(case: Any, time: Stepping) -> Faults:
    yield from one_of(time, {"step": '"50 ms"', "adaptive": "{}"})


@check("thermal.time.adaptive")
def _bounds(case: Any, bounds: Adaptive) -> Faults:
    if not bounds.smallest <= bounds.first <= bounds.largest:
        ends = f"smallest ({bounds.smallest:g} s) <= first ({bounds.first:g} s)"
        yield "", f"{ends} <= largest ({bounds.largest:g} s) does not hold"


@check("verification")
def _is_that_case(case: Case, table: Verification) -> Faults:
    """Report differences between the case and that of its closed form."""
    key, name = "closed_form", table.closed_form
    if not isinstance(case.section, Strip):
        yield key, f'("{name}") is for a half-space: give section.shape = "strip"'
    laws = [law for zone in case.cooling for law in zone.surface]
    if len(laws) != 1 or not isinstance(laws[0], PrescribedTemperature):
        fix = 'give one cooling zone with one law = "temperature"'
        yield key, f'("{name}") is for a surface held at one temperature: {fix}'
    if name != "weiner_boley":
        return
    if case.mechanics is None:
        yield key, f'("{name}") is for stress: give the table [mechanics]'
    elif case.mechanics.law != name:
        yield key, f'("{name}") needs its own law: give mechanics.law = "{name}"'
    elif case.mechanics.strain != "small":
        yield key, f'("{name}") is for small strains: give mechanics.strain = "small"'
    elif case.coupling.follow_shape:
        yield key, f'("{name}") is for the undeformed slice: give coupling.follow_shape = false'
    elif case.coupling.dissipation:
        yield key, f'("{name}") has no heat of flow: give coupling.dissipation = 0'
