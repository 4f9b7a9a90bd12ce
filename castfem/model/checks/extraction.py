"""Checks of [machine.extraction]."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from castfem.base.constants import ROUNDING
from castfem.base.tables import Table
from castfem.model.base import Faults
from castfem.model.checks.registry import caution, check
from castfem.model.machine import Extraction

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("machine.extraction")
def _draws(case: Case, table: Extraction) -> Faults:
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None:
        return
    if not any(pair.driven for pair in rolls.pairs):
        fix = "set driven to yes in the table of [machine] rolls"
        yield "", f"no pair of rolls is driven, nothing would draw the strand; {fix}"
    if case.mechanics is not None and not case.bends:
        fix = "give the rolls of [machine] a radius, or mechanics.planes.force instead"
        yield "", f"is for a strand that its machine bends; {fix}"


@check("machine.extraction")
def _resistance(case: Case, table: Extraction) -> Faults:
    """Report a resistance that is not a curve, or decreases."""
    curve = table.resistance
    if isinstance(curve, float | int):
        fix = 'such as { file = "resistance.csv" }, or "coupled"'
        yield "resistance", f"must be a table over position, {fix}"
    if not isinstance(curve, Table):
        return
    for before, row in itertools.pairwise(zip(curve.arguments, curve.values, strict=True)):
        if row[1] < before[1]:
            yield (
                "resistance",
                f"falls from {1e-3 * before[1]:g} kN at {before[0]:g} m to {1e-3 * row[1]:g} kN at "
                f"{row[0]:g} m: it is that of all rolls above, not the effort in the strand, which "
                "castfem makes of it with the drives",
            )
            return


@check("machine.extraction")
def _twice(case: Case, table: Extraction) -> Faults:
    """Report forces that would be counted twice."""
    if case.mechanics is None or not case.bends:
        return
    planes = case.mechanics.planes
    if planes.neutral_axis in (None, "free"):
        for key, reason in (
            ("force", "stands beside [machine.extraction], which gives the force"),
            (
                "force_contains_bending",
                "follows from [machine.extraction]: a maker's curve has the work of bending in "
                "it, a coupled resistance has not",
            ),
        ):
            value = getattr(planes, key)
            if value is not None and (key != "force" or value != 0.0):
                yield f"/mechanics.planes.{key}", f"{reason}; leave one of the two out"
    if case.mould is not None and case.mould.friction.tag != "none":
        fix = 'give friction = { law = "none" }, or leave machine.extraction out'
        yield "/mould.friction", f"pulls at the strand beside [machine.extraction]; {fix}"


@caution("machine.extraction")
def _leaves_out(case: Case, table: Extraction) -> Faults:
    """Report a resistance curve that does not reach all pairs of the machine."""
    rolls = None if case.machine is None else case.machine.normal()
    if rolls is None or not isinstance(table.resistance, Table):
        return
    from castfem.physics.machine.extraction.resistance import steps_of

    places, rows = [pair.position for pair in rolls.pairs], table.resistance.arguments
    steps, hair = steps_of(table.resistance, places), ROUNDING * max(1.0, places[-1])
    ends = (places[0], *places)  # where the part of the curve of each pair begins
    above = [i for i, place in enumerate(places) if place <= rows[0] + hair and not steps[i]]
    below = [i for i, start in enumerate(ends[:-1]) if start >= rows[-1] - hair and not steps[i]]
    lacking = [
        f"rolls {left[0] + 1} to {left[-1] + 1}" if len(left) > 1 else f"roll {left[0] + 1}"
        for left in (above, [i for i in below if i not in above])
        if left and left != [0]
    ]
    if lacking:
        yield (
            "resistance",
            f"goes from {rows[0]:.4g} to {rows[-1]:.4g} m, the rolls from {places[0]:.4g} to "
            f"{places[-1]:.4g} m: {' and '.join(lacking)} have no resistance; give the curve from "
            "the first pair to the last",
        )
